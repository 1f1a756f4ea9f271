"""Run a researcher's command in the process that plays the game, or in all processes of this server."""

from server.monitoring.commands import AnyGameCommand, BroadcastCommand, EndGame
from server.monitoring.control import Control
from server.monitoring.peers import Peers, SingleProcess


class ClusterControl:
    """`Control` of all processes; made once in server.main."""

    def __init__(self, control: Control, peers: Peers | None = None) -> None:
        self._control, self._peers = control, peers or SingleProcess()

    async def run(self, command: AnyGameCommand) -> bool:
        """Run a command for one game. False: the game does not run, or nobody is there to read the message. A game
        that does not run can be ended, too."""
        if await self._control.run(command) or await self._peers.run_at_owner(command):
            return True
        return isinstance(command, EndGame) and await self._control.end_stored(command.episode)

    async def run_in_each(self, command: BroadcastCommand, within_s: float) -> bool:
        """Run a command in every other process; return whether it succeeded in each of them in time."""
        return await self._peers.run_in_each(command, within_s)

    async def broadcast(self, command: BroadcastCommand) -> int:
        """Run a command in every process; return how many games it reached."""
        here = await self._control.run(command)
        return here + sum(await self._peers.run_at_all(command))
