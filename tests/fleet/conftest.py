"""What the tests of fleets share."""

import os
import shutil

import pytest
from filelock import FileLock

pytest.importorskip("pyarrow")

from simulated_fleet import calibrated, write_fleet


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A folder with a fleet of six machines and, in `out`, its calibrations by this process."""
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "finished_fleet"
    with FileLock(folder.with_suffix(".lock")):
        if not folder.exists():
            partial = tmp_path_factory.mktemp("fleet")
            write_fleet(partial / "bench")
            calibrated(partial / "bench", partial / "out")
            partial.rename(folder)
    return folder


@pytest.fixture
def bench(finished, tmp_path):
    """A copy of its files to spoil."""
    shutil.copytree(finished / "bench", tmp_path / "bench")
    return tmp_path / "bench"
