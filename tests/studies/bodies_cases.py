"""The cases of the study of measured bodies, and what `heatrun calibrate` made of each.

Loads are staircases, drive cycles, short tests, heaters. Each case is written as CSV files and a
motor file, goes through the command, and is read back from its run folder.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from bodies_machines import (
    SINK,
    Bench,
    Courses,
    Duty,
    Machine,
    Sensor,
    channels,
    drawn_bench,
    drawn_sensor,
    four_nodes,
    losses,
    one_node,
    simulate,
    two_nodes,
    with_housing,
)
from study_runs import command, temporary

KINDS: dict[str, tuple[str, ...]] = {
    "second body": ("as declared", "lag 30 s", "offset 2 K", "housing named stator"),
    "torque gain": ("1 %", "2 %", "5 %", "5 %, as advised"),
    "heat or copper only": ("heater", "coil", "coil with power", "coil with leads"),
    "short test": ("2 min", "9 min"),
    "four nodes": ("tooth and yoke",),
}
"""What is looked at, and its variants."""

ADVISED_SD = 0.05
"""What is written into the motor file of a drive that was refused for a torque 5 % off [1]."""

LEADS_SHARE = 0.35
"""Resistance of the leads, which stay cold, over that of the coil [1]."""

Channels = dict[str, np.ndarray]


@dataclass(frozen=True)
class Case:
    tests: list[Channels]  # Columns of each test; the last is held out if there are two.
    motor: str  # Text of the motor file.
    model: str  # Network that is fitted.
    truth: dict[str, float]  # True values of its parameters.


REST_S = 60.0
"""Rest before a test, so that what was measured at its start is seen."""


def jobs(first_seed: int, repeats: int) -> list[dict[str, Any]]:
    """Return all cases in the order in which they are run, which is by chance."""
    named = [
        (kind, variant)
        for kind, variants in KINDS.items()
        for variant in variants
        for _ in range(-(-repeats // len(variants)))
    ]
    rows = [
        {"kind": kind, "variant": variant, "seed": first_seed + place}
        for place, (kind, variant) in enumerate(named)
    ]
    return [rows[place] for place in np.random.default_rng(first_seed).permutation(len(rows))]


def make(kind: str, variant: str, seed: int) -> Case:
    return MAKERS[kind](variant, np.random.default_rng(seed))


def second_body(variant: str, rng: np.random.Generator) -> Case:
    """Return a machine whose stator, or what is named so, is measured too."""
    machine = two_nodes(rng)
    truth = second_order(machine)
    body = "stator"
    if variant == "housing named stator":
        machine, body = with_housing(machine, rng), "housing"
        del truth["Ceq_sr"]  # of three nodes: there is no one true value of it
    bench, sensor = drawn_bench(rng), drawn_sensor(rng)
    if variant == "lag 30 s":
        sensor = replace(sensor, lag_s=30.0)
    if variant == "offset 2 K":
        sensor = replace(sensor, offset_K=float(rng.choice([-2.0, 2.0])))
    tests = read(machine, (staircase(rng), cycle(rng)), bench, rng, {"stator_degC": (body, sensor)})
    return Case(tests, motor_text(machine, bench), "second", truth)


def torque_gain(variant: str, rng: np.random.Generator) -> Case:
    """Return a drive that motors and generates, with losses from electrical power and torque."""
    machine, bench = two_nodes(rng), drawn_bench(rng)
    gain = 0.01 * float(variant.split()[0]) * rng.choice([-1.0, 1.0])
    shaft = rng.uniform(10.0, 20.0) * machine.watts
    tests = []
    for duty in (both_ways(rng), both_ways(rng, 3600.0)):
        courses = simulated(machine, duty, rng)
        seen = channels(rng, courses, bench)
        rated = machine.rated_rpm * np.pi / 30.0
        torque = shaft / rated * courses.torque
        power = torque * courses.speed_rpm * np.pi / 30.0
        noise = 2e-4 * shaft * rng.standard_normal(power.size) * (courses.current_A > 0.0)
        seen["torque_Nm"] = (1.0 + gain) * torque
        seen["electrical_power_W"] = power + losses(rng, courses, bench) + noise
        tests.append(seen)
    text = motor_text(machine, bench)
    if variant.endswith("as advised"):
        text += f"[parameters.shaft_power_gain]\nsd = {ADVISED_SD}\n"
    return Case(tests, text, "second", second_order(machine))


def heat_or_copper(variant: str, rng: np.random.Generator) -> Case:
    bench = drawn_bench(rng)
    if variant == "heater":
        machine = one_node(rng)
        duties = heated(on_and_off(rng)), heated(on_and_off(rng, 3600.0))
        tests = read(machine, duties, bench, rng)
        for test in tests:
            del test["phase_current_A"], test["speed_rpm"]
        truth = {"Ceq": machine.capacity["block"], "Req": machine.resistance["block", SINK]}
        text = '[motor]\nname = "block"\n[constants]\nphase_current_A = 0\n'
        return Case(tests, text, "first", truth)
    machine = replace(two_nodes(rng, copper_share=1.0), phases=1)
    room = round(rng.uniform(15.0, 30.0), 1)
    tests = []
    for duty in (on_and_off(rng), on_and_off(rng, 3600.0)):
        courses = simulated(machine, duty, rng, room - bench.sink_offset_K)
        seen = channels(rng, courses, bench)
        del seen["ambient_degC"], seen["speed_rpm"]
        if variant != "coil":
            seen["losses_W"] = losses(rng, courses, bench)
        if variant == "coil with leads":
            seen["losses_W"] += LEADS_SHARE * machine.ohm * courses.current_A**2
        tests.append(seen)
    constants = "losses_W = 0" if variant == "coil" else "speed_rpm = 0"
    words = "map" if variant == "coil" else "balance"
    text = motor_text(machine, bench, words) + f"[constants]\nambient_degC = {room}\n{constants}\n"
    return Case(tests, text, "second", second_order(machine))


def short_test(variant: str, rng: np.random.Generator) -> Case:
    machine, bench = two_nodes(rng), drawn_bench(rng)
    tests = read(machine, (short(rng, 60.0 * float(variant.split()[0])),), bench, rng)
    return Case(tests, motor_text(machine, bench), "second", second_order(machine))


def four(variant: str, rng: np.random.Generator) -> Case:
    machine, bench = four_nodes(rng), drawn_bench(rng)
    bodies = {f"{node}_degC": (node, drawn_sensor(rng)) for node in ("tooth", "yoke")}
    tests = read(machine, (staircase(rng), cycle(rng)), bench, rng, bodies)
    truth = {f"Ceq_{node}": value for node, value in machine.capacity.items()}
    for (a, b), value in machine.resistance.items():
        truth[f"Req_{a}_{'ambient' if b == SINK else b}"] = value
    return Case(tests, motor_text(machine, bench), "four", truth)


MAKERS: dict[str, Callable[[str, np.random.Generator], Case]] = {
    "second body": second_body,
    "torque gain": torque_gain,
    "heat or copper only": heat_or_copper,
    "short test": short_test,
    "four nodes": four,
}


def read(
    machine: Machine,
    duties: tuple[Duty, ...],
    bench: Bench,
    rng: np.random.Generator,
    bodies: dict[str, tuple[str, Sensor]] | None = None,
) -> list[Channels]:
    """Return tests with losses as a balance, and with the bodies that are measured."""
    tests = []
    for duty in duties:
        courses = simulated(machine, duty, rng)
        seen = channels(rng, courses, bench) | {"losses_W": losses(rng, courses, bench)}
        for channel, (node, sensor) in (bodies or {}).items():
            seen[channel] = sensor.read(rng, courses, courses.nodes_degC[node])
        tests.append(seen)
    return tests


def simulated(
    machine: Machine, duty: Duty, rng: np.random.Generator, room_degC: float | None = None
) -> Courses:
    """Return a test in a room whose air swings by 0.3 K, or by 0.1 K if it is held."""
    swing, period = (0.3 if room_degC is None else 0.1), rng.uniform(1200.0, 5000.0)
    room = rng.uniform(15.0, 30.0) if room_degC is None else room_degC
    return simulate(machine, duty, lambda t: room + swing * np.sin(2.0 * np.pi * t / period))


def second_order(machine: Machine) -> dict[str, float]:
    return {
        "Ceq_w": machine.capacity["winding"],
        "Ceq_sr": machine.capacity["stator"],
        "Req_w": machine.resistance["winding", "stator"],
        "Req_sr": machine.resistance["stator", SINK],
    }


def motor_text(machine: Machine, bench: Bench, losses: str = "balance") -> str:
    return (
        f'[motor]\nname = "study"\nphases = {machine.phases}\nlosses = "{losses}"\n'
        f"rated_speed_rpm = {machine.rated_rpm:.1f}\n[winding]\n"
        f"phase_resistance_ohm = {machine.ohm * (1.0 + bench.ohm_gain):.6g}\n"
    )


def write_case(case: Case, folder: Path) -> list[str]:
    (folder / "motor.toml").write_text(case.motor, encoding="utf-8")
    paths = [folder / f"test_{number + 1}.csv" for number in range(len(case.tests))]
    for path, test in zip(paths, case.tests, strict=True):
        pd.DataFrame(test).to_csv(path, index=False, float_format="%.8g")
    held_out = ["--holdout", str(paths[1])] if len(paths) > 1 else []
    return [
        "calibrate", str(folder / "motor.toml"), str(paths[0]), *held_out,
        "--model", case.model, "--quick", "--out", str(folder / "run"),
    ]  # fmt: skip


def run(job: dict[str, Any]) -> dict[str, Any]:
    case = make(job["kind"], job["variant"], job["seed"])
    with temporary() as folder:
        arguments = write_case(case, folder)
        begin = time.process_time()
        code, said = command(arguments)
        row = {**job, "exit_code": code, "processor_s": time.process_time() - begin,
               "truth": case.truth}  # fmt: skip
        if code != 0:
            told = [line for line in said.splitlines() if not line.startswith(("note", "warn"))]
            return {**row, "failure": "\n".join(told)[-1200:]}
        return {**row, **described(folder / "run", case)}


def described(folder: Path, case: Case) -> dict[str, Any]:
    import heatrun

    run = heatrun.open_run(folder)
    model = run.result.models[case.model]
    entries = {name: model.parameters[name] for name in case.truth}
    held_out = [row for row in model.residuals if row.role == "holdout"]
    return {
        "value": {name: entry.value for name, entry in entries.items()},
        "sd": {name: entry.sd for name, entry in entries.items()},
        "interval_95": {name: list(entry.interval_95) for name, entry in entries.items()},
        "prior_95": {name: list(entry.prior_95) for name, entry in entries.items()},
        "identifiability": {
            name: entry.identifiability if isinstance(entry.identifiability, str) else ""
            for name, entry in entries.items()
        },
        "nuisances": {name: [e.value, e.sd] for name, e in model.nuisances.items()},
        "rmse_K": max(row.rmse_K for row in model.residuals if row.role == "calibration"),
        "holdout_rmse_K": held_out[0].rmse_K if held_out else None,
        "holdout_coverage_95": held_out[0].coverage_95 if held_out else None,
        "findings": [[f.id, f.message] for f in run.result.findings if f.severity == "warning"],
    }


def duty_of(
    lengths_s: np.ndarray, current: np.ndarray, speed: np.ndarray, sign: np.ndarray | None = None
) -> Duty:
    """Return loads of given lengths [s]; they change between two samples, not on one."""
    edges = np.concatenate([[0.0], np.cumsum(lengths_s)])
    edges[-1] = np.floor(edges[-1])
    sign = np.ones_like(current) if sign is None else sign
    other = 0.4 * speed + 0.6 * speed**1.7
    return Duty(edges, current, speed, sign * np.minimum(current, 1.0), other)


def staircase(rng: np.random.Generator, seconds: float = 5400.0) -> Duty:
    """Return long loads with a rest among them, of which the last cools the machine."""
    num = int(rng.integers(4, 7))
    lengths = rng.dirichlet(np.full(num, 6.0)) * (seconds - REST_S)
    current = rng.uniform(0.4, 1.3, num)
    speed = rng.uniform(0.3, 1.1, num)
    current[-1], speed[-1] = 0.0, 0.0
    return _after_rest(lengths, current, speed)


def cycle(rng: np.random.Generator, seconds: float = 3600.0) -> Duty:
    """Return a drive cycle of loads from half a minute to three minutes, as a motor."""
    lengths, num = _lengths(rng, seconds, 30.0, 180.0)
    current = rng.uniform(0.1, 1.4, num) * (rng.random(num) > 0.15)
    return _after_rest(lengths, current, rng.uniform(0.2, 1.1, num))


def both_ways(rng: np.random.Generator, seconds: float = 5400.0) -> Duty:
    """Return a drive cycle that motors and generates, from one minute to five a load."""
    lengths, num = _lengths(rng, seconds, 60.0, 300.0)
    sign = np.where(rng.random(num) < 0.5, -1.0, 1.0)
    sign[:2] = 1.0, -1.0
    current = rng.uniform(0.3, 1.2, num)
    return _after_rest(lengths, current, rng.uniform(0.3, 1.1, num), sign)


def short(rng: np.random.Generator, seconds: float) -> Duty:
    """Return a load at once, and after half of the test or more another one."""
    begin, share = rng.uniform(3.0, 9.0), rng.uniform(0.5, 0.8)
    lengths = np.array([begin, share * (seconds - begin), (1.0 - share) * (seconds - begin)])
    current = np.array([0.0, rng.uniform(1.0, 2.0), rng.uniform(0.0, 0.8)])
    return duty_of(lengths, current, np.array([0.0, *rng.uniform(0.5, 1.0, 2)]))


def on_and_off(rng: np.random.Generator, seconds: float = 7200.0) -> Duty:
    """Return a current, a rest, a smaller current and a rest, at standstill."""
    lengths = rng.dirichlet([12.0, 6.0, 8.0, 4.0]) * (seconds - REST_S)
    level = np.array([rng.uniform(0.8, 1.2), 0.0, rng.uniform(0.4, 0.8), 0.0])
    return _after_rest(lengths, level, np.zeros(4))


def heated(duty: Duty) -> Duty:
    still = np.zeros_like(duty.current)
    return Duty(duty.edges_s, still, still, still, duty.current)


def _lengths(
    rng: np.random.Generator, seconds: float, least: float, most: float
) -> tuple[np.ndarray, int]:
    lengths = rng.uniform(least, most, int(2.0 * seconds / (least + most)))
    lengths *= (seconds - REST_S) / lengths.sum()
    return lengths, lengths.size


def _after_rest(
    lengths: np.ndarray, current: np.ndarray, speed: np.ndarray, sign: np.ndarray | None = None
) -> Duty:
    sign = np.ones_like(current) if sign is None else sign
    return duty_of(np.r_[REST_S, lengths], np.r_[0.0, current], np.r_[0.0, speed], np.r_[1.0, sign])
