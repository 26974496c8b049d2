"""A fleet of the study by the user's path: fleet command, its folder, population, its folder."""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from fleet_cases import NAMES, SHORT_MIN, Fleet, draw_fleet, write_fleet

import heatrun
from heatrun import cli


def run(job: dict[str, Any]) -> dict[str, Any]:
    """Return the row of a fleet.

    Args:
        job: `seed`, `machines`, and `workers` for the fleet's calibrations.
    """
    begin = time.monotonic()
    fleet = draw_fleet(job["seed"], job["machines"])
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = write_fleet(fleet, folder / "bench", job["seed"])
        calibrated = heatrun.calibrate_fleet(path, out=folder / "fleet", workers=job["workers"])
        calibrated_s = time.monotonic() - begin
        words = [str(calibrated.path), "--covariate", "supplier", "--out", str(folder / "type")]
        code = cli.main(["population", *words])
        if code != 0:
            raise SystemExit(f"population of seed {job['seed']} ended with {code}")
        table = _table(folder / "type")
        content = json.loads((folder / "type" / "population.json").read_bytes())
    return {
        **job,
        "is_converged": content["is_converged"],
        "method": content["method"],
        "left_out": content["left_out"],
        "population": _population(fleet, content),
        "machines_found": _machines(fleet, table),
        "calibrated_s": calibrated_s,
        "processor_s": time.monotonic() - begin,
    }


def _table(folder: Path) -> list[dict[str, Any]]:
    from pyarrow.parquet import ParquetFile

    with ParquetFile(folder / "population.parquet") as file:
        rows = file.read().to_pylist()
    return [row for row in rows if row["status"] == "used"]


def _population(fleet: Fleet, content: dict[str, Any]) -> list[dict[str, Any]]:
    """Return each parameter of the population with its truth and its interval."""
    used = [machine["name"] for machine in content["machines"]]
    middle = np.exp(fleet.middle(used))
    (label,) = content["covariates"]
    sign = 1.0 if label == "supplier=south" else -1.0
    rows = []
    for place, name in enumerate(NAMES):
        said = content["parameters"][name]
        effect = content["covariates"][label][name]
        for kind, truth, entry in (
            ("median", middle[place], said["median"]),
            ("spread", np.expm1(fleet.sd[place]), said["spread"]),
            ("supplier", np.expm1(sign * fleet.supplier[place]), effect),
        ):
            low, high = entry["interval_95"]
            rows.append(
                {"kind": kind, "parameter": name, "truth": float(truth), "value": entry["value"],
                 "low": low, "high": high}
            )  # fmt: skip
    return rows


def _machines(fleet: Fleet, table: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return each machine's errors of the logarithms, alone and given all, and whether it fits."""
    rows = []
    for row in table:
        place = int(row["machine"][1:])
        truth = np.exp(fleet.logs[place])
        at = [row["parameters"].index(name) for name in NAMES]

        def numbers(column: str, row: dict[str, Any] = row, at: list[int] = at) -> np.ndarray:
            return np.array(row[column])[at]

        is_inside = (numbers("given_low_95") <= truth) & (truth <= numbers("given_high_95"))
        is_inside_alone = (numbers("alone_low_95") <= truth) & (truth <= numbers("alone_high_95"))
        rows.append(
            {
                "is_short": bool(fleet.minutes[place] == SHORT_MIN),
                "is_outlier": bool(fleet.is_outlier[place]),
                "odd": NAMES[fleet.odd[place]] if fleet.odd[place] >= 0 else "",
                "outlier_probability": row["outlier_probability"],
                "different": row["different"],
                "error_alone": np.log(numbers("alone_values") / truth).round(5).tolist(),
                "error_given": np.log(numbers("given_values") / truth).round(5).tolist(),
                "is_inside": is_inside.tolist(),
                "is_inside_alone": is_inside_alone.tolist(),
            }
        )
    return rows
