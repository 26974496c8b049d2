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


def pytest_configure(config: pytest.Config) -> None:
    """Let all processes of this run of the tests share their compilations, with no other run.

    Half of the processor time of the tests was compiling the same functions in each of them.
    """
    if COMPILATIONS in os.environ:  # a worker's, or the user's
        return
    folder = tempfile.mkdtemp(prefix="heatrun-tests-")
    os.environ[COMPILATIONS] = folder
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.3")
    config.add_cleanup(lambda: shutil.rmtree(folder, ignore_errors=True))


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
