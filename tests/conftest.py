"""What all tests share."""

import atexit
import gc
import json
import os
import shutil
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from types import ModuleType
from typing import Any

import bench_package
import pytest
from hypothesis import settings
from xdist.scheduler import LoadFileScheduling

COMPILATIONS = "JAX_COMPILATION_CACHE_DIR"
ONE_THREAD = "OPENBLAS_NUM_THREADS"

MOST_KEPT_BYTES = 1_000_000_000
"""Of compilations that are kept between two runs; with more of them the next starts anew."""

MOST_RESIDENT_BYTES = 1_400_000_000
"""Memory of a worker from which on it drops compiled programs between two files."""

WORTH_DROPPING_BYTES = 600_000_000
"""And what it must have grown by since it last did so: much of it is never given back."""

PROGRAMS = {
    "chromium": ("chromium", "chromium-browser", "google-chrome"),
    "octave": ("octave-cli",),
    "clang": ("clang",),
    "cppcheck": ("cppcheck",),
}
"""Packages of Debian that some tests need, with the programs of which one will do."""

SECONDS = Path(__file__).with_name("seconds.json")
"""What each file takes [s], if a second or more; `pytest --seconds` writes it anew."""

MOST_QUICK_S = 1.0
"""What a file takes at most that `--quick` runs [s]."""

NOT_QUICK = ("app/", "benchmarks/", "crosschecks/", "faults/", "fleet/", "studies/")
"""Folders of tests that start other programs or fit a lot."""

TOGETHER = dict.fromkeys(
    (f"heatrun/test_{name}.py" for name in ("discover", "effects_search", "missing")),
    "search for effects",
)
"""Files that one worker runs, for what the first has traced and compiled serves the others."""

BEGUN_S = time.monotonic()
"""When this process began."""

TAKEN: Counter[str] = Counter()

LEFT_BYTES = pytest.StashKey[int]()
"""Memory that was left when compiled programs were last dropped."""

# The same examples in every run: a rare find is for `make study-fuzz` to make.
settings.register_profile("same", derandomize=True, deadline=None, max_examples=60)
settings.register_profile("random", deadline=None, max_examples=1000, print_blob=True)
settings.load_profile("same")


def _share_compilations() -> None:
    """Let all processes share their compilations, and this run those of the last.

    Most of the processor time of the tests is compiling. And keep the linear algebra of NumPy and
    SciPy on one thread in each, as the commands do: threads that wait for one another take up to
    nine times the processor time where there are other users.
    """
    os.environ.setdefault(ONE_THREAD, "1")
    if COMPILATIONS in os.environ:  # a worker's, or the user's
        return
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path("~").expanduser() / ".cache")
    folder = base / "heatrun" / "tests"
    if sum(file.stat().st_size for file in folder.glob("*")) > MOST_KEPT_BYTES:
        shutil.rmtree(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:  # a home that cannot be written to
        folder = Path(tempfile.mkdtemp(prefix="heatrun-tests-"))
        atexit.register(shutil.rmtree, folder, ignore_errors=True)
    os.environ[COMPILATIONS] = str(folder)


_share_compilations()  # before another conftest loads JAX


def pytest_unconfigure(config: pytest.Config) -> None:
    """Say in the last line what was skipped for want of a program, and how to get it."""
    missing = [name for name, any_of in PROGRAMS.items() if not any(map(shutil.which, any_of))]
    if missing and not hasattr(config, "workerinput") and not config.option.collectonly:
        print(
            f"Skipped: all tests that need {' or '.join(missing)}. To install: "
            f"apt-get install {' '.join(missing)}"
        )


def pytest_collection_finish(session: pytest.Session) -> None:
    """Keep what imports and collection left out of every later garbage collection."""
    gc.collect()
    gc.freeze()


def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Drop compiled programs between files once they fill the memory."""
    if nextitem is not None and nextitem.path == item.path:
        return
    most = max(MOST_RESIDENT_BYTES, item.config.stash.get(LEFT_BYTES, 0) + WORTH_DROPPING_BYTES)
    if "jax" in sys.modules and _resident_bytes() > most:
        sys.modules["jax"].clear_caches()
        if "heatrun.io.programs" in sys.modules:
            sys.modules["heatrun.io.programs"].forget()
        gc.collect()
        item.config.stash[LEFT_BYTES] = _resident_bytes()


def _resident_bytes() -> int:
    """Return the memory that this process holds; 0 where the system does not tell."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
    except OSError:
        return 0
    return pages * os.sysconf("SC_PAGE_SIZE")


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add `--quick`, which is `make quick`, `--minutes` and `--seconds`."""
    parser.addoption("--quick", action="store_true", help="only files that take seconds")
    parser.addoption("--seconds", action="store_true", help=f"write {SECONDS.name} anew")
    parser.addoption("--minutes", type=float, help="begin no test after this, and say which")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Put the files that take longest first, so that no core waits for the other at the end.

    With `--quick` these are left out; with `--minutes` they come last, and are what a slow machine
    has no time for.
    """
    taken = json.loads(SECONDS.read_text())
    seconds = {item: taken.get(_file(item.nodeid), 0.0) for item in items}
    if config.getoption("quick"):
        slow = [
            item
            for item in items
            if seconds[item] > MOST_QUICK_S or _file(item.nodeid).startswith(NOT_QUICK)
        ]
        config.hook.pytest_deselected(items=slow)
        items[:] = [item for item in items if item not in set(slow)]
    items.sort(key=lambda item: -seconds[item], reverse=config.getoption("minutes") is not None)


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Skip what `--minutes` leaves no time for."""
    minutes = item.config.getoption("minutes")
    if minutes is not None and time.monotonic() - BEGUN_S > 60.0 * minutes:
        pytest.skip(f"no time left after {minutes:g} minutes")


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Add up what the tests of each file take; in the process that all workers report to."""
    TAKEN[_file(report.nodeid)] += report.duration


def pytest_sessionfinish(session: pytest.Session) -> None:
    """Write what each file took, if that was asked for."""
    if session.config.getoption("seconds") and not hasattr(session.config, "workerinput"):
        taken = {name: round(s, 1) for name, s in sorted(TAKEN.items()) if s >= 1.0}
        SECONDS.write_text(json.dumps(taken, indent=1) + "\n")


def _file(nodeid: str) -> str:
    """Return the file of a test below `tests`."""
    return nodeid.split("::")[0].removeprefix("tests/")


class OneWorkerForAFile(LoadFileScheduling):
    """Gives each worker whole files, and all of those that go together."""

    def _split_scope(self, nodeid: str) -> str:
        return TOGETHER.get(_file(nodeid)) or super()._split_scope(nodeid)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> OneWorkerForAFile | None:
    """Return how files are given to workers where `--dist loadfile` is asked for."""
    return OneWorkerForAFile(config, log) if config.getoption("dist") == "loadfile" else None


@pytest.fixture(scope="session")
def generator() -> ModuleType:
    """The simulated bench of `data/synthetic`."""
    return bench_package.bench()


@pytest.fixture(scope="session")
def hidden_bench() -> ModuleType:
    """The bench with hidden causes, a part of the simulated bench."""
    return bench_package.hidden_bench()
