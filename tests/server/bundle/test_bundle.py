"""The bundle for preregistration: complete, reproducible, and refused if anything differs."""

import asyncio
import csv
import io
import json
import re
import subprocess
import sys
import time
import zipfile
from collections.abc import Iterator
from pathlib import Path

import httpx
import pytest

import kitchenmind
from server.bundle import archive, making, state
from server.bundle.archive import BundleRefused
from server.participation import progress
from server.participation.served_studies import Studies
from server.settings import ROOT
from server.store.database import Database
from server.store.migrate import migrate
from server.store.participants import complete
from server.study.loader import load_study
from tests.support import onnx_files

PUBLISHED = ROOT / "studies" / "external_predictor.yaml"
QUICK = ROOT / "studies" / "quick_look.yaml"


@pytest.fixture(scope="module")
def bundle(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("bundle") / "quick_look.zip"
    assert kitchenmind.main(["bundle", str(QUICK), "--out", str(path)]) == 0
    return path


@pytest.fixture(scope="module")
def published(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The published study in the kitchen whose agents are all bundled."""
    others = r"(?m)^  - \{name: (double_rings|double_counters|matrix|clear_division),.*\n|^breaks:.*\n"
    path = tmp_path_factory.mktemp("published") / "study.yaml"
    path.write_text(re.sub(others, "", PUBLISHED.read_text(encoding="utf-8")), encoding="utf-8")
    assert [kitchen.name for kitchen in load_study(path).study.layouts] == ["coordination_ring"]
    return path


def rewritten(bundle: Path, path: Path, change: dict[str, object]) -> Path:
    """Return the same bundle with another description of the machine."""
    texts, manifest = archive.unpacked(bundle)
    manifest["state"] = manifest["state"] | change
    path.write_bytes(archive.packed(texts, manifest))
    return path


def test_the_same_study_makes_the_same_bytes(bundle: Path) -> None:
    assert making.make(load_study(QUICK)) == bundle.read_bytes()


def test_a_bundle_is_never_written_over(bundle: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = bundle.read_bytes()
    assert kitchenmind.main(["bundle", str(QUICK), "--out", str(bundle)]) == 2
    assert "already exists" in capsys.readouterr().err
    assert bundle.read_bytes() == before


def test_a_bundle_has_all_that_is_registered(published: Path, tmp_path: Path) -> None:
    (tmp_path / "plan.md").write_text("H1: people with marks earn more.", encoding="utf-8")
    path = tmp_path / "study.zip"
    words = ["bundle", str(published), "--out", str(path), "--plan", str(tmp_path / "plan.md"), "--participants", "6"]
    assert kitchenmind.main(words) == 0
    texts, manifest = archive.unpacked(path)
    study = load_study(published).study
    assert texts["study.yaml"] == published.read_text(encoding="utf-8")
    assert texts["plan.md"] == "H1: people with marks earn more."
    assert {f"layouts/{kitchen.name}.layout" for kitchen in study.layouts} <= set(texts)
    for agent in study.agents:
        for kitchen in study.layouts:
            assert re.fullmatch(r"[0-9a-f]{64}", manifest["state"]["models"][f"{kitchen.name}/{agent.name}"])
    assert "server/main.py" in manifest["state"]["code"]
    assert "static/js/game/game.js" in manifest["state"]["code"]
    for question in study.questions(str(study.after_episode)):
        for language in study.languages:
            assert question.text.of(language) in texts["questions.md"]
    plan = json.loads(texts["analysis.json"])
    assert plan["main_comparison"] == "tom - none"
    assert {rule["rule"] for rule in plan["quality_rules"]} >= {"idle", "hidden", "unfinished"}
    rows = list(csv.DictReader(io.StringIO(texts["allocation.csv"])))
    assert len(rows) == 6 * 2
    assert {rows[n]["condition"] for n in range(0, 6, 2)} == {"tom", "random", "none"}


def test_a_bundle_registers_the_primary_test() -> None:
    study = load_study(ROOT / "tests" / "data" / "every_setting.yaml").study
    primary = making.texts.planned_analysis(study)["primary_test"]
    assert primary["comparison"] == ["worse", "bare"]
    assert (primary["measure"], primary["test"], primary["direction"]) == ("fun", "student", "greater")
    assert making.texts.planned_analysis(study)["smallest_effect"]["answers"] == 0.6
    assert making.texts.planned_analysis(load_study(PUBLISHED).study)["primary_test"] is None


def test_planned_analysis_names_the_factors_and_the_levels_of_each_condition() -> None:
    study = load_study(ROOT / "studies" / "examples" / "two_factors.yaml").study
    plan = making.texts.planned_analysis(study)
    assert plan["factors"] == {"steps": ["one", "three"], "opacity": ["off", "on"]}
    assert plan["levels_of_conditions"]["three_off"] == {"steps": "three", "opacity": "off"}
    assert "factorial" in plan["tests"][-1]
    assert making.texts.planned_analysis(load_study(PUBLISHED).study)["factors"] is None
    within = study.model_copy(update={"cells": study.cells.model_copy(update={"within": ("steps",)})})
    assert not any("equivalence" in text for text in making.texts.planned_analysis(within)["tests"])


def test_the_allocation_list_is_what_participants_get(tmp_path: Path) -> None:
    file = load_study(PUBLISHED)
    listed = {
        int(row["participant"]): (row["condition"], int(row["seed"]))
        for row in csv.DictReader(io.StringIO(making.texts.allocation(file.study, 20)))
    }
    orders: dict[int, list[tuple[str, str, int]]] = {}
    for row in csv.DictReader(io.StringIO(making.texts.allocation(file.study, 20))):
        game = (row["layout"], row["agent"], int(row["episode_seed"]))
        orders.setdefault(int(row["participant"]), []).append(game)
    url = f"sqlite:///{tmp_path}/study.db"
    migrate(url)
    with Database(url) as database:
        studies = asyncio.run(Studies.opened(database, [file]))
        for number in range(1, 21):
            arrival = progress.ConsentArrival(file.study.name, f"token {number}")
            participant = database.write_now(progress.enrol, studies, arrival)
            assert listed[number] == (participant.condition, participant.seed)
            way = [step for step in studies.steps_of(participant) if step.kind == "episode"]
            assert orders[number] == [(step.layout, step.agent, step.seed) for step in way]
            database.write_now(complete, participant.id, f"KM-{number:04d}")


def test_a_bundle_that_fits_is_opened(bundle: Path) -> None:
    assert making.open_bundle(bundle).file.text == QUICK.read_text(encoding="utf-8")


def test_other_code_kitchens_or_weights_are_refused_and_named(bundle: Path, tmp_path: Path) -> None:
    _, manifest = archive.unpacked(bundle)
    said = manifest["state"]
    model = next(iter(said["models"]))
    changes = {
        "code": said["code"] | {"server/main.py": "0" * 64},
        "layouts": said["layouts"] | {"coordination_ring": "0" * 64},
        "models": said["models"] | {model: "0" * 64},
    }
    with pytest.raises(BundleRefused) as refused:
        making.open_bundle(rewritten(bundle, tmp_path / "other.zip", changes))
    for words in ("the code differs in server/main.py", "coordination_ring is another", f"weights of {model} are"):
        assert words in str(refused.value)
    assert "Go back to kitchenmind" in str(refused.value)


def test_a_file_that_came_later_is_other_code_too() -> None:
    here = state.BundleState("1", {}, {}, {"a.py": "x", "b.py": "y"})
    assert state.differences(state.BundleState("1", {}, {}, {"a.py": "x"}), here) == [
        "the code differs in b.py (made with 1, this is 1)"
    ]
    assert state.differences(here, here) == []


def test_a_model_that_is_not_here_makes_no_bundle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "study.yaml"
    text = QUICK.read_text(encoding="utf-8")
    path.write_text(text.replace("- {name: sp_strong}", "- {name: nobody}"), encoding="utf-8")
    assert kitchenmind.main(["bundle", str(path), "--out", str(tmp_path / "x.zip")]) == 2
    assert "has no trained agent called" in capsys.readouterr().err
    assert not (tmp_path / "x.zip").exists()


def test_a_study_that_could_not_be_served_makes_no_bundle(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    onnx_files.linear_agent(tmp_path / "mine.onnx", ("games", 3, 3, 26))
    text = QUICK.read_text(encoding="utf-8")
    agents = re.compile(r"(?m)^agents:\n(?:  - .*\n)+")
    assert agents.search(text)
    study = tmp_path / "study.yaml"
    study.write_text(
        agents.sub("agents:\n  - {name: mine, model: mine.onnx, predictor: random}\n", text), encoding="utf-8"
    )
    assert kitchenmind.main(["bundle", str(study), "--out", str(tmp_path / "b.zip")]) == 2
    said = capsys.readouterr().err
    assert "agents.0.model: 'mine.onnx' cannot be used on coordination_ring" in said
    assert "(3, 3, 26)" in said or "3, 3, 26]" in said
    assert not (tmp_path / "b.zip").exists()


def test_an_agent_without_a_predictor_gets_a_list_of_possible_ones(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "study.yaml"
    text = QUICK.read_text(encoding="utf-8")
    path.write_text(text.replace("- {name: sp_strong}", "- {name: planner}"), encoding="utf-8")
    assert kitchenmind.main(["study", "check", str(path)]) == 2
    said = capsys.readouterr().err
    assert "has no trained predictor called" in said
    assert "Write `predictor: NAME` for this agent; there are: " in said


def zipped(path: Path, members: list[tuple[str, bytes]]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        for name, content in members:
            file.writestr(name, content)
    return path


def harmful(folder: Path, bundle: Path) -> Iterator[tuple[str, Path]]:
    good = bundle.read_bytes()
    outside = [("../outside.yaml", b"x"), ("/absolute.yaml", b"x"), ("a\\..\\b.yaml", b"x"), ("..", b"x")]
    for number, member in enumerate(outside):
        yield "It is not a bundle", zipped(folder / f"outside{number}.zip", [member])
    yield "too large", zipped(folder / "bomb.zip", [("bomb.yaml", b"\0" * (archive.MAX_BYTES + 1))])
    halves = [(f"half{n}.yaml", b"\0" * (archive.MAX_BYTES // 2 + 1)) for n in range(2)]
    yield "too large", zipped(folder / "bombs.zip", halves)
    many = [(f"f{n}.yaml", b"") for n in range(archive.MAX_FILES + 1)]
    yield "too many files", zipped(folder / "many.zip", many)
    with pytest.warns(UserWarning, match="Duplicate"):
        twice = zipped(folder / "twice.zip", [("study.yaml", b"a"), ("study.yaml", b"b")])
    yield "two of one name", twice
    yield "is not a bundle", zipped(folder / "empty.zip", [])
    yield "is not a bundle", zipped(folder / "list.zip", [("manifest.json", b"[]")])
    (folder / "text.zip").write_bytes(b"name: quick_look")
    yield "cannot be read", folder / "text.zip"
    (folder / "torn.zip").write_bytes(good[: len(good) // 2])
    yield "cannot be read", folder / "torn.zip"
    (folder / "huge.zip").write_bytes(b"\0" * (archive.MAX_BYTES + 1))
    yield "too large", folder / "huge.zip"


def test_harmful_archives_are_refused_and_leave_nothing_behind(bundle: Path, tmp_path: Path) -> None:
    for words, path in harmful(tmp_path, bundle):
        before = sorted(tmp_path.parent.rglob("*"))
        with pytest.raises(BundleRefused, match=words):
            making.open_bundle(path)
        assert sorted(tmp_path.parent.rglob("*")) == before, path.name


def test_a_text_that_was_changed_is_refused(bundle: Path, tmp_path: Path) -> None:
    with zipfile.ZipFile(bundle) as file:
        members = [(name, file.read(name)) for name in file.namelist()]
    for name, _ in members[:-1]:
        other = [(each, content + b" " if each == name else content) for each, content in members]
        if name != archive.MANIFEST:
            with pytest.raises(BundleRefused, match="is not as it was bundled"):
                archive.unpacked(zipped(tmp_path / "changed.zip", other))
    with pytest.raises(BundleRefused, match="is not as it was bundled"):
        archive.unpacked(zipped(tmp_path / "more.zip", [*members, ("more.md", b"x")]))


def served(folder: Path) -> tuple["subprocess.Popen[bytes]", str]:
    """Make and serve a bundle; return the server's output until it can be opened or has ended."""
    bundle, log = folder / "bundle.zip", folder / "log"
    bundle.unlink(missing_ok=True)
    assert kitchenmind.main(["bundle", str(QUICK), "--out", str(bundle)]) == 0
    words = ["serve", "--bundle", str(bundle), "--port", "0", "--database", f"sqlite:///{folder}/study.db"]
    with log.open("w") as stream:
        line = [sys.executable, str(ROOT / "kitchenmind"), *words]
        server = subprocess.Popen(line, stdout=stream, stderr=stream)
    while "http://" not in log.read_text() and server.poll() is None:
        time.sleep(0.1)
    return server, log.read_text()


def test_a_bundle_is_served_alone(bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert kitchenmind.main(["serve", "--bundle", str(bundle), "--study", str(QUICK), "--port", "0"]) == 2
    assert "leave --study out" in capsys.readouterr().err
    server, said = served(tmp_path)
    if "the code differs" in said:  # a file was saved in an editor between making and serving
        server, said = served(tmp_path)
    try:
        found = re.search(r"http://127\.0\.0\.1:\d+", said)
        assert found, said
        page = httpx.get(found.group(0), headers={"accept": "text/html"}).text
        assert set(re.findall(r'href="/s/(\w+)', page)) == {"quick_look"}
    finally:
        server.terminate()
        server.wait(30)


def test_the_command_gives_the_reason_why_a_bundle_is_not_served(
    bundle: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = rewritten(bundle, tmp_path / "other.zip", {"code": {}, "code_version": "9.9"})
    for verb in ("serve", "doctor"):
        assert kitchenmind.main([verb, "--bundle", str(other), "--port", "0"]) == 2
        said = capsys.readouterr().err
        assert "the code differs in " in said
        assert "made with 9.9" in said


def foreign_study(folder: Path, model: str) -> Path:
    """The quick look with somebody's own model."""
    path = folder / "study.yaml"
    text = QUICK.read_text(encoding="utf-8")
    agent = next(line for line in text.splitlines() if line.lstrip().startswith("- {name: sp"))
    own = f"  - {{name: own, model: '{model}', predictor: random}}"
    path.write_text(text.replace(agent, own).replace("agent: {name: sp", "agent: {name: own"), encoding="utf-8")
    return path


def test_a_bundle_runs_code_that_is_not_in_it_only_if_it_was_allowed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "somebodys_package"
    package.mkdir()
    (package / "__init__.py").write_text(f"open({str(tmp_path / 'ran')!r}, 'w').close()\n")
    (package / "agent.py").write_text((package / "__init__.py").read_text() + "class Agent: ...\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    model = "somebodys_package.agent:Agent"
    path = tmp_path / "study.zip"
    path.write_bytes(making.make(load_study(foreign_study(tmp_path, model))))
    with pytest.raises(BundleRefused, match=f"--allow-model {model}"):
        making.open_bundle(path)
    with pytest.raises(BundleRefused, match="allow-model"):
        making.open_bundle(path, ["other:Agent"])
    assert making.open_bundle(path, [model]).file.study.name == "quick_look"
    assert not (tmp_path / "ran").exists(), "to look at a bundle runs nothing of it"
    (package / "agent.py").write_text("class Agent: ...  # another one\n")
    with pytest.raises(BundleRefused, match="weights of"):
        making.open_bundle(path, [model])


def test_the_command_uses_an_address_of_a_bundle_only_if_allowed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    url, path = "http://127.0.0.1:9/act", tmp_path / "study.zip"
    path.write_bytes(making.make(load_study(foreign_study(tmp_path, url))))
    for verb in ("serve", "doctor"):
        assert kitchenmind.main([verb, "--bundle", str(path), "--port", "0"]) == 2
        assert f"--allow-model {url}" in capsys.readouterr().err


def test_weights_next_to_an_onnx_model_belong_to_the_bundle(tmp_path: Path) -> None:
    onnx_files.linear_agent(tmp_path / "a.onnx", ["games", 5, 5, 26], weights_file="a.weights")
    path = tmp_path / "study.zip"
    path.write_bytes(making.make(load_study(foreign_study(tmp_path, str(tmp_path / "a.onnx")))))
    assert making.open_bundle(path).file.study.name == "quick_look"
    changed = bytearray((tmp_path / "a.weights").read_bytes())
    changed[100] ^= 1
    (tmp_path / "a.weights").write_bytes(changed)
    with pytest.raises(BundleRefused, match=r"a\.onnx are others"):
        making.open_bundle(path)
