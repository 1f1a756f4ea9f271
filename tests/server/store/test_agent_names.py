"""An agent from outside appears under its name in the study, not under its path."""

from dataclasses import replace

import pytest

from server.export import codebook
from server.export.rows import Selection, episode_rows
from server.store import episodes, overview, studies, ticks
from server.store.accuracy import RunningAccuracy
from server.store.database import Database
from tests.support.study_data import SPEC, new_participant, played, result_of


@pytest.mark.parametrize(("stored", "shown"), [("mine", "mine"), (None, "./agents/bc.onnx")])
def test_an_agent_is_called_what_the_study_calls_it(database: Database, stored: str | None, shown: str) -> None:
    def fill(connection):
        study = studies.register(connection, "one", "name: one")
        person = new_participant(connection, study.id)
        spec = replace(SPEC, agents=(None, "./agents/bc.onnx"))
        new = episodes.NewEpisode(spec, "episode-01", (person, None), study.id, "tom", agent_name=stored)
        episode = episodes.create(connection, new)
        records = played(episode)
        ticks.insert(connection, records)
        episodes.end(connection, result_of(records, spec))
        return study.id, episode

    study, episode = database.write_now(fill)
    assert database.read_now(overview.played, episode)[episode].agent == shown
    accuracy = RunningAccuracy()
    database.read_now(accuracy.count, (study,))
    assert {agent for agent, _ in accuracy.hits} == {shown}
    (row,) = database.read_now(lambda connection: list(episode_rows(Selection(connection), ())))
    named = dict(zip([column.name for column in codebook.EPISODES.columns], row, strict=True))
    assert (named["agent_name"], named["agent_1"]) == (stored, "./agents/bc.onnx")
