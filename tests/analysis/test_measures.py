"""Measures of an episode, counted by hand on a few timesteps."""

import shutil
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import polars as pl
import pytest

from analysis import accuracy, measures
from analysis.results import select
from analysis.tables import Export, read_export
from server.play.messages import Input
from server.play.session import Session
from tests.support.live_fakes import make_spec, new_record

NO_PAUSES = pl.DataFrame(schema={"episode": pl.String, "reason": pl.String, "duration_ms": pl.String})
N, S, E, W, STAY, INTERACT = range(6)


def ticks(
    person: list[int], partner: list[int], predictions: list[tuple[int | None, ...]] | None = None
) -> pl.DataFrame:
    steps = list(zip(*(predictions or [(None, None, None)] * len(person)), strict=True))
    return pl.DataFrame(
        {
            "episode": "e",
            "timestep": range(len(person)),
            "person": person,
            "partner": partner,
            **{f"predicted_{step}": steps[step - 1] for step in (1, 2, 3)},
            "late": False,
        },
        schema_overrides={f"predicted_{step}": pl.Int8 for step in (1, 2, 3)},
    )


def test_a_prediction_is_right_if_the_partner_does_it_in_the_timestep_it_was_about() -> None:
    partner = [N, E, S, W]
    predictions = [(N, E, S), (E, W, W), (None, None, None), (W, N, N)]
    found = measures.prediction_hits(ticks([STAY] * 4, partner, predictions)).sort("step", "timestep")
    assert found.select("timestep", "step", "hit").rows() == [
        (0, 1, True),
        (1, 1, True),
        (3, 1, True),
        (0, 2, True),
        (1, 2, False),
        (0, 3, True),
        (1, 3, True),
    ]
    shares = measures.accuracy_of_episodes(ticks([STAY] * 4, partner, predictions)).row(0, named=True)
    assert (shares["accuracy_1"], shares["accuracy_2"], shares["accuracy_3"]) == (1, 0.5, 1)
    assert shares["accuracy"] == pytest.approx(2.5 / 3)


def test_predictions_never_reach_into_the_next_episode() -> None:
    both = pl.concat(
        [ticks([STAY], [N], [(N, E, E)]), ticks([STAY], [E], [(N, N, N)]).with_columns(episode=pl.lit("f"))]
    )
    assert measures.prediction_hits(both).sort("episode").select("episode", "step", "hit").rows() == [
        ("e", 1, True),
        ("f", 1, False),
    ]


def test_the_longest_wait_is_a_run_of_one_episode() -> None:
    waits = [STAY, STAY, N, STAY, STAY, STAY]
    both = pl.concat([ticks(waits, waits), ticks([STAY, N], [N, N]).with_columns(episode=pl.lit("f"))])
    assert dict(measures.longest_idle(both).rows()) == {"e": 3, "f": 1}


def test_pushing_counts_timesteps_after_the_eighth_same_move() -> None:
    moves = [E] * 10 + [STAY] * 10 + [INTERACT] * 20
    assert measures.pushing(ticks(moves, moves))["pushing_share"].item() == pytest.approx(2 / 40)


def test_lag_is_what_slow_keys_cost_more_than_the_fastest() -> None:
    keys = ticks([N] * 21, [N] * 21).with_columns(
        key_client_ms=pl.col("timestep") * 200.0, key_received_ms=pl.col("timestep") * 201.0 + 5000
    )
    assert measures.lag(keys, NO_PAUSES)["lag_ms"].item() == pytest.approx(19)
    assert measures.lag(keys.drop("key_client_ms"), NO_PAUSES)["lag_ms"].item() is None


def test_a_key_that_is_held_counts_once_in_the_lag() -> None:
    """It decides many timesteps, each of which names its message."""
    first = pl.min_horizontal("timestep", pl.lit(40))  # of forty quick keys and a slow one, which is held for long
    keys = ticks([N] * 60, [N] * 60).with_columns(
        key_client_ms=first * 200.0, key_received_ms=first * 200.0 + pl.when(first == 40).then(900).otherwise(30)
    )
    assert measures.lag(keys, NO_PAUSES)["lag_ms"].item() == 0


