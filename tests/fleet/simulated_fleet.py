"""A small fleet on disk: two-node machines under load steps, integrated sample by sample.

Its truth is independent of lptn: plain Python sums over the samples, Euler steps of one second.
"""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from heatrun_fleet.cluster import Workers
from heatrun_fleet.fleet_file import Batch, batches_of, digests_of, load_fleet, numerics
from heatrun_fleet.job import calibrate_fleet_into

MOTOR = """[motor]
name = "line 3"
insulation_class = "F"
[winding]
phase_resistance_ohm = 0.0062
reference_temperature_degC = 25.0
"""

TRUTH = {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625}
"""Centre of the type: J/K, J/K, K/W, K/W."""

SPREAD = 0.05
"""Standard deviation of the logarithm from machine to machine [1]."""


def machine_of(number: int) -> dict[str, float]:
    """The parameters of a machine of the type, by its number."""
    rng = np.random.default_rng([17, number])
    return {name: v * math.exp(SPREAD * rng.standard_normal()) for name, v in TRUTH.items()}


def bench_file(truth: dict[str, float], seed: int, minutes: float = 40.0) -> str:
    """A test as CSV: time, current, losses, ambient, winding."""
    rng = np.random.default_rng(seed)
    currents = rng.uniform(60.0, 170.0, 8)
    winding = stator = 22.0
    lines = ["t,Is,Pd,Te,Tw_m"]
    num = round(minutes * 60.0)
    for second in range(num):
        current = 0.0 if second < 20 else currents[min(second * 8 // num, 7)]
        copper = 3.0 * 0.0062 * (234.5 + winding) / 259.5 * current**2
        other = 250.0 if current else 0.0
        read = winding + 0.1 * rng.standard_normal()
        if second % 2 == 0:
            lines.append(f"{second},{current:.2f},{copper + other:.1f},22.0,{read:.2f}")
        flow = (winding - stator) / truth["Req_w"]
        winding += (copper - flow) / truth["Ceq_w"]
        stator += (other + flow - (stator - 22.0) / truth["Req_sr"]) / truth["Ceq_sr"]
    return "\n".join(lines) + "\n"


def write_fleet(folder: Path, num: int = 6, minutes: float = 20.0) -> list[str]:
    """Write motor file, tests and a manifest of `num` machines; return the machines' names."""
    (folder / "tests").mkdir(parents=True)
    (folder / "motor.toml").write_text(MOTOR)
    names = [f"M{number:03d}" for number in range(num)]
    rows = ["machine,type,test,supplier,date"]
    for number, name in enumerate(names):
        truth = machine_of(number)
        file = f"tests/{name}.csv"
        (folder / file).write_text(bench_file(truth, number, minutes))
        supplier = "north" if number % 2 else "south"
        rows.append(f"{name},A,{file},{supplier},2026-03-{1 + number % 28:02d}")
    write_manifest(folder, rows)
    (folder / "FLEET.toml").write_text(
        '[fleet]\nname = "line 3"\nmotor = "motor.toml"\nmanifest = "machines.csv"\n'
    )
    return names


def planned(
    folder: Path, size: int = 2, *, file: str = "FLEET.toml", model=None, seed: int = 0, **said
) -> list[Batch]:
    """Return the batches of a fleet on disk; what is said more is of the numerics."""
    fleet = load_fleet(folder / file, model)
    return list(batches_of(fleet, digests_of(fleet), size, seed=seed, numerics=numerics(**said)))


def calibrated(folder: Path, out: Path, **settings):
    """Calibrate a fleet on disk, by this process unless told otherwise."""
    settings = {"workers": Workers(0), "batch": 2, **settings}
    return calibrate_fleet_into(out, load_fleet(folder / "FLEET.toml"), **settings)


def write_manifest(folder: Path, rows: Sequence[str]) -> None:
    (folder / "machines.csv").write_text("\n".join(rows) + "\n")
