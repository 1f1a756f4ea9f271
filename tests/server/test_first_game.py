"""Nothing is compiled once pages can be opened, as that would delay the first game on a fresh machine."""

import sys
from pathlib import Path
from typing import Any

import fastapi.routing
import httpx
import numba
import pytest
from numba.core.dispatcher import Dispatcher

from overcooked.layout import layout_names, load_layout, parse_layout
from overcooked.state import Kitchens
from server.bots.participant import Bot
from tests.support.live_server import LiveServer
from tests.support.real_server import RealServer

ONE_POT = "XXPXX\nO1 2O\nXDSXX"
THREE_POTS = "XPPPX\nO1 2O\nXDSXX"


def compiled(folder: Path) -> list[str]:
    return sorted(path.relative_to(folder).as_posix() for path in folder.rglob("*.nb[ic]"))


def signatures() -> dict[str, set[str]]:
    """For which types each kernel that is loaded has been compiled, or read from the cache."""
    loaded = [module for name, module in list(sys.modules.items()) if name.startswith(("overcooked.", "models."))]
    kernels = {id(one): one for module in loaded for one in vars(module).values() if isinstance(one, Dispatcher)}
    return {one.py_func.__qualname__: set(map(str, one.signatures)) for one in kernels.values()}


async def test_a_game_compiles_nothing_that_the_start_has_not(tmp_path: Path) -> None:
    Kitchens.start(load_layout("coordination_ring")).encode()  # as the bot does, in this process
    with LiveServer(tmp_path) as live:
        before = signatures()
        assert before["step"]
        journal = await Bot(live.url, "short", 1).take_part()  # a tutorial in a kitchen with one pot, and episodes
        assert len(journal.ended) >= 2
        assert signatures() == before


async def test_the_first_request_finds_its_routes_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    made: list[str] = []
    original = fastapi.routing._populate_api_route_state

    def counted(route: Any, path: str, *arguments: Any, **named: Any) -> None:
        made.append(path)
        original(route, path, *arguments, **named)

    with LiveServer(tmp_path) as live:
        monkeypatch.setattr(fastapi.routing, "_populate_api_route_state", counted)
        async with httpx.AsyncClient(base_url=live.url) as client:
            for path in ("/", "/s/short", "/admin/login", "/health/live"):
                assert (await client.get(path)).status_code == 200
    assert made == []


@pytest.mark.slow  # half a minute of compiling
async def test_the_first_game_with_an_empty_compiler_cache_compiles_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cache = tmp_path / "numba"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(cache))
    with RealServer(tmp_path) as server:
        before = compiled(cache)
        assert any("rules.step" in name for name in before)
        journal = await Bot(server.url, "short", 1).take_part()  # a tutorial in a kitchen with one pot, and episodes
        assert len(journal.ended) >= 2
        assert compiled(cache) == before


def test_kernels_see_every_kitchen_as_the_same_types() -> None:
    layouts = [load_layout(name) for name in layout_names()] + [parse_layout(text) for text in (ONE_POT, THREE_POTS)]
    assert {len(layout.pots) for layout in layouts} == {1, 2, 3}
    for name in ("tiles", "pots", "counters", "starts", "static_planes", "static_views"):
        assert len({str(numba.typeof(getattr(layout, name))) for layout in layouts}) == 1, name


def test_every_template_is_compiled_before_the_first_page(tmp_path: Path) -> None:
    with LiveServer(tmp_path) as live:
        environment = live.app.state.services.web.templates
        assert environment.cache is not None
        assert {name for _, name in environment.cache} == set(environment.list_templates())