@pytest.mark.parametrize("kind", ["time", "text"])
def test_lag_is_unknown_where_the_game_ran_faster_than_real_time(kind: str) -> None:
    """As bots play: the game's clock runs five times as fast as the browser's."""
    began = datetime(2026, 1, 1, tzinfo=UTC)
    fast = ticks([N] * 21, [N] * 21).with_columns(
        key_client_ms=pl.col("timestep") * 40.0,
        key_received_ms=pl.col("timestep") * 200.0,
        scheduled_ms=pl.col("timestep") * 200.0,
        late_ms=0.0,
        made_at=pl.Series([began + timedelta(milliseconds=40 * t) for t in range(21)]).dt.cast_time_unit("us"),
    )
    late = fast.with_columns(  # the first ten timesteps are late and then caught up with, one after the other
        episode=pl.lit("real"),
        key_client_ms=pl.col("timestep") * 200.0,
        made_at=pl.Series([began + timedelta(milliseconds=max(200 * t, 1990 + t)) for t in range(21)]),
        late_ms=pl.Series([max(0.0, 1990.0 - 199 * t) for t in range(21)]),
    ).with_columns(key_received_ms=pl.col("key_client_ms") + pl.when(pl.col("timestep") < 10).then(900).otherwise(40))
    both = pl.concat([fast, late.cast({"made_at": fast.schema["made_at"]})])
    if kind == "text":
        both = both.with_columns(pl.col("made_at").dt.strftime("%Y-%m-%d %H:%M:%S%.6fZ"))
    found = dict(measures.lag(both, NO_PAUSES).rows())
    assert found == {"e": None, "real": pytest.approx(860)}


def test_a_pause_or_a_new_page_is_no_lag() -> None:
    """The server's clock leaves pauses out, and the browser's restarts with a new page."""
    client = [200.0 * t + (13_000 if t >= 10 else 0) - (30_000 if t >= 15 else 0) for t in range(21)]
    keys = ticks([N] * 21, [N] * 21).with_columns(
        pl.Series("key_client_ms", client), key_received_ms=pl.col("timestep") * 200.0 + 40
    )
    pauses = pl.DataFrame({"episode": ["e", "e", "e", "f"], "timestep": [10, 15, 15, 3]})
    assert measures.lag(keys, pauses)["lag_ms"].item() == pytest.approx(0)
    assert measures.lag(keys, pauses.head(1))["lag_ms"].item() > 10_000
    assert measures.lag(keys, pauses.drop("timestep"))["lag_ms"].item() is None


def test_a_pause_of_a_real_session_is_no_lag() -> None:
    """Every key arrives 40 ms late; half-way, the game is paused for 10 s, and a countdown of 3 s follows."""
    session = Session(new_record(make_spec()), 0.0)
    paused = []
    records = []
    now = 100.0
    session.release(0, now)
    session.count_down(now, now)
    session.finish_tick([None] * len(session.begin_start()), 1.0)
    while not session.over:
        if session.simulation.timestep == 20 and not paused:
            paused.append(session.pause(0, "hidden", now, datetime(2026, 1, 1, tzinfo=UTC)))
            session.release(0, now + 10)
            session.count_down(now + 10, now + 13)
        seq, pressed = session.simulation.timestep, session.next_deadline - 0.15
        session.key(0, Input(seq, None, E, 1000 * (pressed - 90)), pressed + 0.04)
        now = session.next_deadline
        questions = session.begin_tick(now)
        records.append(session.finish_tick([None] * len(questions), 1.0))
    keys = [record.keys[0] for record in records]
    table = ticks([E] * len(keys), [N] * len(keys)).with_columns(
        pl.Series("key_client_ms", [key.client_ms for key in keys]),
        pl.Series("key_received_ms", [key.received_ms for key in keys]),
    )
    pauses = pl.DataFrame({"episode": "e", "timestep": [one.timestep for one in paused if one is not None]})
    assert measures.lag(table, pauses)["lag_ms"].item() == pytest.approx(0, abs=0.01)


def test_reward_is_score_and_credit_and_every_episode_keeps_its_row(planted: Export) -> None:
    episodes = measures.episode_measures(planted)
    assert episodes["episode"].to_list() == planted.episodes["episode"].to_list()
    assert episodes["reward"].to_list() == (planted.episodes["score"] + planted.episodes["progress"]).to_list()
    one = planted.ticks.filter(pl.col("episode") == episodes["episode"][0])
    first = episodes.row(0, named=True)
    assert first["idle_share"] == pytest.approx(sum(action == STAY for action in one["person"]) / 60)
    assert first["interactions"] == sum(action == INTERACT for action in one["person"])


def test_hidden_time_is_a_share_of_the_time_that_the_episode_took(planted: Export) -> None:
    episode = planted.episodes["episode"][0]
    reasons = ["hidden", "blur", "lost"]
    pauses = pl.DataFrame({"episode": [episode] * 3, "reason": reasons, "duration_ms": [3000.0, 1000.0, 9000.0]})
    found = measures.episode_measures(replace(planted, pauses=pauses))
    assert found["hidden_share"][0] == pytest.approx(4000 / (60 * 200 + 4000))
    assert found["hidden_share"][1] == 0


