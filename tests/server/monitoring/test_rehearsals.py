"""A rehearsal runs in a separate process, reports its result, and never outlives the server."""

import asyncio
import json
from contextlib import AsyncExitStack
from pathlib import Path

import pytest

from server.monitoring import rehearsals
from server.monitoring.rehearsals import Rehearsal, Rehearsals

OUTCOME = {"started": 3, "completed": 2, "dropped": 1, "by_condition": {"a": 2}, "episodes": 4, "violations": []}


def program(monkeypatch: pytest.MonkeyPatch, folder: Path, code: str) -> None:
    """What runs in the place of `kitchenmind`."""
    file = folder / "program.py"
    file.write_text(f"import json, os, sys, time\nfrom pathlib import Path\n{code}\n", encoding="utf-8")
    monkeypatch.setattr(rehearsals, "_PROGRAM", file)


def rehearsed(text: str = "name: x\n") -> tuple[Rehearsal, list[Rehearsal]]:
    """Run one to its end; what is known of it, and what was noted."""
    noted: list[Rehearsal] = []

    async def note(over: Rehearsal) -> None:
        noted.append(over)

    async def run() -> Rehearsal:
        async with AsyncExitStack() as stack:
            all_of_them = Rehearsals(stack, Path("data"))
            assert all_of_them.start(Rehearsal(7, 3, 5, "mara"), text, note)
            assert not all_of_them.start(Rehearsal(8, 1, 5, "ben"), text, note), "one at a time"
            assert all_of_them.of(8) is None
            while not noted:
                await asyncio.sleep(0.01)
            found = all_of_them.of(7)
            assert found is not None
            return found

    return asyncio.run(run()), noted


def test_the_outcome_of_the_command_is_kept_and_noted(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    said = "assert Path(sys.argv[4]).read_text() == 'name: x\\n' and sys.argv[1:4] == ['bots', '5', '--study']\n"
    said += f"assert os.environ['KITCHENMIND_DATA'] == {str(Path('data').absolute())!r}, 'its trained models'\n"
    program(monkeypatch, tmp_path, f"{said}print(json.dumps({OUTCOME!r}))")
    found, noted = rehearsed()
    assert (found.is_running, found.outcome, found.failure) == (False, OUTCOME, "")
    assert noted == [found]


def test_a_failing_command_is_reported_with_its_output(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    program(monkeypatch, tmp_path, "print('there is no agent', file=sys.stderr)\nsys.exit(2)")
    found, _ = rehearsed()
    assert (found.outcome, found.failure) == ({}, "there is no agent")
    program(monkeypatch, tmp_path, "sys.exit(3)")
    assert "status 3" in rehearsed()[0].failure


def test_a_process_that_cannot_be_started_is_a_failure_with_its_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    async def refuse(number: int, file: Path, data: Path | None) -> tuple[int | None, str, str]:
        raise OSError("no more processes")

    monkeypatch.setattr(rehearsals, "_bots", refuse)
    found, noted = rehearsed()
    assert (found.is_running, found.failure, noted) == (False, "no more processes", [found])


def test_the_command_ends_with_the_server(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    here = tmp_path / "pid"
    code = f"Path({str(here)!r}).with_suffix('.new').write_text(json.dumps(os.getpid()))\n"
    code += f"os.rename({str(here.with_suffix('.new'))!r}, {str(here)!r})\ntime.sleep(600)"
    program(monkeypatch, tmp_path, code)

    async def note(_: Rehearsal) -> None: ...

    async def run() -> int:
        async with AsyncExitStack() as stack:
            Rehearsals(stack).start(Rehearsal(1, 1, 1, "mara"), "", note)
            while not here.exists():
                await asyncio.sleep(0.01)
            return int(json.loads(here.read_text()))

    pid = asyncio.run(run())
    status = Path(f"/proc/{pid}/status")
    assert not status.exists() or "State:\tZ" in status.read_text()
