"""A fleet of the study of noise by the user's path: fleet, population, and the next machines."""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from fleet_cases import NAMES
from fleet_noise_cases import (
    EFFECT,
    NOISE,
    SHARE_SPREAD,
    NoisyFleet,
    draw_noisy_fleet,
    write_noisy_fleet,
)

import heatrun
from heatrun import cli

TEST_MIN, NEXT_MIN, NUM_NEXT = 120.0, 10.0, 20
"""Length of the tests of the machines that make the type, and of those that come after it [min];
number of the latter."""


def run(job: dict[str, Any]) -> dict[str, Any]:
    """Return the row of a fleet.

    Args:
        job: `seed`, `machines`, `has_effect`, `heat`, and `workers` for the calibrations.
    """
    begin = time.monotonic()
    num = job["machines"]
    fleet = draw_noisy_fleet(
        job["seed"], num + NUM_NEXT, has_effect=job["has_effect"], heat=job["heat"]
    )
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        path = write_noisy_fleet(
            fleet, folder / "bench", job["seed"], minutes=TEST_MIN, places=range(num)
        )
        out = heatrun.calibrate_fleet(path, out=folder / "fleet", workers=job["workers"]).path
        code = cli.main(["population", str(out), "--out", str(folder / "type")])
        if code != 0:
            raise SystemExit(f"population of seed {job['seed']} ended with {code}")
        content = json.loads((folder / "type" / "population.json").read_bytes())
        rows = _rows(folder / "type" / "population.parquet")
        following = {
            how: _following(fleet, folder, how, motor, job)
            for how, motor in (("alone", ""), ("sisters", '[population]\nrun = "../type"\n'))
        }
    return {
        **job,
        "is_converged": content["is_converged"] and content["noise"]["is_converged"],
        "left_out": content["left_out"],
        "type": _type(fleet, content),
        "heat_of_the_next": _heat_of_the_next(fleet, content, num),
        "machines_found": [_machine(fleet, row) for row in rows if row["status"] == "used"],
        "next": following,
        "processor_s": time.monotonic() - begin,
    }


def _following(
    fleet: NoisyFleet, folder: Path, how: str, motor: str, job: dict[str, Any]
) -> list[dict[str, Any]]:
    """Return errors of the logarithms of the machines that come after the type was known."""
    places = range(job["machines"], job["machines"] + NUM_NEXT)
    path = write_noisy_fleet(
        fleet, folder / how, job["seed"], minutes=NEXT_MIN, places=places, motor=motor
    )
    heatrun.calibrate_fleet(path, out=folder / f"out_{how}", workers=job["workers"])
    found = []
    for row in _rows(folder / f"out_{how}" / "machines.parquet"):
        if row["status"] != "fitted":
            found.append({"machine": row["machine"], "status": row["status"]})
            continue
        at = [row["parameters"].index(name) for name in NAMES]
        size = len(row["parameters"])
        mean = np.array(row["log_mean"])[at]
        sd = np.sqrt(np.diag(np.reshape(row["log_covariance"], (size, size))))[at]
        error = mean - fleet.machines.logs[int(row["machine"][1:])]
        found.append(
            {"machine": row["machine"], "status": row["status"], "error": error.round(5).tolist(),
             "is_inside": (np.abs(error) <= 1.96 * sd).tolist(), "sd": sd.round(5).tolist()}
        )  # fmt: skip
    return found


def _rows(path: Path) -> list[dict[str, Any]]:
    from pyarrow.parquet import ParquetFile

    with ParquetFile(path) as file:
        return file.read().to_pylist()


def _type(fleet: NoisyFleet, content: dict[str, Any]) -> list[dict[str, Any]]:
    """Return what is said of the type, each with its truth."""
    rows = []

    def add(of: str, name: str, kind: str, truth: float, entry: dict[str, Any]) -> None:
        low, high = entry["interval_95"]
        rows.append({"of": of, "name": name, "kind": kind, "truth": float(truth),
                     "value": entry["value"], "low": low, "high": high})  # fmt: skip

    used = [int(machine["name"][1:]) for machine in content["machines"]]
    middle = np.exp(fleet.machines.middle([fleet.machines.machines[place] for place in used]))
    for place, name in enumerate(NAMES):
        add("network", name, "median", middle[place], content["parameters"][name]["median"])
    for place, name in enumerate(NOISE):
        said = content["noise"]["parameters"][name]
        add("noise", name, "median", np.exp(fleet.noise_mean[place]), said["median"])
        add("noise", name, "spread", np.expm1(fleet.noise_sd[place]), said["spread"])
    if fleet.share_median > 0.0:
        said = content["parameters"][f"{EFFECT}.q"]
        add("effect", EFFECT, "median", fleet.share_median, said["median"])
        add("effect", EFFECT, "spread", np.expm1(SHARE_SPREAD), said["spread"])
    return rows


def _heat_of_the_next(fleet: NoisyFleet, content: dict[str, Any], num: int) -> list[bool]:
    """Return whether the heat of each further machine lies in what is said of the next one."""
    low, high = content["noise"]["parameters"]["unmodelled_heat"]["next_interval_95"]
    return [bool(low <= heat <= high) for heat in np.exp(fleet.noise[num:, 3])]


def _machine(fleet: NoisyFleet, row: dict[str, Any]) -> dict[str, Any]:
    place = int(row["machine"][1:])
    found: dict[str, Any] = {
        "machine": row["machine"],
        "is_other": bool(fleet.is_other[place]),
        "probability": row["noise_outlier_probability"],
        "is_outlier": row["is_outlier"],
    }
    if row["noise"]:
        truth = np.exp(fleet.noise[place])
        low, high = (np.array(row[f"noise_given_{end}_95"]) for end in ("low", "high"))
        found["noise_inside"] = ((low <= truth) & (truth <= high)).tolist()
        found["heat_error"] = [
            float(np.log(row[f"noise_{how}_values"][3] / truth[3])) for how in ("alone", "given")
        ]
    at = [row["parameters"].index(name) for name in NAMES]
    truth = np.exp(fleet.machines.logs[place])
    for how in ("alone", "given"):
        low, high = (np.array(row[f"{how}_{end}_95"])[at] for end in ("low", "high"))
        found[f"inside_{how}"] = ((low <= truth) & (truth <= high)).tolist()
    if fleet.share_median > 0.0:
        q = row["parameters"].index(f"{EFFECT}.q")
        found["effect_inside"] = bool(
            row["given_low_95"][q] <= fleet.share[place] <= row["given_high_95"][q]
        )
    return found
