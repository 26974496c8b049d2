"""A fleet's folder with rows as `heatrun fleet` writes them, of posteriors drawn about a truth."""

import json
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from heatrun_fleet.rows import COLUMNS, part_bytes

NAMES = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
UNITS = ("J/K", "J/K", "K/W", "K/W")
MEDIAN = np.array([700.0, 15000.0, 0.15, 0.11])
SPREAD = np.array([0.03, 0.05, 0.06, 0.04])
ERROR = 0.015
PRIOR_SD = np.array([1.3, 1.5, 1.8, 1.4])
NOISE_NAMES = ("noise_sd", "noise_time", "noise_white", "unmodelled_heat")
NOISE_UNITS = ("K", "s", "K", "1")
NOISE_MEDIAN = np.array([0.15, 50.0, 0.05, 0.003])
NOISE_SPREAD = np.array([0.25, 0.15, 0.20, 0.40])
NOISE_ERROR = np.array([0.10, 0.20, 0.05, 0.30])
NOISE_PRIOR_SD = np.array([1.2, 1.0, 1.5, 1.2])


def machine(
    number: int, seed: int = 0, *, shift: Sequence[float] = (0.0,) * 4,
    noise_shift: Sequence[float] = (0.0,) * 4, **said,
):  # fmt: skip
    """Return the row of a machine whose posterior was drawn about its true parameters.

    Args:
        number: Of the machine.
        seed: Of its type.
        shift: Of the logarithms of its parameters, beside its share of the spread.
        noise_shift: The same of its noise and unmodelled heat.
        **said: Columns that are otherwise than in a good row.
    """
    mean, variance, prior_mean = _posterior(
        [seed, number], MEDIAN, SPREAD, ERROR, PRIOR_SD, shift=shift, prior_off=0.3
    )
    empty = {name: [] if kind.startswith("list") else None for name, kind, _, _ in COLUMNS}
    row = {
        **empty,
        "machine": f"M{number:03d}", "type": "A", "covariates": [], "status": "fitted",
        "findings": "[]", "model": "second", "is_converged": True, "result": "converged",
        "parameters": list(NAMES), "parameter_units": list(UNITS), "transforms": ["log"] * 4,
        "parameter_values": np.exp(mean).tolist(),
        "parameter_sd": (np.exp(mean) * np.sqrt(variance)).tolist(),
        "log_mean": mean.tolist(), "log_covariance": np.diag(variance).ravel().tolist(),
        "prior_mean": prior_mean.tolist(), "prior_sd": PRIOR_SD.tolist(),
        **_noise([seed, number, 1], noise_shift),
    }  # fmt: skip
    covariates = list(said.pop("covariates", {}).items())
    return {**row, "covariates": covariates, **said}


def _posterior(seed, median, spread, error, prior_sd, *, shift, prior_off):
    """Return mean and variance of the logarithms once the truth is read, and the prior's mean."""
    rng = np.random.default_rng(seed)
    true = np.log(median) + spread * rng.standard_normal(4) + shift
    prior_mean = np.log(median) + prior_off
    read = true + error * rng.standard_normal(4)
    precision = error**-2 + prior_sd**-2
    return (read * error**-2 + prior_mean * prior_sd**-2) / precision, 1.0 / precision, prior_mean


def _noise(seed: Sequence[int], shift: Sequence[float]):
    """Return the columns of noise and unmodelled heat."""
    mean, variance, prior_mean = _posterior(
        seed, NOISE_MEDIAN, NOISE_SPREAD, NOISE_ERROR, NOISE_PRIOR_SD, shift=shift, prior_off=-0.4
    )
    return {
        "noise": list(NOISE_NAMES), "noise_units": list(NOISE_UNITS),
        "noise_values": np.exp(mean).tolist(), "noise_log_mean": mean.tolist(),
        "noise_log_covariance": np.diag(variance).ravel().tolist(),
        "noise_prior_mean": prior_mean.tolist(), "noise_prior_sd": NOISE_PRIOR_SD.tolist(),
    }  # fmt: skip


def refused(number: int, message: str, **said):
    finding = {"id": "x", "severity": "error", "message": message, "where": "", "remedy": "",
               "test": ""}  # fmt: skip
    lists = {name: [] for name, kind, _, _ in COLUMNS if kind.startswith("list")}
    row = machine(number, status="refused", is_converged=False, findings=json.dumps([finding]))
    return {**row, **lists, "result": message, "log_mean": [], **said}


def write_rows(folder: Path, rows) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "machines.parquet").write_bytes(part_bytes(rows))
    (folder / "manifest.json").write_text(json.dumps({"fleet": "line 3"}))
    return folder
