"""A case of the study: a machine at random, a hidden cause of a given size, three records."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..machine import Machine, random_motor
from ..profile import REST, Profile, Segment, drive_cycle, duty
from .causes import (
    FROM_A_MAP,
    HEAT,
    SENSOR,
    UNKNOWN_HEAT,
    UNKNOWN_SENSOR,
    Load,
    lagged,
)
from .misfit import Seen, visible_misfit
from .plant import HALF_S, Array, Course, Plant, integrate

EFFECT_IDS = (*HEAT, *SENSOR)
UNKNOWN_IDS = (*UNKNOWN_HEAT, *UNKNOWN_SENSOR)

CLEAN = "clean"
"""Stands for a machine in which nothing is hidden, as an empty tuple does."""

KINDS = ("two_tests", "single_step", "duty")
"""Kinds of cases."""

LENGTH_S = 7200.0
"""Length of every test [s]."""

DUTY_S = 5400.0
"""Length of the tests of the kind `"duty"` [s]."""

LEAST_K, MOST_K = 0.3, 1.5
"""Range of the visible misfit that hidden causes are given [K]."""

HOTTEST_DEGC = 140.0
"""The loads are chosen so that the winding stays below this [degC]."""


@dataclass(frozen=True)
class Recording:
    """One test as the bench wrote it down.

    Attributes:
        name: Name of the test.
        role: `"calibration"` or `"holdout"`.
        columns: Canonical channels, each of shape (time,).
        reading: The sensor's node without noise [degC].
        stator: Stator temperature [degC].
        added_W: Heat that a cause adds to the stator from outside [W].
    """

    name: str
    role: str
    columns: dict[str, Array]
    reading: Array
    stator: Array
    added_W: Array


@dataclass(frozen=True)
class Case:
    """A case of the study.

    Attributes:
        hidden: Ids of what is hidden; empty for a clean machine.
        seed: Of everything that was drawn.
        machine: The base machine.
        losses: `"balance"` or `"map"`.
        amplitudes: Amplitude of each hidden cause [1].
        visible_misfit_K: What a refitted base network leaves of the calibration tests [K].
        is_visible: Whether the cause reaches the least misfit within its range.
        resolution_K: Step of the winding channel [K].
        tests: Two calibration tests and one held out.
    """

    hidden: tuple[str, ...]
    seed: int
    machine: Machine
    losses: str
    amplitudes: dict[str, float]
    visible_misfit_K: float
    is_visible: bool
    resolution_K: float
    tests: tuple[Recording, ...]


def make_case(
    hidden: tuple[str, ...],
    seed: int,
    *,
    resolution_K: float | None = None,
    target_K: float | None = None,
    kind: str = "two_tests",
    only_test: int | None = None,
    amplitude: float | None = None,
) -> Case:
    """Return a case.

    Args:
        hidden: Ids of `EFFECT_IDS` or `UNKNOWN_IDS`; empty for a clean machine.
        seed: Of everything that is drawn.
        resolution_K: Step of the winding channel [K]; 0.1 or 1 at random by default.
        target_K: Visible misfit [K]; drawn between `LEAST_K` and `MOST_K` by default. Several
            causes get this much each.
        kind: `"two_tests"`; `"single_step"`: one constant load, on which nothing can be named; or
            `"duty"`: one test of 90 minutes, and a drive cycle held out.
        only_test: Place of the one test that the causes act in, such as a fan that failed; all
            tests by default (events happen in the first).
        amplitude: Amplitude of each cause [1], instead of a visible misfit.

    Returns:
        The case, the same for the same arguments.

    Raises:
        ValueError: If an id or the kind is not known, an id comes twice, or the target is not
            above zero.
    """
    hidden = () if hidden == (CLEAN,) else hidden
    _check(hidden, kind, target_K)
    rng = np.random.default_rng([seed, 5])
    machine = random_motor(rng)
    losses = "map" if any(name in FROM_A_MAP for name in hidden) else "balance"
    target = target_K or float(np.exp(rng.uniform(np.log(LEAST_K), np.log(MOST_K))))
    resolution = resolution_K or float(rng.choice([0.1, 1.0]))
    loads, roles = _loads(machine, hidden, kind, rng)
    if only_test is not None:
        loads = [replace(load, event_test=only_test) for load in loads]
    stream = int(rng.integers(2**31))
    amplitudes: dict[str, float] = {}
    for name in hidden:
        alone = amplitude or _amplitude(machine, loads, name, target, losses, stream, only_test)
        amplitudes[name] = alone
    acting = [_acting(amplitudes, load, only_test) for load in loads]
    courses = [_course(machine, x, a, stream) for x, a in zip(loads, acting, strict=True)]
    seen = [
        _seen(machine, load, course, a, losses)
        for load, course, a in zip(loads, courses, acting, strict=True)
    ]
    misfit = visible_misfit(machine, seen[: roles.count("calibration")], losses)
    instruments = _Instruments.draw(rng, resolution)
    tests = tuple(
        instruments.record(f"test_{i + 1}", role, load, course, one, amplitudes, rng)
        for i, (role, load, course, one) in enumerate(zip(roles, loads, courses, seen, strict=True))
    )
    return Case(
        hidden=hidden,
        seed=seed,
        machine=machine,
        losses=losses,
        amplitudes=amplitudes,
        visible_misfit_K=misfit,
        is_visible=misfit >= 0.95 * LEAST_K,
        resolution_K=resolution,
        tests=tests,
    )


def _acting(amplitudes: dict[str, float], load: Load, only_test: int | None) -> dict[str, float]:
    """Return the causes that act in a test."""
    return amplitudes if only_test in (None, load.index) else {}


def _check(hidden: tuple[str, ...], kind: str, target_K: float | None) -> None:
    """Refuse what would otherwise come out as a clean machine under the name of a cause."""
    known = (*EFFECT_IDS, *UNKNOWN_IDS)
    for name in hidden:
        if name not in known:
            raise ValueError(
                f"No cause is called {name!r}. Pass ids of EFFECT_IDS or UNKNOWN_IDS, or () for a "
                f"clean machine; known are {', '.join(known)}."
            )
    if len(set(hidden)) < len(hidden):
        raise ValueError(f"A cause comes twice in {hidden}. Name each once.")
    if kind not in KINDS:
        raise ValueError(f"No kind of case is called {kind!r}. Pass one of {', '.join(KINDS)}.")
    if target_K is not None and target_K <= 0.0:
        raise ValueError(f"The visible misfit is {target_K} K. Ask for one above zero.")


def _loads(
    machine: Machine, hidden: tuple[str, ...], kind: str, rng: np.random.Generator
) -> tuple[list[Load], list[str]]:
    """Return the loads of all tests, hot but not too hot for the machine as it is."""
    length = LENGTH_S
    if kind == "single_step":
        profiles = [Profile((REST, Segment(LENGTH_S - 60.0, rng.uniform(0.5, 0.8), 0.7)))] * 2
        roles = ["calibration", "holdout"]
    elif kind == "duty":
        length = DUTY_S
        profiles = [duty(length), drive_cycle(length)]
        roles = ["calibration", "holdout"]
    else:
        profiles = [_staircase(rng), _cycle(rng), _staircase(rng)]
        roles = ["calibration", "calibration", "holdout"]
    loads = []
    for index, profile in enumerate(profiles):
        time = HALF_S * np.arange(round(length / HALF_S) + 1)
        drift, phase = rng.uniform(-0.5, 0.5), rng.uniform(0.0, 6.28)
        room = rng.uniform(18.0, 26.0)
        ambient = room + drift * time / 3600.0 + 0.2 * np.sin(2 * np.pi * time / 1900.0 + phase)
        load = Load(
            index=index,
            time_s=time,
            current=machine.current(profile.torque(time)),
            speed=machine.rated_speed_rpm * profile.speed(time),
            ambient=ambient,
        )
        if "fan_cooling" in hidden:
            load.fan = _switched(rng, time.size)
        if "coolant_sink" in hidden:
            swing = lagged(_switched(rng, time.size), 200.0)
            load.coolant = ambient + 15.0 + 20.0 * (swing - 0.5)
        loads.append(load)
    for _ in range(12):
        hottest = max(
            float(integrate(Plant(machine), x.current, x.speed, x.ambient, x.ambient[0])
                  .winding_degC.max())
            for x in loads
        )  # fmt: skip
        if 90.0 < hottest < HOTTEST_DEGC:
            break
        factor = 0.9 if hottest >= HOTTEST_DEGC else 1.1
        loads = [replace(x, current=factor * x.current) for x in loads]
    return loads, roles


def _switched(rng: np.random.Generator, size: int) -> Array:
    """Return a channel that is switched between levels every 10 to 20 minutes."""
    values, place = np.empty(size), 0
    while place < size:
        length = int(rng.uniform(600.0, 1200.0) / HALF_S)
        values[place : place + length] = rng.choice([0.0, 0.4, 0.7, 1.0])
        place += length
    return values


def _staircase(rng: np.random.Generator) -> Profile:
    """Return levels of torque and speed that move apart, pulses, a spin, and two stops."""
    segments = [REST]
    segments += [
        Segment(480.0, float(rng.uniform(0.2, 0.85)), float(speed))
        for speed in rng.permutation([0.15, 0.45, 0.75, 1.0])
    ]
    high, low = rng.uniform(0.8, 1.0), rng.uniform(0.05, 0.2)
    speed = float(rng.uniform(0.3, 0.7))
    for _ in range(8):
        segments += [Segment(60.0, float(high), speed), Segment(60.0, float(low), speed)]
    segments += [Segment(900.0, 0.0, 0.0), Segment(480.0, 0.0, float(rng.uniform(0.7, 1.0)))]
    segments += [
        Segment(420.0, float(rng.uniform(0.4, 0.9)), float(speed))
        for speed in rng.permutation([0.3, 0.9])
    ]
    left = LENGTH_S - sum(segment.duration_s for segment in segments)
    return Profile((*segments, Segment(left, 0.0, 0.0)))


def _cycle(rng: np.random.Generator) -> Profile:
    """Return stop-and-go driving with dwells of random length, then a long stop."""
    segments, total = [REST], REST.duration_s
    while total < LENGTH_S - 1900.0:
        speed, dwell = float(rng.uniform(0.2, 1.0)), float(rng.integers(40, 200))
        ramp = float(round(18.0 * speed))
        trip = [
            Segment(ramp, float(rng.uniform(0.6, 1.0)), speed, speed_ramp_s=ramp),
            Segment(dwell, float(rng.uniform(0.05, 0.6)), speed),
            Segment(ramp, float(rng.uniform(-0.7, -0.4)), 0.0, speed_ramp_s=ramp),
            Segment(float(rng.integers(10, 60)), 0.0, 0.0),
        ]
        segments += trip
        total += sum(segment.duration_s for segment in trip)
    return Profile((*segments, Segment(LENGTH_S - total, 0.0, 0.0)))


def _course(machine: Machine, load: Load, amplitudes: dict[str, float], stream: int) -> Course:
    plant = Plant(machine)
    plant.notes["switch_degC"] = float(load.ambient[0]) + 30.0
    for name, amplitude in amplitudes.items():
        cause = HEAT.get(name) or UNKNOWN_HEAT.get(name)
        if cause is not None:
            cause(plant, load, amplitude, np.random.default_rng(stream))
    return integrate(plant, load.current, load.speed, load.ambient, float(load.ambient[0]))


def _seen(
    machine: Machine, load: Load, course: Course, amplitudes: dict[str, float], losses: str
) -> Seen:
    reading = course.winding_degC
    if "end_winding_node" in amplitudes:
        reading = 0.15 * reading + 0.85 * course.overhang_degC
    for name, amplitude in amplitudes.items():
        cause = SENSOR.get(name) or UNKNOWN_SENSOR.get(name)
        if cause is not None:
            reading = cause(course, load, amplitude, reading)
    channel = course.nominal_other_W
    if losses == "balance":
        channel = course.copper_W + course.other_W
        if "loss_gain" in amplitudes:
            channel = channel / (1.0 + 0.1 * amplitudes["loss_gain"])
    return Seen(load.current, channel, load.ambient, reading)


def _amplitude(
    machine: Machine,
    loads: list[Load],
    name: str,
    target: float,
    losses: str,
    stream: int,
    only_test: int | None = None,
) -> float:
    """Return the amplitude at which a refitted base network leaves the target [K]."""
    fitted = loads[:-1]

    def misfit(amplitude: float) -> float:
        seen = []
        for load in fitted:
            only = _acting({name: amplitude}, load, only_test)
            seen.append(_seen(machine, load, _course(machine, load, only, stream), only, losses))
        return visible_misfit(machine, seen, losses)

    amplitude, reached = 0.6, misfit(0.6)
    for _ in range(4):
        if abs(reached / target - 1.0) < 0.07:
            break
        amplitude = min(1.0, amplitude * float(np.clip(target / max(reached, 1e-3), 0.15, 4.0)))
        reached = misfit(amplitude)
        if amplitude == 1.0 and reached < target:
            break
    return amplitude


@dataclass(frozen=True)
class _Instruments:
    """Errors of the instruments; see `draw` for their sizes."""

    sd_K: float
    time_s: float
    white_K: float
    offset_K: float
    resolution_K: float
    power_gain: float

    @classmethod
    def draw(cls, rng: np.random.Generator, resolution_K: float) -> _Instruments:
        return cls(
            sd_K=rng.uniform(0.05, 0.2),
            time_s=rng.uniform(10.0, 60.0),
            white_K=rng.uniform(0.02, 0.15),
            offset_K=0.2 * rng.standard_normal(),
            resolution_K=resolution_K,
            power_gain=0.003 * rng.standard_normal(),
        )

    def record(
        self, name: str, role: str, load: Load, course: Course, seen: Seen,
        amplitudes: dict[str, float], rng: np.random.Generator,
    ) -> Recording:  # fmt: skip
        size = load.time_s.size
        phi = float(np.exp(-HALF_S / self.time_s))
        shocks = (np.sqrt(1.0 - phi**2) * self.sd_K * rng.standard_normal(size)).tolist()
        slow, value = np.empty(size), self.sd_K * float(rng.standard_normal())
        for i, shock in enumerate(shocks):
            value = phi * value + shock
            slow[i] = value
        noisy = seen.reading + self.offset_K + slow + self.white_K * rng.standard_normal(size)
        ambient = load.ambient + 0.05 * rng.standard_normal(size)
        power = seen.losses * (1.0 + self.power_gain) * (1.0 + 0.01 * rng.standard_normal(size))
        columns = {
            "time_s": load.time_s,
            "phase_current_A": np.abs(load.current + 0.05 * rng.standard_normal(size)),
            "losses_W": power + 0.5 * rng.standard_normal(size),
            "ambient_degC": np.round(ambient / 0.1) * 0.1,
            "winding_degC": np.round(noisy / self.resolution_K) * self.resolution_K,
            "speed_rpm": np.abs(load.speed + 0.5 * rng.standard_normal(size) * (load.speed > 0)),
        }
        if load.coolant is not None:
            columns["coolant_degC"] = load.coolant + 0.1 * rng.standard_normal(size)
        if load.fan is not None:
            columns["fan"] = load.fan
        return Recording(name, role, columns, seen.reading, course.stator_degC, course.added_W)
