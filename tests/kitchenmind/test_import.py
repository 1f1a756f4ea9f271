"""`import kitchenmind` is quick, and an unknown name lists the known ones."""

import subprocess
import sys
from pathlib import Path

import pytest

import kitchenmind
from overcooked.layout import load_layout

ROOT = Path(__file__).parents[2]
HEAVY = ("numpy", "numba", "polars", "torch", "fastapi", "sqlalchemy", "httpx", "onnxruntime")


def loaded_by(program: str) -> set[str]:
    words = [sys.executable, "-c", f"import sys\n{program}\nprint(*sys.modules)"]
    done = subprocess.run(words, capture_output=True, text=True, cwd=ROOT, check=True)
    return set(done.stdout.split())


def test_importing_it_imports_nothing_heavy() -> None:
    assert loaded_by("import kitchenmind; dir(kitchenmind)") & set(HEAVY) == set()


def test_neither_loading_nor_simulating_needs_torch_or_the_server() -> None:
    program = "import kitchenmind; kitchenmind.load; kitchenmind.simulate('coordination_ring', 'stay', horizon=2)"
    assert loaded_by(program) & {"torch", "fastapi", "sqlalchemy", "pettingzoo"} == set()


NEVER = {"torch", "scipy.linalg", "polars", "onnxruntime", "matplotlib", "alembic"}
UNUSED = {
    "from overcooked.layout import load_layout; load_layout('matrix').static_views": {"numba", "pydantic"},
    "import overcooked.state": {"pydantic", "sqlalchemy", "fastapi", "asyncio"},
    "sys.argv += ['0']; import models.inference.worker": {"pydantic", "sqlalchemy", "fastapi", "asyncio"},
    "import server.store.migrate, server.web.passwords": {"numba", "fastapi", "httpx"},  # kitchenmind admin
    "import server.main": {"httpx", "websockets", "redis", "psycopg"},
}


@pytest.mark.parametrize("program", UNUSED)
def test_a_process_starts_without_what_it_does_not_use(program: str) -> None:
    assert loaded_by(program) & (UNUSED[program] | NEVER) == set()


@pytest.mark.parametrize("words", [["-m", "kitchenmind"], [str(ROOT / "kitchenmind")]])
def test_the_package_is_the_command_line_from_any_folder(words: list[str], tmp_path: Path) -> None:
    (tmp_path / "client.py").write_text("raise SystemExit('a file of the current folder was imported')")
    environment = {"PYTHONPATH": str(ROOT)} if words[0] == "-m" else {}
    done = subprocess.run(
        [sys.executable, *words, "--help"], cwd=tmp_path, env=environment, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("usage: kitchenmind ")


def test_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(AttributeError, match=r"no attribute 'lode'. It has: load, simulate, kitchen"):
        getattr(kitchenmind, "lode")  # noqa: B009


@pytest.mark.parametrize("layout", ["coordination_ring", load_layout("coordination_ring")])
def test_a_kitchen_is_the_pettingzoo_environment(layout: object) -> None:
    env = kitchenmind.kitchen(layout, horizon=3)  # type: ignore[arg-type]
    observations, _ = env.reset(seed=0)
    assert set(observations) == {"chef_0", "chef_1"}
    for _ in range(3):
        *_, truncated, _ = env.step({agent: env.action_space(agent).sample() for agent in env.agents})
    assert truncated == {"chef_0": True, "chef_1": True}


def test_a_kitchen_without_pettingzoo_names_the_remedy(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "overcooked.pettingzoo_env", raising=False)
    monkeypatch.setitem(sys.modules, "pettingzoo", None)
    with pytest.raises(ModuleNotFoundError, match="needs pettingzoo: pip install gymnasium pettingzoo"):
        kitchenmind.kitchen("coordination_ring")


def test_a_kitchen_of_no_timesteps_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 1 timestep"):
        kitchenmind.kitchen("coordination_ring", horizon=0)
