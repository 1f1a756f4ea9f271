"""The guides do what they say: their commands are run, in their order, each guide in a separate folder.

A block marked `sh` is run line by line and must succeed; `serve` must bring up a page and keeps running.
A block marked `yaml FILE` gives these keys to FILE, one marked `text FILE` or `python FILE` writes it. Blocks without a
mark need more than one machine or more than a minute: of these only the words of `kitchenmind` are checked here. They
are run by `test_guide_server.py`, `test_guide_containers.py`, `test_guide_backup.py`, and for training by
`training/test_guide_own_agent.py`, `training/test_guide_own_kitchen.py` and `training/test_guide_own_predictor.py`.
"""

import importlib
import os
import re
import selectors
import shlex
import subprocess
import sys
import time
import urllib.request
from collections.abc import Iterator
from pathlib import Path

import pytest

import kitchenmind
from kitchenmind.argument_parser import ExactArgumentParser

ROOT = Path(__file__).parent.parent
GUIDES = sorted(page for folder in ("tutorials", "guides") for page in (ROOT / "docs" / folder).glob("*.md"))
BLOCK = re.compile(r"^```(?P<mark>[^\n]*)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL)
LINKED = ("studies", "docs", "tests", "overcooked")
TIMEOUT_S = 120.0


def blocks(guide: Path) -> list[tuple[str, str]]:
    """Mark and text of every block, in order."""
    return [(found["mark"].strip(), found["text"]) for found in BLOCK.finditer(guide.read_text(encoding="utf-8"))]


def is_run(guide: Path) -> bool:
    return any(mark == "sh" for mark, _ in blocks(guide))


class GuideReader:
    """Somebody who follows a guide to the letter."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in LINKED:
            (folder / name).symlink_to(ROOT / name)
        self.database = f"sqlite:///{folder}/own.sqlite3"
        settings = {"DATABASE": self.database, "PORT": "0", "SECRET": "a secret of the tests, long enough"}
        self.environment = {**os.environ} | {f"KITCHENMIND_{name}": value for name, value in settings.items()}
        self.serving: subprocess.Popen[str] | None = None

    def follow(self, mark: str, text: str) -> None:
        kind, _, name = mark.partition(" ")
        if kind == "yaml" and name:
            self._give(self.folder / name, text)
        elif kind in ("text", "python") and name:
            (self.folder / name).write_text(text, encoding="utf-8")
        elif mark == "sh":
            for line in text.splitlines():
                self._run(shlex.split(line, comments=True))

    def _run(self, words: list[str]) -> None:
        given, words = assignments(words)
        environment = self.environment | given
        if words[:2] == ["kitchenmind", "serve"]:
            self._serve(words, environment)
            return
        if words[0] == "make":
            words = ["make", "--dry-run", "--directory", str(ROOT), *words[1:]]
        done = subprocess.run(
            _program(words), cwd=self.folder, env=environment, capture_output=True, text=True, timeout=TIMEOUT_S
        )
        assert done.returncode == 0, f"{shlex.join(words)}\n{done.stdout}{done.stderr}"

    def _serve(self, words: list[str], environment: dict[str, str]) -> None:
        """Up until the next one, or the end of the guide."""
        self.leave()
        self.serving = subprocess.Popen(
            _program(words), cwd=self.folder, env=environment, stdout=subprocess.PIPE, text=True
        )
        assert self.serving.stdout is not None
        with selectors.DefaultSelector() as selector:
            selector.register(self.serving.stdout, selectors.EVENT_READ)
            deadline = time.monotonic() + TIMEOUT_S
            line = ""
            while "http://" not in line:
                assert selector.select(deadline - time.monotonic()), f"{shlex.join(words)}: no address"
                line = self.serving.stdout.readline()
                assert line, f"{shlex.join(words)}: it ended"
        address = re.search(r"http://\S+", line)
        assert address is not None
        with urllib.request.urlopen(address[0], timeout=20) as page:
            assert page.status == 200

    def leave(self) -> None:
        if self.serving is not None:
            self.serving.terminate()
            self.serving.communicate(timeout=30)
            self.serving = None

    @staticmethod
    def _give(file: Path, text: str) -> None:
        """The file with these blocks in place of those of the same name."""
        kept = file.read_text(encoding="utf-8")
        for key in re.findall(r"^(\w+):", text, re.MULTILINE):
            kept = re.sub(rf"^{key}:.*\n(?:[ #-].*\n|\n)*", "", kept, flags=re.MULTILINE)
        file.write_text(f"{kept.rstrip()}\n{text}", encoding="utf-8")


def assignments(words: list[str]) -> tuple[dict[str, str], list[str]]:
    """The settings in front of a command, and the command."""
    count = next((k for k, word in enumerate(words) if "=" not in word), len(words))
    return dict(word.split("=", 1) for word in words[:count]), words[count:]


def _program(words: list[str]) -> list[str]:
    own = {"kitchenmind": [sys.executable, str(ROOT / "kitchenmind")], "python": [sys.executable]}
    return [*own.get(words[0], words[:1]), *words[1:]]


@pytest.fixture
def reader(tmp_path: Path) -> Iterator[GuideReader]:
    somebody = GuideReader(tmp_path)
    yield somebody
    somebody.leave()


@pytest.mark.slow
@pytest.mark.timeout(280)
@pytest.mark.parametrize("guide", [guide for guide in GUIDES if is_run(guide)], ids=lambda guide: guide.stem)
def test_the_links_of_the_guide_lead_to_the_named_pages(guide: Path, reader: GuideReader) -> None:
    for mark, text in blocks(guide):
        reader.follow(mark, text)


@pytest.mark.parametrize("guide", GUIDES, ids=lambda guide: guide.stem)
def test_words_of_every_command_are_understood(guide: Path) -> None:
    understood: list[str] = []
    for _, text in blocks(guide):
        for line in text.splitlines():
            bare = line.removeprefix(".venv/bin/").removeprefix("docker compose exec server ")
            words = shlex.split(bare, comments=True) if "kitchenmind " in line else []
            _, words = assignments(words)
            if words[:1] == ["kitchenmind"]:
                parse(words[1:])
                understood.append(line)
    assert understood


def test_no_contact_in_a_guide_repeats_the_words_in_front_of_it() -> None:
    """The consent page writes `Questions?` before what the study gives."""
    contacts = [
        line for guide in GUIDES for line in guide.read_text("utf-8").splitlines() if line.startswith("contact:")
    ]
    assert contacts
    assert [line for line in contacts if "Questions?" in line or "问题" in line] == []


def parse(words: list[str]) -> None:
    """Read the words as their verb does; SystemExit where it does not know them."""
    module = importlib.import_module(kitchenmind.VERBS[words[0]][0])
    parser = ExactArgumentParser(prog=f"kitchenmind {words[0]}")
    module.add_arguments(parser)
    parser.parse_args(words[1:])
