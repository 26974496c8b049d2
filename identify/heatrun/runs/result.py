"""The result of a calibration as plain data: what stands in `fit.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from lptn.effects import AbstractEffect

from ..bench.blocks import Blocks
from ..bench.channels.column_mapping import describe_mapping
from ..bench.record import Finding, Record
from ..inference import noise
from ..inference.comparison import compare, residual_row, verdict
from ..inference.effect_parameters import qualified
from ..inference.identifiability import forecast, state
from ..inference.parameters import Parameter, Slot
from ..inference.posterior import Posterior
from ..inference.predict import Prediction
from ..inference.sampling.importance import evaluate
from ..motor import Motor
from ..ratings.figures import derive
from ..version import __version__

FORMAT = "heatrun-fit/1"


def describe_test(
    record: Record, blocks: Blocks, motor: Motor, role: str, reduction_error_K: float
) -> dict[str, Any]:
    """Return what is said of a test."""
    source = record.sources[0] if record.sources else None

    def span(channel: str) -> list[float] | None:
        if channel not in record or not np.any(np.isfinite(record[channel])):
            return None
        return [float(np.nanmin(record[channel])), float(np.nanmax(record[channel]))]

    return {
        "name": record.name,
        "role": role,
        "path": "" if source is None else source.path,
        "sha256": "" if source is None else source.sha256,
        "reader": "" if source is None else source.reader,
        "notes": [*record.notes, *blocks.notes],
        "mapping": describe_mapping(record),
        "duration_s": record.duration_s,
        "num_samples": int(record.time_s.size),
        "sample_s": blocks.sample_s,
        "step_s": float(blocks.inputs.step),
        "block_s": blocks.block_s,
        "rounding_K": blocks.rounding_K,
        "start_degC": blocks.start_degC,
        "current_A": span("phase_current_A"),
        "losses_W": span("losses_W"),
        "speed_rpm": span("speed_rpm"),
        "winding_degC": span("winding_degC"),
        "sink_degC": span(f"{motor.sink}_degC"),
        "reduction_error_K": reduction_error_K,
    }


def describe_finding(finding: Finding) -> dict[str, Any]:
    """Return a finding as plain data."""
    return {
        "id": finding.id,
        "severity": finding.severity,
        "message": finding.message,
        "where": finding.where,
        "remedy": finding.remedy,
        "test": finding.test,
        "values": dict(finding.values),
    }


def describe_effect(kind: type[AbstractEffect]) -> dict[str, Any]:
    """Return what is said of an effect in a model; its parameters stand with the others."""
    card = kind.card
    names = [qualified(kind, name) for name in card.parameters]
    return {"id": card.id, "law": card.law, "parameters": names}


def describe_model(
    posterior: Posterior,
    predictions: Sequence[Prediction],
    roles: Sequence[str],
    duties: Sequence[str] = (),
) -> dict[str, Any]:
    """Return the entry of one network."""
    fit = posterior.fit
    slots = fit.slots
    longer = forecast(fit)
    draws = posterior.values()
    main: dict[str, Any] = {}
    nuisances: dict[str, Any] = {}
    for position, slot in enumerate(slots):
        entry = _free(posterior, slot, position, draws[slot.name].ravel(), longer)
        is_main = slot.parameter.role in ("network", "resistance", "effect", "known")
        (main if is_main else nuisances)[slot.name] = entry
    for parameter in fit.problem.parameters.by_test[0].values():
        if parameter.fixed is not None:
            is_main = parameter.role in ("network", "resistance", "effect", "known")
            (main if is_main else nuisances)[parameter.name] = _fixed(parameter)
    matrix = np.corrcoef(np.stack([draws[s.name].ravel() for s in slots]))
    size = fit.vector.size
    at_fit = fit.noise
    num_blocks = int(np.sum(fit.problem.is_observed))
    prior = -0.5 * float(np.sum(fit.vector**2)) - 0.5 * size * float(np.log(2 * np.pi))
    log_likelihood = fit.problem.temper * (float(evaluate(fit, fit.vector[None])[0]) - prior)
    model = fit.problem.model
    return {
        "title": model.title,
        "nodes": list(model.form.nodes),
        "effects": [describe_effect(kind) for kind in model.effects],
        "result": fit.result.name,
        "message": fit.result.value,
        "stats": fit.stats,
        "num_modes": len(fit.modes),
        "parameters": main,
        "nuisances": nuisances,
        "correlation": {"names": [s.name for s in slots], "matrix": matrix},
        "noise": {
            "sd_K": float(at_fit.sd),
            "time_s": float(at_fit.time),
            "white_K": float(at_fit.white),
            "kind": fit.problem.noise_kind,
            "temper": fit.problem.temper,
            "prior": {p.name: list(p.prior_interval_95()) for p in noise.NOISE},
        },
        "residuals": [
            residual_row(prediction, role)
            for prediction, role in zip(predictions, roles, strict=True)
        ],
        "posterior": {
            "method": posterior.method,
            "draws": int(posterior.flat.shape[0]),
            "ess_min": posterior.weighted.effective_size
            if posterior.convergence is None
            else posterior.convergence.effective_size,
            "autocorrelation_max": None
            if posterior.convergence is None
            else posterior.convergence.autocorrelation,
            "rhat_max": None if posterior.convergence is None else posterior.convergence.rhat,
            "pareto_k": posterior.weighted.pareto_k,
            "verdict": posterior.sentence(),
            "is_sound": posterior.is_sound,
        },
        "derived": derive(posterior, duties),
        "evidence": {
            "log_evidence": fit.log_evidence,
            "aic": 2.0 * size - 2.0 * log_likelihood,
            "bic": size * float(np.log(num_blocks)) - 2.0 * log_likelihood,
            "num_parameters": size,
            "num_blocks": num_blocks,
        },
    }


def assemble(
    motor: Motor,
    tests: Sequence[dict[str, Any]],
    findings: Sequence[Finding],
    models: dict[str, dict[str, Any]],
    predictions: Mapping[str, Sequence[Prediction]],
    *,
    command: str,
    seed: int,
) -> dict[str, Any]:
    """Return the whole of `fit.json`."""
    roles = [test["role"] for test in tests]
    pair = tuple(models) if len(models) == 2 else None
    return {
        "format": FORMAT,
        "heatrun_version": __version__,
        "command": command,
        "seed": seed,
        "motor": {
            "name": motor.name,
            "phases": motor.phases,
            "losses": motor.losses,
            "sink": motor.sink,
            "insulation_class": motor.insulation_class,
            "phase_resistance_ohm": motor.phase_resistance_ohm,
            "reference_temperature_degC": motor.reference_temperature_degC,
            "resistance_coefficient_degC": motor.resistance_coefficient_degC,
            "rated_speed_rpm": motor.rated_speed_rpm,
            "path": motor.path,
            "sha256": motor.sha256,
        },
        "tests": list(tests),
        "findings": [describe_finding(finding) for finding in findings],
        "verdict": verdict(models),
        "models": models,
        "comparison": None
        if pair is None
        else compare(predictions[pair[0]], predictions[pair[1]], roles),
    }


def _free(
    posterior: Posterior, slot: Slot, position: int, draws: np.ndarray, longer: dict[str, float]
) -> dict[str, Any]:
    parameter = slot.parameter
    value, sd = float(np.median(draws)), float(np.std(draws))
    laplace = posterior.fit.covariance[position, position]
    share = posterior.fit.covariance_type_a[position, position] / laplace
    sd_a = sd * float(np.sqrt(min(share, 1.0)))
    entry = {
        "value": value,
        "unit": parameter.unit,
        "sd": sd,
        "sd_type_a": sd_a,
        "sd_type_b": float(np.sqrt(max(sd**2 - sd_a**2, 0.0))),
        "interval_95": [float(q) for q in np.quantile(draws, [0.025, 0.975])],
        "relative_sd": sd / abs(value) if value != 0 else None,
        "prior_95": list(parameter.prior_interval_95()),
        "prior_basis": parameter.basis,
        "meaning": parameter.meaning,
        "fixed": False,
    }
    if parameter.role in ("effect", "known"):
        is_clear = sd < 0.25 * abs(value - parameter.centre) if value != 0 else False
        entry |= {
            "identifiability": "identified" if is_clear else "weak",
            "why": "belongs to an effect of the model.",
        }
    if parameter.role in ("network", "resistance"):
        statement = state(posterior, parameter, sd / abs(value), longer)
        entry |= {"identifiability": statement.verdict, "why": statement.why}
    return entry


def _fixed(parameter: Parameter) -> dict[str, Any]:
    return {
        "value": parameter.fixed,
        "unit": parameter.unit,
        "sd": 0.0,
        "sd_type_a": 0.0,
        "sd_type_b": 0.0,
        "interval_95": [parameter.fixed, parameter.fixed],
        "relative_sd": 0.0,
        "prior_95": [parameter.fixed, parameter.fixed],
        "prior_basis": "fixed in the motor file",
        "meaning": parameter.meaning,
        "fixed": True,
        "identifiability": "fixed",
        "why": "fixed in the motor file",
    }
