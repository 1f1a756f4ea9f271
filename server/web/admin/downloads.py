"""The export as a button: `kitchenmind export` itself, in a separate process, so that games do not notice."""

import asyncio
import subprocess
from collections.abc import AsyncIterator
from functools import partial
from pathlib import Path

from fastapi import APIRouter, HTTPException, Response
from fastapi.responses import StreamingResponse

from server.monitoring.low_priority import start_module
from server.monitoring.temporary_folders import TemporaryFolder
from server.store import audit
from server.web.admin.rendering import study_at
from server.web.admin.researcher_auth import ActDep, AdminFormDep
from server.web.services import ServicesDep

router = APIRouter(prefix="/admin/s/{name}")
CHUNK_BYTES = 256 * 1024
TIMEOUT_S = 600
_BUSY = "Another export is being made. Go back, and try again in a minute."
_SLOW = "The export took too long: games come first. Run `kitchenmind export` on the server, or try again later."
_one_at_a_time = asyncio.Lock()


@router.post("/export")
async def export(name: str, admin: ActDep, services: ServicesDep, form: AdminFormDep) -> Response:  # noqa: ARG001 - checks the form
    """Send all data of the study as a zip archive. It shows the conditions, so this is refused in blind mode."""
    study_at(services.web, name)
    if admin.blind:
        raise HTTPException(409, "An export shows the conditions. Turn blind mode off first.")
    if _one_at_a_time.locked():
        raise HTTPException(503, _BUSY, {"Retry-After": "30"})
    async with _one_at_a_time:  # taken before anything else is awaited
        await services.web.database.write(audit.add, admin.name, "export", {"study": name})
        folder = TemporaryFolder("export")
        try:
            archive = await _make(folder.path, name, services.settings.database)
        except BaseException:
            folder.remove()
            raise
    headers = {"Content-Disposition": f'attachment; filename="{name}.zip"', "Cache-Control": "no-store"}
    return StreamingResponse(_stream(archive, folder), media_type="application/zip", headers=headers)


async def _make(folder: Path, study: str, database: str) -> Path:
    """Return the archive."""
    words = ("server.commands.export_archive", str(folder), study)
    start = partial(start_module, *words, database=database, output=subprocess.PIPE, errors=subprocess.STDOUT)
    process = await asyncio.to_thread(start)
    try:
        output, _ = await asyncio.to_thread(process.communicate, timeout=TIMEOUT_S)
    except subprocess.TimeoutExpired:
        raise HTTPException(503, _SLOW, {"Retry-After": "600"}) from None
    finally:
        if process.poll() is None:
            process.kill()
            await asyncio.to_thread(process.communicate)
    if process.returncode:
        raise HTTPException(500, output.decode(errors="replace")[-300:])
    return folder / "archive.zip"


async def _stream(archive: Path, folder: TemporaryFolder) -> AsyncIterator[bytes]:
    with folder, archive.open("rb") as file:
        while chunk := await asyncio.to_thread(file.read, CHUNK_BYTES):
            yield chunk
