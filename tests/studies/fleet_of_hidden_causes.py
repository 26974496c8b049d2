"""Fleets of one type on one bench, with an effect that all machines share, or none.

Independent of lptn: all machines of a fleet march side by side by the classical Runge-Kutta method
in steps of one second, in NumPy. The laws of the effects differ from the catalogue's: other
exponents, thresholds, lags. Machines differ by 4 % in each parameter and by 20 % in the effect.
Instruments of the bench are off by the same amount for all machines of a fleet; each machine has
errors of its own sensor beside them.
"""

import importlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

import numpy as np
from bench_package import bench, hidden_bench
from fleet_cases import write_bench

TRUTH = {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625}
"""Centre of the type: J/K, J/K, K/W, K/W."""

SPREAD, EFFECT_SPREAD = 0.04, 0.2
"""Between machines: of the logarithm of each parameter, and of the effect over its mean [1]."""

RS0, B, TREF = 0.0062, 234.5, 25.0
RATED_A, RATED_RPM = 150.0, 6000.0
HYSTERESIS_W, EDDY_W, STRAY_W = 260.0, 320.0, 675.0

TEST_S = 3600
"""Length of each of the two tests [s]."""

STEP_S = 0.5
"""Between readings [s]."""

RESOLUTION_K = 0.5
"""Step of the winding channel [K]."""

BENCH = {"power_gain": 0.005, "current_gain": 0.0025, "sensor_gain": 0.0025, "sensor_offset": 0.25,
         "ambient_offset": 0.25}  # fmt: skip
"""Standard deviations of the bench's errors, half of what heatrun takes them for: 1, 1, 1, K, K."""

OWN = {"sensor_gain": 0.002, "sensor_offset": 0.2}
"""Standard deviations of those of each machine's own sensor."""

MOTOR = f"""[motor]
name = "line"
losses = "balance"
rated_speed_rpm = {RATED_RPM}
[winding]
phase_resistance_ohm = {RS0}
reference_temperature_degC = {TREF}
"""


@dataclass
class Plant:
    """A fleet while a test runs; what an effect may change."""

    amplitude: np.ndarray  # Of the effect, shape (machine,).
    # Factor on 1/Req_sr, of rise [K] and lagged speed ratio [1].
    conductance: Callable[[np.ndarray, float], Any] = lambda rise, speed: 1.0
    # Heat added to the winding and taken from the stator [W], of copper loss and other losses [W],
    # winding temperature [degC] and speed ratio [1].
    into_winding: Callable[..., Any] = lambda copper, other, winding, speed: 0.0
    rotor: Any = 0.0  # Share of the other losses that a rotor takes [1]; 0 for none.
    stator_heat: Callable[[float], Any] = lambda time_s: 0.0  # Heat from outside [W], of time [s].


def _natural_convection(plant: Plant) -> None:
    """Exponent 0.3 above a difference of 4 K."""
    a = plant.amplitude
    plant.conductance = lambda rise, speed: (
        1.0 - a + a * (np.maximum(np.abs(rise), 4.0) / 38.0) ** 0.3
    )


def _speed_cooling(plant: Plant) -> None:
    """Exponent 0.72; the air follows the speed within 10 s."""
    plant.conductance = lambda rise, speed: 1.0 + plant.amplitude * abs(speed) ** 0.72


def _rotor_node(plant: Plant) -> None:
    """The rotor takes a share of the other losses and hands it on, time constant 700 s."""
    plant.rotor = plant.amplitude


def _ac_copper_loss(plant: Plant) -> None:
    """Exponent 1.85, falling with the square of the resistivity; the total is measured."""
    plant.into_winding = lambda copper, other, winding, speed: (
        plant.amplitude * copper * abs(speed) ** 1.85 * (294.5 / (234.5 + winding)) ** 2
    )


def _iron_loss_in_winding(plant: Plant) -> None:
    """A share of the other losses reaches the winding first."""
    plant.into_winding = lambda copper, other, winding, speed: plant.amplitude * other


EFFECTS: dict[str, Callable[[Plant], None]] = {
    "natural_convection": _natural_convection,
    "speed_cooling": _speed_cooling,
    "rotor_node": _rotor_node,
    "ac_copper_loss": _ac_copper_loss,
    "iron_loss_in_winding": _iron_loss_in_winding,
}


def _bench_heat(plant: Plant) -> None:
    """A neighbour on the bench heats the stator in its own rhythm, the same in each test."""
    plant.stator_heat = lambda time_s: 300.0 * plant.amplitude * np.sin(time_s / 330.0 + 1.0)


