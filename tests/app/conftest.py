"""A served folder of tests and a browser that looks at it; skipped where there is no Chromium."""

from __future__ import annotations

import gzip
import json
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, closing
from functools import cache
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]
DATA = ROOT / "data" / "synthetic"
CHROMIUM = next((p for name in ("chromium", "chromium-browser", "google-chrome")
                 if (p := shutil.which(name))), None)  # fmt: skip
START_S, END_S = 180, 60

LONG_MS = 120_000
"""What a browser is waited for: a slow machine is no fault of the page."""

WARM = Path(__file__).with_name("warm.py")

END_WITH_THE_TESTS = """
import ctypes, os, signal, sys
if sys.platform == "linux":
    PR_SET_PDEATHSIG = 1
    ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGTERM)
os.execv(sys.executable, [sys.executable, *sys.argv[1:]])
"""
"""Lets a command end when pytest does, also when a time limit ends that without a word. Not by a
`preexec_fn`: JAX, loaded by other tests of the process, forbids the fork that this takes."""


class Warm:
    """A process that has imported the live view, and starts `heatrun` as often as it is asked to.

    All of those end when it does, and it ends when pytest does.
    """

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, str(WARM)], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def start(
        self, words: list[str], log: Path, constants: dict[str, float] | None = None
    ) -> Forked:
        log.touch()
        asked = {"words": words, "log": str(log), "constants": constants or {}}
        return Forked(self, self.ask(**asked, environment=dict(os.environ)))

    def ask(self, **asked: Any) -> Any:
        self._process.stdin.write(json.dumps(asked) + "\n")
        self._process.stdin.flush()
        return json.loads(self._process.stdout.readline())

    def close(self) -> None:
        self._process.stdin.close()
        self._process.stdout.close()
        try:
            self._process.wait(END_S)
        finally:
            self._process.kill()
            self._process.wait()


class Forked:
    """A command that `Warm` has started, with what the tests need of `subprocess.Popen`."""

    def __init__(self, warm: Warm, pid: int) -> None:
        self._warm, self.pid = warm, pid
        self.returncode: int | None = None

    def poll(self) -> int | None:
        if self.returncode is None:
            self.returncode = self._warm.ask(code=self.pid)
        return self.returncode

    def wait(self, seconds: float = 60.0) -> int:
        end = time.monotonic() + seconds
        while (code := self.poll()) is None:
            if time.monotonic() > end:
                raise subprocess.TimeoutExpired("heatrun", seconds)
            time.sleep(0.02)
        return code

    def send_signal(self, number: int) -> None:
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)


class Served:
    """A running `heatrun view`: forked off a warm process, or without one started as users do."""

    def __init__(
        self,
        folder: Path,
        *options: str,
        warm: Warm | None = None,
        constants: dict[str, float] | None = None,
    ) -> None:
        self.folder, self.out = folder, folder.parent / "runs"
        self.log = folder.parent / f"{folder.name}.log"
        words = ["view", str(folder), "--no-browser", "--port", "0", "--out", str(self.out),
                 *options]  # fmt: skip
        if warm is not None:
            self.process = warm.start(words, self.log, constants)
        else:
            with self.log.open("w") as file:
                self.process = subprocess.Popen(
                    [sys.executable, "-c", END_WITH_THE_TESTS, "-m", "heatrun.cli", *words],
                    stdout=file, stderr=file, env=dict(os.environ),
                )  # fmt: skip
        try:
            self.url = self._told()
        except BaseException:
            self.close()
            raise

    def _told(self) -> str:
        end = time.monotonic() + START_S
        while time.monotonic() < end and self.process.poll() is None:
            found = re.search(r"http://\S+:\d+/\S*(?= shows)", self.log.read_text())
            if found:
                return found.group()
            time.sleep(0.1)
        raise AssertionError(self.log.read_text())

    @property
    def most_MB(self) -> float:
        status = Path(f"/proc/{self.process.pid}/status").read_text()
        return int(re.search(r"VmHWM:\s+(\d+)", status).group(1)) / 1e3

    def children(self) -> list[int]:
        listed = Path(f"/proc/{self.process.pid}/task").glob("*/children")
        return [int(pid) for each in listed for pid in each.read_text().split()]

    def close(self) -> None:
        self.process.terminate()
        try:
            self.process.wait(END_S)
        finally:
            self.process.kill()
            self.process.wait()


