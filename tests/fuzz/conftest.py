from __future__ import annotations

from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def targets(loaded):
    """What the campaign feeds with hostile bytes."""
    return loaded("fuzz_targets", Path(__file__).with_name("targets.py")).TARGETS
