"""Simulated participants complete every bundled study, repeat their choices, and detect every violation."""

import asyncio
import json
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import parse_qsl

import pytest
from sqlalchemy import Connection, delete, select, update

import kitchenmind
from server.bots.faults import GUARANTEES, Trial, table
from server.bots.group import BotGroup, GroupOutcome, _arrival, check_outcome, simulate
from server.bots.invariants import Claim, broken_at_code
from server.bots.local_server import QUICK, OwnServer
from server.bots.participant import Bot
from server.commands import bots as bots_command
from server.participation.recruiter_links import recruitment_of
from server.store.database import Database
from server.store.tables import answers, episodes, inputs, participants, ticks
from server.study.loader import load_study
from server.study.recruitment import Recruitment
from server.study.steps import episodes_of
from tests.support import command_line

ROOT = Path(__file__).parents[3]
STUDIES = sorted((ROOT / "studies").glob("**/*.yaml"))
OTHER_KITCHENS = ROOT / "studies" / "classic_kitchens.yaml"  # `external_predictor` in kitchens whose models load long
SCRIPTED = ROOT / "tests" / "data" / "small_study.yaml"


def shortened(study: Path, folder: Path, horizon: int = 15) -> Path:
    text = study.read_text(encoding="utf-8")
    if "\ngame:" in text:
        text = re.sub(r"horizon: \d+", f"horizon: {horizon}", text)
    else:
        text += f"\ngame: {{horizon: {horizon}}}\n"
    short = folder / study.name
    short.write_text(text, encoding="utf-8")
    return short


def simulated(*words: str) -> tuple[int, dict[str, Any]]:
    ended = command_line.run("bots", *words, "--json")
    assert ended.stdout, ended.stderr
    return ended.returncode, json.loads(ended.stdout)


@pytest.fixture(scope="module")
def all_bundled(tmp_path_factory: pytest.TempPathFactory) -> Iterator[OwnServer]:
    """One server with every study of the project but one, rounds shortened."""
    folder = tmp_path_factory.mktemp("bundled")
    short = [shortened(study, folder) for study in STUDIES if study != OTHER_KITCHENS]
    server = OwnServer(f"sqlite:///{folder / 'kept.sqlite3'}", short[0], QUICK)
    for study in short[1:]:
        server.add_study(study)
    with server:
        yield server


# As published, and the smallest.
EVERY_RUN = ("external_predictor", "quick_look")


@pytest.mark.parametrize(
    "study",
    [
        pytest.param(study, id=study.stem, marks=[] if study.stem in EVERY_RUN else [pytest.mark.slow])
        for study in STUDIES
        if study != OTHER_KITCHENS
    ],
)
def test_every_bundled_study_can_be_completed(study: Path, all_bundled: OwnServer) -> None:
    is_completed(study, all_bundled)


@pytest.mark.slow
def test_the_study_of_the_classic_kitchens_can_be_completed(tmp_path: Path) -> None:
    with OwnServer(f"sqlite:///{tmp_path / 'kept.sqlite3'}", shortened(OTHER_KITCHENS, tmp_path), QUICK) as server:
        is_completed(OTHER_KITCHENS, server)


def is_completed(study: Path, server: OwnServer) -> None:
    plan = load_study(study).study
    # Two of a condition, where they play with each other.
    number = 2 * len(plan.conditions) if any(agent.human for agent in plan.agents) else 2
    with Database(server.database, read_only=True) as kept:
        bots = asyncio.run(simulate(BotGroup(number, plan.name, plan), server.url, kept))
        outcome = check_outcome(bots, kept)
    assert outcome.violations == []
    assert (outcome.started, outcome.completed, outcome.dropped) == (number, number, 0)
    assert sum(outcome.by_condition.values()) == number
    assert outcome.episodes == number * episodes_of(plan)


