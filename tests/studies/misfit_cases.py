"""The cases of the study of misfit, and what `heatrun calibrate` made of each.

One cause that the network does not have, mild enough to pass for noise, in one test of 90 minutes
or in two of two hours.
Each case is written as CSV files and a motor file, goes through the command, and is read back from
its run folder.
"""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from bench_package import hidden_bench, write_motor
from study_runs import command, temporary

PARAMETERS = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")

KINDS: dict[str, dict[str, Any]] = {
    "nothing": {},
    "sensor_lag": {"amplitude": 0.5},
    "natural_convection": {"target_K": 0.09},
    "speed_cooling": {"target_K": 0.10},
    "rotor_node": {"target_K": 0.12},
    "ambient_drift": {"amplitude": 0.42},
    "time_shift": {"amplitude": 0.1},
    **{cause: {"target_K": 0.12} for cause in (
        "external_loss", "neighbour_body", "ac_copper_loss", "iron_loss_in_winding",
        "insulation_conductivity", "radiation", "fan_cooling", "cooling_step", "coolant_sink",
        "end_winding_node", "bearing_friction", "stray_load_loss", "contact_drift",
        "sensor_contact",
    )},
    "standby_loss": {"amplitude": 0.3},
    "ambient_recirculation": {"amplitude": 0.2},
    **{f"unknown:{cause}": {"target_K": 0.15}
       for cause in ("heat_step", "periodic_source", "thermostat", "sensor_wander")},
    "loss_gain": {"amplitude": 0.3},
    "sensor_gain": {"amplitude": 0.6},
    "winding_resistance": {"amplitude": 0.06},
    "copper_coefficient": {"amplitude": -0.68},
    "current scale 3 %": {},
    "torque offset 0.2 %": {},
}  # fmt: skip
"""What is hidden, by amplitude (lag of 20 s, drift of 3 K in 90 minutes, clocks 5 s apart, losses
3 %, rise 1.5 % and resistance 3 % off, aluminium taken for copper) or by its visible misfit [K]."""

IN_TWO_TESTS = ("nothing", "natural_convection", "speed_cooling", "rotor_node", "ambient_drift",
                "time_shift")  # fmt: skip
"""Kinds that are also looked at in a staircase and a drive cycle of two hours each."""

BY_HAND = ("current scale 3 %", "torque offset 0.2 %")

OF_AN_INSTRUMENT = ("loss_gain", "sensor_gain", "winding_resistance", "copper_coefficient",
                    *BY_HAND)  # fmt: skip
"""Errors of instruments and of the motor file: two or three times what they are declared to be."""

WOULD_TELL = {
    "current scale 3 %": "a second transducer, or voltage and current at standstill",
    "torque offset 0.2 %": "the torque read with the coupling open, before and after",
    "loss_gain": "a loss measurement of another kind at one load, or direct current at standstill",
    "sensor_gain": "the sensor in a bath, or the resistance method at the hot end",
    "winding_resistance": "four-wire resistance at a known temperature",
    "copper_coefficient": "the resistance, cold and hot",
    "standby_loss": "a spell with the inverter on and no current",
    "ambient_recirculation": "a second sensor of the air, farther away",
}
"""Measurement that would show what one test of this kind cannot."""

REDEFINES = dict.fromkeys(("natural_convection", "speed_cooling", "radiation", "fan_cooling",
                           "cooling_step", "ambient_recirculation"), "Req_sr") | dict.fromkeys(
    ("insulation_conductivity", "contact_drift"), "Req_w")  # fmt: skip
"""Parameter that has another meaning under an effect: there is no one true value of it."""

REFERENCES = 2
"""Machines for each cause that are also calibrated with the effect that is hidden in them."""

POWER = 15.0
"""Shaft power over the other losses at rated load [1], for the offset of a torque transducer."""


