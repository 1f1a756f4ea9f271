"""Deletes a participant who may be in a game: at the participant's own request, or on request by a researcher."""

from server.cluster.command_dispatch import ClusterControl
from server.monitoring.commands import DismissParticipant, EndGames
from server.store import overview, withdrawal
from server.web.dependencies import Web


async def delete(
    web: Web, control: ClusterControl, participant_id: str, deletion: withdrawal.Deletion | None = None
) -> bool:
    """End the participant's games, delete everything about the person, and close the sockets of their open pages; False
    if there is no such participant.

    A running game would continue to write. A page in the waiting room would wait for a partner who cannot come.
    """
    played = await web.database.read(overview.played_by, participant_id)
    await control.broadcast(EndGames([one.id for one in played]))
    done = await web.database.write(withdrawal.withdraw, participant_id, deletion)
    if done:
        await control.broadcast(DismissParticipant(participant_id))
    return done
