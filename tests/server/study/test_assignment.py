"""Which condition the next participant gets, in simulated studies with dropouts."""

import random
from collections import Counter

import pytest

from server.study.assignment import Count, StudyFullError, next_condition, participant_seed
from server.study.definition import Study
from server.study.loader import parse_study
from tests.support.study_text import SMALL_STUDY

THREE = "  - {name: third, predictor: random}\nagents:"


@pytest.fixture
def three_arms() -> Study:
    return parse_study(SMALL_STUDY.replace("agents:", THREE, 1)).study


class AssignmentSimulation:
    """People come one after the other, up to `at_once` at a time; a share drops out at a random moment."""

    def __init__(self, study: Study, seed: int, dropout: float, at_once: int) -> None:
        self.study, self.dropout, self.at_once = study, dropout, at_once
        self.chance = random.Random(seed)
        self.counts = {condition.name: [0, 0] for condition in study.conditions}  # completed, active
        self.active: list[tuple[str, bool]] = []
        self.arrived = 0

    def held(self) -> dict[str, Count]:
        return {name: Count(completed, active) for name, (completed, active) in self.counts.items()}

    def arrive(self) -> None:
        condition = next_condition(self.study, self.held(), self.arrived)
        self.arrived += 1
        self.counts[condition][1] += 1
        self.active.append((condition, self.chance.random() < self.dropout))

    def leave(self) -> None:
        condition, drops = self.active.pop(self.chance.randrange(len(self.active)))
        self.counts[condition][1] -= 1
        self.counts[condition][0] += not drops

    def completed(self) -> list[int]:
        return [completed for completed, _ in self.counts.values()]


@pytest.mark.parametrize("seed", range(30))
def test_arms_of_90_people_with_30_percent_dropout_differ_by_at_most_one_at_the_end(
    three_arms: Study, seed: int
) -> None:
    simulation = AssignmentSimulation(three_arms, seed, dropout=0.3, at_once=1)
    for _ in range(90):
        simulation.arrive()
        simulation.leave()
    assert max(simulation.completed()) - min(simulation.completed()) <= 1
    assert 40 <= sum(simulation.completed()) <= 80


@pytest.mark.parametrize("seed", range(30))
def test_places_of_dropouts_are_filled_until_90_have_finished_while_15_play_at_once(seed: int) -> None:
    text = SMALL_STUDY.replace("agents:", THREE, 1)
    for predictor in ("none", "tom", "random"):
        text = text.replace(f"predictor: {predictor}}}\n", f"predictor: {predictor}, quota: 30}}\n", 1)
    study = parse_study(text).study
    simulation = AssignmentSimulation(study, seed, dropout=0.3, at_once=15)
    while sum(simulation.completed()) < 90:
        try:
            while len(simulation.active) < 15:
                simulation.arrive()
        except StudyFullError:
            assert simulation.active, "full, although nobody is playing"
        simulation.leave()
    assert simulation.completed() == [30, 30, 30]


def test_where_somebody_waits_for_a_partner_the_next_participant_comes_first(three_arms: Study) -> None:
    held: Counter[str] = Counter()
    met: Counter[str] = Counter()
    arms = []
    for number in range(60):
        waiting = {name: count - met[name] for name, count in held.items()}
        name = next_condition(
            three_arms, {arm: Count(active=count) for arm, count in held.items()}, number, unpaired=waiting
        )
        held[name] += 1
        met[name] = held[name] // 2 * 2
        arms.append(name)
    assert arms[::2] == arms[1::2], "each second person is the partner of the one before"
    assert set(held.values()) == {20}


def test_a_full_condition_gets_nobody_even_if_somebody_waits_there() -> None:
    study = parse_study(SMALL_STUDY.replace("predictor: tom}", "predictor: tom, quota: 1}")).study
    assert next_condition(study, {"with": Count(active=1)}, 1, unpaired={"with": 1}) == "without"


def test_held_places_never_differ_by_more_than_one_before_anybody_leaves(three_arms: Study) -> None:
    simulation = AssignmentSimulation(three_arms, 1, dropout=0, at_once=90)
    for _ in range(90):
        simulation.arrive()
        held = [count.held for count in simulation.held().values()]
        assert max(held) - min(held) <= 1


def test_weights_share_the_places() -> None:
    study = parse_study(SMALL_STUDY.replace("predictor: tom}", "predictor: tom, weight: 2}")).study
    simulation = AssignmentSimulation(study, 1, dropout=0, at_once=90)
    for _ in range(90):
        simulation.arrive()
    assert {name: count.held for name, count in simulation.held().items()} == {"without": 30, "with": 60}


def test_full_condition_gets_nobody_and_a_full_study_shows_a_message() -> None:
    text = SMALL_STUDY.replace("predictor: none}", "predictor: none, quota: 1}")
    study = parse_study(text.replace("predictor: tom}", "predictor: tom, quota: 1}")).study
    assert next_condition(study, {"without": Count(1, 0)}, 1) == "with"
    with pytest.raises(StudyFullError):
        next_condition(study, {"without": Count(1, 0), "with": Count(0, 1)}, 2)


def test_equal_arms_are_drawn_by_the_seed_evenly(three_arms: Study) -> None:
    drawn = [next_condition(three_arms, {}, number) for number in range(300)]
    assert drawn == [next_condition(three_arms, {}, number) for number in range(300)]
    assert all(70 < count < 130 for count in Counter(drawn).values())


def test_participants_have_seeds_of_their_own(three_arms: Study) -> None:
    seeds = [participant_seed(three_arms, number) for number in range(1000)]
    assert len(set(seeds)) == 1000
    assert all(0 <= seed < 2**63 for seed in seeds)
