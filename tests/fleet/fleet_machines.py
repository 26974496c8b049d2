"""Machines of a simulated fleet, by the bench of `data/synthetic`, which is independent code."""

import numpy as np

from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce

NAMES = {
    "t": "time_s", "Is": "phase_current_A", "Pd": "losses_W", "Te": "ambient_degC",
    "Tw_m": "winding_degC", "speed_rpm": "speed_rpm",
}  # fmt: skip


def bench_records(generator, seed, profiles, sample_s):
    """Return a random motor and the columns that its bench recorded under some profiles."""
    rng = np.random.default_rng(seed)
    truth = generator.random_motor(rng)
    instruments = generator.Instruments(resolution_K=0.1)
    records = []
    for profile in profiles:
        course = generator.simulate(truth, profile, sample_s=sample_s, steps_per_sample=2)
        columns = generator.measure(course, rng, instruments)
        records.append({name: np.asarray(column) for name, column in columns.items()})
    return truth, records


def machine(generator, seed, profiles, network="second", sample_s=0.5, **motor):
    """Return the problem of a random machine that was tested with some profiles."""
    truth, records = bench_records(generator, seed, profiles, sample_s)
    said = Motor(f"machine {seed}", phase_resistance_ohm=truth.phase_resistance_ohm, **motor)
    tests = []
    for number, columns in enumerate(records):
        channels = {NAMES[name]: column for name, column in columns.items()}
        tests.append(reduce(Record(f"test {number}", channels), said))
    model = Model.of(network, said).scaled(said, tests)
    return Problem.of(model, said, tests)
