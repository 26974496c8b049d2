"""What the tests of fleets share."""

from __future__ import annotations

import os
import shutil
import sys
from pathlib import Path

import pytest
from filelock import FileLock

pytest.importorskip("pyarrow")

# what several files of tests share stands beside them as plain scripts
sys.path.insert(0, str(Path(__file__).parent))
from simulated_fleet import write_fleet

from heatrun_fleet.cluster import Workers
from heatrun_fleet.fleet_file import load_fleet
from heatrun_fleet.job import calibrate_fleet_into


@pytest.fixture(scope="session")
def finished(tmp_path_factory):
    """A folder with a fleet of six machines and, in `out`, its calibrations by this process."""
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "finished_fleet"
    with FileLock(folder.with_suffix(".lock")):
        if not folder.exists():
            partial = tmp_path_factory.mktemp("fleet")
            write_fleet(partial / "bench")
            calibrate_fleet_into(
                partial / "out", load_fleet(partial / "bench" / "FLEET.toml"),
                workers=Workers(0), batch=2,
            )  # fmt: skip
            partial.rename(folder)
    return folder


@pytest.fixture
def bench(finished, tmp_path):
    """A copy of its files to spoil."""
    shutil.copytree(finished / "bench", tmp_path / "bench")
    return tmp_path / "bench"
