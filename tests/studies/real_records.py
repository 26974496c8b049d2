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

NOTES = """
## What these records can tell

**The Paderborn machine** has what a fit needs: losses by a balance of powers, a coolant, and
winding, tooth and yoke. Whether a network predicts what it has not seen is the column *held out*.
A first half that knows one load only cannot tell how the machine behaves at another; its bands
say so: they hold the readings, though the curve is off by up to a dozen kelvin.

The machine runs at 5500 rpm throughout, with and without a load. Friction that follows the speed
(*turning*) is therefore a constant heat in the rotor, told from the losses of the load only once
that has been taken off.

Four nodes with a magnet that no law of theirs follows are beyond this record: after heating and 20
min of cooling the fit bends an instrument by several of its standard deviations, where it ends
hangs on the last digits, and page 1 says *not to be used*.

**The small motor**: no fit of these runs gives parameters of the machine.

- *Heat from what?* The speed controller records the DC power, and zeros for the phase current.
  Neither the copper loss (current) nor a balance (shaft power) can be formed, and `heatrun check`
  refuses the runs as recorded. An electrical speed without pole pairs and a modulation are no shaft
  power.
- *DC power taken as losses* is an upper bound: the losses of the controller and what the shaft
  takes out are in it. The fit may look good all the same, since power that is no heat
  scales all capacities up and all resistances down together; only time constants are left. For
  run 3 the warning `losses_of_dc_link` says so. In run 13 the voltage holds and the current falls
  as copper's resistance rises, to 3 %, as under a locked rotor: no warning, and nothing in the
  record says whether the shaft stood still; the controller's losses are in it either way.
- *Run 2*: the two clocks cannot be joined. A step of the load in both logs, or one clock, is
  missing.
- *The measured stator body* tells where the stator starts and how heat divides between the bodies,
  in time constants. It is no substitute for watts.
- *Cooling alone* needs no losses: with `losses_W` and `phase_current_A` 0 under `[constants]`,
  the part after the stop gives time constants (`Ceq` times `Req` of the first order), never `Ceq`
  and `Req` apart. These runs end when the motor stops: one of them has 7 s of cooling, the others
  none. Ten minutes more of logging after the stop would have given a time constant.
- What would do: one phase current (a clamp) with the phase resistance and its temperature, the
  rotor locked or the shaft free; or torque and speed beside the DC power; and the logger left on
  while the motor cools.
"""


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
    motor = folder / "motor.toml"
    motor.write_text(job.motor, encoding="utf-8")
    network = job.network
    if network in FILES:
        network = str(folder / f"{network}.toml")
        Path(network).write_text(FILES[job.network], encoding="utf-8")
    tests = job.tests
    if isinstance(tests, pd.DataFrame):
        tests.to_csv(folder / "test.csv", index=False)
        tests = str(folder / "test.csv")
    held: list[str] = []
    if job.holdout is not None:
        job.holdout.to_csv(folder / "later.csv", index=False)
        held = [str(folder / "later.csv")]
    try:
        run = heatrun.calibrate(motor, [tests], holdout=held, model=network, method="quick")
    except Refused as error:
        errors = [finding for finding in error.findings if finding.severity == "error"]
        told = "; ".join(f"{f.id}: {first_sentence(f.message)}" for f in errors)
        return Row(job.record, job.network, told, {}, {}, (), time.monotonic() - began)
    except InputError as error:
        told = first_sentence(str(error))
        return Row(job.record, job.network, told, {}, {}, (), time.monotonic() - began)
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
    return "\n".join(lines) + "\n" + NOTES


if __name__ == "__main__":
    main()
