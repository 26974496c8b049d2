"""What all tests share."""

from __future__ import annotations

import importlib
import importlib.util
import sys
from pathlib import Path
from types import ModuleType

import pytest


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
