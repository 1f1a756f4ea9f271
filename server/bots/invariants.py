"""Compare what simulated participants saw with what is stored. A violation names the guarantee that does not hold."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from sqlalchemy import ColumnElement, Connection, select

from server.bots.game_client import PARTLY_SEEN, Journal
from server.store import participants
from server.store.tables import answers, episodes, ticks
from server.verification import verify


@dataclass(frozen=True)
class Claim:
    """One participant, identified by the cookie, with what they saw."""

    token: str
    journal: Journal


def _lateness(late: int, broken: int) -> str:
    """Say in how many timesteps it is the server's speed."""
    which = "in all of them" if late == broken else f"in {late} of them"
    slow = f"; {which} the server was too slow, so that the models missed their deadline"
    return f"{slow} (fewer participants at once, or more cores)" if late else ""


def broken_in_journal(journal: Journal, blocks: int = 1) -> Iterator[str]:
    """Return violations that show without the database. `blocks`: of rounds, which may differ in what is shown."""
    yield from journal.violations
    numbers = [welcome.number for welcome in journal.games.values() if welcome.kind == "episode"]
    for number in sorted({number for number in numbers if numbers.count(number) > 1}):
        yield f"episode number {number} was played twice"
    shown = {(welcome.partner, welcome.shows_predictions) for welcome in journal.games.values()}
    if blocks == 1 and len(shown) > len({partner for partner, _ in shown}):
        yield "predictions were shown in some games and not in others: the condition changed"
    for episode, timesteps in journal.broken_displays.items():
        last = max(timestep for one, timestep in journal.states if one == episode)
        broken = sorted(timesteps - {last})  # nothing is shown on the last state
        if broken:
            what = "nothing" if journal.games[episode].shows_predictions else "a prediction"
            late = len(journal.late_timesteps.get(episode, set()).intersection(broken))
            yield (
                f"episode {episode} showed {what} in {len(broken)} of {last} timesteps, first in {broken[0]}: "
                f"that is not what its condition requires{_lateness(late, len(broken))}"
            )
    for episode, ended in journal.ended.items():
        welcome = journal.games[episode]
        last = max(timestep for one, timestep in journal.states if one == episode)
        if ended["passed"] and welcome.kind == "episode" and last != welcome.horizon:
            yield f"episode {episode} ended at timestep {last}, not at {welcome.horizon}"


def broken_codes(journals: Sequence[Journal]) -> Iterator[str]:
    """Return completion codes that two participants share."""
    codes = [journal.code for journal in journals if journal.code]
    for code in sorted({code for code in codes if codes.count(code) > 1}):
        yield f"two participants were given the code {code}"


def broken_at_code(connection: Connection, claim: Claim) -> list[str]:
    """Check, while the code is on the screen, that everything it confirms is stored."""
    mine = participants.by_token(connection, claim.token)
    if mine is None or mine.status not in ("completed", "returned") or mine.completion_code is None:
        return ["a completion code was shown before the study was stored as completed"]
    broken = []
    played = select(episodes.c.id, episodes.c.status, episodes.c.final_hash)
    for episode, status, final_hash in connection.execute(played.where(_played_by(mine.id))):
        if status not in ("done", "aborted") or final_hash is None:
            broken.append(f"a completion code was shown before the end of episode {episode} was stored")
    stored = set(connection.execute(select(answers.c.step_key).where(answers.c.participant_id == mine.id)).scalars())
    for step, sent in claim.journal.answers:
        if any(name != "step" for name in sent) and step not in stored:
            broken.append(f"a completion code was shown before the answers of {step} were stored")
    return broken


def broken_in_store(connection: Connection, claim: Claim) -> Iterator[str]:
    """Compare what a participant saw with what is stored, at the end."""
    mine = participants.by_token(connection, claim.token)
    if mine is None:
        yield "somebody who agreed to take part is not in the database"
        return
    if claim.journal.code and mine.completion_code not in (None, claim.journal.code):
        yield f"participant {mine.number}: the code on the screen is not the code that is stored"
    own = connection.execute(select(episodes.c.id, episodes.c.condition).where(_played_by(mine.id))).all()
    for episode, condition in own:
        if condition != mine.condition:
            yield f"participant {mine.number} is in {mine.condition}, but played episode {episode} in {condition}"
        yield from _timesteps(connection, episode, claim.journal)
        result = verify(connection, episode)
        if result.difference is not None:
            yield f"episode {episode} does not re-simulate: {result.difference} (timestep {result.timestep})"
    for episode in sorted(set(claim.journal.games) - {episode for episode, _ in own}):
        yield f"episode {episode} was played and is not stored"


def _timesteps(connection: Connection, episode: str, journal: Journal) -> Iterator[str]:
    query = select(ticks.c.timestep, ticks.c.state_hash).where(ticks.c.episode_id == episode)
    stored = {timestep: state_hash.hex() for timestep, state_hash in connection.execute(query)}
    lost = sorted(set(range(max(stored, default=-1) + 1)) - set(stored))
    if lost:
        yield f"episode {episode} lost timesteps {lost[:5]}"
    seen = {timestep: state_hash for (one, timestep), state_hash in journal.states.items() if one == episode}
    for timestep, state_hash in seen.items():
        if stored.get(timestep) != state_hash and (state_hash != PARTLY_SEEN or timestep not in stored):
            was = "is not stored" if timestep not in stored else "is stored as another one"
            yield f"episode {episode}: the state shown at timestep {timestep} {was}"
            return


def _played_by(participant_id: str) -> ColumnElement[bool]:
    return (episodes.c.participant_0 == participant_id) | (episodes.c.participant_1 == participant_id)
