"""Scripts, styles and templates of the pages: imports between folders of scripts, names, and line lengths."""

import hashlib
import json
import re
from pathlib import Path

ROOT = Path(__file__).parent.parent
SCRIPTS = ROOT / "static" / "js"
MAX_LINE = 120


def scripts() -> list[Path]:
    return sorted(SCRIPTS.rglob("*.js"))


def allowed_imports() -> dict[str, set[str]]:
    """Folder -> folders, as docs/explanation/architecture.md says it."""
    page = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| `static/js/(\w+)` \|[^|]*\|([^|]*)\|$", page, re.MULTILINE)
    return {folder: set(re.findall(r"`(\w+)`", names)) for folder, names in rows}


def test_folders_of_scripts_import_only_what_the_architecture_allows() -> None:
    allowed = allowed_imports()
    assert set(allowed) == {script.parent.name for script in scripts()}
    faults = []
    for script in scripts():
        for name in re.findall(r"(?:from |import\()'([^']+)'", script.read_text(encoding="utf-8")):
            target = (script.parent / name).resolve() if name.startswith(".") else ROOT / name.lstrip("/")
            assert target.is_file(), f"{script.name} imports {name}, which does not exist"
            if target.is_relative_to(SCRIPTS) and target.parent.name not in allowed[script.parent.name] | {
                script.parent.name
            }:
                faults.append(f"{script.relative_to(ROOT)} imports {name}")
    assert faults == []


def test_scripts_have_names_of_their_own() -> None:
    names = [script.name for script in scripts()]
    assert len(names) == len(set(names))


def test_every_script_and_style_that_a_template_names_exists_and_every_script_is_used() -> None:
    named = {
        name
        for template in (ROOT / "templates").rglob("*.html")
        for name in re.findall(r"(?:src|href)=\"{{ root }}(/static/[\w./-]+)\"", template.read_text(encoding="utf-8"))
    }
    assert [name for name in sorted(named) if not (ROOT / name.lstrip("/")).is_file()] == []
    imported = {
        (script.parent / name).resolve()
        for script in scripts()
        for name in re.findall(r"(?:from |import\()'(\.[^']+)'", script.read_text(encoding="utf-8"))
    }
    used = imported | {ROOT / name.lstrip("/") for name in named}
    assert [script.name for script in scripts() if script not in used] == []


def test_lines_of_scripts_styles_and_templates_are_short() -> None:
    files = [file for folder in ("js", "css") for file in (ROOT / "static" / folder).rglob("*.*")]
    files += list((ROOT / "templates").rglob("*.*"))
    long = [
        f"{file.relative_to(ROOT)}:{number}"
        for file in files
        for number, line in enumerate(file.read_text(encoding="utf-8").splitlines(), start=1)
        if len(line) > MAX_LINE
    ]
    assert long == []


def test_the_types_of_uplot_are_those_of_its_vendored_version() -> None:
    note = (ROOT / "static" / "vendor" / "uplot" / "README.md").read_text(encoding="utf-8")
    pinned = json.loads((ROOT / "package.json").read_text(encoding="utf-8"))["devDependencies"]["uplot"]
    assert note.startswith(f"uPlot {pinned} ")


def test_the_library_for_videos_is_the_pinned_one_with_its_licence() -> None:
    folder = ROOT / "static" / "vendor" / "mediabunny"
    note = (folder / "README.md").read_text(encoding="utf-8")
    pinned = json.loads((ROOT / "package.json").read_text(encoding="utf-8"))["devDependencies"]["mediabunny"]
    assert note.startswith(f"Mediabunny {pinned} ")
    assert f"/v/{pinned} " in note, "MPL-2.0: the note says where the source code is"
    digest = hashlib.sha256((folder / "mediabunny.min.mjs").read_bytes()).hexdigest()
    assert f"SHA-256 of `mediabunny.min.mjs`: `{digest}`" in note
    assert "Mozilla Public License Version 2.0" in (folder / "LICENSE").read_text(encoding="utf-8")


def test_the_library_for_videos_is_loaded_only_when_a_video_is_made() -> None:
    def mentions(path: Path) -> list[str]:
        return [line.strip() for line in path.read_text(encoding="utf-8").splitlines() if "mediabunny" in line]

    sources = [*scripts(), *(ROOT / "templates").rglob("*.html")]
    found = {file.name: [line for line in mentions(file) if "typedef" not in line] for file in sources}
    assert {name: lines for name, lines in found.items() if lines} == {
        "video-file.js": ["const library = await import('../../vendor/mediabunny/mediabunny.min.mjs');"]
    }


def test_node_is_needed_for_nothing_but_development() -> None:
    package = json.loads((ROOT / "package.json").read_text(encoding="utf-8"))
    assert "dependencies" not in package
    pins = package["devDependencies"].values()
    assert [pin for pin in pins if not re.fullmatch(r"\d+\.\d+\.\d+", pin)] == [], "pinned exactly"
