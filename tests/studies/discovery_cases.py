"""The cases of the discovery study, and what the command made of each: one row of figures per case.

Each case is written to disk as a bench would leave it (CSV files and a motor file), goes through
`heatrun discover` down to its run folder, and is read back from `discovery.json`.
"""

import json
import time
from functools import partial
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from bench_package import hidden_bench, write_motor
from study_runs import command, temporary

SHOWN = (
    "natural_convection", "speed_cooling", "fan_cooling", "cooling_step", "coolant_sink",
    "ambient_drift", "neighbour_body", "rotor_node", "ac_copper_loss", "iron_loss_in_winding",
    "external_loss", "bearing_friction", "stray_load_loss", "insulation_conductivity",
    "contact_drift", "sensor_lag", "sensor_contact", "sensor_pickup", "time_shift",
)  # fmt: skip
"""Effects that the study's tests can show at some plausible size."""

PAIRS = (
    ("speed_cooling", "sensor_lag"), ("ac_copper_loss", "neighbour_body"),
    ("iron_loss_in_winding", "ambient_drift"), ("cooling_step", "insulation_conductivity"),
)  # fmt: skip

IN_ONE_TEST = ("speed_cooling", "ambient_drift", "sensor_lag")
"""Causes that act in the second test alone: the catalogue has them for all tests only."""

ONE_NODE = ((), (), (), (), ("speed_cooling",), ("bearing_friction",), ("sensor_lag",))
"""What is hidden in machines that are looked at from the first order, beside the winding."""

TRACES = (("natural_convection", 0.10), ("radiation", 0.10))
"""Effects with the misfit that they are given [K]: real, and too small to matter."""

BLOCK_S = 30.0
"""Means over which the noise of the held-out reading is taken [s], as the fit takes them."""

MOST_STEPS, NUM_DRAWS = 250, 100
"""Steps after which emcee is ended where weighted draws do not hold, and draws behind a prediction:
names, verdicts and medians of predictions are looked at here, not intervals."""


def jobs(
    first_seed: int, repeats: int, num_clean: int, num_unknown: int, num_pairs: int
) -> list[dict[str, Any]]:
    """Return all cases of a study in the order in which they are run, which is by chance.

    The gates for clean machines, unknown causes and pairs of effects need the most cases to have
    power; these have counts of their own.
    """
    rows: list[dict[str, Any]] = []

    def add(group: str, hidden: tuple[str, ...], **more: Any) -> None:
        row = {"group": group, "hidden": hidden, "order": "second", "only_test": None,
               "target_K": None}  # fmt: skip
        rows.append({**row, **more})

    for _ in range(num_clean):
        add("clean", ())
    unknown = hidden_bench().UNKNOWN_IDS
    for place in range(num_unknown):
        add("unknown", (unknown[place % len(unknown)],))
    for place in range(num_pairs):
        add("pair", PAIRS[place % len(PAIRS)])
    for _ in range(repeats):
        for effect in SHOWN:
            add("effect", (effect,))
        add("event", ("cooling_step",), only_test=0)
        add("event", ("cooling_step",), only_test=1)
        for effect in IN_ONE_TEST:
            add("in one test", (effect,), only_test=1)
        for effect, target in TRACES:
            add("trace", (effect,), target_K=target)
        for hidden in ONE_NODE:
            add("one node", hidden, order="first")
        add("one node", ("cooling_step",), order="first", only_test=1)
    seeded = [{**row, "seed": first_seed + place} for place, row in enumerate(rows)]
    order = np.random.default_rng(first_seed).permutation(len(seeded))
    return [seeded[place] for place in order]


def run(job: dict[str, Any]) -> dict[str, Any]:
    case = hidden_bench().make_case(
        job["hidden"], job["seed"], target_K=job["target_K"], only_test=job["only_test"]
    )
    row = {
        **job,
        "misfit_K": case.visible_misfit_K,
        "is_visible": case.is_visible,
        "floor_K": floor(case),
    }
    with temporary() as folder:
        arguments = write_bench(case, folder, job["order"])
        wall, processor = time.perf_counter(), time.process_time()
        with shorter():
            code, said = command(arguments)
        row |= {
            "exit_code": code,
            "failure": "" if code == 0 else said[-800:],
            "seconds": time.perf_counter() - wall,
            "processor_s": time.process_time() - processor,
        }
        written = folder / "run" / "discovery.json"
        result = json.loads(written.read_text(encoding="utf-8")) if written.is_file() else None
    return {**row, **described(result)}


def write_bench(case: Any, folder: Path, order: str) -> list[str]:
    write_motor(case, folder)
    by_role: dict[str, list[str]] = {"calibration": [], "holdout": []}
    for test in case.tests:
        path = folder / f"{test.name}.csv"
        table = pd.DataFrame(test.columns).iloc[::2]  # a logger at 1 Hz
        table.to_csv(path, index=False, float_format="%.6g")
        by_role[test.role].append(str(path))
    return [
        "discover", str(folder / "motor.toml"), *by_role["calibration"],
        "--holdout", *by_role["holdout"], "--model", order, "--quick",
        "--out", str(folder / "run"),
    ]  # fmt: skip


def shorter() -> Any:
    """Return the context in which chains and draws of `heatrun discover` are short."""
    from heatrun.posterior.posterior import sample
    from heatrun.posterior.predict import predict

    return patch.multiple(
        "heatrun.calibration",
        sample=partial(sample, most_steps=MOST_STEPS),
        predict=partial(predict, num_draws=NUM_DRAWS),
    )


def described(result: dict[str, Any] | None) -> dict[str, Any]:
    if result is None:
        return {"verdict": "none", "named": [], "traces": [], "holdout": None, "stages_s": {}}
    rejected = [row["id"] for row in result["candidates"] if "held-out test worse" in row["reason"]]
    return {
        "verdict": result["verdict"],
        "named": [
            {
                "id": effect["id"],
                "test": effect["test"],
                "equivalents": effect["equivalents"],
                "probability": effect["probability"],
                "familywise_p": effect["evidence"]["familywise_p"],
            }
            for effect in result["effects"]
        ],
        "traces": result["traces"],
        "rejected_by_holdout": rejected,
        "noise_K": result["adequacy"]["after"]["noise_K"],
        "left_K": result["adequacy"]["after"]["slow_misfit_K"],
        "excess": result["adequacy"]["after"]["low_frequency_excess"],
        "nodes": result["localisation"]["before"]["nodes"],
        "calibration": result["calibration"],
        "holdout": result["holdout"],
        "stages_s": result["seconds"],
    }


def floor(case: Any) -> float:
    """Return what a perfect model would leave of the held-out test [K]: the sensor's errors.

    Means over blocks less their mean, for a constant offset goes into the fit.
    """
    test = case.tests[-1]
    time_s, errors = test.columns["time_s"], test.columns["winding_degC"] - test.reading
    size = round(BLOCK_S / float(time_s[1] - time_s[0]))
    means = errors[: errors.size // size * size].reshape(-1, size).mean(axis=1)
    return float(np.std(means))
