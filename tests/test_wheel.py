"""The wheel is the whole product: installed in a fresh environment, it serves from an empty folder."""

import json
import re
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

ROOT = Path(__file__).resolve().parent.parent
DATA = ("static", "templates", "migrations", "studies", "overcooked/layouts")
_NOT_SOURCE = shutil.ignore_patterns(
    ".venv", ".git", ".*_cache", "node_modules", "build", "runs", "var", "screenshots", "__pycache__", "*.egg-info"
)


@pytest.fixture(scope="module")
def wheel(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Built from a copy, as building writes into the source folder."""
    folder = tmp_path_factory.mktemp("wheel")
    shutil.copytree(ROOT, folder / "source", ignore=_NOT_SOURCE)
    words = ["wheel", str(folder / "source"), "--no-deps", "--no-build-isolation", "-w", str(folder), "--quiet"]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True)
    return next(folder.glob("kitchenmind-*.whl"))


@pytest.fixture(scope="module")
def installed(wheel: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The command in a fresh environment that has the wheel; dependencies are those of the tests, not ourselves."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder)  # our own pip installs into it: putting another one there takes longer than all else
    words = ["--python", folder / "bin" / "python", "install", "--quiet", "--no-deps", wheel]
    subprocess.run([sys.executable, "-m", "pip", *words], check=True)
    packages = Path(sysconfig.get_path("purelib", vars={"base": str(folder)}))
    (packages / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return folder / "bin" / "kitchenmind"


@pytest.fixture
def server(installed: Path, tmp_path: Path) -> Iterator[str]:
    """The address of `kitchenmind serve`, started in an empty folder."""
    process = subprocess.Popen(
        [installed, "serve", "--port", "0"], cwd=tmp_path, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    assert process.stdout is not None
    try:
        said = ""
        while not (found := re.search(r"http://\S+:\d+", said)):
            line = process.stdout.readline()
            assert line, said
            said += line
        assert str(tmp_path / "kitchenmind-data") in said
        yield found.group(0)
    finally:
        process.terminate()
        process.communicate(timeout=60)


def test_the_wheel_has_every_page_script_sprite_migration_study_and_layout(wheel: Path) -> None:
    packed = set(zipfile.ZipFile(wheel).namelist())
    files = [path for part in DATA for path in (ROOT / part).rglob("*") if path.is_file()]
    missing = [path for path in files if path.relative_to(ROOT).as_posix() not in packed]
    assert [path for path in missing if "__pycache__" not in path.parts] == []


@pytest.mark.slow
def test_the_wheel_has_the_weights_that_the_bundled_studies_ask(installed: Path, tmp_path: Path) -> None:
    done = subprocess.run(
        [installed, "doctor", "--port", "0"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert "byte for byte as they were saved" in done.stdout


def test_installed_it_serves_from_an_empty_folder_and_keeps_its_data_there(server: str, tmp_path: Path) -> None:
    with httpx.Client(base_url=server, follow_redirects=True) as client:
        start = client.get("/")
        assert start.status_code == 200
        for address in {*re.findall(r'(?:src|href)="(/static/[^"]+)"', start.text), "/s/quick_look", "/watch"}:
            assert client.get(address).status_code == 200, address
        assert client.get("/health/ready").status_code == 200
    kept = {path.name for path in (tmp_path / "kitchenmind-data").iterdir()}
    assert {"kitchenmind.sqlite3", "secret"} <= kept
    assert [path.name for path in tmp_path.iterdir()] == ["kitchenmind-data"]


def test_installed_it_checks_a_study_against_its_schema(installed: Path, tmp_path: Path) -> None:
    done = subprocess.run([installed, "study", "schema"], cwd=tmp_path, capture_output=True, text=True, check=True)
    assert json.loads(done.stdout) == json.loads((ROOT / "studies" / "schema.json").read_text())


def test_installed_it_is_a_library_too(installed: Path, tmp_path: Path) -> None:
    program = "import kitchenmind; print(kitchenmind.simulate('coordination_ring', 'planner', horizon=200)['score'][0])"
    words = [installed.parent / "python", "-c", program]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=True)
    assert int(done.stdout) > 0