def test_a_study_that_a_server_offers_needs_only_its_name(
    all_bundled: OwnServer, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["--url", all_bundled.url, "--database", all_bundled.database]
    code, outcome = simulated("1", "--study", "intentions", *words)
    assert (code, outcome["completed"], outcome["violations"]) == (0, 1, [])
    assert kitchenmind.main(["bots", "1", "--study", "nothing_there", *words]) == 2
    told = capsys.readouterr().err
    assert "offers no study 'nothing_there'. It offers" in told
    assert "quick_look" in told


def test_the_data_of_all_of_them_can_be_exported(all_bundled: OwnServer, tmp_path: Path) -> None:
    exported = command_line.run("export", "--database", all_bundled.database, "--out", str(tmp_path / "export"))
    assert exported.returncode == 0, exported.stderr


def changed(connection: Connection, statement: Any) -> int:
    return connection.execute(statement).rowcount


@dataclass
class Walked:
    """What some simulated participants saw, and the database that they left."""

    bots: list[Bot]
    path: Path

    def tampered(self, folder: Path, *changes: Any) -> list[str]:
        """The violations that are found after these statements have changed the database."""
        copy = shutil.copy(self.path, folder / "tampered.sqlite3")
        with Database(f"sqlite:///{copy}") as database:
            for change in changes:
                asyncio.run(database.write(changed, change))
            return check_outcome(self.bots, database).violations


def walk(folder: Path, seed: int = 3, dropout: float = 0.0) -> Walked:
    path = folder / f"{seed}.sqlite3"
    with (
        OwnServer(f"sqlite:///{path}", SCRIPTED, QUICK) as server,
        Database(f"sqlite:///{path}", read_only=True) as kept,
    ):
        group = BotGroup(4, "small", load_study(SCRIPTED).study, dropout, seed)
        bots = asyncio.run(simulate(group, server.url, kept))
    return Walked(bots, path)


@pytest.fixture(scope="module")
def walked(tmp_path_factory: pytest.TempPathFactory) -> Walked:
    return walk(tmp_path_factory.mktemp("walked"))


def choices(bots: list[Bot]) -> list[Any]:
    """Return the participants' choices, without random ids."""
    return [
        (
            bot.journal.answers,
            [(bot.journal.games[episode].number, timestep, action) for episode, timestep, action in bot.journal.inputs],
            list(bot.journal.states.values()),
        )
        for bot in bots
    ]


@pytest.mark.slow
def test_a_repeat_with_the_same_seed_makes_the_same_choices(walked: Walked, tmp_path: Path) -> None:
    again = walk(tmp_path)
    assert all(bot.journal.code for bot in walked.bots)
    assert choices(again.bots) == choices(walked.bots)


@pytest.mark.slow
def test_a_kept_guarantee_is_not_a_violation(walked: Walked, tmp_path: Path) -> None:
    assert walked.tampered(tmp_path) == []


def test_a_simulated_browser_uses_the_clock_of_its_game(walked: Walked) -> None:
    columns = select(ticks.c.timestep, ticks.c.key_client_ms_0, ticks.c.key_client_ms_1)
    with Database(f"sqlite:///{walked.path}", read_only=True) as database:
        rows = database.read_now(lambda connection: connection.execute(columns).all())
    pressed = [(timestep, ms) for timestep, *both in rows for ms in both if ms is not None]
    assert pressed
    tick_ms = 200 / float(QUICK["KITCHENMIND_SPEED"])  # the page is told the length of a timestep on its own clock
    assert [(timestep, ms) for timestep, ms in pressed if ms % tick_ms or ms >= tick_ms * timestep] == []


def an_episode(walked: Walked) -> str:
    return next(episode for episode, game in walked.bots[1].journal.games.items() if game.kind == "episode")


def test_a_lost_timestep_is_found(walked: Walked, tmp_path: Path) -> None:
    here = (ticks.c.episode_id == an_episode(walked), ticks.c.timestep == 7)
    found = walked.tampered(tmp_path, delete(ticks).where(*here))
    assert any("lost timesteps [7]" in violation for violation in found)


def test_a_state_that_was_stored_otherwise_than_shown_is_found(walked: Walked, tmp_path: Path) -> None:
    here = (ticks.c.episode_id == an_episode(walked), ticks.c.timestep == 9)
    found = walked.tampered(tmp_path, update(ticks).where(*here).values(state_hash=bytes(8)))
    assert any("state shown at timestep 9 is stored as another one" in violation for violation in found)
    assert any("does not re-simulate" in violation for violation in found)


def test_an_episode_in_another_condition_is_found(walked: Walked, tmp_path: Path) -> None:
    here = episodes.c.id == an_episode(walked)
    found = walked.tampered(tmp_path, update(episodes).where(here).values(condition="another"))
    assert any("in another" in violation for violation in found)


def test_a_lost_episode_is_found(walked: Walked, tmp_path: Path) -> None:
    gone = an_episode(walked)
    statements = (
        update(answers).where(answers.c.episode_id == gone).values(episode_id=None),
        delete(ticks).where(ticks.c.episode_id == gone),
        delete(inputs).where(inputs.c.episode_id == gone),
        delete(episodes).where(episodes.c.id == gone),
    )
    assert f"episode {gone} was played and is not stored" in walked.tampered(tmp_path, *statements)


def test_another_code_than_the_stored_one_is_found(walked: Walked, tmp_path: Path) -> None:
    found = walked.tampered(tmp_path, update(participants).values(completion_code="KM-AAAA-AAAA"))
    assert any("not the code that is stored" in violation for violation in found)


def test_a_code_before_everything_is_stored_is_found(walked: Walked, tmp_path: Path) -> None:
    copy = shutil.copy(walked.path, tmp_path / "early.sqlite3")
    bot = walked.bots[0]
    claim = Claim(bot.token, bot.journal)

    def too_early(connection: Connection) -> list[str]:
        assert broken_at_code(connection, claim) == []
        (mine,) = connection.execute(select(participants.c.id).where(participants.c.number == 1)).one()
        connection.execute(update(episodes).where(episodes.c.participant_0 == mine).values(status="running"))
        connection.execute(delete(answers).where(answers.c.participant_id == mine))
        return broken_at_code(connection, claim)

    with Database(f"sqlite:///{copy}") as database:
        found = asyncio.run(database.write(too_early))
    assert any("before the end of episode" in violation for violation in found)
    assert any("before the answers of everything" in violation for violation in found)


def test_what_a_participant_sees_itself_is_found_without_a_database(walked: Walked) -> None:
    kept = check_outcome(walked.bots, None)
    assert kept.violations == []
    journal = walked.bots[2].journal
    journal.pages.append("everything")
    journal.violations.append("page everything came twice")
    shown_otherwise = check_outcome(walked.bots, None)
    journal.violations.pop()
    assert shown_otherwise.violations == ["page everything came twice"]


@pytest.mark.parametrize(
    ("words", "remedy"),
    [
        (["0"], "from 1 to"),
        (["3", "--dropout", "1.5"], "from 0 to 1"),
        (["3", "--url", "ftp://x"], "http://"),
        (["3", "--study", "no_such_file.yaml"], "no_such_file.yaml"),
        (["3", "--database", "somewhere"], "sqlite:///"),
    ],
)
def test_wrong_input_is_reported_with_its_remedy_and_exit_code_2(
    words: list[str], remedy: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert kitchenmind.main(["bots", *words]) == 2
    told = capsys.readouterr().err
    assert told.startswith("kitchenmind bots: ")
    assert remedy in told


@pytest.mark.slow
def test_bots_refuse_a_public_server_that_would_take_them_for_people(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.delenv("KITCHENMIND_SECRET", raising=False)
    assert kitchenmind.main(["bots", "1", "--url", "https://lab.example.org"]) == 2
    assert "set KITCHENMIND_SECRET" in capsys.readouterr().err


@pytest.mark.parametrize(
    "recruitment",
    [
        *({"source": each} for each in ("prolific", "mturk", "sona")),
        *({"person": "seat", "person_pattern": each} for each in ("[0-9]+", "[0-9]{3}", "[a-z]+[0-9]*")),
    ],
)
def test_bots_come_with_ids_that_look_like_the_recruiter_s(recruitment: dict[str, str]) -> None:
    study = load_study(SCRIPTED).study.model_copy(update={"recruitment": Recruitment(**recruitment)})  # type: ignore[arg-type]
    links = [_arrival(BotGroup(2, "small", study), number) for number in range(2)]
    people = [recruitment_of(study.recruitment, dict(parse_qsl(link.removeprefix("?"))))[0] for link in links]
    assert None not in people
    assert len(set(people)) == 2


@pytest.mark.slow
def test_participants_of_whom_some_give_up_violate_nothing(all_bundled: OwnServer) -> None:
    words = ["--study", "quick_look", "--url", all_bundled.url, "--database", all_bundled.database]
    some_give_up(8, 1, 6, *words)


@pytest.mark.slow
def test_in_a_long_study_those_who_give_up_violate_nothing(tmp_path: Path) -> None:
    study = shortened(ROOT / "studies" / "external_predictor.yaml", tmp_path)
    some_give_up(30, 3, 15, "--study", str(study), "--fast")


def some_give_up(people: int, least: int, most: int, *words: str) -> None:
    status, outcome = simulated(str(people), "--dropout", "0.3", "--seed", "7", *words)
    assert outcome["violations"] == []
    assert status == 0
    assert outcome["started"] == people
    assert outcome["completed"] + outcome["dropped"] == people
    assert least <= outcome["dropped"] <= most


def test_a_broken_guarantee_fails_in_the_table_and_the_others_pass() -> None:
    faults = {"server_kill": 1, "reload": 2, "second_tab": 2, "half_open": 2}
    kept = Trial(GroupOutcome(started=2, completed=2), faults, 1.0)
    assert [is_kept for _, is_kept, _ in kept.rows()] == [True] * (len(GUARANTEES) + 1)
    lost = Trial(GroupOutcome(2, 2, violations=["episode 1 lost timesteps [7]", "something else"]), faults, 1.0)
    assert table(lost, 5).count("FAIL") == 2
    assert "FAIL  nothing that was shown is lost" in table(lost, 5)
    untried = Trial(GroupOutcome(started=2, completed=2), {"reload": 1}, 0.0)
    assert table(untried, 5).count("FAIL") == 1
    assert "no server kill happened" in table(untried, 5)


@pytest.mark.slow
def test_guarantees_hold_while_the_server_is_killed_and_lines_are_lost() -> None:
    tried = command_line.run("bots", "6", "--faults", "--study", str(SCRIPTED), "--seed", "3")
    assert tried.returncode == 0, tried.stdout + tried.stderr
    assert tried.stdout.count("PASS") == len(GUARANTEES) + 1
    assert "1 x server kill" in tried.stdout
    assert "seed 3" in tried.stdout


@pytest.mark.parametrize("form", [[], ["--json"]], ids=["table", "json"])
def test_a_violation_is_reported_and_makes_the_exit_code_1(
    form: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    broken = GroupOutcome(3, 2, 1, {"tom": 2}, 20, ["episode 1 lost timesteps [7]"], 302)
    monkeypatch.setattr(bots_command, "_simulate", lambda _: broken)
    assert kitchenmind.main(["bots", "3", *form]) == 1
    told = capsys.readouterr().out
    assert "episode 1 lost timesteps [7]" in told
    if form:
        keys = {"started", "completed", "dropped", "by_condition", "episodes", "violations", "late_timesteps"}
        assert set(json.loads(told)) == keys
    else:
        assert "late           302  timesteps without an answer of the models: the partner waited" in told


def test_a_server_that_lets_nobody_in_is_a_violation_not_a_success() -> None:
    group = BotGroup(1, "no_such_study")

    async def nobody_answers() -> list[Bot]:
        server = await asyncio.start_server(_refuse, "127.0.0.1", 0)
        async with server:
            port = server.sockets[0].getsockname()[1]
            return await simulate(group, f"http://127.0.0.1:{port}", None)

    outcome = check_outcome(asyncio.run(nobody_answers()), None)
    assert (outcome.started, outcome.completed) == (0, 0)
    assert any("no way on" in violation for violation in outcome.violations)


async def _refuse(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    await reader.readuntil(b"\r\n\r\n")
    writer.write(b"HTTP/1.1 500 Broken\r\nContent-Length: 0\r\nConnection: close\r\n\r\n")
    await writer.drain()
    writer.close()
