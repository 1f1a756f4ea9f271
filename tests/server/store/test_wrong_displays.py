"""Timesteps that did not show what their condition requires are counted from what is stored."""

from dataclasses import replace

import pytest
from msgspec import structs

from server.play.marks import NOTHING_SHOWN
from server.store import episodes, studies, ticks
from server.store.database import Database
from server.store.wrong_displays import DisplayCount, violations
from tests.support.study_data import SPEC, played, result_of

NOTHING = ((NOTHING_SHOWN, 95), (NOTHING_SHOWN, 80), (NOTHING_SHOWN, 60))
MARKS = ((2, 95), (4, 80), (0, 60))


def stored(
    database: Database,
    shown: str,
    displays: list[tuple[tuple[int, int], ...]],
    asked: tuple[bool | None, ...] = (),
    models_ms: tuple[float, ...] = (),
) -> tuple[int, str]:
    """An episode that is over, with these displays on its states; the last one is not counted. `asked`: whether the
    marks were asked for on each state; `models_ms`: how long the models needed."""

    def fill(connection):
        study = studies.register(connection, "one", "name: one")
        spec = replace(SPEC, shown=shown, horizon=len(displays) - 1)
        new = episodes.NewEpisode(spec, "episode-01", (None, None), study.id, "tom")
        episode = episodes.create(connection, new)
        records = played(episode, len(displays) - 1)
        records = [structs.replace(one, displayed=display) for one, display in zip(records, displays, strict=True)]
        records = [
            structs.replace(one, asked=was) for one, was in zip(records, asked or (None,) * len(displays), strict=True)
        ]
        records = [
            structs.replace(one, models_ms=time)
            for one, time in zip(records, models_ms or (1.0,) * len(displays), strict=True)
        ]
        ticks.insert(connection, records)
        episodes.end(connection, result_of(records, spec))
        return study.id, episode

    return database.write_now(fill)


@pytest.mark.parametrize(
    ("shown", "displays", "broken"),
    [
        ("predictor", [MARKS, NOTHING, MARKS, NOTHING, NOTHING], 2),
        ("random", [MARKS, MARKS, NOTHING], 0),
        ("nothing", [NOTHING, MARKS, NOTHING, NOTHING], 1),
        ("nothing", [NOTHING, NOTHING], 0),
        ("predictor", [NOTHING[:1], MARKS[:1], NOTHING[:1]], 1),
    ],
)
def test_what_was_not_shown_as_required_is_counted(
    database: Database, shown: str, displays: list[tuple[tuple[int, int], ...]], broken: int
) -> None:
    study, episode = stored(database, shown, displays)
    assert database.read_now(violations, [episode]) == ({episode: (broken, 0)} if broken else {})
    count = DisplayCount()
    database.read_now(count.count, (study,))
    database.read_now(count.count, (study,))
    assert (count.timesteps, count.episodes, count.waiting) == (broken, int(broken > 0), 0)


def test_marks_on_demand_are_due_in_the_timesteps_in_which_they_were_asked_for(database: Database) -> None:
    displays = [NOTHING, MARKS, NOTHING, MARKS, NOTHING]
    asked = (False, True, True, False, False)  # right, right, missing, not asked for, the last state
    _, episode = stored(database, "predictor", displays, asked)
    assert database.read_now(violations, [episode]) == {episode: (2, 0)}


def test_those_that_are_due_to_the_server_s_lateness_are_counted_separately(database: Database) -> None:
    displays = [NOTHING, NOTHING, MARKS, NOTHING, NOTHING]
    slow, quick = SPEC.deadline_ms + 0.5, float(SPEC.deadline_ms)
    study, episode = stored(database, "predictor", displays, models_ms=(slow, quick, slow, slow, slow))
    assert database.read_now(violations, [episode]) == {episode: (3, 2)}
    count = DisplayCount()
    database.read_now(count.count, (study,))
    assert (count.timesteps, count.late) == (3, 2)


@pytest.mark.parametrize("display", ["actions", "intention", "both"])
def test_marks_and_intentions_are_required_by_their_displays_only(database: Database, display: str) -> None:
    """Four states: too little, what is required, something else, and the last one, which does not count."""

    def fill(connection):
        study = studies.register(connection, "one", "name: one")
        spec = replace(SPEC, shown="predictor", display=display, horizon=3)
        new = episodes.NewEpisode(spec, "episode-01", (None, None), study.id, "tom")
        episode = episodes.create(connection, new)
        both = {
            "actions": (MARKS, (8, -1, -1, 95)),
            "intention": (NOTHING, (4, 3, 0, 95)),
            "both": (MARKS, (0, -1, -1, 95)),
        }
        wrong = (NOTHING, (8, -1, -1, 95)) if display != "both" else (MARKS, None)
        shown = [wrong, both[display], both["intention" if display == "actions" else "actions"], both["both"]]
        records = [
            structs.replace(one, displayed=marks, displayed_intention=intention)
            for one, (marks, intention) in zip(played(episode, 3), shown, strict=True)
        ]
        ticks.insert(connection, records)
        episodes.end(connection, result_of(records, spec))
        return episode

    episode = database.write_now(fill)
    assert database.read_now(violations, [episode]) == {episode: (2, 0)}
