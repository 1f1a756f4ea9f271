"""The model server with real worker processes."""

import asyncio
import os
import signal
import subprocess
import sys
from functools import partial
from itertools import count

import numpy as np
import pytest
import pytest_asyncio

from models.agents.model_paths import ModelPaths
from models.inference.launch import launch
from models.inference.runner import ModelsDown, ModelServer
from models.protocols import History, Intention, Question
from overcooked.constants import EAST, NORTH, SOUP, STAY
from overcooked.layout import load_layout
from overcooked.planes import PLANES
from overcooked.state import Kitchens
from tests.support.onnx_files import linear_agent
from tests.support.parameters import mostly_slow

LAYOUT = "coordination_ring"
NORTHWARD, EVEN = "tests.support.foreign_models:Northward", "tests.support.foreign_models:EvenHanded"
REMEMBERING = "tests.support.foreign_models:Remembering"
PLANNING = "tests.support.foreign_models:Planning"
JAMMING = "tests.support.foreign_models:Jamming"
SLOTTED = "tests.support.foreign_models:Slotted"
PATIENT_MS = 5000
_games = count()  # no two games of this file have one name: some share a server
in_one_loop = pytest.mark.asyncio(loop_scope="module")
FIELDS = ("players", "contents")
NEVER_S = 600.0  # on a busy machine a healthy worker may need longer than a server of a game would wait


class AskedGame:
    """A game played elsewhere: random joint actions, all states kept."""

    def __init__(self, name: str, seed: int = 0, layout: str = LAYOUT) -> None:
        self.name, self.layout = f"{name}-{next(_games)}", layout
        self.draws = np.random.default_rng(seed)
        self.kitchens = Kitchens.start(load_layout(layout))
        self.states = [self.kitchens.copy()]
        self.actions = [(-1, -1)]

    def play(self, timesteps: int = 1) -> "AskedGame":
        events = np.zeros((1, 2), np.int32)
        for _ in range(timesteps):
            joint = self.draws.integers(0, 6, (1, 2)).astype(np.int8)
            self.kitchens.step(joint, events)
            self.states.append(self.kitchens.copy())
            self.actions.append(tuple(joint[0].tolist()))
        return self

    def history(self, k: int) -> History:
        players, contents = (b"".join(getattr(one, name).tobytes() for one in self.states[-k:]) for name in FIELDS)
        return History(players, contents, np.array(self.actions[-k:], np.int8).tobytes())

    def question(self, agent=None, predictor=None, uniform=0.5, stuck=0) -> Question:
        timestep = len(self.actions) - 1
        return Question(self.name, self.layout, 0, timestep, agent, predictor, uniform, stuck, self.history)


async def start(started, agents=(), predictors=(), **settings):
    server = ModelServer([(LAYOUT, name) for name in agents], [(LAYOUT, name) for name in predictors], **settings)
    started.append(server)
    await server.start()
    return server


@pytest.fixture
async def serving():
    """Start model servers and end them."""
    started = []
    yield partial(start, started)
    for server in started:
        await server.close()


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def shared():
    """For tests `in_one_loop`, which only ask: starting its processes takes longer than all that they do."""
    agents, predictors = (NORTHWARD, EVEN, JAMMING), (REMEMBERING, PLANNING, "random")
    server = ModelServer([(LAYOUT, name) for name in agents], [(LAYOUT, name) for name in predictors])
    await server.start()
    yield server
    await server.close()


@pytest_asyncio.fixture(scope="module", loop_scope="module")
async def undisturbed():
    """Published weights behind processes that nobody stops, to compare with."""
    server = ModelServer([(LAYOUT, "sp")], [(LAYOUT, "sp_predictor_stream")])
    await server.start()
    yield server
    await server.close()


@pytest_asyncio.fixture(loop_scope="module")
async def serving_beside():
    """As `serving`, for tests `in_one_loop`."""
    started = []
    yield partial(start, started)
    for server in started:
        await server.close()


async def until(condition):
    while not condition():
        await asyncio.sleep(0.01)


def test_server_side_never_loads_torch():
    code = "import sys, models.inference.runner; sys.exit('torch' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@in_one_loop
