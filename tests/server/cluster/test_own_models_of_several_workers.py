"""Two server processes with PostgreSQL play a study that was made in the dashboard, with a trained agent and predictor
of its own; what happens to their folders after the study was opened changes nothing.
"""

import os
import shutil
import signal
import time
from dataclasses import dataclass, field
from pathlib import Path

import httpx
import pytest
from sqlalchemy import Connection, select

from models.networks.checkpoint import load_checkpoint
from server.store import admins, kitchens, study_drafts
from server.store.database import Database
from server.store.migrate import migrate
from server.store.tables import episodes, ticks
from tests.server.cluster.test_several_workers import SeveralWorkers
from tests.server.participation.test_own_models import GRID, RING
from tests.support.draft_site import asked
from tests.support.page_site import SMALL_STUDY
from tests.support.postgres_server import PostgresServer
from tests.support.redis_server import RedisServer
from tests.support.researcher_site import HASH, Researcher

PILOT = (
    SMALL_STUDY.replace("name: small", "name: pilot")
    .replace("name: coordination_ring", "name: nook")
    .replace("  - {name: matrix, title: {en: Matrix, zh: 矩阵}}\n", "")
    .replace("after: [2]", "after: [1]")
    .replace("{name: planner, predictor: random}", "{name: mine}")
)
pytestmark = pytest.mark.postgres


@dataclass
class Address:
    """What `Researcher` needs of a server."""

    url: str
    clients: list[httpx.Client] = field(default_factory=list)


def played(connection: Connection) -> set[tuple[str | None, str | None, bool]]:
    """Agent, predictor and whether there were predictions, of the games in the drawn kitchen."""
    rows = connection.execute(select(episodes).where(episodes.c.layout == "nook", episodes.c.status == "done")).all()
    predicted = select(ticks.c.episode_id).where(ticks.c.prediction.is_not(None)).distinct()
    known = set(connection.execute(predicted).scalars())
    return {(row.agent_0_sha256 or row.agent_1_sha256, row.predictor_sha256, row.id in known) for row in rows}


def open_pilot(server: SeveralWorkers, database: Database) -> None:
    """As a researcher does in the dashboard."""
    ada = Researcher(Address(server.url))  # type: ignore[arg-type]
    ada.sign_in("ada")
    ada.get("/admin/drafts/new")
    ada.post("/admin/drafts", template="quick_look", name="pilot", title="A pilot")
    (draft,) = database.read_now(study_drafts.every)
    asked(ada, draft.id, "save", text=PILOT, revision="1")
    ada.get(f"/admin/drafts/{draft.id}")
    assert "The study is open" in ada.post(f"/admin/drafts/{draft.id}/open", revision="2").text
    ada.client.close()


def kill_each(server: SeveralWorkers) -> None:
    """Their successors serve the study when this returns."""
    for victim in server.pids():
        os.kill(victim, signal.SIGKILL)
        while len(server.pids()) < 2 or victim in server.pids():
            time.sleep(0.05)
    until, answers = time.monotonic() + 120, 0
    while answers < 20:  # each from a new connection, which either process may accept
        assert time.monotonic() < until, server.log.read_text()
        is_served = httpx.get(f"{server.url}/s/pilot", timeout=60).status_code == 200
        answers = answers + 1 if is_served else 0


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_each_process_plays_with_the_models_that_were_there_when_the_study_was_opened(
    tmp_path: Path, postgres: PostgresServer, redis: RedisServer
) -> None:
    name, place = postgres.new_database(), tmp_path / "data" / "models" / "nook"
    shutil.copytree(RING / "sp", place / "mine")
    shutil.copytree(RING / "sp_predictor_stream", place / "mine_predictor_stream")
    agent, predictor = (load_checkpoint(place / model).sha256 for model in ("mine", "mine_predictor_stream"))
    migrate(postgres.url(name))
    with Database(postgres.url(name)) as database:
        database.write_now(admins.create, "ada", HASH, "own")
        database.write_now(kitchens.save, "nook", GRID, "ada", 0)
    several = SeveralWorkers(tmp_path, postgres.url(name), redis.url)
    several.more_words += ["--data", str(tmp_path / "data")]
    with several as server, Database(several.database, read_only=True) as database:
        open_pilot(several, database)
        shutil.rmtree(place)
        shutil.copytree(RING / "fcp", place / "mine")  # trained again
        for restarted in (False, True):
            if restarted:
                kill_each(several)
            done = server.command("bots", "4", "--url", server.url, "--study", "pilot", "--seed", str(int(restarted)))
            assert done.returncode == 0, done.stdout + done.stderr
            assert database.read_now(played) == {(agent, predictor, True), (None, None, True)}
    postgres.drop_database(name)