def test_a_researchers_pause_during_an_absence_is_not_hidden_time(planted: Export) -> None:
    episode = planted.episodes["episode"][0]
    rows = {
        "episode": [episode] * 3,
        "reason": ["hidden"] * 3,
        "duration_ms": [600_000.0, 200.0, 1000.0],
        "away_ms": [2500.0, 500.0, None],  # the least that is counted; an older version
    }
    found = measures.episode_measures(replace(planted, pauses=pl.DataFrame(rows)))
    assert found["hidden_share"][0] == pytest.approx(3700 / (60 * 200 + 3700))


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_an_absence_during_a_server_failure_does_not_count_as_the_persons(
    kind: str, planted: Export, planted_folder: Path, tmp_path: Path
) -> None:
    """A pause that was on at a crash ends exactly when the pause of the next server begins."""
    folder = shutil.copytree(planted_folder, tmp_path / "data")
    for old in list(folder.rglob("*pauses*")):
        old.unlink()
    began = datetime(2026, 1, 2, 3, 4, 5, 678901, UTC)
    first, second = planted.episodes["episode"][0], planted.episodes["episode"][1]
    rows = [
        (first, "blur", began, 19607.57),
        (first, "server", began + timedelta(milliseconds=19607.57), 9.714),
        (first, "hidden", began + timedelta(minutes=1), 3000.0),
        (second, "blur", began, 1000.0),
        (second, "server", began + timedelta(milliseconds=1000, microseconds=1), 50.0),  # ended by a stop, not cut off
    ]
    table = pl.DataFrame(rows, schema=["episode", "reason", "started_at", "duration_ms"], orient="row")
    if kind == "csv":
        table.with_columns(pl.col("started_at").dt.strftime("%Y-%m-%d %H:%M:%S%.6fZ")).write_csv(folder / "pauses.csv")
    else:
        table.write_parquet(folder / "pauses.parquet")
    found = measures.episode_measures(read_export(folder))
    shares = dict(found.select("episode", "hidden_share").iter_rows())
    assert shares[first] == pytest.approx(3000 / (60 * 200 + 3000))
    assert shares[second] == pytest.approx(1000 / (60 * 200 + 1000))


def test_only_finished_episodes_of_people_who_finished_count(planted: Export) -> None:
    episodes = measures.episode_measures(planted)
    removed = planted.episodes.filter(pl.col("excluded") != "").height
    assert removed > 0
    assert measures.analysed(episodes, planted.participants).height == episodes.height - removed
    first = pl.col("participant") == planted.participants["participant"][0]
    kept = episodes.filter(~first & (pl.col("excluded") == "")).height
    for column, value in (("status", "timed_out"), ("excluded", "asked a friend to play")):
        people = planted.participants.with_columns(
            pl.when(first).then(pl.lit(value)).otherwise(pl.col(column)).alias(column)
        )
        assert measures.analysed(episodes, people).height == kept


def test_live_accuracy_is_the_planted_one_and_its_interval_is_over_people(planted: Export) -> None:
    episodes = measures.analysed(measures.episode_measures(planted), planted.participants)
    rows = accuracy.live(episodes, planted.layouts, planted.agents)
    for step, truth in enumerate((0.88, 0.80, 0.74), start=1):
        row = select(rows, agent="fcp", layout="all", condition="all", step=step)[0]
        assert row.estimate == pytest.approx(truth, abs=0.02)
    by_hand = episodes.filter((pl.col("agent") == "sp") & (pl.col("layout") == "matrix"))["accuracy"]
    row = select(rows, agent="sp", layout="matrix", condition="all", step=0)[0]
    assert (row.n, row.estimate) == (by_hand.len(), pytest.approx(by_hand.mean()))
    assert row.se == pytest.approx(by_hand.std() / by_hand.len() ** 0.5)


def test_offline_accuracy_is_the_mean_of_the_steps_and_of_all_layouts() -> None:
    said = {"sp": {"sp_predictor_stream": {"matrix": [0.9, 0.6, 0.3], "double_rings": [1.0, 1.0, 1.0]}}}
    rows = accuracy.offline(said, ("double_rings", "matrix"), ("sp", "fcp"))
    assert select(rows, layout="matrix", step=0)[0].estimate == pytest.approx(0.6)
    assert select(rows, layout="all", step=0)[0].estimate == pytest.approx(0.8)
    assert select(rows, agent="fcp") == []
    assert accuracy.offline({}, ("matrix",), ("sp",)) == []