async def test_agent_and_predictor_answer_together(shared):
    (decision,) = await shared.ask([AskedGame("a").question(NORTHWARD, "random")], PATIENT_MS)
    assert decision.action == NORTH
    assert decision.probabilities == pytest.approx((1, 0, 0, 0, 0, 0))
    assert np.allclose(decision.prediction, 1 / 6, atol=0.001)


@in_one_loop
async def test_the_given_number_draws_the_action(shared):
    uniforms = [0.01, 0.2, 0.4, 0.6, 0.7, 0.99]
    asked = [AskedGame(f"g{k}").question(EVEN, uniform=uniform) for k, uniform in enumerate(uniforms)]
    assert [decision.action for decision in await shared.ask(asked, PATIENT_MS)] == [0, 1, 2, 3, 4, 5]


@in_one_loop
async def test_a_jammed_agent_is_mixed_as_its_mode_requires(shared):
    free, jammed = await shared.ask(
        [
            AskedGame("a").question(JAMMING, uniform=0.6, stuck=1),
            AskedGame("b").question(JAMMING, uniform=0.6, stuck=2),
        ],
        PATIENT_MS,
    )
    assert (free.action, jammed.action) == (NORTH, EAST)
    assert jammed.probabilities == (0.25, 0.25, 0.25, 0.25, 0, 0)


@in_one_loop
async def test_a_watched_human_is_only_predicted(shared):
    (decision,) = await shared.ask([AskedGame("a").question(predictor="random")], PATIENT_MS)
    assert (decision.action, decision.probabilities) == (STAY, ())
    assert len(decision.prediction) == 3


