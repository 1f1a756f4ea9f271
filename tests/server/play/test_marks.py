"""What is drawn in each condition, and where its randomness comes from."""

from collections import Counter

from hypothesis import given
from hypothesis import strategies as st

from server.play.marks import NOTHING_SHOWN, OPACITIES, display
from server.play.randomness import MARKS, PARTNER, uniform
from tests.support.live_fakes import make_spec

SURE = tuple(tuple(0.9 if action == step else 0.02 for action in range(6)) for step in range(3))
FLAT = ((0.2, 0.16, 0.16, 0.16, 0.16, 0.16),) * 3


def test_predictor_condition_shows_the_likeliest_action_of_each_step() -> None:
    assert [action for action, _ in display(make_spec(), 5, SURE)] == [0, 1, 2]


def test_missing_prediction_shows_nothing() -> None:
    assert [action for action, _ in display(make_spec(), 5, ())] == [NOTHING_SHOWN] * 3


def test_random_marks_are_uniform_and_redrawn_every_timestep() -> None:
    spec = make_spec(shown="random")
    drawn = [display(spec, timestep, SURE) for timestep in range(3000)]
    counts = Counter(action for marks in drawn for action, _ in marks)
    assert set(counts) == set(range(6))
    assert all(abs(count - 1500) < 150 for count in counts.values())
    assert drawn == [display(spec, timestep, ()) for timestep in range(3000)]


def test_random_marks_differ_between_episodes() -> None:
    one, other = make_spec(shown="random", seed=1), make_spec(shown="random", seed=2)
    assert [display(one, t, ()) for t in range(20)] != [display(other, t, ()) for t in range(20)]


def test_fewer_steps_are_shown_where_the_study_says_so() -> None:
    for shown in ("nothing", "random", "predictor"):
        assert len(display(make_spec(shown=shown, steps_shown=2), 1, SURE)) == 2


def test_confidence_makes_unsure_steps_paler_alike_in_all_conditions() -> None:
    spec = make_spec(confidence_opacity=True)
    sure = [opacity for _, opacity in display(spec, 1, SURE)]
    unsure = [opacity for _, opacity in display(spec, 1, FLAT)]
    assert all(pale < full for pale, full in zip(unsure, sure, strict=True))
    random = make_spec(confidence_opacity=True, shown="random")
    assert [opacity for _, opacity in display(random, 1, FLAT)] == unsure


def test_plain_opacities_are_those_of_the_drawing_rules() -> None:
    assert tuple(opacity for _, opacity in display(make_spec(), 1, FLAT)) == OPACITIES


@given(st.integers(0, 2**63 - 1), st.integers(0, 10_000), st.sampled_from([PARTNER, PARTNER + 1, MARKS, MARKS + 2]))
def test_every_number_lies_in_the_unit_interval_and_comes_again(seed: int, timestep: int, purpose: int) -> None:
    drawn = uniform(seed, timestep, purpose)
    assert 0 <= drawn < 1
    assert drawn == uniform(seed, timestep, purpose)


def test_numbers_are_the_same_on_every_machine() -> None:
    assert [round(uniform(1, t, PARTNER), 12) for t in range(3)] == EXPECTED


def test_numbers_of_neighbouring_timesteps_and_purposes_are_unrelated() -> None:
    pairs = [(uniform(9, t, PARTNER), uniform(9, t + 1, PARTNER), uniform(9, t, PARTNER + 1)) for t in range(2000)]
    for k in (1, 2):
        covariance = sum((pair[0] - 0.5) * (pair[k] - 0.5) for pair in pairs) / len(pairs)
        assert abs(covariance) < 0.01


EXPECTED = [0.423211448196, 0.439784939364, 0.719072606241]
