"""Run by test_episodes.py: writes ticks and says on standard output which are acknowledged, until it is killed."""

import asyncio
import sys

from server.store import episodes
from server.store.database import Database
from server.store.store_recorder import StoreRecorder
from tests.support.study_data import SPEC, played

EPISODES = 5
HORIZON = 400


async def main(url: str) -> None:
    database = Database(url)
    recorder = StoreRecorder(database, patience_s=30)
    found = await database.read(episodes.unfinished)
    for _ in range(EPISODES - len(found)):
        found.append(await database.write(episodes.create, episodes.NewEpisode(SPEC, "episode-01")))
    stored = [await database.read(episodes.load, episode) for episode in found]
    todo = [
        played(record.episode, HORIZON)[len(record.joint_actions) + bool(record.last_hash) :]
        for record in stored
        if record
    ]
    sys.stdout.write("ready\n")
    sys.stdout.flush()
    for slot in zip(*todo, strict=False):
        await recorder.ticks(slot)
        sys.stdout.write("".join(f"{record.episode} {record.timestep}\n" for record in slot))
        sys.stdout.flush()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
