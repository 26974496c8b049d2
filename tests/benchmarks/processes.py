"""Whole processes: cold start and peak memory of each command, and of a record of 28 hours."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pandas as pd
from duty_record import record
from measured import heatrun
from rows import Row

from heatrun.commands import all_commands

SECTION = "Processes"
DATA = Path(__file__).parents[2] / "data" / "synthetic"
LONG, LARGE = "A million samples", 1_000_000


def help_of_each() -> list[Row]:
    """Time the help of every command: what a slow import at the top of a file would cost."""
    with tempfile.TemporaryDirectory() as folder:
        times = {name: heatrun([name, "--help"], Path(folder)).wall_s for name in all_commands()}
    slowest = max(times, key=lambda name: times[name])
    detail = ", ".join(f"{name} {1e3 * taken:.0f} ms" for name, taken in times.items())
    return [Row(SECTION, f"--help of the slowest command ({slowest})", times[slowest], "s", None,
                detail)]  # fmt: skip


def commands() -> list[Row]:
    """Time each command once from a cold process and an empty cache, and calibrate once more."""
    motor, duty, short = (
        str(DATA / name) for name in ("motor.toml", "duty_90min.csv.gz", "duty_30min.csv.gz")
    )
    rows = []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        out = str(folder / "run")
        jobs = [
            ("check, 90 min at 10 Hz", ["check", motor, duty], "check", None),
            (
                "calibrate, 90 min at 10 Hz, both orders",
                ["calibrate", motor, duty, "--out", out],
                "calibrate",
                20.0,
            ),
            (
                "the same, compilations kept",
                ["calibrate", motor, duty, "--out", f"{out} again"],
                "calibrate",
                None,
            ),
            ("sheet", ["sheet", out], "sheet", None),
            ("compare --quick", ["compare", motor, short, "--quick"], "compare", None),
            (
                "simulate",
                ["simulate", motor, out, short, "--out", str(folder)],
                "simulate",
                None,
            ),
            (
                "discover --quick, 30 min",
                ["discover", motor, short, "--quick", "--out", f"{out} discovery"],
                "discover",
                None,
            ),
        ]
        for what, words, cache, target in jobs:
            took = heatrun(words, folder / "cache" / cache)
            note = f"peak {took.peak_MB:.0f} MB"
            rows.append(Row(SECTION, what, took.wall_s, "s", target, note))
    return rows


def large_record() -> list[Row]:
    """Go from a file of a million samples to bands; return time and peak memory."""
    made = record(LARGE)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        pd.DataFrame(
            {
                "t": 0.1 * pd.RangeIndex(LARGE).to_numpy(),
                "Is": made["current_squared"] ** 0.5,
                "Pd": made["losses"],
                "Te": made["ambient"],
                "Tw_m": made["measured"].round(1),
            }
        ).to_csv(folder / "long.csv", index=False, float_format="%.6g")
        begin = time.perf_counter()
        done = subprocess.run(
            [sys.executable, str(Path(__file__).with_name("long_record.py")),
             str(DATA / "motor.toml"), str(folder / "long.csv")],
            check=True, capture_output=True, text=True,
        )  # fmt: skip
        taken = time.perf_counter() - begin
    peaks = json.loads(done.stdout)
    detail = "after " + ", ".join(f"{stage} {peak:.0f}" for stage, peak in peaks.items())
    peak = max(peaks.values())
    return [
        Row(LONG, "peak memory, from the file to bands", peak, "MB", 1024.0, detail),
        Row(LONG, "time, from the file to bands, second order", taken, "s"),
    ]
