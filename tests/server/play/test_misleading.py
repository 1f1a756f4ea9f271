"""Misleading marks: plausible, possible by the rules, and never what the partner does next."""

from pathlib import Path

import pytest

from models.protocols import Decision
from overcooked.constants import EAST, INTERACT, NORTH, SOUTH, STAY, WEST
from overcooked.layout import parse_layout
from server.participation.episode_specs import episode_spec
from server.play.misleading import wrong_future
from server.play.session import Session
from server.play.simulation import Simulation
from server.study.loader import StudyError, load_study, parse_study
from server.study.steps import steps
from tests.support.live_fakes import make_spec, new_record

EXAMPLE = Path(__file__).parents[3] / "studies" / "examples" / "misleading_marks.yaml"
ROOM = """
XXXXPX
O 2  X
X 1  D
XXXXSX
""".strip()


def simulation() -> Simulation:
    return Simulation(parse_layout(ROOM, "room"), 40)


def row(**probabilities: float) -> tuple[float, ...]:
    """Probabilities by action; what is left is spread over the others."""
    names = ("north", "south", "east", "west", "stay", "interact")
    rest = (1 - sum(probabilities.values())) / (len(names) - len(probabilities))
    return tuple(probabilities.get(name, rest) for name in names)


SURE = (row(west=0.8, east=0.12), row(interact=0.9, east=0.05), row(east=0.7))


def test_the_first_step_is_the_most_probable_one_that_was_not_decided() -> None:
    assert wrong_future(simulation(), 1, SURE, WEST)[0] == EAST
    assert wrong_future(simulation(), 1, SURE, STAY)[0] == WEST


def test_without_a_known_decision_the_most_probable_action_is_avoided() -> None:
    assert wrong_future(simulation(), 1, SURE, None)[0] == EAST


def test_every_step_is_possible_after_the_ones_before() -> None:
    facing_nothing = wrong_future(simulation(), 1, SURE, WEST)
    assert facing_nothing[1] != INTERACT, "after a step east there is only floor ahead"
    at_crate = wrong_future(simulation(), 1, (row(west=0.6), row(interact=0.9), row(interact=0.9)), NORTH)
    assert at_crate[:2] == (WEST, INTERACT)
    assert at_crate[2] != INTERACT, "a hand that holds an onion takes no other"


def test_the_other_chef_is_in_the_way() -> None:
    path = wrong_future(simulation(), 1, (row(south=0.9), row(south=0.9), row(south=0.9)), NORTH)
    assert path[0] == SOUTH, "it turns to the chef below"
    assert path[1] != SOUTH, "and cannot walk there"


@pytest.mark.parametrize("steps_shown", [1, 3])
def test_a_misleading_round_never_shows_what_comes(steps_shown: int) -> None:
    spec = make_spec(grid=ROOM, layout="room", misleading=True, steps_shown=steps_shown)
    session = Session(new_record(spec), 0.0)
    questions = session.begin_start()
    for timestep in range(30):
        decided = (WEST, INTERACT, EAST, SOUTH, NORTH, STAY)[timestep % 6]
        decisions = [Decision(decided, (1 / 6,) * 6, SURE) for _ in questions]
        record = session.finish_tick(decisions, 1.0)
        assert record.misleading is True
        assert record.displayed[0][0] != record.next_actions[1]
        assert len(record.displayed) == steps_shown
        questions = session.begin_tick(0.0)
    assert session.frames.violations == 0


def test_a_late_predictor_misleads_nobody() -> None:
    session = Session(new_record(make_spec(grid=ROOM, layout="room", misleading=True)), 0.0)
    record = session.finish_tick([None for _ in session.begin_start()], 1.0)
    assert record.misleading is False
    assert {action for action, _ in record.displayed} == {6}


def test_rounds_mislead_from_the_named_one_on_and_the_practice_never() -> None:
    study = load_study(EXAMPLE).study
    specs = {
        condition: [episode_spec(study, step, condition, "en") for step in steps(study, condition, 5) if step.is_game]
        for condition in ("right", "wrong")
    }
    assert [spec.misleading for spec in specs["wrong"]] == [False, False, True]
    assert [spec.misleading for spec in specs["right"]] == [False, False, False]


def test_a_share_of_the_rounds_is_drawn_by_the_seed() -> None:
    text = EXAMPLE.read_text("utf-8").replace("{from_round: 2}", "{share: 0.5}").replace("repeat: 2", "repeat: 20")
    study = parse_study(text).study

    def drawn(seed: int) -> list[bool]:
        rounds = [step for step in steps(study, "wrong", seed) if step.kind == "episode"]
        return [episode_spec(study, step, "wrong", "en").misleading for step in rounds]

    assert drawn(5) == drawn(5)
    shares = [sum(drawn(seed)) / 20 for seed in range(20)]
    assert 0.4 < sum(shares) / 20 < 0.6
    assert len(set(shares)) > 1


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("debriefing: purpose\n", "", "marks that mislead people need a debriefing that says so"),
        ("debriefing: purpose", "debriefing: nowhere", "there is no page 'nowhere'. Known pages: purpose."),
        (
            "tutorial, episodes, trust, purpose",
            "purpose, tutorial, episodes, trust",
            "the debriefing does not follow the rounds",
        ),
        ("{from_round: 2}", "{from_round: 3}", "there is no round 3: the study has 2"),
        ("predictor: misleading, ", "predictor: tom, ", "`misleading` has no effect with another predictor"),
    ],
)
def test_a_study_that_misleads_without_a_debriefing_after_it_is_refused(old: str, new: str, reason: str) -> None:
    text = EXAMPLE.read_text("utf-8")
    assert old in text
    with pytest.raises(StudyError) as refused:
        parse_study(text.replace(old, new))
    assert reason in str(refused.value)
