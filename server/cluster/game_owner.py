"""This process as one of several: the games it owns, what it reports to the others, and the commands it runs for
them.
"""

from collections.abc import Callable

from server.cluster.registry import Cluster, LetGo
from server.monitoring.commands import Command
from server.monitoring.control import Control
from server.monitoring.live_games import LiveGames
from server.monitoring.peers import Process, View
from server.play.games import Games
from server.play.recorder import EpisodeRecord
from server.store.fences import FencedRecorder
from server.study.loader import StudyError, StudyFile
from server.study.steps import has_rounds_for_two


class ClusterNode:
    """The `Owners` of its games, and its representation in the cluster. `show` connects it to the dashboard and
    commands of this process."""

    def __init__(self, recorder: FencedRecorder, cluster: Cluster) -> None:
        self.recorder, self.cluster = recorder, cluster
        self._live: LiveGames | None = None
        self._control: Control | None = None
        self.process: Callable[[str], Process] = lambda name: Process(name, {})

    async def load(self, episode: str) -> EpisodeRecord | None:
        """Take over the episode: from now on no other process can store anything of it. Raises RecorderDown."""
        record = await self.recorder.take(episode)
        if record is not None:
            await self.cluster.taken(episode, self.recorder.fence(episode))
        return record

    async def still_mine(self, episode: str) -> bool:
        return await self.recorder.still_mine(episode)

    def let_go(self, episode: str) -> None:
        self.recorder.let_go(episode)

    def show(self, live: LiveGames, control: Control, process: Callable[[str], Process]) -> None:
        """Report this process to the others from now on. `process`: returns its status for its name."""
        self._live, self._control, self.process = live, control, process
        self.cluster.start(self)

    # Requests from the cluster

    def leases(self) -> list[str]:
        return [game.episode for game in self._games]

    async def views(self) -> list[View]:
        return [] if self._live is None else await self._live.own_views()

    async def run(self, command: Command | LetGo) -> int:
        """Run a command of another process; return how many games it reached."""
        if isinstance(command, LetGo):
            game = self._games.get(command.episode)
            if game is not None and self.recorder.fence(command.episode) < command.fence:
                self._games.let_go(game)
                return 1
            return 0
        assert self._control is not None  # noqa: S101 nobody asks before `show`
        return await self._control.run(command)

    @property
    def _games(self) -> Games:
        assert self._live is not None  # noqa: S101 nobody asks before `show`
        return self._live.games


def refuse_pairs(files: list[StudyFile]) -> None:
    """Refuse studies in which people play with people: both must reach the same process. Raises StudyError."""
    for file in files:
        if has_rounds_for_two(file.study):
            reason = f"{file.source}: two people of one round must reach the same process."
            raise StudyError([f"{reason} Serve this study with one worker, without --redis."])
