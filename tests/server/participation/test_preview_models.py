"""Which models a preview has loaded, and when those of a kitchen that a draft draws end."""

import asyncio
from collections.abc import Mapping, Sequence
from typing import Any, cast

import pytest

from models.inference.runner import ModelServer
from models.inference.supervised_worker import ModelsDown
from server.participation.preview_models import PreviewModels
from server.study.loader import StudyError, StudyFile, parse_study
from tests.support.small_site import SMALL_STUDY

Name = tuple[str, str]


class LoadedModels:
    """Stands for the model server: knows what it was told to load and to drop."""

    def __init__(self) -> None:
        self.grids: dict[str, str] = {}
        self.names: set[Name] = set()
        self.down = False

    def has(self, agents: Sequence[Name], predictors: Sequence[Name]) -> bool:
        return self.names.issuperset([*agents, *predictors])

    async def add(self, agents: Sequence[Name], predictors: Sequence[Name], grids: Mapping[str, str], _: Any) -> None:
        if self.down:
            raise ModelsDown("no worker starts")
        self.names |= {*agents, *predictors}
        self.grids |= grids

    async def drop(self, layout: str) -> None:
        self.names = {name for name in self.names if name[0] != layout}
        del self.grids[layout]


@pytest.fixture
def loaded() -> LoadedModels:
    return LoadedModels()


def drawn(*rows: str) -> StudyFile:
    """A study whose kitchen is called as a bundled one and has a grid of its own."""
    grid = "\\n".join(rows)
    kitchen = "{name: coordination_ring,"
    return parse_study(SMALL_STUDY.replace(kitchen, f'{kitchen} grid: "{grid}",'), "draft")


ONE = drawn("XXPXX", "O  2O", "X1  X", "XDXSX")
TWO = drawn("XXPXX", "O  2X", "X1  O", "XDXSX")


def previews(loaded: LoadedModels, idle_s: float = 100.0) -> PreviewModels:
    return PreviewModels(cast(ModelServer, loaded), idle_s)


async def test_a_drawn_kitchen_never_shares_its_models_with_one_of_the_same_name(loaded: LoadedModels) -> None:
    models = previews(loaded)
    bundled = parse_study(SMALL_STUDY, "draft")
    served = {("coordination_ring", name) for name in ("planner", "stay", "random")}
    loaded.names |= served
    assert await models.load(bundled, bundled.study.layouts[0]) == "coordination_ring"
    assert loaded.names == served, "the models of a study that is served are used"
    layout = await models.load(ONE, ONE.study.layouts[0])
    assert layout.startswith("coordination_ring#")
    assert loaded.grids == {layout: ONE.study.layouts[0].grid}
    assert {name for name, _ in loaded.names} == {"coordination_ring", layout}


async def test_a_kitchen_that_was_drawn_again_replaces_the_one_that_nobody_plays_in(loaded: LoadedModels) -> None:
    models = previews(loaded)
    first = await models.load(ONE, ONE.study.layouts[0])
    async with models.playing(ONE, ONE.study.layouts[0]) as playing:
        second = await models.load(TWO, TWO.study.layouts[0])
        assert (playing, set(loaded.grids)) == (first, {first, second})
    third = await models.load(TWO, TWO.study.layouts[0])
    assert (third, set(loaded.grids)) == (second, {second})


BUNDLED = parse_study(SMALL_STUDY, "draft")


@pytest.mark.parametrize("file", [ONE, BUNDLED], ids=["drawn", "bundled, of no study"])
async def test_models_end_when_nobody_plays_for_a_while(loaded: LoadedModels, file: StudyFile) -> None:
    models = previews(loaded, idle_s=0.0)
    async with models.playing(file, file.study.layouts[0]) as layout:
        await asyncio.sleep(0.01)
        assert set(loaded.grids) == {layout}
    for _ in range(100):
        await asyncio.sleep(0.01)
        if not loaded.grids:
            break
    assert (loaded.grids, loaded.names) == ({}, set())


async def test_models_that_do_not_load_are_an_error_of_the_draft(loaded: LoadedModels) -> None:
    loaded.down = True
    with pytest.raises(StudyError, match="draft: no worker starts"):
        await previews(loaded).load(ONE, ONE.study.layouts[0])
