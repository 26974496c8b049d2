"""Real records through the command's way, the misses too: `make study-real`.

Each row is one record and one network: why it is refused, or how far the fit is from the readings,
fitted and held out. The records are not part of the project (`../shared/bench`): what is not there
is left out.
"""

import argparse
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from exam import first_sentence
from paderborn import BENCH, MOTOR, PADERBORN, columns_of
from study_runs import put, temporary

import heatrun
from heatrun.calibration import Refused
from heatrun.errors import InputError

NETWORKS = ("second", "cooled", "three", "four", "turning")
TURNING = """[network]
name = "turning"
title = "winding, tooth, yoke, rotor"
nodes = ["winding", "tooth", "yoke", "rotor"]
links = [["winding", "tooth"], ["tooth", "yoke"], ["tooth", "rotor"], ["yoke", "ambient"]]
losses = { copper = "winding", iron = ["tooth", "yoke"], mechanical = "rotor" }
by_speed = ["mechanical"]
[network.sensors]
winding_degC = "winding"
tooth_degC = "tooth"
yoke_degC = "yoke"
magnet_degC = "rotor"
"""
"""The network `four` with friction and windage that follow the speed, as a user's file."""
FILES = {"turning": TURNING}
"""Networks that do not come with heatrun."""
SPLITS = {"first half": 3752.5, "heating, 20 min of cooling": 5595.0}
"""Until when profile 24 is calibrated [s]; the load is taken off at 4395 s, the record ends at
7505 s. What is later is held out."""

SMALL = {
    "Run2": ("Run2-Throttle100/DAQ_run2.csv", "Run2-Throttle100/Export_DataAPD_run2.csv"),
    "Run3": ("Run3-Throttle48/DAQ_Run3.csv", "Run3-Throttle48/Export_DataAPD_run3.csv"),
    "Run13": ("Run13-Throttle8/DAQ_run13.csv", "Run13-Throttle8/Export_DataAPD_run13.csv"),
}
"""Runs of the small motor: thermocouples and speed controller, on two clocks."""

HEAD = '[motor]\nname = "small BLDC motor"\nlosses = "balance"\n'
READINGS = {
    "as recorded": HEAD,
    "DC power as losses": f'{HEAD}[columns]\nlosses_W = "Power (W)"\n[constants]\n'
    "phase_current_A = 0\n",
    "no losses": f"{HEAD}[constants]\nphase_current_A = 0\nlosses_W = 0\n",
}
"""Motor files that a user may come to."""

STOPPED = ("Run3", 206.5)
"""The only run that goes on after the stop, and when its winding is hottest [s]."""


@dataclass(frozen=True)
class Row:
    record: str  # What was recorded, and how it was read.
    network: str  # Name of the network; empty where no fit was tried.
    refused: str  # First sentence of the error, empty without one.
    # RMSE [K] and coverage of the 95 % band [1] of calibration and holdout, where there are such.
    residuals: dict[str, tuple[float, float]]
    # RMSE of other bodies that were fitted [K], by channel, of the calibration.
    bodies: dict[str, float]
    warnings: tuple[str, ...]  # Ids of the findings that warn.
    seconds: float  # Wall-clock time [s].


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bench", type=Path, default=BENCH)
    parser.add_argument("--out", type=Path, default=Path("results") / "real")
    options = parser.parse_args()
    rows = []
    with temporary() as folder:
        for job in (*small_motor(options.bench / "tass"), *paderborn(options.bench / PADERBORN)):
            rows.append(calibrated(job, folder))
            print(line(rows[-1]), flush=True)
            # what is done stays, where the study is stopped
            put(options.out / "table.md", table(rows))
    if not rows:
        print(f"{options.bench} holds no real records: nothing is done.")


@dataclass(frozen=True)
class Job:
    record: str  # As `Row.record`.
    network: str  # Name of the network.
    motor: str  # The motor file.
    tests: pd.DataFrame | str  # Bench files by name, or the text that names a file where it lies.
    holdout: pd.DataFrame | None = None  # The same of what is predicted only.


def paderborn(path: Path) -> Iterator[Job]:
    if not path.exists():
        return
    record = pd.read_csv(path)
    for split, until in SPLITS.items():
        parts = [record[record.time_s < until], record[record.time_s >= until]]
        first, later = (pd.DataFrame(columns_of(part)) for part in parts)
        for network in NETWORKS:
            yield Job(f"Paderborn 24, {split}", network, MOTOR, first, later)


