"""A fleet's folder with rows as `heatrun fleet` writes them, of posteriors drawn about a truth."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from heatrun.fleet.parts import part_bytes
from heatrun.fleet.rows import COLUMNS

NAMES = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
UNITS = ("J/K", "J/K", "K/W", "K/W")
MEDIAN = np.array([700.0, 15000.0, 0.15, 0.11])
SPREAD = np.array([0.03, 0.05, 0.06, 0.04])
ERROR = 0.015
PRIOR_SD = np.array([1.3, 1.5, 1.8, 1.4])


def machine(number: int, seed: int = 0, *, shift: Sequence[float] = (0.0,) * 4, **said):
    """Return the row of a machine whose posterior was drawn about its true parameters.

    Args:
        number: Of the machine.
        seed: Of its type.
        shift: Of the logarithms of its parameters, beside its share of the spread.
        **said: Columns that are otherwise than in a good row.
    """
    rng = np.random.default_rng([seed, number])
    true = np.log(MEDIAN) + SPREAD * rng.standard_normal(4) + shift
    prior_mean = np.log(MEDIAN) + 0.3
    read = true + ERROR * rng.standard_normal(4)
    precision = ERROR**-2 + PRIOR_SD**-2
    mean = (read * ERROR**-2 + prior_mean * PRIOR_SD**-2) / precision
    empty = {name: [] if kind.startswith("list") else None for name, kind, _, _ in COLUMNS}
    row = {
        **empty,
        "machine": f"M{number:03d}", "type": "A", "covariates": [], "status": "fitted",
        "findings": "[]", "model": "second", "is_converged": True, "result": "converged",
        "parameters": list(NAMES), "parameter_units": list(UNITS), "transforms": ["log"] * 4,
        "parameter_values": np.exp(mean).tolist(),
        "parameter_sd": (np.exp(mean) / np.sqrt(precision)).tolist(),
        "log_mean": mean.tolist(), "log_covariance": np.diag(1.0 / precision).ravel().tolist(),
        "prior_mean": prior_mean.tolist(), "prior_sd": PRIOR_SD.tolist(),
    }  # fmt: skip
    covariates = list(said.pop("covariates", {}).items())
    return {**row, "covariates": covariates, **said}


def refused(number: int, message: str, **said):
    """Return the row of a machine that its records do not allow."""
    finding = {"id": "x", "severity": "error", "message": message, "where": "", "remedy": "",
               "test": ""}  # fmt: skip
    lists = {name: [] for name, kind, _, _ in COLUMNS if kind.startswith("list")}
    row = machine(number, status="refused", is_converged=False, findings=json.dumps([finding]))
    return {**row, **lists, "result": message, "log_mean": [], **said}


def write_rows(folder: Path, rows) -> Path:
    """Write rows as the folder of a fleet."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "machines.parquet").write_bytes(part_bytes(rows))
    (folder / "manifest.json").write_text(json.dumps({"fleet": "line 3"}))
    return folder
