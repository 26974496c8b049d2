"""The benchmark in small: the rivals agree, and the table comes out."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def test_the_small_benchmark_runs_and_the_rivals_agree():
    script = Path(__file__).with_name("run.py")
    done = subprocess.run(
        [sys.executable, str(script), "--small"], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "| likelihood of 64 / C |" in done.stdout
    assert "| emcee 64 x 2000 on blocks |" in done.stdout