def small_motor(folder: Path) -> Iterator[Job]:
    for run, files in SMALL.items():
        if not all((folder / name).exists() for name in files):
            continue
        temperatures, drive = (folder / name for name in files)
        for reading, motor in READINGS.items():
            if reading == "no losses" and run != STOPPED[0]:
                continue
            yield Job(f"{run}, {reading}", "second", motor, f"{temperatures}+{drive}@10Hz")
        if run == STOPPED[0]:
            cooling = after_stop(temperatures, STOPPED[1])
            yield Job(f"{run}, after the stop", "first", READINGS["no losses"], cooling)


def after_stop(path: Path, from_s: float) -> pd.DataFrame:
    whole = pd.read_csv(path, skiprows=6, encoding="utf-8-sig")
    minutes = whole["Time (s)"].str.split(":", expand=True).astype(float)
    whole["Time (s)"] = 60.0 * minutes[0] + minutes[1]
    return whole[whole["Time (s)"] >= from_s].drop(columns="Sample")


def calibrated(job: Job, folder: Path) -> Row:
    began = time.monotonic()
    network = job.network
    if network in FILES:
        network = str(folder / f"{network}.toml")
        Path(network).write_text(FILES[job.network], encoding="utf-8")
    motor, test = folder / "motor.toml", folder / "test.csv"
    motor.write_text(job.motor, encoding="utf-8")
    if isinstance(job.tests, pd.DataFrame):
        job.tests.to_csv(test, index=False)
    held = [folder / "later.csv"] if job.holdout is not None else []
    if job.holdout is not None:
        job.holdout.to_csv(held[0], index=False)
    tests = job.tests if isinstance(job.tests, str) else test

    def refused(told: str) -> Row:
        return Row(job.record, job.network, told, {}, {}, (), time.monotonic() - began)

    try:
        run = heatrun.calibrate(motor, [tests], holdout=held, model=network, method="quick")
    except Refused as error:
        errors = [finding for finding in error.findings if finding.severity == "error"]
        told = "; ".join(f"{f.id}: {first_sentence(f.message)}" for f in errors)
        return refused(told)
    except InputError as error:
        return refused(first_sentence(str(error)))
    model = run.result.models[job.network]
    warnings = dict.fromkeys(f.id for f in run.result.findings if f.severity == "warning")
    return Row(
        job.record,
        job.network,
        "",
        {row.role: (row.rmse_K, row.coverage_95) for row in model.residuals},
        {
            row.body.removesuffix("_degC"): row.rmse_K
            for row in model.bodies or ()
            if row.fitted and row.role == "calibration"
        },
        tuple(warnings),
        time.monotonic() - began,
    )


def line(row: Row) -> str:
    if row.refused:
        return f"| {row.record} | {row.network} | {row.refused} | | | | | {row.seconds:.0f} s |"
    cells = []
    for role in ("calibration", "holdout"):
        rmse, coverage = row.residuals.get(role, (np.nan, np.nan))
        known = np.isfinite(rmse)
        cells.append(f"{rmse:.2f} K, {100 * coverage:.0f} %" if known else "–")
    bodies = ", ".join(f"{name} {rmse:.2f} K" for name, rmse in row.bodies.items()) or "–"
    told = ", ".join(row.warnings) or "none"
    return (
        f"| {row.record} | {row.network} | – | {cells[0]} | {bodies} | {cells[1]} | {told} "
        f"| {row.seconds:.0f} s |"
    )


def table(rows: list[Row]) -> str:
    lines = [
        "# Real records",
        "",
        "`make study-real`: records that no one here wrote, through `heatrun calibrate --quick`. "
        "RMSE of the winding, and share of its block means inside the 95 % band; *bodies*: RMSE of "
        "other sensors that were fitted. A record that is held out is predicted from its own first "
        "40 s on. *turning*: the network four, with friction and windage that follow the speed.",
        "",
        "| record | network | refused, and why | calibrated | bodies | held out | warnings "
        "| time |",
        "|---|---|---|---|---|---|---|---|",
        *(line(row) for row in rows),
    ]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
