"""The benchmark in small: the rivals agree, and the table says what was missed, by how much."""

import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from profile_commands import PHASES
from rows import Row, duration, markdown


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


@pytest.mark.slow
def test_the_whole_benchmark_runs_in_small():
    """The script itself compares the sums of squares with those in C and numba."""
    table = run()
    for what in ("likelihood of 64 / C |", "one likelihood, scipy solve_ivp |",
                 "complete fit, warm", "emcee 64 x 2000 on blocks", "samples, likelihood of 1,",
                 "--help of the slowest command"):  # fmt: skip
        assert f"| {what}" in table


@pytest.mark.parametrize("command", PHASES)
def test_what_the_profile_measures_is_there(command):
    for place in PHASES[command].values():
        module, name = place.rsplit(".", 1)
        assert hasattr(import_module(module), name), place


def test_a_missed_target_says_by_how_much():
    table = markdown([Row("Fit", "warm", 0.15, "s", 0.1), Row("Fit", "ratio", 0.5, "1", 1.0)])
    assert "| warm | 150 ms |  | ≤ 100 ms | **MISSED by 50 %** |" in table
    assert "| ratio | 0.5 |  | ≤ 1 | met |" in table


def test_a_row_without_a_target_has_no_verdict():
    assert "| x | 3 MB |  |  |  |" in markdown([Row("Memory", "x", 3.0, "MB")])


def test_times_come_with_a_fitting_unit():
    assert [duration(t) for t in (2e-5, 2e-3, 2.0, 600.0, 72_000.0)] == [
        "20 µs", "2 ms", "2 s", "10 min", "20 h"]  # fmt: skip
