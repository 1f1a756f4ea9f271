"""Accounts, sessions and decisions in a real database; what is counted of predictions."""

from datetime import UTC, datetime, timedelta

import pytest
from scipy.stats import binomtest

from server.store import admins, audit, episodes, interventions, participants, studies, withdrawal
from server.store.accuracy import wilson
from server.store.database import Database
from tests.support.study_data import SPEC, new_participant

NOW = datetime(2026, 1, 2, 3, 4, tzinfo=UTC)


@pytest.fixture
def mara(database: Database) -> str:
    database.write_now(admins.create, "mara", "a hash", "act")
    return "mara"


def test_a_name_is_given_once(database: Database, mara: str) -> None:
    with pytest.raises(admins.NameTaken):
        database.write_now(admins.create, mara, "another", "watch")
    with pytest.raises(ValueError, match="not a role"):
        database.write_now(admins.create, "other", "a hash", "king")


def test_a_session_has_its_account_and_starts_in_blind_mode(database: Database, mara: str) -> None:
    database.write_now(admins.open_session, mara, "t" * 64, NOW)
    found = database.read_now(admins.session, "t" * 64, NOW)
    assert found is not None
    session, touch_is_due = found
    assert (session.name, session.role, session.blind, touch_is_due) == (mara, "act", True, False)
    assert session.may("watch")
    assert session.may("act")
    assert not session.may("own")


def test_a_session_ends_when_nobody_uses_it_and_after_half_a_day_anyway(database: Database, mara: str) -> None:
    token = "t" * 64
    database.write_now(admins.open_session, mara, token, NOW)
    assert database.read_now(admins.session, token, NOW + admins.IDLE) is not None
    assert database.read_now(admins.session, token, NOW + admins.IDLE + timedelta(seconds=1)) is None
    for hours in range(1, 13):
        database.write_now(admins.touch, token, NOW + timedelta(hours=hours))
    assert database.read_now(admins.session, token, NOW + admins.MAX_SESSION) is not None
    assert database.read_now(admins.session, token, NOW + admins.MAX_SESSION + timedelta(seconds=1)) is None


def test_a_session_from_before_the_clock_was_set_back_ends_too(database: Database, mara: str) -> None:
    database.write_now(admins.open_session, mara, "t" * 64, NOW)
    assert database.read_now(admins.session, "t" * 64, NOW - timedelta(days=2)) is None
    assert database.read_now(admins.session, "t" * 64, NOW - admins.IDLE - timedelta(minutes=1)) is None
    found = database.read_now(admins.session, "t" * 64, NOW - timedelta(hours=1))
    assert found is not None
    assert found[1], "it is noted when the session was used"


def test_a_new_password_or_removal_ends_all_sessions(database: Database, mara: str) -> None:
    for end in (lambda: database.write_now(admins.set_password, mara, "new"),
                lambda: database.write_now(admins.remove, mara)):  # fmt: skip
        database.write_now(admins.open_session, mara, "t" * 64, NOW)
        assert end()
        assert database.read_now(admins.session, "t" * 64, NOW) is None
    assert not database.write_now(admins.remove, mara)


def test_an_exclusion_is_undone_once_and_deleted_with_the_participant(database: Database) -> None:
    study = database.write_now(studies.register, "s", "text")
    new = participants.NewParticipant(study.id, "tom", 1, "token")
    person = database.write_now(participants.create, new).id
    number = database.write_now(interventions.exclude, person, None, ("other", "a note"), "mara")
    (held,) = database.read_now(interventions.exclusions_of, [person])
    assert (held.reason, held.note, held.excluded_by) == ("other", "a note", "mara")
    assert database.write_now(interventions.restore, number, "mara")
    assert not database.write_now(interventions.restore, number, "mara")
    assert database.read_now(interventions.exclusions_of, [person]) == []
    assert database.write_now(withdrawal.withdraw, person)
    assert database.read_now(audit.first_forged) is None


def test_an_excluded_round_of_two_is_excluded_for_both(database: Database) -> None:
    study = database.write_now(studies.register, "s", "text")
    people = tuple(database.write_now(new_participant, study.id) for _ in range(3))
    new = episodes.NewEpisode(SPEC, "episode-01", (people[0], people[1]), study.id)
    episode = database.write_now(episodes.create, new)
    database.write_now(interventions.exclude, people[0], episode, ("other", ""), "mara")
    database.write_now(interventions.exclude, people[0], None, ("not attentive", ""), "mara")
    held = [[one.reason for one in database.read_now(interventions.exclusions_of, [person])] for person in people]
    assert held == [["other", "not attentive"], ["other"], []]


def test_a_study_is_paused_until_it_is_resumed(database: Database) -> None:
    assert database.write_now(interventions.pause_study, "s", "mara")
    assert not database.write_now(interventions.pause_study, "s", "mara")
    assert database.read_now(interventions.paused_studies) == {"s"}
    assert database.write_now(interventions.resume_study, "s", "mara")
    assert not database.write_now(interventions.resume_study, "s", "mara")
    assert database.read_now(interventions.paused_studies) == set()


@pytest.mark.parametrize(("right", "asked"), [(0, 5), (5, 5), (78, 100), (1, 1000), (1, 1)])
def test_wilson_interval_is_that_of_scipy(right: int, asked: int) -> None:
    interval = binomtest(right, asked).proportion_ci(method="wilson")
    assert wilson(right, asked) == pytest.approx((right / asked, interval.low, interval.high), abs=1e-12)


def test_wilson_interval_of_nothing_is_everything() -> None:
    assert wilson(0, 0) == (0.0, 0.0, 1.0)
