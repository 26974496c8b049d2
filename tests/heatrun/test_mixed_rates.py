"""Tests of different rates: what one of them has for itself gets through to the written run."""

from __future__ import annotations

import gzip
from pathlib import Path

import arviz
import numpy as np
import pytest

import heatrun
from heatrun.cli import main

DATA = Path(__file__).parents[2] / "data" / "synthetic"


@pytest.mark.slow
def test_a_10_Hz_and_a_2_s_file_are_calibrated_together(tmp_path):
    with gzip.open(DATA / "duty_30min.csv.gz", "rt") as file:
        lines = file.read().splitlines()
    (tmp_path / "fast.csv").write_text("\n".join(lines) + "\n")
    (tmp_path / "slow.csv").write_text("\n".join([lines[0], *lines[1::20]]) + "\n")
    run = tmp_path / "run"
    code = main([
        "calibrate", str(DATA / "motor.toml"), str(tmp_path / "fast.csv"),
        str(tmp_path / "slow.csv"), "--model", "first", "--quick", "--out", str(run),
    ])  # fmt: skip
    assert code == 0
    draws = arviz.from_netcdf(run / "posterior_first.nc").posterior
    assert list(draws["Tw_start"]["test"].values) == ["fast", "slow"]
    assert list(draws["load_timing"]["test_of_load_timing"].values) == ["slow"]
    assert np.isfinite(draws["load_timing"]).all()
    read = heatrun.open_run(run)
    told = {row.sample_s: row.tests for row in read.result.models["first"].noise.loggers}
    assert told == {0.1: ("fast",), 2.0: ("slow",)}
    scales = read.draws("first").loggers
    assert {logger.sample_s for logger in scales} == {0.1, 2.0}
    assert 1.0 in scales.values()
