"""A researcher's deeds, done wherever the game runs: in this process or in another one of the same server."""

from collections.abc import Sequence
from typing import Any

from server.monitoring.control import Control
from server.monitoring.peers import Peers, SingleProcess


class ClusterControl:
    """`Control` of all processes; made once in server.main."""

    def __init__(self, control: Control, peers: Peers | None = None) -> None:
        self._control, self._peers = control, peers or SingleProcess()

    async def do(self, deed: str, episode: str, *given: Any) -> bool:
        """pause, resume, tell, extend or end a game. False: the game does not run, or nobody is there to be told."""
        return await self.answer(deed, episode, *given) or await self._peers.owner_does(deed, episode, *given)

    async def end_all(self, episodes: Sequence[str]) -> None:
        """Ends these games where they run."""
        await self._control.end_all(episodes)
        await self._peers.all_do("end_all", list(episodes))

    async def pause_study(self, study: str) -> None:
        await self._to_study("pause_study", study)

    async def resume_study(self, study: str) -> None:
        await self._to_study("resume_study", study)

    async def tell_study(self, study: str, text: str) -> int:
        """Shows the words in every running game of a study: in how many."""
        return await self._to_study("tell_study", study, text)

    async def _to_study(self, deed: str, *given: str) -> int:
        here = await self.answer(deed, *given)
        there = await self._peers.all_do(deed, *given)
        return int(here) + sum(int(reached) for reached in there)

    async def answer(self, deed: str, *given: Any) -> Any:
        """Does here what another process asks for. Raises ValueError for what no process asks for."""
        control = self._control
        match deed, given:
            case "pause" | "resume" as name, (str(episode),):
                return control.pause(episode) if name == "pause" else control.resume(episode)
            case "tell", (str(episode), str(text)):
                return control.tell(episode, text)
            case "extend", (str(episode), int() | float() as seconds):
                return control.extend(episode, float(seconds))
            case "end", (str(episode),):
                return await control.end(episode)
            case "end_all", (list(episodes),):
                await control.end_all(episodes)
            case "pause_study", (str(study),):
                control.pause_study(study)
            case "resume_study", (str(study),):
                await control.resume_study(study)
            case "tell_study", (str(study), str(text)):
                return sum(control.tell(episode, text) for episode in await control.episodes_of(study))
            case _:
                raise ValueError(f"there is no deed {deed!r}")
        return 0
