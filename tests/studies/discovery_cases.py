"""The cases of the discovery study, and what came of each: one row of figures per case."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any

import numpy as np
from bench_package import hidden_bench

import heatrun.runtime  # noqa: F401  (settings of JAX before its first use)
from heatrun.bench.blocks import Blocks
from heatrun.bench.record import Record
from heatrun.bench.reduction import reduce
from heatrun.discovery.engine import Engine, Refit
from heatrun.discovery.folds import rmse
from heatrun.discovery.library import Candidate
from heatrun.discovery.run import Discovery, discover
from heatrun.inference.effect_parameters import EVENT
from heatrun.inference.problem import Problem
from heatrun.motor import Motor

SHOWN = (
    "natural_convection", "speed_cooling", "fan_cooling", "cooling_step", "coolant_sink",
    "ambient_drift", "neighbour_body", "rotor_node", "ac_copper_loss", "iron_loss_in_winding",
    "external_loss", "bearing_friction", "stray_load_loss", "insulation_conductivity",
    "contact_drift", "sensor_lag", "sensor_contact", "time_shift",
)  # fmt: skip
"""Effects that the study's tests can show at some plausible size."""

HARDLY = (
    "radiation", "ambient_recirculation", "end_winding_node", "standby_loss",
    "copper_coefficient", "winding_resistance", "loss_gain", "sensor_gain",
)  # fmt: skip
"""Effects that a refitted network hides on them: under 0.1 K at the edge of their range."""

PAIRS = (
    ("speed_cooling", "sensor_lag"), ("ac_copper_loss", "neighbour_body"),
    ("iron_loss_in_winding", "ambient_drift"), ("external_loss", "sensor_lag"),
    ("cooling_step", "insulation_conductivity"), ("speed_cooling", "ac_copper_loss"),
    ("coolant_sink", "ac_copper_loss"), ("rotor_node", "time_shift"),
)  # fmt: skip

SINGLE = ("speed_cooling", "ac_copper_loss", "iron_loss_in_winding", "standby_loss")


def jobs(first_seed: int, num_motors: int, num_clean: int) -> list[dict[str, Any]]:
    """Return all cases of a study by seed."""
    bench = hidden_bench()
    rows: list[dict[str, Any]] = []

    def add(group: str, hidden: tuple[str, ...], kind: str = "two_tests") -> None:
        rows.append({"group": group, "hidden": hidden, "kind": kind})

    for _ in range(num_clean):
        add("clean", ())
    for _ in range(num_motors):
        for effect in SHOWN:
            add("effect", (effect,))
    for effect in HARDLY:
        add("hardly visible", (effect,))
    for pair in PAIRS:
        add("pair", pair)
    for _ in range(max(1, num_motors)):
        for cause in bench.UNKNOWN_IDS:
            add("unknown", (cause,))
    for effect in SINGLE:
        add("single step", (effect,), "single_step")
    return [{**row, "seed": first_seed + i} for i, row in enumerate(rows)]


def reduced(case: Any) -> tuple[Motor, list[tuple[Blocks, str]]]:
    """Return the motor and the reduced records of a case."""
    motor = Motor(
        "study",
        phase_resistance_ohm=case.machine.phase_resistance_ohm,
        losses=case.losses,
        rated_speed_rpm=case.machine.rated_speed_rpm,
    )
    return motor, [(reduce(Record(t.name, t.columns), motor), t.role) for t in case.tests]


def run(job: dict[str, Any]) -> dict[str, Any]:
    """Run one case and return its row."""
    case = hidden_bench().make_case(job["hidden"], job["seed"], kind=job["kind"])
    motor, tests = reduced(case)
    begin = time.perf_counter()
    found = discover(motor, [test for test, role in tests if role == "calibration"])
    seconds = time.perf_counter() - begin
    named = [
        {
            "id": each.rival.candidate.id,
            "equivalents": [candidate.id for candidate in each.equivalents],
            "probability": each.probability,
            "familywise_p": next(
                r.familywise_p for r in found.growth.rounds if r.accepted is each.rival
            ),
        }
        for each in found.named
    ]
    return {
        **job,
        "misfit_K": case.visible_misfit_K,
        "is_visible": case.is_visible,
        "resolution_K": case.resolution_K,
        "losses": case.losses,
        "verdict": found.verdict.word,
        "named": named,
        "first_p": found.growth.rounds[0].familywise_p,
        "excess": found.after.excess,
        "correlation_s": found.after.correlation_s,
        "left_K": found.after.misfit_K,
        "noise_K": found.after.noise_K,
        "nodes": list(found.where_before.node),
        "next_test": None if found.next_test is None else found.next_test.what,
        "held_out": held_out(found, case, motor, tests),
        "stages_s": found.seconds,
        "seconds": seconds,
    }


def held_out(
    found: Discovery, case: Any, motor: Motor, tests: list[tuple[Blocks, str]]
) -> dict[str, float] | None:
    """Return errors on the held-out test: network alone, found model, true structure [K]."""
    test = next((t for t, role in tests if role == "holdout"), None)
    if test is None or not case.hidden:
        return None
    result = {
        "before_K": _predicted(found.engine, found.growth.base, motor, test),
        "found_K": _predicted(found.engine, found.final, motor, test),
    }
    true = _true_structure(found, case.hidden)
    if true is not None:
        result["true_K"] = _predicted(found.engine, true, motor, test)
    return result


def _true_structure(found: Discovery, hidden: tuple[str, ...]) -> Refit | None:
    """Return the fit of the model with just the hidden effects, None if they are not all known."""
    engine = found.engine
    free, z = list(found.growth.base.free), found.growth.base.z.copy()
    for effect in hidden:
        kind = engine.kinds.get(effect)
        if kind is None:
            return None
        candidate = Candidate(kind, 0 if kind.card.family == EVENT else None)
        scores = [s for s in found.growth.rounds[0].scores if s.candidate == candidate]
        if not scores:
            return None
        for slot, value in scores[0].start.items():
            z[slot] = value
            free.append(slot)
    return engine.refit(z, free, found.final.noise)


def _predicted(engine: Engine, fit: Refit, motor: Motor, test: Blocks) -> float:
    """Return the error on a test that was not fitted; only its start temperatures are [K]."""
    problem = Problem.of(engine.problem.model, motor, [replace(test, name="held out")])
    trial = Engine(problem)
    z = np.zeros(len(trial.slots))
    for position, slot in enumerate(trial.slots):
        at = engine.find(slot.parameter.name) if slot.test is None else None
        if at is not None:
            z[position] = fit.z[at]
    starts = [i for i, slot in enumerate(trial.slots) if slot.parameter.role == "start"]
    return rmse(trial.refit(z, starts, fit.noise).residual[trial.is_observed])
