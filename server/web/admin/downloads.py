"""The export as a button: `kitchenmind export` itself, in a process of its own, so that games do not notice."""

import asyncio
import os
import sys
import tempfile
from collections.abc import AsyncIterator
from pathlib import Path

from fastapi import APIRouter, HTTPException, Response
from fastapi.responses import StreamingResponse

from server.settings import ROOT
from server.store import audit
from server.web.admin.rendering import study_at
from server.web.admin.researcher_auth import ActDep, AdminFormDep
from server.web.services import ServicesDep

router = APIRouter(prefix="/admin/s/{name}")
CHUNK_BYTES = 256 * 1024
LONGEST_S = 600
_one_at_a_time = asyncio.Lock()
_ZIP = "import shutil, sys; shutil.make_archive(sys.argv[1], 'zip', *sys.argv[2:4])"


@router.post("/export")
async def export(name: str, admin: ActDep, services: ServicesDep, form: AdminFormDep) -> Response:  # noqa: ARG001 - checks the form
    """All data of the study as a zip archive. It tells the conditions, so not in blind mode."""
    study_at(services.web, name)
    if admin.blind:
        raise HTTPException(409, "an export tells the conditions: turn blind mode off first")
    if _one_at_a_time.locked():
        raise HTTPException(503, "another export is being made", {"Retry-After": "30"})
    async with _one_at_a_time:  # taken before anything else is awaited
        await services.web.database.write(audit.add, admin.name, "export", {"study": name})
        folder = tempfile.TemporaryDirectory(prefix="kitchenmind-export-")
        try:
            archive = await _make(Path(folder.name), name, services.settings.database)
        except BaseException:
            folder.cleanup()
            raise
    headers = {"Content-Disposition": f'attachment; filename="{name}.zip"', "Cache-Control": "no-store"}
    return StreamingResponse(_stream(archive, folder), media_type="application/zip", headers=headers)


async def _make(folder: Path, study: str, database: str) -> Path:
    """The archive. The address of the database goes by the environment: it may hold a password."""
    words = [str(ROOT / "kitchenmind.py"), "export", "--out", str(folder / study), "--study", study]
    await _run([sys.executable, *words], {"KITCHENMIND_DATABASE": database})
    await _run([sys.executable, "-c", _ZIP, str(folder / "archive"), str(folder), study], {})
    return folder / "archive.zip"


async def _run(line: list[str], environment: dict[str, str]) -> None:
    process = await asyncio.create_subprocess_exec(
        "nice", "-n", "10", *line,
        env={**os.environ, **environment}, stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
    )  # fmt: skip
    try:
        async with asyncio.timeout(LONGEST_S):
            output, _ = await process.communicate()
    except BaseException:
        if process.returncode is None:
            process.kill()
        raise
    if process.returncode:
        raise HTTPException(500, output.decode(errors="replace")[-300:])


async def _stream(archive: Path, folder: "tempfile.TemporaryDirectory[str]") -> AsyncIterator[bytes]:
    with folder, archive.open("rb") as file:
        while chunk := await asyncio.to_thread(file.read, CHUNK_BYTES):
            yield chunk
