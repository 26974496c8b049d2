import pytest


@pytest.fixture(scope="session")
def found():
    import chains

    return chains.fitted("duty_30min", "second")
