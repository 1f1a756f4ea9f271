"""The data name a model by the files that were loaded, and a change in the middle of a study is reported."""

import asyncio
import hashlib
import logging
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from server.participation.model_hashes import changed_models
from server.participation.study_versions import StudyVersions
from server.required_models import WEIGHTS, fingerprint
from server.settings import Settings
from server.store import episodes
from server.study.loader import StudyFile, load_study
from tests.server.participation.test_study_versions import AddedModels
from tests.support.page_site import SMALL_STUDY, PageSite
from tests.support.researcher_site import signed_in
from tests.support.researcher_site import site as admin_site
from tests.support.study_data import SPEC, new_participant

site = admin_site
RING = WEIGHTS / "coordination_ring"
NOW = "b" * 64


@pytest.fixture
def file(tmp_path: Path) -> StudyFile:
    path = tmp_path / "small.yaml"
    path.write_text(SMALL_STUDY, encoding="utf-8")
    return load_study(path)


def play(site: PageSite, sha256: str, simulated: bool = False, rounds: int = 1) -> None:
    """Store rounds of one participant with an agent of these weights."""
    study_id, _ = site.studies.open("small")
    person = site.database.write_now(new_participant, study_id, simulated=simulated)
    spec = replace(SPEC, layout="matrix", agents=(None, "sp"))
    for number in range(rounds):
        new = episodes.NewEpisode(
            *(spec, f"episode-{number}", (person, None), study_id, "tom", (None, sha256)), code_version="1.2.3"
        )
        site.database.write_now(episodes.create, new)


def found(site: PageSite, file: StudyFile, now: str | None = NOW) -> list[str]:
    return site.database.read_now(changed_models, "small", file.sha256, lambda layout, model: now)


def test_a_model_with_other_weights_than_in_earlier_rounds_is_named(site: PageSite, file: StudyFile) -> None:
    play(site, "a" * 64, rounds=2)
    (words,) = found(site, file)
    assert "`sp` on `matrix` is not the same as in 2 rounds" in words
    assert f"SHA-256 {'a' * 12}…, now {'b' * 12}…" in words
    assert "on kitchenmind 1.2.3" in words


def test_the_same_weights_bots_and_models_without_files_are_no_change(site: PageSite, file: StudyFile) -> None:
    play(site, NOW)
    play(site, "a" * 64, simulated=True)
    assert found(site, file) == []
    play(site, "c" * 64)
    assert len(found(site, file)) == 1
    assert found(site, file, now=None) == []


def test_another_version_of_the_study_may_have_other_models(site: PageSite, file: StudyFile) -> None:
    play(site, "a" * 64)
    other = replace(file, text=file.text + "\n", sha256=hashlib.sha256(f"{file.text}\n".encode()).hexdigest())
    assert found(site, other) == []


def test_the_dashboard_and_the_log_report_it(
    site: PageSite, file: StudyFile, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    play(site, "a" * 64)
    settings = Settings(database=f"sqlite:///{Path(file.source).parent}/site.db")
    versions = StudyVersions(settings, [file], AddedModels(), site.studies)  # type: ignore[arg-type]
    monkeypatch.setattr(versions, "fingerprint", lambda layout, model: NOW)
    with caplog.at_level(logging.WARNING):
        asyncio.run(versions.begin(site.database))
    assert "small: `sp` on `matrix` is not the same" in caplog.text
    site.use(replace(site.services, versions=versions))
    assert (
        "<code>sp</code> on <code>matrix</code> is not the same" in signed_in(site, "watch").get("/admin/s/small").text
    )


def test_files_that_are_replaced_while_the_server_runs_do_not_count(site: PageSite, tmp_path: Path) -> None:
    shutil.copytree(RING / "sp", tmp_path / "agents" / "mine")
    path = tmp_path / "mine.yaml"
    named = "{name: mine, model: ./agents/mine, predictor: random}"
    path.write_text(SMALL_STUDY.replace("{name: planner, predictor: random}", named, 1), encoding="utf-8")
    settings = Settings(database=f"sqlite:///{tmp_path}/site.db")
    versions = StudyVersions(settings, [load_study(path)], AddedModels(), site.studies)  # type: ignore[arg-type]
    loaded = versions.fingerprint("matrix", "./agents/mine")
    assert loaded == fingerprint("matrix", f"{tmp_path}/agents/mine") is not None
    shutil.rmtree(tmp_path / "agents" / "mine")
    shutil.copytree(RING / "fcp", tmp_path / "agents" / "mine")
    assert fingerprint("matrix", f"{tmp_path}/agents/mine") != loaded
    assert versions.fingerprint("matrix", "./agents/mine") == loaded
