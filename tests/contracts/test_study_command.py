"""`kitchenmind study`: check, new and schema."""

import json
import re
import shutil
from pathlib import Path

import pytest

import kitchenmind
from models.agents.model_paths import WEIGHTS
from server.study.definition import Study
from server.study.loader import load_study
from server.study.steps import episodes_of

STUDIES = Path(__file__).parents[2] / "studies"
BUNDLED = sorted(STUDIES.glob("**/*.yaml"))


@pytest.fixture(params=BUNDLED, ids=lambda path: path.stem)
def path(request: pytest.FixtureRequest) -> Path:
    found: Path = request.param
    return found


def test_check_shows_how_factors_are_crossed(capsys: pytest.CaptureFixture[str]) -> None:
    assert kitchenmind.main(["study", "check", str(STUDIES / "examples" / "two_factors.yaml")]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "  factors      steps: one, three; opacity: off, on" in lines
    assert "  conditions   one_off x1, one_on x1, three_off x1, three_on x1" in lines


def run(*words: str, capsys: pytest.CaptureFixture[str]) -> tuple[int, str, str]:
    code = kitchenmind.main(["study", *words])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_check_summarises_a_valid_study(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, out, err = run("check", str(path), capsys=capsys)
    assert (code, err) == (0, "")
    assert f"{path} is a study: {path.stem}" in out


@pytest.mark.parametrize(
    ("agent", "place", "reason"),
    [
        (
            "{name: nobody, predictor: random}",
            "agents.0.name",
            "coordination_ring has no trained agent called 'nobody'",
        ),
        ("{name: nobody}", "agents.0.name", "It has no predictor either"),
        ("{name: planner}", "agents.0", "no trained predictor called 'planner_predictor_stream'"),
        ("{name: sp, predictor: bc_predictor}", "agents.0.predictor", "called 'bc_predictor'. Did you mean"),
        ("{name: sp, predictor: sp}", "agents.0.predictor", "'sp' cannot be used on coordination_ring"),
        ("{name: sp, predictor: planner}", "agents.0.predictor", "'planner' cannot be used on coordination_ring"),
        ("{name: sp_predictor_stream, predictor: random}", "agents.0.name", "cannot be used on coordination_ring"),
        ("{name: mine, model: mine.onnx, predictor: random}", "agents.0.model", "there is no file"),
        ("{name: sp, predictor: ./mine.onnx}", "agents.0.predictor", "there is no file"),
        ("{name: mine, model: broken.onnx, predictor: random}", "agents.0.model", "is not an ONNX model"),
        ("{name: sp, predictor: ./folder}", "agents.0.predictor", "there is no checkpoint in"),
        ("{name: sp, predictor: 'own:Missing'}", "agents.0.predictor", "has no class Missing"),
        ("{name: sp, predictor: 'unfinished:Other'}", "agents.0.predictor", "unfinished.py:2 is not valid Python"),
        (
            "{name: mine, model: 'nowhere_at_all:Agent', predictor: random}",
            "agents.0.model",
            "there is no Python module",
        ),
        ("{name: sp, predictor: 'http://127.0.0.1:9/x'}", "agents.0.predictor", "cannot be used over HTTP"),
        ("{name: sp, predictor: sp_predictor_stream@60}", "agents.0.predictor", "asks for a variant of a predictor"),
        ("{name: sp, predictor: sp_predictor_stream@greedy}", "agents.0.predictor", "asks for a variant"),
        ("{name: mine, model: sp@60, predictor: random}", "agents.0.model", "'sp@60' cannot be used"),
    ],
)
def test_check_refuses_agents_and_predictors_that_cannot_play(
    agent: str, place: str, reason: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "quick_look.yaml"
    (tmp_path / "broken.onnx").write_bytes(b"not ONNX")
    (tmp_path / "unfinished.py").write_text("class Other:\n    x = (\n", encoding="utf-8")
    (tmp_path / "own.py").write_text("class Other:\n    pass\n", encoding="utf-8")
    text = (STUDIES / "quick_look.yaml").read_text("utf-8")
    file.write_text(text.replace("- {name: sp_strong}", f"- {agent}"), encoding="utf-8")
    code, _, err = run("check", str(file), capsys=capsys)
    line = text[: text.index("- {name: sp_strong}")].count("\n") + 1
    assert code == 2
    assert any(f"{file}:{line}: {place}: " in said and reason in said for said in err.splitlines())


def test_models_are_found_from_the_folder_of_the_study_whatever_the_current_one(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = tmp_path / "lab"
    shutil.copytree(WEIGHTS / "coordination_ring" / "sp", folder / "agents" / "mine")
    shutil.copytree(WEIGHTS / "coordination_ring" / "sp_predictor_stream", folder / "p")
    shutil.copy(STUDIES.parent / "docs" / "examples" / "own_predictor.py", folder / "lab_predictor.py")
    text = (STUDIES / "quick_look.yaml").read_text("utf-8")
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    for predictor in ("./p", "p", "'lab_predictor:LastAction'"):
        agent = f"- {{name: mine, model: agents/mine, predictor: {predictor}}}"
        (folder / "lab.yaml").write_text(text.replace("- {name: sp_strong}", agent), encoding="utf-8")
        code, out, err = run("check", str(folder / "lab.yaml"), capsys=capsys)
        assert (code, err) == (0, ""), predictor
        assert "warning" not in out


@pytest.mark.parametrize(
    ("agent", "question"),
    [
        (
            "{name: sp, predictor: random}",
            "condition `tom` shows predictions of sp in coordination_ring, and `random` guesses at random. "
            "Is that intended? If not, leave `predictor` empty: sp_predictor_stream is there.",
        ),
        (
            "{name: planner, predictor: random}",
            "condition `tom` shows predictions of planner in coordination_ring, and `random` guesses at random. "
            "Is that intended? If not, train one: `kitchenmind collect --layout coordination_ring --agent planner`, "
            "then `kitchenmind train predictor --layout coordination_ring --agent "
            "planner --out var/models/coordination_ring/planner_predictor_stream`.",
        ),
        ("{name: sp, predictor: guide}", "`guide` knows the scripted guide only"),
        ("{name: sp, predictor: fcp_predictor_stream}", "trained to predict another agent than sp"),
    ],
)
def test_check_asks_whether_predictions_about_nothing_are_intended(
    agent: str, question: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "quick_look.yaml"
    text = (STUDIES / "quick_look.yaml").read_text("utf-8")
    file.write_text(text.replace("- {name: sp_strong}", f"- {agent}"), encoding="utf-8")
    code, out, _ = run("check", str(file), capsys=capsys)
    assert code == 0
    assert re.search(rf"^warning: .*{re.escape(question)}", out, re.MULTILINE)
    assert "Is that intended?" in out


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("seed: 7", "sed: 7", "unknown key 'sed'. Did you mean 'seed'?"),
        ("{name: coordination_ring, title", "{name: coordination_rng, title", "there is no layout 'coordination_rng'"),
        (
            "{name: coordination_ring, title: {en: Coordination Ring, zh: 协作环}}",
            '{name: own, title: Own, grid: "XXPXX\\nO1 2 \\nXDXSX"}',
            "row 2, column 5: the border is open here",
        ),
        (
            "{name: coordination_ring, title: {en: Coordination Ring, zh: 协作环}}",
            '{name: coordination_ring, title: Own, grid: "XXPXX\\nO1 2O\\nXDXSX"}',
            "'sp_strong' was trained on another grid",
        ),
    ],
)
def test_check_refuses_with_line_reason_and_exit_code_2(
    old: str, new: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "wrong.yaml"
    text = (STUDIES / "quick_look.yaml").read_text("utf-8")
    file.write_text(text.replace(old, new, 1), encoding="utf-8")
    code, _, err = run("check", str(file), capsys=capsys)
    line = text[: text.index(old)].count("\n") + 1
    assert code == 2
    assert f"{file}:{line}: " in err
    assert message in err


def test_check_of_a_file_that_is_not_there_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    code, _, err = run("check", str(tmp_path / "none.yaml"), capsys=capsys)
    assert (code, "none.yaml: No such file" in err) == (2, True)


def test_editors_find_the_schema_of_a_study_where_its_first_line_says(
    path: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    new = tmp_path / "deep" / "pilot.yaml"
    run("new", "pilot", "--out", str(new), capsys=capsys)
    for file in (path, new):
        first = file.read_text("utf-8").splitlines()[0]
        assert first.startswith("# yaml-language-server: $schema=")
        assert (file.parent / first.partition("=")[2]).resolve() == (STUDIES / "schema.json").resolve()


def test_check_shows_how_often_each_layout_and_agent_comes_when(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    _, out, _ = run("check", str(path), capsys=capsys)
    study = load_study(path).study
    words = [line.split() for line in out.splitlines() if line.startswith("    ")]
    rows = {name: [int(cell) for cell in cells] for name, *cells in words}
    episodes = episodes_of(study)
    for part in (study.layouts, study.agents):
        table = [rows[one.name] for one in part]
        assert [sum(column) for column in zip(*table, strict=True)] == [60] * episodes


def test_check_shows_the_primary_test(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = (STUDIES / "external_predictor.yaml").read_text("utf-8")
    file = tmp_path / "study.yaml"
    file.write_text(text, encoding="utf-8")
    assert "no primary test is declared" in run("check", str(file), capsys=capsys)[1]
    file.write_text(f"{text}\nprimary: {{comparison: [tom, none], direction: greater, looks: [30, 60]}}\n", "utf-8")
    code, out, _ = run("check", str(file), capsys=capsys)
    assert code == 0
    assert "welch of reward, tom - none, greater, alpha 0.05, looks at 30, 60 people (obrien_fleming)" in out
    file.write_text(f"{text}\nprimary: {{comparison: [tom, nobody]}}\n", "utf-8")
    code, _, err = run("check", str(file), capsys=capsys)
    line = text.count("\n") + 2
    assert code == 2
    assert f"{file}:{line}: primary.comparison.1: there is no condition 'nobody'. Known: none, random, tom." in err


def test_new_study_passes_its_check_and_is_never_overwritten(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "pilot.yaml"
    assert run("new", "pilot", "--out", str(file), capsys=capsys)[0] == 0
    assert load_study(file).study.name == "pilot"
    assert run("check", str(file), capsys=capsys)[0] == 0
    before = file.read_bytes()
    code, _, err = run("new", "pilot", "--out", str(file), capsys=capsys)
    assert (code, "already exists" in err) == (2, True)
    assert file.read_bytes() == before
    assert run("new", "Not A Name", capsys=capsys)[0] == 2


def test_schema_describes_every_key_of_a_study(capsys: pytest.CaptureFixture[str]) -> None:
    code, out, _ = run("schema", capsys=capsys)
    schema = json.loads(out)
    assert code == 0
    kept = STUDIES / "schema.json"
    assert out == kept.read_text("utf-8"), f"run `kitchenmind study schema > {kept}`"
    assert set(schema["properties"]) == set(Study.model_fields)
    assert schema["properties"]["seed"]["description"] == "The seed of everything random in the study."
    assert (
        schema["$defs"]["ChoiceQuestion"]["properties"]["key"]["description"] == "The name of the answer in the data."
    )
    assert schema["additionalProperties"] is False
    assert "null" not in schema["$defs"]["Text"]
