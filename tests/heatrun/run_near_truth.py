"""A run folder whose posterior lies closely around the truth of the generator's machine."""

import hashlib
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import xarray

from heatrun.model.model import Model
from heatrun.model.model_parameters import parameters
from heatrun.record.motor import Motor, ParameterOverride
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from heatrun.results.values import to_plain
from heatrun.runs.machine import tested
from heatrun.runs.run import ModelOfRun, model_text
from heatrun.runs.write import motor_text
from lptn.effects import AbstractEffect

TRUTH = {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625, "Rs0": 0.0062}
INSTRUMENTS = ("current_gain", "power_gain", "sensor_gain", "sensor_offset", "ambient_offset")
NUM_DRAWS = 500
UNITS = {"Ce": "J/K", "Re": "K/W", "Rs": "ohm"}
"""By the first letters of a parameter."""

FITTED = "a"
"""Stands for the SHA-256 of the file that the run was calibrated on."""


def seal(folder: Path) -> None:
    """List the files of a run with their digests, as a finished run does."""
    files = {p.name: hashlib.sha256(p.read_bytes()).hexdigest() for p in folder.glob("*.*")
             if p.name != "manifest.json"}  # fmt: skip
    inputs = [{"path": "motor.toml", "sha256": "of the motor"}, {"path": "a.csv", "sha256": FITTED}]
    manifest = {"files": files, "inputs": inputs}
    (folder / "manifest.json").write_text(json.dumps(manifest), encoding="utf-8")


def run_near_truth(
    folder: Path,
    motor: Motor,
    test: Record,
    *,
    others: dict[str, float] | None = None,
    seed: int = 6,
    effects: tuple[type[AbstractEffect], ...] = (),
) -> Path:
    """Write a run in the form of a calibration on a test called `duty`."""
    folder.mkdir()
    rng = np.random.default_rng(seed)
    truth = TRUTH | (others or {})
    around = {**truth, "noise_sd": 0.2, "noise_time": 200.0, "noise_white": 0.02}
    draws = {
        name: (("chain", "draw"), value * (1.0 + 0.005 * rng.normal(size=(1, NUM_DRAWS))))
        for name, value in around.items()
    }
    result = json.loads((Path(__file__).parents[1] / "stored" / "fit-1.json").read_text())
    result["motor"] |= {"name": "reference", "path": "motor.toml", "sha256": "of the motor"}
    second = result["models"]["second"]
    entry = second["parameters"]["Ceq_w"]
    second["parameters"] = {
        n: {
            **entry,
            "value": value,
            "unit": UNITS.get(n[:2], "1"),
            "interval_95": [float(end) for end in np.quantile(draws[n][1], [0.025, 0.975])],
        }
        for n, value in truth.items()
    }
    second["nuisances"] = {n: {**entry, "value": 0.0, "fixed": True} for n in INSTRUMENTS}
    described = {"name": "duty", "path": "a.csv", "sha256": FITTED, "role": "calibration"}
    tests = [{**result["tests"][0], **described}]
    blocks = replace(reduce(test, motor), name="duty")
    second["load"] = to_plain(tested([blocks]).load)
    result |= {"models": {"second": second}, "tests": tests}
    (folder / "fit.json").write_text(json.dumps(result), encoding="utf-8")
    certain = {name: ParameterOverride(fixed=0.0) for name in (*INSTRUMENTS, "load_timing")}
    model = Model.of("second", motor, effects)
    known = parameters(model, replace(motor, parameters=certain), [blocks])
    text = model_text(ModelOfRun(model, known))
    (folder / "model_second.toml").write_bytes(text)
    (folder / "motor.toml").write_bytes(motor_text(motor))
    heat = 0.0015 * np.exp(0.2 * np.random.default_rng(7).normal(size=(1, NUM_DRAWS)))
    draws["unmodelled_heat"] = (("chain", "draw"), heat)
    starts = 20.0 + 0.2 * rng.normal(size=(2, 1, NUM_DRAWS, 1))
    for name, start in zip(("Tw_start", "Tsr_start"), starts, strict=True):
        draws[name] = (("chain", "draw", "test"), start)
    xarray.Dataset(draws).to_netcdf(
        folder / "posterior_second.nc", group="posterior", engine="h5netcdf"
    )
    seal(folder)
    return folder
