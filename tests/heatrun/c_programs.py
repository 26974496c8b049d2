"""The C of an export, compiled with a harness, and a simulated machine that drives its observer."""

import shutil
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from run_near_truth import TRUTH
from scipy.signal import lfilter

from heatrun.export import mat_bytes, network_variables
from heatrun.export.c_file import CSource
from heatrun.export.missed import Missed
from heatrun.export.network_course import read_network
from heatrun.model.catalogue import effects_named
from heatrun.model.model import Model
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_record
from heatrun.record.record import Record

DATA = Path(__file__).parents[2] / "data" / "synthetic"
MACHINE = load_motor(DATA / "motor.toml")
COMPILER = shutil.which("gcc") or shutil.which("cc")
needs_compiler = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-pedantic", "-O1"]
in_both_precisions = pytest.mark.parametrize(
    "words", [(), ("-DHEATRUN_REAL=float",)], ids=["double", "float"]
)
MISSED = Missed(
    heat=0.01, heat_s=1200.0, slow_K=0.2, slow_s=60.0, white_K=0.03, sensor_K=0.0, sink_K=0.0,
    share=0.0, resolution_K=0.0,
)  # fmt: skip
SAID = {"run": "run", "sha256": "0" * 64, "machine": "bench", "network": "second order",
        "corrections": "by nothing"}  # fmt: skip
VALUES = TRUTH | {
    "Ceq": 12500.0, "Req": 0.132, "Tw_start": 60.4, "Tsr_start": 55.8,
    "speed_cooling.g": 0.9, "speed_cooling.m": 0.73, "radiation.eA": 0.1,
}  # fmt: skip
LEAD_OHM = 0.0004


@cache
def half_hour():
    """The bundled duty's first half hour, with a fan, a coolant, and a locked rotor for a while."""
    record = read_record(DATA / "duty_30min.csv.gz", MACHINE)
    waves = 0.5 + 0.5 * np.sin(record.time_s / 200.0)
    further = {"fan": waves, "coolant_degC": 30.0 + 5.0 * waves}
    turns = (record.time_s < 300.0) | (record.time_s > 500.0)
    further["speed_rpm"] = np.where(turns, record["speed_rpm"], 0.0)
    return Record(record.name, {**record.channels, **further})


def source(network="second", effects=(), *, record=None, losses="balance", said=SAID, step=1.0,
           **values):  # fmt: skip
    """Return the C of the reference machine with a network and effects, their values typical."""
    machine = replace(MACHINE, losses=losses)
    model = Model.of(network, machine, effects_named(effects, "test"))
    centres = {each.name: each.centre for each in model.form.parameters}
    centres |= {name: 40.0 for _, name in model.form.starts}
    centres |= {
        f"{kind.card.id}.{name}": quantity.typical
        for kind in model.effects for name, quantity in kind.card.parameters.items()
    }  # fmt: skip
    variables, _ = network_variables(
        record or half_hour(), {**centres, **VALUES, **values}, machine, model,
        rated_speed=300.0, rated_current=100.0,
    )  # fmt: skip
    cold = (VALUES["Rs0"], LEAD_OHM)
    return CSource.of(read_network(mat_bytes(variables)), MISSED, said, step, cold)


BUILT = {}
"""Programs by what they were compiled of: each is compiled once."""


def written(folder, made):
    folder.mkdir(exist_ok=True)
    for name, text in made.texts().items():
        (folder / name).write_bytes(text)
    return folder


def build(folder, made, *words, harness="main.c"):
    written(folder, made)
    sources = ("thermal_network.h", "thermal_network.c", harness)
    key = (*words, *((folder / name).read_bytes() for name in sources))
    if key not in BUILT:
        program = folder / f"replay_{len(BUILT)}"  # the others stay
        command = [str(COMPILER), *STRICT, *words, "-o", program, harness, "thermal_network.c"]
        status, said = checked(folder, *command)
        assert status == 0, said
        BUILT[key] = program
    return BUILT[key]


def checked(folder, *command):
    """Return the status of a command in a folder, and all that it says."""
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False)
    return done.returncode, done.stdout + done.stderr


def observed(folder, made, start, sd, rows, *words):
    """Return temperatures, standard deviations, each (step, node), status, sensor, (step,)."""
    shutil.copy(Path(__file__).with_name("observe.c"), folder)
    return run_observer(build(folder, made, *words, harness="observe.c"), start, sd, rows)


def run_observer(program, start, sd, rows):
    done = subprocess.run([program, str(start), str(sd)], input=np.asarray(rows, float).tobytes(),
                          capture_output=True, check=False)  # fmt: skip
    assert done.returncode == 0
    found = np.frombuffer(done.stdout).reshape(len(rows), -1)
    return found[:, 0:-2:2], found[:, 1:-2:2], found[:, -2], found[:, -1]


def hidden_machine(seed, num=3600, eA=0.0):
    """A two-node machine with heat that the network misses, by Euler steps of 0.1 s.

    Returns:
        Temperatures (step, node), rows of current, losses, sink and reading (step, 4).
    """
    drawn = np.random.default_rng(seed).standard_normal((num, 4))
    missed = lfilter([0.01 * 625.0 * np.sqrt(1 - np.exp(-2 / 1200.0))],
                     [1.0, -np.exp(-1 / 1200.0)], drawn[:, :2], axis=0).tolist()  # fmt: skip
    noise = lfilter([0.2 * np.sqrt(1 - np.exp(-2 / 60.0))], [1.0, -np.exp(-1 / 60.0)], drawn[:, 2])
    Cw, Csr, Rw, Rsr, Rs0 = (VALUES[n] for n in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr", "Rs0"))
    k, T, Tsr, course, loads = 3 * Rs0 / (234.5 + 25.0), 60.0, 55.0, [], []
    for second in range(num):
        loads.append((220.0, 1100.0) if (second // 900) % 2 == 0 else (60.0, 150.0))
        current, loss = loads[-1]
        for _ in range(10):
            copper, across = k * current**2 * (234.5 + T), (T - Tsr) / Rw
            out = (Tsr - 20.0) / Rsr
            out += 5.67e-8 * eA * ((Tsr + 273.15) ** 4 - 293.15**4)
            T += 0.1 * (copper - across + missed[second][0]) / Cw
            Tsr += 0.1 * (loss - copper + across - out + missed[second][1]) / Csr
        course.append((T, Tsr))
    course = np.array(course)
    reading = course[:, 0] + noise + 0.13 * drawn[:, 3]
    return course, np.column_stack((loads, np.full(num, 20.0), reading))


def through_a_lag(course, lag_s):
    """Return what a sensor shows that follows a course, each second, by steps of 10 ms."""
    fine = np.interp(np.arange(100 * (course.size - 1) + 1) / 100.0, range(course.size), course)
    share = 0.01 / lag_s
    late, _ = lfilter([0.0, share], [1.0, share - 1.0], fine, zi=fine[:1])
    return late[::100]
