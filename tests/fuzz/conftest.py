import pytest


@pytest.fixture(scope="session")
def targets():
    """What the campaign feeds with hostile bytes; loaded late, for it imports all readers."""
    from targets import TARGETS

    return TARGETS
