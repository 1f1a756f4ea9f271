"""The tests run in the lightest browser that is installed."""

from pathlib import Path

import pytest

from tests.support.browser.chromium import installed_chromium


@pytest.fixture(autouse=True)
def machine(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine whose only browsers are those in `tmp_path`."""
    monkeypatch.setenv("PATH", str(tmp_path / "bin"))
    monkeypatch.setenv("PLAYWRIGHT_BROWSERS_PATH", str(tmp_path / "playwright"))


def program(path: Path) -> str:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.touch(mode=0o755)
    return str(path)


def test_playwrights_newest_headless_shell_is_preferred_to_a_whole_browser(tmp_path: Path) -> None:
    chromium = program(tmp_path / "bin" / "chromium")
    program(tmp_path / "playwright" / "chromium-1255" / "chrome-linux64" / "chrome")
    assert installed_chromium() == chromium
    program(tmp_path / "playwright" / "chromium_headless_shell-999" / "chrome-linux" / "headless_shell")
    folder = tmp_path / "playwright" / "chromium_headless_shell-1255"
    newest = program(folder / "chrome-headless-shell-linux64" / "chrome-headless-shell")
    assert installed_chromium() == newest


def test_the_systems_headless_shell_comes_first(tmp_path: Path) -> None:
    program(tmp_path / "playwright" / "chromium_headless_shell-999" / "chrome-linux" / "headless_shell")
    shell = program(tmp_path / "bin" / "chromium-headless-shell")
    assert installed_chromium() == shell


def test_without_a_browser_the_remedy_is_named() -> None:
    with pytest.raises(AssertionError, match="run `make system`"):
        installed_chromium()
