"""The running accuracy of the dashboard is about people, or about bots where only bots came."""

from sqlalchemy import Connection

from server.store import episodes, participants, studies, ticks, withdrawal
from server.store.accuracy import RunningAccuracy
from server.store.database import Database
from server.store.participants import NewParticipant, new_token
from server.store.wrong_displays import DisplayCount
from tests.support.study_data import SPEC, played, result_of


def one_round(connection: Connection, simulated: bool) -> int:
    """A participant who played one round; returns the study."""
    study = studies.register(connection, "one", "name: one")
    new = NewParticipant(study.id, "tom", 7, new_token(), simulated=simulated)
    person = participants.create(connection, new).id
    plan = episodes.NewEpisode(SPEC, "episode-01", (person, None), study.id, "tom")
    episode = episodes.create(connection, plan)
    records = played(episode)
    ticks.insert(connection, records)
    episodes.end(connection, result_of(records))
    return study.id


def test_people_and_bots_are_never_counted_together(database: Database) -> None:
    accuracy = RunningAccuracy()

    def counted() -> int:
        database.read_now(accuracy.count, (study,))
        return sum(hits.episodes for hits in accuracy.hits.values())

    study = database.write_now(one_round, True)
    database.write_now(one_round, True)
    assert counted() == 2, "only bots have come"
    database.write_now(one_round, False)
    assert counted() == 1, "of a study in which people take part"
    database.write_now(one_round, True)
    assert (counted(), accuracy.waiting) == (1, 0)


def test_rounds_of_a_deleted_participant_no_longer_count(database: Database) -> None:
    accuracy, display = RunningAccuracy(), DisplayCount()
    study, _ = (database.write_now(one_round, False) for _ in range(2))

    def counted() -> tuple[int, int]:
        for count in (accuracy, display):
            database.read_now(count.count, (study,))
        return sum(hits.episodes for hits in accuracy.hits.values()), len(display.by_episode)

    assert counted() == (2, 2)
    person = database.read_now(participants.of_study, study)[0].id
    database.write_now(withdrawal.withdraw, person)
    assert counted() == (1, 1)