def jobs(first_seed: int, repeats: int, num_clean: int) -> list[dict[str, Any]]:
    kinds = [(kind, n, "duty") for kind in KINDS if kind != "nothing" for n in range(repeats)]
    kinds += [("nothing", REFERENCES, "duty")] * num_clean
    kinds += [(kind, REFERENCES, "two_tests") for kind in IN_TWO_TESTS for _ in range(repeats)]
    rows = [
        {"kind": kind, "seed": first_seed + place, "with_truth": number < REFERENCES,
         "tests": tests}
        for place, (kind, number, tests) in enumerate(kinds)
    ]  # fmt: skip
    return [rows[place] for place in np.random.default_rng(first_seed).permutation(len(rows))]


def is_in_machine(kind: str) -> bool:
    return kind != "nothing" and kind not in OF_AN_INSTRUMENT


def run(job: dict[str, Any]) -> dict[str, Any]:
    kind = job["kind"]
    hidden = () if kind in ("nothing", *BY_HAND) else (kind,)
    case = hidden_bench().make_case(
        hidden, job["seed"], kind=job["tests"], resolution_K=0.1, **KINDS[kind]
    )
    with temporary() as folder:
        arguments = write_bench(case, folder, kind)
        begin = time.process_time()
        code, said = command(arguments)
        row = {**job, "exit_code": code, "processor_s": time.process_time() - begin}
        if code != 0:
            return {**row, "failure": said[-800:]}
        row |= {"visible_K": case.visible_misfit_K, **described(folder / "run", case)}
        if job["with_truth"] and is_in_machine(kind) and ":" not in kind:
            arguments[-1] = str(folder / "reference")
            code, said = command([*arguments, "--with", kind])
            row["failure_with_truth"] = "" if code == 0 else said[-800:]
            known = described(folder / "reference", case) if code == 0 else {}
            row["interval_95_with_truth"] = known.get("interval_95")
        return row


def write_bench(case: Any, folder: Path, kind: str) -> list[str]:
    machine = case.machine
    write_motor(case, folder)
    paths = []
    for test in case.tests:
        table = pd.DataFrame(test.columns).iloc[::2]  # a logger at 1 Hz
        if kind == "current scale 3 %":
            table["phase_current_A"] *= 1.03
        if kind == "torque offset 0.2 %":
            rated = POWER * (machine.hysteresis_W + machine.eddy_W + machine.stray_W)
            table["losses_W"] += 0.002 * rated * table["speed_rpm"] / machine.rated_speed_rpm
        paths.append(folder / f"{test.name}.csv")
        table.to_csv(paths[-1], index=False, float_format="%.6g")
    return [
        "calibrate", str(folder / "motor.toml"), *map(str, paths[:-1]),
        "--holdout", str(paths[-1]),
        "--model", "second", "--quick", "--out", str(folder / "run"),
    ]  # fmt: skip


def described(folder: Path, case: Any) -> dict[str, Any]:
    import heatrun
    from heatrun.results.values import known
    from heatrun.runs.verdict import headline

    run = heatrun.open_run(folder)
    model = run.result.models["second"]
    entries = {name: model.parameters[name] for name in PARAMETERS}
    held_out = next(row for row in model.residuals if row.role == "holdout")
    return {
        "truth": {name: getattr(case.machine, name) for name in PARAMETERS},
        "value": {name: entry.value for name, entry in entries.items()},
        "sd": {name: entry.sd for name, entry in entries.items()},
        "interval_95": {name: list(entry.interval_95) for name, entry in entries.items()},
        "use": headline(run.result).use,
        "has": [effect.id for effect in model.effects],
        "maybe": {row.id: row.probability for row in known(model.maybe_missing) or ()},
        "rmse_K": max(r.rmse_K for r in model.residuals if r.role == "calibration"),
        "holdout_rmse_K": held_out.rmse_K,
        "holdout_coverage_95": held_out.coverage_95,
        "findings": [[f.id, f.message] for f in run.result.findings if f.severity == "warning"],
    }
