"""A served folder of tests and a browser that looks at it; skipped where there is no Chromium."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
DATA = ROOT / "data" / "synthetic"
CHROMIUM = next((p for name in ("chromium", "chromium-browser", "google-chrome")
                 if (p := shutil.which(name))), None)  # fmt: skip
START_S = 60


class Served:
    """A running `heatrun view`."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder, self.out = folder, folder.parent / "runs"
        log = folder.parent / f"{folder.name}.log"
        with log.open("w") as file:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "heatrun.cli", "view", str(folder), "--no-browser",
                 "--port", "0", "--out", str(self.out), *options],
                stderr=file, env=dict(os.environ),
            )  # fmt: skip
        end = time.monotonic() + START_S
        found = None
        while found is None and time.monotonic() < end and self.process.poll() is None:
            time.sleep(0.1)
            found = re.search(r"http://[\d.]+:\d+/", log.read_text())
        assert found, log.read_text()
        self.url = found.group()

    def close(self) -> None:
        self.process.terminate()
        self.process.wait(10)


def _fill(where: Path) -> Path:
    where.mkdir()
    for name in ("motor.toml", "duty_30min.csv.gz", "step_30min.csv.gz"):
        shutil.copy(DATA / name, where / name)
    return where


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder with a motor file and two short tests."""
    return _fill(tmp_path / "bench")


@pytest.fixture(scope="session")
def bench_data() -> Path:
    return DATA


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Served]:
    """One server for the tests of a file; a test that changes a file brings its own."""
    server = Served(_fill(tmp_path_factory.mktemp("view") / "bench"))
    yield server
    server.close()


@pytest.fixture
def served_empty(tmp_path: Path) -> Iterator[Served]:
    (tmp_path / "empty").mkdir()
    server = Served(tmp_path / "empty", "--max-upload-MB", "1")
    yield server
    server.close()


@pytest.fixture(scope="session")
def browser():
    if CHROMIUM is None:
        pytest.skip("no Chromium is installed")
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()


@pytest.fixture
def tab(browser):
    """A tab of its own context, at a laptop's size; what it asks for elsewhere is kept."""
    context = browser.new_context(viewport={"width": 1366, "height": 800}, accept_downloads=True)
    page = context.new_page()
    page.set_default_timeout(60_000)
    page.problems = []
    page.elsewhere = []
    page.on("pageerror", lambda error: page.problems.append(str(error)))
    page.on("console", lambda m: page.problems.append(m.text) if m.type == "error" else None)
    page.on("request", lambda r: None if r.url.startswith(("http://127.0.0.1", "data:", "blob:"))
            else page.elsewhere.append(r.url))  # fmt: skip
    yield page
    context.close()