def _surface_rise(plant: Plant) -> None:
    """The surface sheds heat better when hot, in proportion to the rise."""
    plant.conductance = lambda rise, speed: 1.0 + 0.02 * plant.amplitude * (rise - 40.0)


UNKNOWN: dict[str, Callable[[Plant], None]] = {
    "bench_heat": _bench_heat,
    "surface_rise": _surface_rise,
}
"""Causes that are in no catalogue; the second is near to `natural_convection`."""


@dataclass(frozen=True)
class Fleet:
    parameters: dict[str, np.ndarray]  # Of each machine, by name, shape (machine,).
    bench: dict[str, float]  # Errors that all machines share.
    # By machine, by test: columns of the record, shape (time,).
    tests: list[list[dict[str, np.ndarray]]]


def fleet(
    num: int, seed: int, effect: str = "", amplitude: float = 0.0,
    bench: Mapping[str, float] | None = None,
) -> Fleet:  # fmt: skip
    """Return the records of a fleet."""
    rng = np.random.default_rng([seed, 3])
    parameters = {n: v * np.exp(SPREAD * rng.standard_normal(num)) for n, v in TRUTH.items()}
    own_amplitude = amplitude * np.maximum(0.0, 1.0 + EFFECT_SPREAD * rng.standard_normal(num))
    drawn = {name: sd * float(rng.standard_normal()) for name, sd in BENCH.items()}
    errors = drawn | dict(bench or {})
    gain = OWN["sensor_gain"] * rng.standard_normal(num) + errors["sensor_gain"]
    offset = OWN["sensor_offset"] * rng.standard_normal(num) + errors["sensor_offset"]
    noise = {"sd": rng.uniform(0.6, 1.0, num), "time_s": rng.uniform(50.0, 120.0, num)}
    tests: list[list[dict[str, np.ndarray]]] = [[] for _ in range(num)]
    for number in range(2):
        current, speed = programme(number)
        scale = 1.0 + 0.02 * rng.standard_normal(num)
        ambient = rng.uniform(19.0, 25.0, num)
        amperes = current[:, None] * scale
        course = march(parameters, amperes, speed, ambient, effect, own_amplitude)
        reading = course["winding"] + gain * (course["winding"] - ambient) + offset
        reading = reading + _ou(rng, noise["sd"], noise["time_s"], current.size)
        reading = reading + 0.05 * rng.standard_normal(reading.shape)
        for i in range(num):
            tests[i].append({
                "time_s": STEP_S * np.arange(current.size),
                "phase_current_A": np.abs(amperes[:, i] * (1.0 + errors["current_gain"])
                                          + 0.05 * rng.standard_normal(current.size)),
                "losses_W": course["losses"][:, i] * (1.0 + errors["power_gain"])
                + rng.standard_normal(current.size),
                "ambient_degC": ambient[i] + errors["ambient_offset"]
                + 0.03 * rng.standard_normal(current.size),
                "winding_degC": RESOLUTION_K * np.rint(reading[:, i] / RESOLUTION_K),
                "speed_rpm": np.abs(speed),
            })  # fmt: skip
    return Fleet(parameters, errors, tests)


def programme(number: int) -> tuple[np.ndarray, np.ndarray]:
    """Return current [A] and speed [rpm] every half second: the same programme for each machine."""
    levels = (
        [(0.0, 0.0, 60), (1.0, 0.35, 700), (0.45, 1.0, 600), (0.9, 0.6, 240), (0.1, 0.6, 200),
         (0.95, 0.15, 500), (0.0, 0.0, 700), (0.3, 0.9, 300), (0.0, 0.0, 300)],
        [(0.0, 0.0, 60), (0.5, 0.8, 500), (0.0, 1.0, 400), (1.05, 0.5, 600), (0.2, 0.2, 300),
         (0.8, 1.0, 340), (0.0, 0.0, 1400)],
    )[number]  # fmt: skip
    moments = np.cumsum([0, *(length for _, _, length in levels)])
    time = STEP_S * np.arange(round(TEST_S / STEP_S) + 1)
    at, amps, turns = [], [], []
    for (torque, speed, _), first, last in zip(levels, moments[:-1], moments[1:], strict=True):
        at += [first + 4.0, last]  # a ramp of four seconds
        amps += [RATED_A * torque] * 2
        turns += [RATED_RPM * speed] * 2
    return np.interp(time, at, amps), np.interp(time, at, turns)


