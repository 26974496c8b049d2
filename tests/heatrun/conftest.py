"""A calibrated record that the tests of the statistics share."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from heatrun.bench.record import Record
from heatrun.bench.reduction import reduce
from heatrun.inference.fit import fit
from heatrun.inference.model import Model
from heatrun.inference.problem import Problem
from heatrun.motor import Motor

# what several files of tests write stands beside them as a plain script
sys.path.insert(0, str(Path(__file__).parent))

NAMES = {
    "t": "time_s",
    "Is": "phase_current_A",
    "Pd": "losses_W",
    "Te": "ambient_degC",
    "Tw_m": "winding_degC",
    "speed_rpm": "speed_rpm",
}


@pytest.fixture(scope="session")
def motor():
    return Motor("reference", phase_resistance_ohm=0.0062, insulation_class="F")


@pytest.fixture(scope="session")
def truth():
    return {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625}


@pytest.fixture(scope="session")
def bench(generator):
    """Records of the reference motor, made by the independent generator at 1 Hz."""

    def make(profile, seed, name="duty", **instruments):
        machine = generator.reference_motor()
        truth = generator.simulate(machine, profile, sample_s=1.0, steps_per_sample=20)
        rng = np.random.default_rng(seed)
        columns = generator.measure(truth, rng, generator.Instruments(**instruments))
        return Record(name, {NAMES[key]: np.asarray(v) for key, v in columns.items()})

    return make


@pytest.fixture(scope="session")
def duty(bench, generator):
    return bench(generator.duty(3600.0), seed=11)


@pytest.fixture(scope="session")
def blocks(duty, motor):
    return reduce(duty, motor)


@pytest.fixture(scope="session")
def fitted(blocks, motor):
    return fit(Problem.of(Model.of("second", motor), motor, [blocks]))
