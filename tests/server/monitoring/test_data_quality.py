"""Which episodes the quality rules are applied to, and how often."""

from collections import Counter
from typing import Any

import pytest

from server.monitoring import data_quality
from server.monitoring.data_quality import DataQuality, EpisodeQuality
from server.store import episodes, studies, ticks
from server.store.database import Database
from tests.support.study_data import SPEC, new_participant, played, result_of


async def test_a_round_of_two_is_checked_once_and_counts_for_both(
    database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    study = database.write_now(studies.register, "two", "name: two")
    people = (database.write_now(new_participant, study.id), database.write_now(new_participant, study.id))
    episode = database.write_now(episodes.create, episodes.NewEpisode(SPEC, "episode-01", people, study.id, "tom"))
    records = played(episode)
    database.write_now(ticks.insert, records)
    database.write_now(episodes.end, result_of(records))
    checked: list[str] = []

    def proposals(_: Any, chosen: list[str]) -> dict[str, EpisodeQuality]:
        checked.extend(chosen)
        return dict.fromkeys(chosen, EpisodeQuality("look", "idle"))

    monkeypatch.setattr(data_quality, "_proposals", proposals)
    quality = DataQuality(database)
    assert [await quality.check_new((study.id,)) for _ in range(2)] == [0, 0]
    assert checked == [episode]
    assert quality.by_person() == {person: Counter(look=1) for person in people}
    assert quality.of(episode) == EpisodeQuality("look", "idle")