def march(
    parameters: Mapping[str, np.ndarray], current: np.ndarray, speed: np.ndarray,
    ambient: np.ndarray, effect: str, amplitude: np.ndarray,
) -> dict[str, np.ndarray]:  # fmt: skip
    """Return winding [degC] and total losses [W], shape (time, machine).

    Args:
        parameters: Of each machine, by name.
        current: Phase current every half second [A], shape (time, machine).
        speed: Speed every half second [rpm].
        ambient: Of each machine [degC].
        effect: One of `EFFECTS` or `UNKNOWN`; empty for none.
        amplitude: Of each machine.
    """
    plant = Plant(amplitude)
    if effect:
        (EFFECTS | UNKNOWN)[effect](plant)
    C_w, C_sr, R_w, R_sr = (parameters[name] for name in TRUTH)
    ratio = np.abs(speed) / RATED_RPM
    lag = np.empty_like(ratio)
    air = ratio[0]
    for i, value in enumerate(ratio):
        air += STEP_S * (value - air) / 10.0
        lag[i] = air
    copper_per_K = 3.0 * current**2 * RS0 / (B + TREF)
    other = HYSTERESIS_W * ratio[:, None] + EDDY_W * ratio[:, None] ** 2
    other = other + STRAY_W * (current / RATED_A) ** 2 * ratio[:, None] ** 1.5

    def slope(i: int, state: np.ndarray) -> np.ndarray:
        winding, stator, rotor = state
        copper = copper_per_K[i] * (B + winding)
        moved = plant.into_winding(copper, other[i], winding, ratio[i])
        across = (winding - stator) / R_w
        out = (stator - ambient) / R_sr * plant.conductance(stator - ambient, lag[i])
        fed = plant.rotor * other[i]
        heat = plant.stator_heat(STEP_S * i)
        flow = plant.rotor * 20000.0 / 700.0 * (rotor - stator)
        of_rotor = (other[i] - 20000.0 / 700.0 * (rotor - stator)) / 20000.0
        return np.stack([
            (copper + moved - across) / C_w,
            (other[i] - moved - fed + flow + across - out + heat) / C_sr,
            of_rotor * (plant.rotor > 0),
        ])  # fmt: skip

    state = np.stack([ambient] * 3)
    course = np.empty((current.shape[0], current.shape[1]))
    last, h = current.shape[0] - 1, 2.0 * STEP_S
    for i in range(0, last, 2):
        k1 = slope(i, state)
        k2 = slope(i + 1, state + 0.5 * h * k1)
        k3 = slope(i + 1, state + 0.5 * h * k2)
        k4 = slope(i + 2, state + h * k3)
        after = state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        course[i] = state[0]
        course[i + 1] = 0.5 * (state + after)[0] + h / 8.0 * (k1 - slope(i + 2, after))[0]
        state = after
    course[last] = state[0]
    return {"winding": course, "losses": copper_per_K * (B + course) + other}


@lru_cache
def amplitude_of(effect: str, visible_K: float) -> float:
    """Return the amplitude at which a refitted two-node network leaves a misfit [K, rms]."""
    hidden_bench()
    machine = bench().reference_motor()
    misfit = importlib.import_module(f"{bench().__name__}.hidden.misfit")
    centre = {name: np.array([value]) for name, value in TRUTH.items()}
    ambient = np.array([22.0])

    def left(amplitude: float) -> float:
        seen = []
        for number in range(2):
            current, speed = programme(number)
            course = march(centre, current[:, None], speed, ambient, effect, np.array([amplitude]))
            channels = (current, course["losses"][:, 0], np.full(current.size, 22.0),
                        course["winding"][:, 0])  # fmt: skip
            seen.append(misfit.Seen(*channels))
        return misfit.visible_misfit(machine, seen, "balance")

    amplitude = 0.1
    for _ in range(6):
        reached = left(amplitude)
        if abs(reached / visible_K - 1.0) < 0.03:
            break
        amplitude = min(0.95, amplitude * float(np.clip(visible_K / reached, 0.2, 5.0)))
    return amplitude


def write(found: Fleet, folder: Path) -> Path:
    tests = {f"M{i:03d}_{number + 1}": columns for i, tests in enumerate(found.tests)
             for number, columns in enumerate(tests)}  # fmt: skip
    rows = [f"{name[:4]},A,tests/{name}.csv" for name in tests]
    return write_bench(folder, MOTOR, "line", ["machine,type,test", *rows], tests.items())


def _ou(rng: np.random.Generator, sd: np.ndarray, time_s: np.ndarray, size: int) -> np.ndarray:
    """Return a slow error of each reading every half second [K], shape (time, machine)."""
    keep = np.exp(-STEP_S / time_s)
    shocks = sd * np.sqrt(1.0 - keep**2) * rng.standard_normal((size, sd.size))
    value = sd * rng.standard_normal(sd.size)
    rows = np.empty_like(shocks)
    for i, shock in enumerate(shocks):
        value = keep * value + shock
        rows[i] = value
    return rows
