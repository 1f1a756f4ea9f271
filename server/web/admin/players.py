"""Whether people play now: previews and rehearsals would take the time of their games."""

from server.web.services import Services


async def games_of_all(services: Services) -> int:
    """Return how many games all processes of this server hold; those of other processes as they said last."""
    others = await services.live.peers.processes()
    return len(services.games) + sum(int(process.figures.get("games", 0)) for process in others)
