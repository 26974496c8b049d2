from __future__ import annotations

import sys
from pathlib import Path

import pytest

# the checks stand beside their tests as plain scripts
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def found():
    """The second-order fit of a bundled record."""
    import chains

    return chains.fitted("duty_30min", "second")