@in_one_loop
async def test_a_decision_has_the_intentions_of_the_newest_state_if_there_are_any(shared):
    games = [AskedGame(f"g{k}", seed=k).play(k) for k in range(4)]
    for k, decision in enumerate(await shared.ask([game.question(predictor=PLANNING) for game in games], PATIENT_MS)):
        assert decision.intentions == (Intention(0, -1, -1, 0, 0.75), Intention(1, 2 * (k + 1) // 4, 2, 5, 0.25))
    (decision,) = await shared.ask([AskedGame("a").question(NORTHWARD, "random")], PATIENT_MS)
    assert decision.intentions == ()


@in_one_loop
async def test_games_of_many_lengths_are_distinguished(shared):
    games = [AskedGame(f"g{k}", seed=k).play(k) for k in range(12)]
    together = await shared.ask([game.question(predictor=REMEMBERING) for game in games], PATIENT_MS)
    for game, decision in zip(games, together, strict=True):
        seen = np.array(game.actions[-8:]).sum()
        assert np.argmax(decision.prediction[0]) == seen % 6


def new_workers(server, count, killed):
    """Whether so many answer, none of them killed: a death is noticed a moment later."""
    return len(server.worker_pids()) == count and killed.isdisjoint(server.worker_pids())


@in_one_loop
async def test_a_killed_worker_comes_back_and_answers_as_if_nothing_had_happened(serving_beside, shared):
    server = await serving_beside([EVEN], [REMEMBERING], hang_s=NEVER_S)
    game = AskedGame("a", seed=3)
    for timestep in range(30):
        question = game.play().question(EVEN, REMEMBERING, uniform=timestep / 30)
        if timestep == 20:
            killed = set(server.worker_pids())
            for pid in killed:
                os.kill(pid, signal.SIGKILL)
            assert await server.ask([question], 200) == [None]
            await until(partial(new_workers, server, 2, killed))
            continue
        assert await server.ask([question], PATIENT_MS) == await shared.ask([question], PATIENT_MS)
    assert server.statistics().restarts == 2


@pytest.mark.parametrize("weights_file", mostly_slow([None, "weights.bin"]))
async def test_a_restarted_worker_refuses_a_file_that_has_changed(serving, tmp_path, caplog, weights_file):
    path = tmp_path / "agent.onnx"
    layout = load_layout(LAYOUT)
    shape = ["games", layout.width, layout.height, PLANES]
    linear_agent(path, shape, seed=1, weights_file=weights_file)
    first = {file: file.read_bytes() for file in tmp_path.iterdir()}
    server = await serving([str(path)])
    (before,) = await server.ask([AskedGame("a").question(str(path), uniform=0.7)], PATIENT_MS)
    linear_agent(path, shape, seed=2, weights_file=weights_file)

    async def killed():
        pids = server.worker_pids()
        for pid in pids:
            os.kill(pid, signal.SIGKILL)
        await until(lambda: server.worker_pids() != pids)

    await killed()
    if server.worker_pids():  # a spare that was loaded before the change: it is gone now too
        await killed()
    await until(lambda: "files have changed since the server started" in caplog.text)
    assert await server.ask([AskedGame("b").question(str(path))], 50) == [None]
    for file, content in first.items():
        file.write_bytes(content)
    await until(lambda: all(server.worker_pids()) and server.worker_pids())
    (after,) = await server.ask([AskedGame("c").question(str(path), uniform=0.7)], PATIENT_MS)
    assert after.probabilities == before.probabilities


async def test_a_worker_that_hangs_is_replaced(serving):
    hanging = "tests.support.foreign_models:Hanging"
    server = await serving([hanging], hang_s=0.3)
    good, bad = AskedGame("a"), AskedGame("b")
    bad.states[-1].contents[0, 0, 0] = SOUP  # on the counter in the corner
    assert await server.ask([bad.question(hanging)], 50) == [None]
    await until(lambda: server.statistics().restarts == 1)
    (decision,) = await server.ask([good.question(hanging)], PATIENT_MS)
    assert decision is not None


async def test_the_successor_of_a_worker_that_hung_gets_more_time(serving):
    slow = "tests.support.foreign_models:VerySlowAfterWarming"
    server = await serving([slow], hang_s=0.3)
    game = AskedGame("a")
    assert await server.ask([game.question(slow)], 50) == [None]
    await until(lambda: server.statistics().restarts == 1)
    for _ in range(200):  # each process is as slow: without more time, none would ever answer
        if (await server.ask([game.question(slow)], 50))[0] is not None:
            break
        await asyncio.sleep(0.05)
    else:
        pytest.fail(f"no answer after {server.statistics().restarts} workers")


async def test_a_model_that_answers_within_a_long_deadline_does_not_hang(serving):
    slow = "tests.support.foreign_models:SlowAfterWarming"
    server = await serving([slow], hang_s=0.1)
    (decision,) = await server.ask([AskedGame("a").question(slow)], PATIENT_MS)
    assert decision is not None
    assert server.statistics().restarts == 0


async def test_a_late_answer_is_dropped_and_the_next_is_in_time(serving):
    slow = "tests.support.foreign_models:SlowAfterWarming"
    server = await serving([slow])
    game = AskedGame("a")
    assert await server.ask([game.question(slow)], 20) == [None]
    (decision,) = await server.ask([game.play().question(slow, uniform=0.99)], PATIENT_MS)
    assert decision.action == 5
    assert server.statistics().late == 1
    assert server.statistics().restarts == 0


async def test_a_slow_agent_delays_no_other(serving):
    slow = "tests.support.foreign_models:SlowAfterWarming"
    server = await serving([slow, NORTHWARD])
    late, quick = await server.ask([AskedGame("a").question(slow), AskedGame("b").question(NORTHWARD)], 150)
    assert late is None
    assert quick.action == NORTH


async def test_nan_is_not_an_answer_and_is_counted(serving):
    broken = "tests.support.foreign_models:BrokenAfterWarming"
    server = await serving([broken])
    game = AskedGame("a")
    answers = [(await server.ask([game.play().question(broken)], PATIENT_MS))[0] for _ in range(8)]
    assert answers == [None] * 8
    counted = server.statistics().faults
    assert sum(count for fault, count in counted.items() if "NaN" in fault) == 5
    assert sum(count for fault, count in counted.items() if "resting" in fault) == 3


async def test_nan_in_one_game_costs_no_other_game_its_answer(serving):
    agent, predictor = "tests.support.foreign_models:SometimesNan", SLOTTED
    server = await serving([agent], [predictor])
    good, bad = AskedGame("a"), AskedGame("b")
    bad.states[-1].contents[0, 0, 0] = SOUP  # on the counter in the corner
    for _ in range(8):  # more than the faults after which a model rests
        asked = [game.question(agent, predictor, uniform=0.99) for game in (good, bad)]
        answered, unanswered = await server.ask(asked, PATIENT_MS)
        assert (answered.action, len(answered.prediction), unanswered) == (5, 3, None)
        for game in (good, bad):
            game.play()
        bad.states[-1].contents[0, 0, 0] = SOUP
    assert sum(server.statistics().faults.values()) == 16


async def test_a_model_that_does_not_fit_is_refused_before_anything_is_served(serving):
    with pytest.raises(ModelsDown, match=r"WrongShape cannot be used on coordination_ring: .*shape \(1, 3\)"):
        await serving(["tests.support.foreign_models:WrongShape"])
    with pytest.raises(ModelsDown, match="no_such_module:Agent was not found"):
        await serving(["no_such_module:Agent"])


@pytest.mark.slow
async def test_added_models_answer_together_with_the_earlier_ones(serving):
    server = await serving([NORTHWARD])
    with pytest.raises(ModelsDown, match="no_such_module:Agent was not found"):
        await server.add([(LAYOUT, "planner"), (LAYOUT, "no_such_module:Agent")], [], {}, ModelPaths())
    assert await server.ask([AskedGame("a").question("planner")], PATIENT_MS) == [None]
    await server.add([(LAYOUT, NORTHWARD), (LAYOUT, "planner")], [(LAYOUT, "random")], {}, ModelPaths())
    asked = [AskedGame("a").question(NORTHWARD), AskedGame("b").question("planner", "random")]
    northward, planner = await server.ask(asked, PATIENT_MS)
    assert northward.action == NORTH
    assert len(planner.prediction) == 3
    assert len(server.worker_pids()) == 2


async def test_models_that_two_ask_for_at_the_same_time_are_loaded_once(serving):
    server = await serving([NORTHWARD])
    await asyncio.gather(*(server.add([(LAYOUT, "stay")], [], {}, ModelPaths()) for _ in range(2)))
    assert len(server.worker_pids()) == 2


@pytest.mark.parametrize("first", ["agent", "predictor"])
async def test_an_agent_and_a_predictor_of_one_name_may_be_added_one_after_the_other(serving, first):
    name = [(LAYOUT, "random")]
    server = await serving(**{f"{first}s": ["random"]})
    await server.add(*((name, []) if first == "predictor" else ([], name)), {}, ModelPaths())
    game = AskedGame("a")
    for _ in range(2):
        (decision,) = await server.ask([game.play().question("random", "random", uniform=0.99)], PATIENT_MS)
        assert decision.action == 5
        assert len(decision.prediction) == 3
    assert server.statistics().restarts == 0


async def test_two_kitchens_of_one_name_have_models_of_their_own_until_one_is_dropped(serving):
    server = await serving([NORTHWARD])
    apart = f"{LAYOUT}#another"  # called as the bundled one, with the grid of another
    await server.add([(apart, "planner")], [(apart, "random")], {apart: load_layout("cramped_room").text}, ModelPaths())
    other = AskedGame("b", layout="cramped_room")
    other.layout = apart
    northward, planner = await server.ask([AskedGame("a").question(NORTHWARD), other.question("planner")], PATIENT_MS)
    assert (northward.action, sum(planner.probabilities)) == (NORTH, pytest.approx(1))
    await server.drop(apart)
    assert len(server.worker_pids()) == 1
    northward, gone = await server.ask([AskedGame("a").question(NORTHWARD), other.question("planner")], PATIENT_MS)
    assert (northward.action, gone) == (NORTH, None)


@in_one_loop
async def test_an_unknown_model_is_not_answered(shared):
    assert await shared.ask([AskedGame("a").question("somebody_else")], 50) == [None]


@in_one_loop
async def test_a_forgotten_game_starts_from_scratch(shared):
    game = AskedGame("a", seed=1).play(5)
    before = await shared.ask([game.question(predictor=REMEMBERING)], PATIENT_MS)
    shared.forget(game.name)
    assert await shared.ask([game.question(predictor=REMEMBERING)], PATIENT_MS) == before


@in_one_loop
async def test_asking_twice_about_one_state_gives_the_same_answer(shared):
    game = AskedGame("a", seed=2)
    for _ in range(12):
        question = game.play().question(predictor=REMEMBERING)
        assert await shared.ask([question], PATIENT_MS) == await shared.ask([question], PATIENT_MS)


async def test_a_game_whose_predictor_failed_last_makes_room_for_the_next(serving):
    server = await serving(predictors=[SLOTTED])
    failed = AskedGame("a")
    assert (await server.ask([failed.question(predictor=SLOTTED)], PATIENT_MS))[0].prediction[0][0] == 1
    failed.play().states[-1].contents[0, 0, 0] = SOUP  # on the counter in the corner
    assert await server.ask([failed.question(predictor=SLOTTED)], PATIENT_MS) == [None]
    server.forget(failed.name)
    (decision,) = await server.ask([AskedGame("b").question(predictor=SLOTTED)], PATIENT_MS)
    assert decision.prediction[0][0] == 1


async def test_nothing_is_left_running_after_close():
    server = ModelServer([(LAYOUT, NORTHWARD)], [(LAYOUT, "random")])
    await server.start()
    pids = server.worker_pids()
    await server.close()
    for pid in pids:
        with pytest.raises(ProcessLookupError):
            os.kill(pid, 0)


def same(one, other):
    """Answers of a network asked alone or among others agree up to rounding."""
    return (
        one.action == other.action
        and np.allclose(one.probabilities, other.probabilities, atol=1e-5)
        and np.allclose(one.prediction, other.prediction, atol=1e-5)
    )


@in_one_loop
async def test_after_late_answers_a_game_is_predicted_as_if_nothing_had_happened(serving_beside, undisturbed):
    server = await serving_beside(["sp"], ["sp_predictor_stream"])
    game, other = AskedGame("a", seed=4), AskedGame("b", seed=5)
    for timestep in range(24):
        asked = [each.play().question("sp", "sp_predictor_stream") for each in (game, other)]
        (pid,) = server.worker_pids()
        if timestep in (10, 11, 12):
            os.kill(pid, signal.SIGSTOP)
            assert await server.ask(asked, 20) == [None, None]
            os.kill(pid, signal.SIGCONT)
            await asyncio.sleep(0.05)
            expected = await undisturbed.ask(asked, PATIENT_MS)
            continue
        answers, expected = await server.ask(asked, PATIENT_MS), await undisturbed.ask(asked, PATIENT_MS)
        assert all(map(same, answers, expected)), timestep
    assert (server.statistics().late, server.statistics().restarts) == (6, 0)


@in_one_loop
async def test_what_waits_at_a_worker_is_answered_together_and_as_alone(serving_beside, undisturbed):
    server = await serving_beside(["sp", NORTHWARD], ["sp_predictor_stream"])
    games = [AskedGame(f"g{k}", seed=k).play(k) for k in range(12)]
    for _ in range(3):
        asked = [game.play().question("sp", "sp_predictor_stream", uniform=0.3) for game in games]
        pid = server.worker_pids()[0]
        os.kill(pid, signal.SIGSTOP)
        waiting = [asyncio.create_task(server.ask([question], PATIENT_MS)) for question in asked]
        await asyncio.sleep(0.05)
        os.kill(pid, signal.SIGCONT)
        for question, answer in zip(asked, await asyncio.gather(*waiting), strict=True):
            assert same(answer[0], (await undisturbed.ask([question], PATIENT_MS))[0])


async def test_a_worker_with_unanswered_questions_gets_no_new_ones(serving):
    server = await serving(predictors=[REMEMBERING])
    pid = server.worker_pids()[0]
    os.kill(pid, signal.SIGSTOP)
    game = AskedGame("a", seed=6)
    for _ in range(4):
        assert await server.ask([game.play().question(predictor=REMEMBERING)], 30) == [None]
    os.kill(pid, signal.SIGCONT)
    await asyncio.sleep(0.1)
    (decision,) = await server.ask([game.play().question(predictor=REMEMBERING)], PATIENT_MS)
    assert np.argmax(decision.prediction[0]) == np.array(game.actions[-8:]).sum() % 6


async def test_a_process_launched_ahead_becomes_the_first_worker_and_ends_with_the_server(serving):
    ahead = launch()
    server = await serving(agents=["sp"], ahead=ahead)
    assert server.worker_pids()[0] == ahead.process.pid
    await server.close()
    assert ahead.process.poll() is not None


def test_a_process_launched_ahead_that_nobody_uses_can_be_ended_twice():
    ahead = launch()
    ahead.end()
    ahead.end()
    assert ahead.process.returncode == -signal.SIGKILL
