"""How the tests and benchmarks start Chromium."""

import asyncio
import os
import shutil
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from playwright.sync_api import Browser, Error, sync_playwright

# Chromium follows the last list of this kind, so Playwright's own is repeated. The three after it are ours: for every
# context Chromium would start two processes for menus of its window and one in reserve, 0.8 s of a processor in all.
DISABLED_FEATURES = (
    "AvoidUnnecessaryBeforeUnloadCheckSync,DestroyProfileOnBrowserClose,HttpsUpgrades,HttpsFirstBalancedModeAutoEnable,"
    "LensOverlay,MediaRouter,PaintHolding,ThirdPartyStoragePartitioning,AvoidCorsURLLoaderRestartOnRedirect,"
    "TcpPortRandomizationWin,OptimizationHints,NetworkTimeServiceQuerying,AimEnabled,PreconnectToSearch,"
    "WebUIOmniboxPopup,WebUIOmniboxAimPopup,SpareRendererForSitePerProcess"
)
# A page of a test lives for a second: optimising scripts would take longer than it saves. The
# process for graphics draws in software, and as a thread it takes no messages between processes for each picture.
CHROMIUM_ARGUMENTS = [
    f"--disable-features={DISABLED_FEATURES}",
    "--js-flags=--max-lazy --no-opt --no-maglev",
    "--in-process-gpu",
    "--no-sandbox",
    "--disable-gpu",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
]


def installed_chromium() -> str:
    """Return the path of the browser. The headless shell, the same engine without a browser's windows and menus, takes
    a fifth less of a processor; where it is not installed, the whole browser runs headless. Fail if there is none."""
    shell = shutil.which("chromium-headless-shell") or _shell_of_playwright()
    names = ("chromium", "chromium-browser", "google-chrome")
    executable = shell or next(filter(None, map(shutil.which, names)), None)
    assert executable, "no Chromium is installed: run `make system`, or install the package `chromium`"
    return executable


def _shell_of_playwright() -> str | None:
    """Return the newest headless shell that `playwright install chromium` has put on this machine."""
    cache = Path.home() / ("Library/Caches" if sys.platform == "darwin" else ".cache")
    folder = Path(os.environ.get("PLAYWRIGHT_BROWSERS_PATH") or cache / "ms-playwright")
    found = [
        (int(path.parents[1].name.rpartition("-")[2]), str(path))
        for path in folder.glob("chromium_headless_shell-*/*/*headless*shell")
        if os.access(path, os.X_OK) and path.is_file()
    ]
    return max(found)[1] if found else None


class SharedChromium:
    """The installed Chromium, started once for all test files of a process."""

    def __init__(self) -> None:
        self._executable = installed_chromium()
        self._playwright = sync_playwright().start()
        self._browser = self._launched()
        self._loop = asyncio.get_running_loop()
        asyncio._set_running_loop(None)

    def _launched(self) -> Browser:
        return self._playwright.chromium.launch(executable_path=self._executable, args=CHROMIUM_ARGUMENTS)

    @contextmanager
    def in_use(self) -> Iterator[Browser]:
        """Lend the browser, and close every context that is left in it.

        Between two calls Playwright's event loop counts as running, so that no asynchronous test could follow. Only
        inside this block does it: the loop is put aside at the end and taken up at the beginning.
        """
        asyncio._set_running_loop(self._loop)
        try:
            if not self._browser.is_connected():  # it may have crashed
                self._browser = self._launched()
            yield self._browser
            with suppress(Error):  # a browser that has gone has closed them itself
                for context in self._browser.contexts:
                    context.close()
        finally:
            asyncio._set_running_loop(None)

    def close(self) -> None:
        with self.in_use() as browser, suppress(Error):
            browser.close()
        asyncio._set_running_loop(self._loop)
        self._playwright.stop()
        asyncio._set_running_loop(None)
