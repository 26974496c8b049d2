from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def targets():
    """What the campaign feeds with hostile bytes, which is no part of the packages."""
    name = "fuzz_targets"
    spec = importlib.util.spec_from_file_location(name, Path(__file__).with_name("targets.py"))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module.TARGETS
