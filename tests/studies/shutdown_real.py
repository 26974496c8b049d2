"""The load drop of a real record with its first readings hidden: `make study-shutdown`.

The machine of Paderborn's profile 24 is driven on at 5500 rpm without load, so that a part of the
losses stays; a sensor stands for the resistance. What it showed when the load was taken off is
known. The record is not part of the project (`../shared/bench`): without it nothing is done.
"""

import contextlib
import io
import json
from pathlib import Path
from typing import Any

import pandas as pd
from paderborn import MOTOR, calibrated, columns_of, paderborn_record
from study_runs import put, temporary

from heatrun import cli

DROP_S, READ_S = 4394.0, 300.0
"""When the load is taken off, between two samples 2.5 s apart, and how long is read [s]."""

DELAYS_S = (30.0, 60.0, 90.0)

SAID = """[shutdown]
sensor_sd_K = 0
sensor_lag_s = 5
moment_sd_s = 1
run_down_s = 0
losses_after = 0.4
losses_after_sd = 0.1
current_after = 0.46
"""
"""As the drive records it: 98 of 212 A flow on, to weaken the field, and 1.5 of 3.6 kW stay, some
of it friction, which heats no winding. The lag is what the first load step shows."""


def main() -> None:
    found = paderborn_record("A real load drop with its first readings hidden.", "shutdown")
    if found is None:
        return
    record, out = found
    with temporary() as folder:
        heating = columns_of(record[record.time_s < DROP_S - 10.0])
        run = calibrated(folder, MOTOR + SAID, heating).path
        rows = [
            answer(record, delay, folder, of_run) for delay in DELAYS_S for of_run in (None, run)
        ]
    put(out / "real.md", table(rows))
    print(table(rows))


def answer(record: pd.DataFrame, delay_s: float, folder: Path, run: Path | None) -> dict[str, Any]:
    before = record[(record.time_s > DROP_S - 20.0) & (record.time_s < DROP_S)]
    since = record.time_s - DROP_S
    part = record[(since >= delay_s) & (since <= delay_s + READ_S)]
    readings = pd.DataFrame({
        "time_s": part.time_s - DROP_S,
        "winding_degC": part.stator_winding_degC,
        "coolant_degC": part.coolant_degC,
    })  # fmt: skip
    readings.to_csv(folder / "readings.csv", index=False)
    words = ["shutdown", f"{folder}/motor.toml", f"{folder}/readings.csv", "--json"]
    if run is not None:
        words += ["--run", str(run)]
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        cli.main(words)
    return {
        **json.loads(said.getvalue()),
        "delay_s": delay_s,
        "with_run": run is not None,
        "truth": float(before.stator_winding_degC.mean()),
    }


def table(rows: list[dict[str, Any]]) -> str:
    lines = [
        "# A real load drop with its first readings hidden",
        "",
        f"Paderborn's profile 24: the sensor showed {rows[0]['truth']:.2f} °C when the load was "
        "taken off; the speed stays at 5500 rpm. 5 min of readings at 2.5 s, from the first one "
        "that is not hidden on. *run*: calibrated on the heating alone (second order, quick). One "
        "drop of one machine: an example, no rate.",
        "",
        "| first reading | prior | winding | 95 % interval | holds | error | determinable |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        low, high = row["winding_95_degC"]
        lines.append(
            f"| {row['delay_s']:.0f} s | {'run' if row['with_run'] else 'none'} "
            f"| {row['winding_degC']:.1f} °C | {low:.1f} … {high:.1f} °C "
            f"| {'yes' if low <= row['truth'] <= high else '**no**'} "
            f"| {row['winding_degC'] - row['truth']:+.1f} K "
            f"| {'yes' if row['is_determinable'] else 'no'} |"
        )
    lines += ["", "By hand from the same readings, error [K]:", ""]
    first = [row for row in rows if not row["with_run"]]
    lines += [
        "| method | " + " | ".join(f"{row['delay_s']:.0f} s" for row in first) + " |",
        "|---" * (1 + len(first)) + "|",
    ]
    for place, one in enumerate(first[0]["by_hand"]):
        off = (f"{row['by_hand'][place]['degC'] - row['truth']:+.1f}" for row in first)
        lines.append(f"| {one['method']} | {' | '.join(off)} |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    main()
