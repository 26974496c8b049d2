"""The cases of the study of shut-downs: a machine, its bench, and the command's answer."""

from __future__ import annotations

import contextlib
import io
import json
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from shutdown_machines import machine

from heatrun import cli

MOTOR = """[motor]
name = "machine {seed}"
insulation_class = "F"
[winding]
measured_resistance_ohm = {cold:.9g}
reference_temperature_degC = {cold_degC:.4f}
lead_resistance_ohm = {leads:.6g}
[constants]
ambient_degC = {sink:.2f}
[shutdown]
cold_resistance_sd = {cold_sd:g}
cold_temperature_sd_K = {cold_degC_sd:g}
coefficient_sd_degC = 0.5
sink_sd_K = 0.5
moment_sd_s = {moment_sd:g}
{more}"""


def bench(seed: int, delay_s: float, kind: str) -> dict[str, Any]:
    """Return the truth and what the bench wrote: motor file, readings, temperature at switch-off.

    Args:
        seed: Random seed.
        delay_s: Until the first reading.
        kind: `"bridge"` for resistances, `"sensor"` for a sensor with a lag.
    """
    random = np.random.default_rng(seed)
    made = machine(random)
    step, minutes = random.choice([5.0, 10.0, 15.0, 30.0]), random.uniform(4.0, 10.0)
    stated_s = delay_s + np.arange(0.0, 60.0 * minutes, step)
    moment_sd = random.choice([0.2, 0.5])
    true_s = stated_s + random.normal(0.0, moment_sd)
    fine_s = np.arange(0.0, true_s[-1] + 5.0, 0.5)
    shutdown_degC, fine_degC = made.cooled(fine_s)
    jitter = random.normal(0.0, 0.15, true_s.size)  # by hand, or by a logger's slow range
    winding = np.interp(true_s + jitter, fine_s, fine_degC)
    sink = made.ambient_degC + random.normal(0.0, 0.5)
    cold_sd, cold_degC_sd = 0.001, 0.1
    said = {"seed": seed, "sink": sink, "cold_sd": cold_sd, "cold_degC_sd": cold_degC_sd,
            "moment_sd": moment_sd, "cold": 1.0, "cold_degC": 20.0, "leads": 0.0}  # fmt: skip
    if kind == "sensor":
        lag = random.uniform(2.0, 15.0)
        shown = np.empty(fine_s.size)
        shown[0] = shutdown_degC
        for k in range(1, fine_s.size):
            target = 0.5 * (fine_degC[k - 1] + fine_degC[k])
            shown[k] = target + (shown[k - 1] - target) * np.exp(-0.5 / lag)
        offset = random.normal(0.0, 0.3)
        read = np.interp(true_s, fine_s, shown) + offset + random.normal(0.0, 0.05, true_s.size)
        stated_lag = lag * random.lognormal(0.0, 0.4)
        more = f"run_down_s = {made.run_down_s:.3g}\nsensor_lag_s = {stated_lag:.3g}\n"
        more += "sensor_sd_K = 0.3\n"
        lines = ["time_s,winding_degC", *(
            f"{t:.1f},{T:.2f}" for t, T in zip(stated_s, read, strict=True))]  # fmt: skip
    else:
        ohm_20 = 10.0 ** random.uniform(-2.5, 1.0)
        cold_degC = made.ambient_degC + random.normal(0.0, 0.5)
        leads = ohm_20 * (random.uniform(0.002, 0.02) if random.random() < 0.3 else 0.0)
        said["leads"] = leads * (1.0 + random.normal(0.0, 0.1)) if leads else 0.0
        factor = ohm_20 / (made.B + 20.0)
        cold = factor * (made.B + cold_degC) + leads
        said["cold"] = cold * (1.0 + random.normal(0.0, cold_sd))
        said["cold_degC"] = cold_degC + random.normal(0.0, cold_degC_sd)
        noise = 10.0 ** random.uniform(-4.3, -3.2)  # 0.05 to 0.6 per mille: 0.02 to 0.2 K
        ohm = (factor * (made.B + winding) + leads) * (1 + random.normal(0.0, noise, winding.size))
        more = "lead_sd = 0.1\n"
        if random.random() < 0.5:
            more += f"run_down_s = {made.run_down_s:.3g}\n"
        lines = ["time_s,R [mOhm]", *(
            f"{t:.1f},{1000.0 * R:.6g}" for t, R in zip(stated_s, ohm, strict=True))]  # fmt: skip
    return {
        "truth": shutdown_degC,
        "motor": MOTOR.format(**said, more=more),
        "readings": "\n".join(lines) + "\n",
        "first_degC": float(fine_degC[int(2 * delay_s)]),
    }


def run(job: dict[str, Any]) -> dict[str, Any]:
    """Return the row of a case: what the command wrote, beside the truth."""
    made = bench(job["seed"], job["delay_s"], job["kind"])
    began = time.process_time()  # other jobs may share the cores
    code, said = answer(made)
    row = {**job, "truth": made["truth"], "code": code,
           "seconds": round(time.process_time() - began, 3)}  # fmt: skip
    if said is None:
        return row
    keys = ("winding_degC", "winding_95_degC", "standard_uncertainty_K", "gum_uncertainty_K",
            "extrapolation_95_K", "is_determinable", "latest_first_reading_s")  # fmt: skip
    row |= {key: said[key] for key in keys}
    row["lost_K"] = made["truth"] - made["first_degC"]
    row["by_hand"] = {one["method"]: one["degC"] for one in said["by_hand"]}
    latest = said["latest_first_reading_s"]
    if not said["is_determinable"] and latest is not None:
        _, sooner = answer(bench(job["seed"], latest, job["kind"]))
        row["sooner_extrapolation_95_K"] = None if sooner is None else sooner["extrapolation_95_K"]
    return row


def answer(made: dict[str, Any]) -> tuple[int, dict[str, Any] | None]:
    """Return the exit code of the command, and what stands in the file that it wrote."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "motor.toml").write_text(made["motor"], encoding="utf-8")
        (folder / "readings.csv").write_text(made["readings"], encoding="utf-8")
        words = ["shutdown", f"{folder}/motor.toml", f"{folder}/readings.csv", "--out",
                 f"{folder}/out"]  # fmt: skip
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
            code = cli.main(words)
        out = folder / "out" / "shutdown.json"
        return code, json.loads(out.read_text(encoding="utf-8")) if out.exists() else None
