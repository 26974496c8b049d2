"""The result of a discovery as plain data: what stands in `discovery.json`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..inference.effect_parameters import qualified
from ..inference.posterior import Posterior
from ..inference.predict import Prediction
from ..version import __version__
from .fates import describe_candidates, test_name
from .final_check import Adequacy
from .library import Candidate
from .localise import Span, Where
from .response import SENSOR
from .rivals import Named
from .run import Discovery, Shown
from .traces import Trace

FORMAT = "heatrun-discovery/2"
"""Described by `schema.json` beside this file; the number rises with what a reader must know."""

SELECTED = (
    "The held-out tests took part in the selection of effects: none was added that predicts one of "
    "them worse. Their error after is therefore no independent proof; a further test would be."
)
"""What must be said of held-out tests that were looked at before an effect was added."""


def assemble(
    found: Discovery,
    shown: Shown,
    roles: Sequence[str],
    *,
    command: str,
    seed: int,
) -> dict[str, Any]:
    """Return the whole of `discovery.json`.

    Args:
        found: What was found.
        shown: Posteriors and predictions of all tests.
        roles: Role of each test.
        command: The command, as it is to stand in the result.
        seed: Of everything that was drawn.
    """
    after = found.after
    held_out = [p for p, role in zip(shown.predictions, roles, strict=True) if role == "holdout"]
    return {
        "format": FORMAT,
        "heatrun_version": __version__,
        "command": command,
        "seed": seed,
        "motor": {"name": found.engine.problem.motor.name},
        "verdict": found.verdict.word,
        "sentence": found.verdict.sentence,
        "effects": [_effect(found, shown, each) for each in found.named],
        "dropped": found.dropped,
        "traces": [describe_trace(trace) for trace in found.traces],
        "where": [_span(span) for span in found.where_before.spans],
        "where_left": [_span(span) for span in found.where_after.spans],
        "localisation": {"before": _where(found.where_before), "after": _where(found.where_after)},
        "candidates": describe_candidates(found),
        "adequacy": {"before": _adequacy(found.before), "after": _adequacy(after)},
        "calibration": _gap(
            [p for p, role in zip(shown.predictions, roles, strict=True) if role != "holdout"],
            after.noise_K,
        ),
        "holdout": _held_out(found, held_out, after.noise_K) if held_out else None,
        "tests": [
            {"name": before.test.name, "role": role, "before": _row(before), "after": _row(last)}
            for (before, last), role in zip(shown.predictions, roles, strict=True)
        ],
        "parameters": _parameters(shown),
        "noise": {
            "sd_K": float(found.final.noise.sd),
            "time_s": float(found.final.noise.time),
            "white_K": float(found.final.noise.white),
        },
        "posterior": {
            "before": shown.posteriors[0].sentence(),
            "after": shown.posteriors[1].sentence(),
            "is_sound": shown.posteriors[1].is_sound,
        },
        "next_test": _next(found),
        "seconds": found.seconds,
    }


def _held_out(
    found: Discovery, pairs: Sequence[tuple[Prediction, Prediction]], floor: float
) -> dict[str, Any]:
    """Return the gap on held-out tests, and whether these decided about an effect."""
    judged = [r for each in found.growth.rounds for r in each.rivals if r.held_out_K]
    return {
        **_gap(pairs, floor),
        "took_part_in_selection": bool(judged),
        "sentence": SELECTED if judged else "The held-out tests took no part in the selection.",
    }


def describe_trace(trace: Trace) -> dict[str, Any]:
    """Return an effect that is there and too small to matter."""
    return {
        "id": trace.rival.candidate.id,
        "equivalents": [candidate.id for candidate in trace.equivalents],
        "closes_K": trace.rival.gap_K,
        "delta_log_evidence": trace.rival.delta_log_evidence,
    }


def _effect(found: Discovery, shown: Shown, named: Named) -> dict[str, Any]:
    rival = named.rival
    kind = rival.candidate.kind
    draws = shown.posteriors[1].values()
    names = {name: _slot_name(found, rival.candidate, name) for name in kind.card.parameters}
    round_ = next(r for r in found.growth.rounds if r.accepted is rival)
    return {
        "id": rival.candidate.id,
        "family": kind.card.family,
        "law": kind.card.law,
        "test": test_name(found, rival.candidate),
        "probability": named.probability,
        "equivalents": [candidate.id for candidate in named.equivalents],
        "parameters": {
            name: {
                "value": float(np.median(draws[slot])),
                "unit": kind.card.parameters[name].unit,
                "interval_95": [float(q) for q in np.quantile(draws[slot], [0.025, 0.975])],
            }
            for name, slot in names.items()
            if slot in draws
        },
        "evidence": {
            "delta_log_evidence": named.delta_log_evidence,
            "familywise_p": round_.familywise_p,
        },
        "left_out": {"rmse_before_K": rival.left_out_without_K, "rmse_after_K": rival.left_out_K},
        "rivals": [
            {
                "id": swap.candidate.id,
                "delta_log_evidence": -swap.delta_log_evidence,
                "share_of_gap": swap.share,
                "parameters": swap.values,
                "reason": swap.reason or "not distinguishable from these tests",
            }
            for swap in named.swaps
        ],
    }


def _slot_name(found: Discovery, candidate: Candidate, name: str) -> str:
    full = qualified(candidate.kind, name)
    return full if candidate.test is None else f"{full}[{test_name(found, candidate)}]"


def _span(span: Span) -> dict[str, Any]:
    unit = "K" if span.node == SENSOR else "W"
    return {
        "test": span.test,
        "from_s": span.from_s,
        "to_s": span.to_s,
        "node": span.node,
        f"missing_{unit}": span.missing,
        "interval_95": list(span.interval_95),
    }


def _where(where: Where) -> dict[str, Any]:
    return {
        "nodes": list(where.node),
        "log_evidence": where.log_evidence,
        "dependence": where.dependence,
        "courses": [
            {
                "test": course.test,
                "node": course.node,
                "unit": course.unit,
                "time_s": course.time_s,
                "mean": course.mean,
                "sd": course.sd,
            }
            for course in where.courses
        ],
    }


def _adequacy(found: Adequacy) -> dict[str, Any]:
    return {
        "is_adequate": found.is_adequate,
        "low_frequency_excess": found.excess,
        "correlation_s": found.correlation_s,
        "slow_misfit_K": found.misfit_K,
        "noise_K": found.noise_K,
    }


def _gap(pairs: Sequence[tuple[Prediction, Prediction]], floor: float) -> dict[str, Any]:
    result: dict[str, Any] = {"noise_floor_K": floor}
    for name, place in (("before", 0), ("after", 1)):
        errors = np.concatenate([p[place].residual[p[place].test.is_observed] for p in pairs])
        inside = [p[place].coverage_95() for p in pairs]
        sizes = [int(p[place].test.is_observed.sum()) for p in pairs]
        result |= {
            f"rmse_{name}_K": float(np.sqrt(np.mean(errors**2))),
            f"max_{name}_K": float(np.max(np.abs(errors))),
            f"coverage_95_{name}": float(np.average(inside, weights=sizes)),
        }
    return result


def _row(prediction: Prediction) -> dict[str, float]:
    seen = prediction.test.is_observed
    errors = prediction.residual[seen]
    return {
        "rmse_K": float(np.sqrt(np.mean(errors**2))),
        "max_K": float(np.max(np.abs(errors))),
        "end_K": float(np.mean(errors[-5:])),
        "coverage_95": prediction.coverage_95(),
    }


def _parameters(shown: Shown) -> dict[str, Any]:
    before, after = shown.posteriors
    result: dict[str, Any] = {}
    for slot in before.fit.slots:
        if slot.parameter.role in ("network", "resistance"):
            entry: Mapping[str, Any] = {
                "before": _figure(before, slot.name),
                "after": _figure(after, slot.name),
                "unit": slot.parameter.unit,
            }
            was, now = entry["before"]["value"], entry["after"]["value"]
            result[slot.name] = {**entry, "wrong_by": was / now - 1.0 if now else None}
    return result


def _figure(posterior: Posterior, name: str) -> dict[str, Any]:
    draws = posterior.values()[name].ravel()
    return {
        "value": float(np.median(draws)),
        "interval_95": [float(q) for q in np.quantile(draws, [0.025, 0.975])],
    }


def _next(found: Discovery) -> dict[str, Any] | None:
    test = found.next_test
    if test is None:
        return None
    return {
        "separates": list(test.separates),
        "what": test.what,
        "start": test.start,
        "profile": test.profile,
        "expected_log_bayes_factor": test.expected_log_bayes_factor,
    }
