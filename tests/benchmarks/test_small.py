"""The benchmark in small: the rivals agree, and the table comes out."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


def run(*words):
    script = Path(__file__).with_name("run.py")
    done = subprocess.run(
        [sys.executable, str(script), "--small", *words],
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_the_likelihood_is_that_of_the_rivals():
    """The script itself compares the sums of squares with those in C and numba."""
    table = run("--only", "likelihood")
    assert "| likelihood of 64 / C |" in table
    assert "| one likelihood, scipy solve_ivp |" in table


@pytest.mark.slow
def test_the_whole_benchmark_runs_in_small():
    table = run()
    for what in ("complete fit, warm", "emcee 64 x 2000 on blocks", "samples, likelihood of 1,",
                 "--help of the slowest command"):  # fmt: skip
        assert f"| {what}" in table
