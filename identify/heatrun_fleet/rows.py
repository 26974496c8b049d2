"""A machine of a fleet as a row: what its calibration found, in one Arrow schema for all.

The thermal parameters, the network's and those of its effects, stand as parallel lists in the order
of `parameters`. Beside values in their units, each row carries their posterior as a normal law in
the space in which the fit's prior is normal: the natural logarithm for parameters whose
`transforms` entry is `"log"` (of the value in its unit), the value itself for `"linear"`. In that
space the prior is normal too, parameter by parameter: `prior_mean` and `prior_sd`. The
two together give the tests' own evidence back: precision inv(log_covariance) - diag(prior_sd^-2).
All other parameters, those of instruments and starts, are integrated out of `log_covariance`.

Nothing in a row depends on when, where or on how many processes it was worked out.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from heatrun.fit.fit_result import RESULT, Fit
from heatrun.model.noise import noise_parameters
from heatrun.record.record import Finding
from heatrun.results.json_text import to_plain

from .arrow_schema import LIST, Column, arrow_schema
from .entries import Entry
from .shared_effects.columns import COLUMNS as OF_EFFECTS

FORMAT = "heatrun-fleet-rows/3"

THERMAL = ("network", "effect", "known")
"""Roles of the parameters that a population is made of."""

FITTED, REFUSED, FAILED = "fitted", "refused", "failed"
"""States of a machine: fitted; its rows, files or records do not allow it; the fit led nowhere."""

Row = dict[str, Any]

COLUMNS: tuple[Column, ...] = (
    ("machine", "text", "", "name of the machine, unique in the fleet"),
    ("type", "text", "", "what it is one of; empty if not said"),
    ("covariates", "map", "", "further columns of the fleet file, as texts"),
    ("status", "text", "", "fitted, refused (by its row, files or records) or failed"),
    ("findings", "text", "", "JSON list of id, severity, message, where, remedy, test"),
    ("model", "text", "", "name of the network"),
    ("is_converged", "truth", "", "whether the fit converged"),
    ("result", "text", "", "how the fit ended, in a sentence"),
    ("parameters", "list of text", "", "names of the thermal parameters"),
    ("parameter_units", "list of text", "", "unit of each"),
    ("transforms", "list of text", "", "log or linear: the space of the columns log_… and prior_…"),
    ("parameter_values", LIST, "parameter_units", "most probable value of each"),
    ("parameter_sd", LIST, "parameter_units", "standard deviation of each, to first order"),
    ("log_mean", LIST, "by transforms", "mean of ln(value / unit), or of the value if linear"),
    ("log_covariance", LIST, "by transforms", "covariance, row by row, all else integrated out"),
    ("prior_mean", LIST, "by transforms", "centre of the prior in that space"),
    ("prior_sd", LIST, "by transforms", "its standard deviation; independent parameters"),
    ("others", "list of text", "", "names of the other free parameters: resistance, instruments, "
     "starts, test by test in brackets"),
    ("other_units", "list of text", "", "unit of each"),
    ("other_values", LIST, "other_units", "most probable value of each"),
    ("other_sd", LIST, "other_units", "standard deviation of each, to first order"),
    ("noise", "list of text", "", "names of the parameters of noise and unmodelled heat"),
    ("noise_units", "list of text", "", "unit of each"),
    ("noise_values", LIST, "noise_units", "most probable value of each"),
    ("noise_log_mean", LIST, "1", "mean of ln(value / unit)"),
    ("noise_log_covariance", LIST, "1", "their covariance, row by row"),
    ("noise_prior_mean", LIST, "1", "centre of the prior of ln(value / unit)"),
    ("noise_prior_sd", LIST, "1", "its standard deviation"),
    ("noise_level_K", "number", "K", "standard deviation of the noise of a 20 s mean"),
    ("rmse_K", "number", "K", "root mean square residual of the winding's block means"),
    ("log_evidence", "number", "nat", "marginal likelihood by Laplace's method"),
    ("num_tests", "count", "1", "records that were fitted"),
    ("duration_s", "number", "s", "their length in all"),
    ("num_blocks", "count", "1", "block means that were fitted"),
    ("holdout_tests", "list of text", "", "names of the records that were predicted only"),
    ("holdout_rmse_K", LIST, "K", "root mean square error of each"),
    ("holdout_coverage_95", LIST, "1", "share of its block means inside the 95 % band"),
    ("inputs", "list of file", "", "files: path as in the fleet file, role, SHA-256 (empty: none)"),
    *OF_EFFECTS,
)  # fmt: skip
"""Name, kind, unit and meaning of each column, in order."""


@cache
def schema() -> Any:
    """Return the Arrow schema of the rows; units and meanings stand in the fields' metadata.

    Raises:
        InputError: If pyarrow is not installed.
    """
    return arrow_schema(COLUMNS, FORMAT)


def unfitted(
    entry: Entry, model: str, status: str, findings: Sequence[Finding], inputs: Sequence[Row]
) -> Row:
    """Return the row of a machine without a fit.

    Args:
        entry: The machine.
        model: Name of the network.
        status: `REFUSED` or `FAILED`.
        findings: Why, and what else was found.
        inputs: Its files.
    """
    empty = {name: [] if kind.startswith("list") else None for name, kind, _, _ in COLUMNS}
    return {
        **empty,
        "machine": entry.machine,
        "type": entry.type,
        "covariates": list(entry.covariates),
        "status": status,
        "findings": findings_text(findings),
        "model": model,
        "is_converged": False,
        "result": next((f.message for f in findings if f.severity == "error"), ""),
        "inputs": list(inputs),
    }


def fitted(
    entry: Entry,
    fit: Fit,
    findings: Sequence[Finding],
    inputs: Sequence[Row],
    *,
    duration_s: float,
    holdout: Sequence[tuple[str, float, float]] = (),
) -> Row:
    """Return the row of a fit.

    Args:
        entry: The machine.
        fit: As `heatrun.fit.fit.fit` gives it.
        findings: Of its rows and records; those of the fit are added.
        inputs: Its files.
        duration_s: Length of the fitted records in all [s].
        holdout: Name, RMSE [K] and coverage [1] of each record that was predicted only.
    """
    is_sound = fit.result is not RESULT.no_start
    row = unfitted(entry, fit.problem.model.name, FITTED if is_sound else FAILED, (), inputs)
    every = [*findings, *fit.findings]
    if not is_sound:
        every.append(Finding("fit_failed", "error", fit.result.value, fit.problem.label))
        return {**row, "findings": findings_text(every), "result": fit.result.value}
    places = [i for i, slot in enumerate(fit.slots) if slot.parameter.role in THERMAL]
    others = [i for i in range(len(fit.slots)) if i not in places]
    values = fit.values()
    noise = noise_parameters(fit.problem.model.adequacy)
    num = len(fit.slots)
    return {
        **row,
        "findings": findings_text(every),
        "is_converged": fit.result is RESULT.converged,
        "result": fit.result.value,
        **_parameters(fit, places, values),
        "others": [fit.slots[i].name for i in others],
        "other_units": [fit.slots[i].parameter.unit for i in others],
        "other_values": [values[fit.slots[i].name] for i in others],
        "other_sd": [_sd(fit, i, values) for i in others],
        "noise": [each.name for each in noise],
        "noise_units": [each.unit for each in noise],
        "noise_values": [float(p.value(z)) for p, z in zip(noise, fit.noise_z, strict=True)],
        "noise_log_mean": _means(noise, fit.noise_z),
        "noise_log_covariance": _covariance(noise, fit.covariance[num:, num:]),
        "noise_prior_mean": _means(noise, np.zeros(len(noise))),
        "noise_prior_sd": [each.sd for each in noise],
        "noise_level_K": float(fit.noise.total()),
        "rmse_K": fit.rmse_K(),
        "log_evidence": fit.log_evidence,
        "num_tests": len(fit.problem.tests),
        "duration_s": duration_s,
        "num_blocks": int(np.sum(fit.problem.is_observed)),
        "holdout_tests": [name for name, _, _ in holdout],
        "holdout_rmse_K": [rmse for _, rmse, _ in holdout],
        "holdout_coverage_95": [coverage for _, _, coverage in holdout],
    }


def _parameters(fit: Fit, places: Sequence[int], values: dict[str, float]) -> Row:
    slots = [fit.slots[i] for i in places]
    kinds = [slot.parameter for slot in slots]
    return {
        "parameters": [slot.name for slot in slots],
        "parameter_units": [each.unit for each in kinds],
        "transforms": [each.transform for each in kinds],
        "parameter_values": [values[slot.name] for slot in slots],
        "parameter_sd": [_sd(fit, i, values) for i in places],
        "log_mean": _means(kinds, fit.z[list(places)]),
        "log_covariance": _covariance(kinds, fit.covariance[np.ix_(places, places)]),
        "prior_mean": _means(kinds, np.zeros(len(kinds))),
        "prior_sd": [each.sd for each in kinds],
    }


def _means(kinds: Sequence[Any], z: np.ndarray) -> list[float]:
    """Return scores in the space of the transforms: logarithms, or values."""
    return [
        float((np.log(each.centre) if each.transform == "log" else each.centre) + each.sd * score)
        for each, score in zip(kinds, z, strict=True)
    ]


def _covariance(kinds: Sequence[Any], of_scores: np.ndarray) -> list[float]:
    scale = np.array([each.sd for each in kinds])
    whole = of_scores * scale[:, None] * scale
    return (0.5 * (whole + whole.T)).ravel().tolist()


def _sd(fit: Fit, place: int, values: dict[str, float]) -> float:
    slot = fit.slots[place]
    sd = slot.parameter.sd * float(np.sqrt(fit.covariance[place, place]))
    return sd * abs(values[slot.name]) if slot.parameter.transform == "log" else sd


def findings_text(findings: Sequence[Finding]) -> str:
    """Return findings as JSON text, those that were made twice once."""
    every = [
        {"id": f.id, "severity": f.severity, "message": f.message, "where": f.where,
         "remedy": f.remedy, "test": f.test}
        for f in findings
    ]  # fmt: skip
    return json.dumps(to_plain([f for i, f in enumerate(every) if f not in every[:i]]),
                      ensure_ascii=False)  # fmt: skip


def file_row(path: str, role: str, sha256: str) -> Row:
    """Return an entry of `inputs`; arguments as `COLUMNS` says."""
    return {"path": path, "role": role, "sha256": sha256}
