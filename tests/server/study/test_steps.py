"""The step sequence of a participant: its order, and that it depends on the seed alone."""

from collections import Counter
from itertools import pairwise
from pathlib import Path

import pytest

from server.study.definition import Study
from server.study.latin_square import balanced_square
from server.study.loader import load_study, parse_study
from server.study.order import episode_order
from server.study.steps import episodes_of, position, steps
from tests.support.study_text import SMALL_STUDY

PUBLISHED = Path(__file__).parents[3] / "studies" / "external_predictor.yaml"
SEEDS = range(40)


@pytest.fixture
def small() -> Study:
    return parse_study(SMALL_STUDY).study


@pytest.fixture
def published() -> Study:
    return load_study(PUBLISHED).study


def with_rule(rule: str) -> Study:
    return parse_study(SMALL_STUDY.replace("rule: paper", f"rule: {rule}")).study


def agents_by_layout(study: Study, seed: int) -> list[list[str]]:
    by_layout: dict[str, list[str]] = {}
    for layout, agent in episode_order(study, seed, 0):
        by_layout.setdefault(layout, []).append(agent)
    return list(by_layout.values())


def test_steps_follow_the_flow_with_a_questionnaire_after_every_episode(small: Study) -> None:
    keys = [step.key for step in steps(small, "with", 5)]
    assert keys == [
        "everything", "introduction", "quiz", "tutorial",
        "ready-01", "episode-01", "after-01", "ready-02", "episode-02", "after-02", "break-02",
        "ready-03", "episode-03", "after-03", "ready-04", "episode-04", "after-04", "goodbye", "thanks",
    ]  # fmt: skip
    assert [step.kind for step in steps(small, "with", 5)][-3:] == ["questionnaire", "page", "thanks"]


def test_a_step_asks_the_questions_that_the_study_has_under_this_name(published: Study) -> None:
    way = steps(published, published.conditions[0].name, 7)
    asking = [step for step in way if step.asks]
    assert {step.kind for step in asking} == {"quiz", "questionnaire"}
    assert all(published.questions(step.asks) for step in asking)
    assert all(step.kind not in ("quiz", "questionnaire") for step in way if not step.asks)


def test_keys_of_a_step_sequence_are_unique(published: Study) -> None:
    keys = [step.key for step in steps(published, "tom", 3)]
    assert len(set(keys)) == len(keys)


def test_progress_bar_never_goes_back(published: Study) -> None:
    phases = [step.phase for step in steps(published, "tom", 3)]
    assert list(dict.fromkeys(phases)) == ["introduction", "practice", "rounds", "finish"]
    order = {phase: place for place, phase in enumerate(dict.fromkeys(phases))}
    assert [order[phase] for phase in phases] == sorted(order[phase] for phase in phases)


def test_same_seed_gives_the_same_steps_whatever_the_condition(published: Study) -> None:
    for seed in SEEDS:
        sequences = {steps(published, condition.name, seed) for condition in published.conditions}
        assert len(sequences) == 1
        assert sequences == {steps(published, "none", seed)}


def test_episodes_of_one_participant_have_different_seeds(published: Study) -> None:
    seeds = [step.seed for number in SEEDS for step in steps(published, "tom", number) if step.is_game]
    assert len(set(seeds)) == len(seeds) == 11 * len(SEEDS)
    assert all(0 < seed < 2**63 for seed in seeds)


def test_unknown_condition_has_no_steps(small: Study) -> None:
    with pytest.raises(KeyError):
        steps(small, "nobody", 1)


def test_published_study_has_ten_episodes_five_layouts_in_order_and_both_agents_in_each(published: Study) -> None:
    for seed in SEEDS:
        order = episode_order(published, seed, 0)
        assert [layout for layout, _ in order][::2] == [
            "coordination_ring", "double_rings", "double_counters", "matrix", "clear_division",
        ]  # fmt: skip
        assert all(first[0] == second[0] for first, second in zip(order[::2], order[1::2], strict=True))
        assert Counter(agent for _, agent in order) == {"sp": 5, "fcp": 5}
    assert episodes_of(published) == 10


def test_paper_rule_reverses_the_agents_from_layout_to_layout(published: Study) -> None:
    for seed in SEEDS:
        pairs = agents_by_layout(published, seed)
        assert all(later == earlier[::-1] for earlier, later in pairwise(pairs))


def test_paper_rule_draws_the_first_agent_at_random(published: Study) -> None:
    first = Counter(episode_order(published, seed, 0)[0][1] for seed in range(400))
    assert 160 < first["sp"] < 240


def test_fixed_rule_is_as_listed() -> None:
    study = with_rule("fixed")
    expected = (
        ("coordination_ring", "planner"),
        ("coordination_ring", "stay"),
        ("matrix", "planner"),
        ("matrix", "stay"),
    )
    assert {episode_order(study, seed, seed) for seed in SEEDS} == {expected}


def test_shuffled_rule_plays_everything_once_in_many_orders() -> None:
    study = with_rule("shuffled")
    orders = {episode_order(study, seed, 0) for seed in range(200)}
    assert all(len(set(order)) == 4 for order in orders)
    assert len(orders) > 15


def test_latin_square_puts_every_layout_at_every_place_equally_often() -> None:
    study = with_rule("latin_square")
    places = Counter(
        (layout, place // 2) for n in range(8) for place, (layout, _) in enumerate(episode_order(study, 1, n))
    )
    assert set(places.values()) == {8}


@pytest.mark.parametrize("size", [1, 2, 3, 4, 5, 6])
def test_balanced_square_lets_everything_follow_everything_equally_often(size: int) -> None:
    rows = balanced_square(size)
    follows = Counter((a, b) for row in rows for a, b in pairwise(row))
    assert all(sorted(row) == list(range(size)) for row in rows)
    assert len(follows) == size * (size - 1)
    assert len(set(follows.values())) <= 1


def test_repeat_plays_every_pair_so_often() -> None:
    study = parse_study(SMALL_STUDY.replace("rule: paper", "rule: shuffled, repeat: 3")).study
    assert set(Counter(episode_order(study, 9, 0)).values()) == {3}
    assert episodes_of(study) == 12


def test_position_finds_a_step_by_its_key(small: Study) -> None:
    way = steps(small, "with", 5)
    assert way[position(way, "episode-03")].number == 3
    with pytest.raises(KeyError):
        position(way, "episode-99")