@cache
def _second_by_second(name: str) -> bytes:
    """Return a bundled test with every tenth of its samples: the checks of a page take their time.

    That page and download hold a faster one is seen in `test_view_browser.py`.
    """
    lines = gzip.decompress((DATA / name).read_bytes()).splitlines(keepends=True)
    return gzip.compress(b"".join([lines[0], *lines[1::10]]), mtime=0)


def _fill(where: Path) -> Path:
    where.mkdir()
    shutil.copy(DATA / "motor.toml", where)
    for name in ("duty_30min.csv.gz", "step_30min.csv.gz"):
        (where / name).write_bytes(_second_by_second(name))
    return where


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    return _fill(tmp_path / "bench")


@pytest.fixture(scope="module")
def shared_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The same for tests that change nothing in it."""
    return _fill(tmp_path_factory.mktemp("shared") / "bench")


@pytest.fixture(scope="session")
def bench_data() -> Path:
    return DATA


@pytest.fixture(scope="session")
def warm() -> Iterator[Warm]:
    """What starts the servers of all tests but those on the start and the end of one."""
    process = Warm()
    try:
        yield process
    finally:
        process.close()


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory, warm: Warm) -> Iterator[Served]:
    """One server for the tests of a file; a test that changes a file brings its own."""
    server = Served(_fill(tmp_path_factory.mktemp("view") / "bench"), warm=warm)
    try:
        yield server
    finally:
        server.close()


@pytest.fixture
def served_empty(tmp_path: Path, warm: Warm) -> Iterator[Served]:
    (tmp_path / "empty").mkdir()
    server = Served(tmp_path / "empty", "--max-upload-MB", "1", warm=warm)
    try:
        yield server
    finally:
        server.close()


@pytest.fixture
def serve(tmp_path: Path, warm: Warm) -> Iterator[Callable[..., Served]]:
    """Start servers with options, each of a folder of its own, ended after the test.

    A cold one is started as users do.
    """
    started: list[Served] = []

    def start(
        *options: str,
        fill: Callable[[Path], object] | None = None,
        constants: dict[str, float] | None = None,
        is_cold: bool = False,
    ) -> Served:
        folder = _fill(tmp_path / f"bench{len(started)}")
        if fill is not None:
            fill(folder)
        origin = None if is_cold else warm
        started.append(Served(folder, *options, warm=origin, constants=constants))
        return started[-1]

    try:
        yield start
    finally:
        for server in started:
            server.close()


@pytest.fixture(scope="session")
def served_class() -> type[Served]:
    return Served


@pytest.fixture(scope="session")
def wire():
    """The client that sends what it likes: `ask`, `upgrade`, `Tab`."""
    import wire

    return wire


@pytest.fixture
def open_tab(wire):
    """Open pages as a browser has them; they are closed after the test."""
    with ExitStack() as opened:
        yield lambda *words, **more: opened.enter_context(closing(wire.Tab(*words, **more)))


@pytest.fixture(scope="module")
def lives(served: Served, wire) -> Iterator[None]:
    """After all tests of a file a user's page still opens."""
    yield
    wire.opens(served.url)


@pytest.fixture(scope="session")
def browser():
    if CHROMIUM is None:
        pytest.skip("no Chromium is installed")
    from playwright.sync_api import expect, sync_playwright

    expect.set_options(timeout=LONG_MS)

    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=CHROMIUM, args=["--no-sandbox"])
        yield found
        found.close()


LAPTOP = {"viewport": {"width": 1366, "height": 800}}
PHONE = {"viewport": {"width": 390, "height": 844}, "is_mobile": True, "has_touch": True,
         "device_scale_factor": 3}  # fmt: skip


@pytest.fixture
def tab(browser):
    """A tab of its own context, at a laptop's size; what it asks for elsewhere is kept."""
    yield from _tab_of(browser, LAPTOP)


@pytest.fixture
def phone(browser):
    """The same of a phone, which lays a page out as wide as that says and not as its window is."""
    yield from _tab_of(browser, PHONE)


def _tab_of(browser, device):
    context = browser.new_context(**device, accept_downloads=True)
    page = context.new_page()
    page.set_default_timeout(LONG_MS)
    page.problems = []
    page.elsewhere = []
    page.on("pageerror", lambda error: page.problems.append(str(error)))
    page.on("console", lambda m: page.problems.append(m.text) if m.type == "error" else None)
    page.on("request", lambda r: None if r.url.startswith(("http://127.0.0.1", "data:", "blob:"))
            else page.elsewhere.append(r.url))  # fmt: skip
    yield page
    context.close()
