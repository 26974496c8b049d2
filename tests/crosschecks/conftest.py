import pytest


@pytest.fixture(scope="session")
def found():
    """The second-order fit of a bundled record."""
    import chains

    return chains.fitted("duty_30min", "second")
