"""What all tests share."""

from __future__ import annotations

import importlib
import importlib.util
import os
import shutil
import sys
import tempfile
from pathlib import Path
from types import ModuleType

import pytest

COMPILATIONS = "JAX_COMPILATION_CACHE_DIR"
ONE_THREAD = "OPENBLAS_NUM_THREADS"
LONGEST = (
    "test_view_browser.py", "test_discover_command.py", "test_run_everywhere.py",
    "test_posterior.py", "test_cli.py", "test_fleet_engine.py", "test_bodies.py",
    "test_sheet_again.py", "test_coverage_small.py", "test_notebooks.py",
    "test_rest_and_time_to.py", "test_effects.py", "test_simulate.py", "test_fit.py",
    "test_attacks_load.py",
    "test_export_run.py", "test_attacks_files.py", "test_physics.py", "test_discover_bodies.py",
    "test_two_sinks.py", "test_attacks_browser.py", "test_constant_drive.py", "test_heat_only.py",
    "test_corpus.py", "test_densities.py", "test_attacks_address.py",
)  # fmt: skip
"""Files that take half a minute or more, longest first."""


def pytest_configure(config: pytest.Config) -> None:
    """Let all processes of this run of the tests share their compilations, with no other run.

    Half of the processor time of the tests was compiling the same functions in each of them. And
    keep the linear algebra of NumPy and SciPy on one thread in each, as the commands do: threads
    that wait for one another take up to nine times the processor time where there are other users.
    """
    os.environ.setdefault(ONE_THREAD, "1")
    if COMPILATIONS in os.environ:  # a worker's, or the user's
        return
    folder = tempfile.mkdtemp(prefix="heatrun-tests-")
    os.environ[COMPILATIONS] = folder
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.3")
    config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Put the files that take longest first, so that no core waits for the other at the end."""
    places = {name: place for place, name in enumerate(LONGEST)}
    items.sort(key=lambda item: places.get(item.path.name, len(places)))


@pytest.fixture(scope="session")
def generator() -> ModuleType:
    """The simulated bench of `data/synthetic`, which is no part of the installed packages."""
    folder = Path(__file__).parents[1] / "data" / "synthetic" / "generator"
    name = "synthetic_bench"
    spec = importlib.util.spec_from_file_location(name, folder / "__init__.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="session")
def hidden_bench(generator) -> ModuleType:
    """The bench with hidden causes, a part of the simulated bench."""
    return importlib.import_module(f"{generator.__name__}.hidden")
