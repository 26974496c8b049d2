"""Machines and bodies at random from 1 W to 1 MW, and what a bench reads of them.

Nothing here knows of the packages under test: conductances and capacities in NumPy, integrated by
SciPy's LSODA from load step to load step, the copper's resistance followed as it warms. Instruments
have errors drawn from what is declared of them; noise of the sensors is correlated over a minute,
readings are rounded to 0.1 K, and the losses wander by 0.2 %, which no prior knows of.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp
from scipy.signal import lfilter, lsim

SINK = "sink"
COPPER_DEGC, REFERENCE_DEGC = 234.5, 25.0
HOT_DEGC = 100.0
"""Temperature at which the copper loss at rated current is what the machine was drawn with."""

Sink = Callable[[float], float]


@dataclass(frozen=True)
class Machine:
    watts: float  # Losses at rated load [W].
    capacity: Mapping[str, float]  # Heat capacity by node [J/K].
    # Resistance by pair of nodes, one of which may be the sink [K/W].
    resistance: Mapping[tuple[str, str], float]
    shares: Mapping[str, float]  # Where the losses other than copper enter [1].
    copper_share: float  # Share of the copper loss at rated load [1].
    phases: int = 3  # Number of phases.
    rated_rpm: float = 3000.0  # Rated speed [rpm].

    @property
    def nodes(self) -> tuple[str, ...]:
        """Its nodes, the winding first."""
        return tuple(self.capacity)

    @property
    def rated_A(self) -> float:
        return float(np.sqrt(self.watts))

    @property
    def ohm(self) -> float:
        """Resistance of a phase at the reference temperature [ohm]."""
        warm = (COPPER_DEGC + HOT_DEGC) / (COPPER_DEGC + REFERENCE_DEGC)
        return self.copper_share * self.watts / (self.phases * self.rated_A**2 * warm)

    def copper_W(self, current_A: np.ndarray, winding_degC: np.ndarray) -> np.ndarray:
        warm = (COPPER_DEGC + winding_degC) / (COPPER_DEGC + REFERENCE_DEGC)
        return self.phases * current_A**2 * self.ohm * warm


@dataclass(frozen=True)
class Duty:
    """Loads that are held from one moment to the next."""

    edges_s: np.ndarray  # Where each begins, and the end of the last [s], shape (load + 1,).
    current: np.ndarray  # Phase current over rated [1], shape (load,).
    speed: np.ndarray  # Speed over rated [1].
    torque: np.ndarray  # Torque over rated, negative as a generator [1].
    other: np.ndarray  # Losses other than copper over rated [1].

    def held(self, time_s: np.ndarray) -> np.ndarray:
        place = np.searchsorted(self.edges_s, time_s, side="right") - 1
        return np.minimum(place, self.current.size - 1)


@dataclass(frozen=True)
class Courses:
    """What happens, once a second."""

    time_s: np.ndarray  # Time [s], shape (sample,).
    sink_degC: np.ndarray  # Temperature of the sink [degC].
    nodes_degC: Mapping[str, np.ndarray]  # Temperature by node [degC].
    current_A: np.ndarray  # Phase current [A].
    other_W: np.ndarray  # Losses other than copper [W].
    copper_W: np.ndarray  # Copper loss [W].
    speed_rpm: np.ndarray  # Speed [rpm].
    torque: np.ndarray  # Torque over rated [1].


def simulate(machine: Machine, duty: Duty, sink: Sink) -> Courses:
    """Integrate a machine from equilibrium with its sink, exactly from step to step of the load."""
    nodes = machine.nodes
    capacity = np.array([machine.capacity[node] for node in nodes])
    share = np.array([machine.shares.get(node, 0.0) for node in nodes])
    loss_matrix, to_sink = conductances(machine)
    other = duty.other * (1.0 - machine.copper_share) * machine.watts
    current = duty.current * machine.rated_A

    def slope(time_s, T, load):
        heat = share * other[load] - loss_matrix @ T + to_sink * sink(time_s)
        heat[0] += machine.copper_W(current[load], T[0])
        return heat / capacity

    time = np.arange(0.0, duty.edges_s[-1] + 1e-9, 1.0)
    T = np.empty((len(nodes), time.size))
    now = np.full(len(nodes), sink(0.0))
    T[:, 0] = now
    for load, (begin, end) in enumerate(zip(duty.edges_s[:-1], duty.edges_s[1:], strict=True)):
        inside = np.flatnonzero((time > begin) & (time <= end))
        at = np.unique([*time[inside], end])
        found = solve_ivp(slope, (begin, end), now, "LSODA", at, args=(load,), rtol=1e-8, atol=1e-7)
        T[:, inside] = found.y[:, : inside.size]
        now = found.y[:, -1]
    held = duty.held(time)
    return Courses(
        time, np.array([sink(t) for t in time]), dict(zip(nodes, T, strict=True)), current[held],
        other[held], machine.copper_W(current[held], T[0]),
        duty.speed[held] * machine.rated_rpm, duty.torque[held],
    )  # fmt: skip


def conductances(machine: Machine) -> tuple[np.ndarray, np.ndarray]:
    """Return the matrix of conductances, shape (node, node), and those to the sink [W/K]."""
    nodes = machine.nodes
    matrix, to_sink = np.zeros((len(nodes), len(nodes))), np.zeros(len(nodes))
    for pair, resistance in machine.resistance.items():
        inner = [nodes.index(node) for node in pair if node != SINK]
        for i in inner:
            matrix[i, i] += 1.0 / resistance
            if SINK in pair:
                to_sink[i] += 1.0 / resistance
        if len(inner) == 2:
            matrix[inner[0], inner[1]] -= 1.0 / resistance
            matrix[inner[1], inner[0]] -= 1.0 / resistance
    return matrix, to_sink


def drawn_size(rng: np.random.Generator) -> tuple[float, float, float]:
    """Return losses [W], heat capacity [J/K] and resistance to the sink [K/W] of a machine."""
    decades = rng.uniform(0.0, 6.0)
    slow = np.exp(np.interp(decades, [0.0, 6.0], np.log([600.0, 7200.0])) + rng.normal(0.0, 0.2))
    watts = 10.0**decades
    resistance = rng.uniform(30.0, 100.0) / watts
    return watts, float(np.clip(slow, 600.0, 7200.0)) / resistance, resistance


def one_node(rng: np.random.Generator) -> Machine:
    watts, capacity, resistance = drawn_size(rng)
    return Machine(watts, {"block": capacity}, {("block", SINK): resistance}, {"block": 1.0}, 0.0)


def two_nodes(rng: np.random.Generator, *, copper_share: float | None = None) -> Machine:
    watts, capacity, resistance = drawn_size(rng)
    copper_share = rng.uniform(0.3, 0.7) if copper_share is None else copper_share
    in_winding = rng.uniform(0.03, 0.10)
    return Machine(
        watts,
        {"winding": in_winding * capacity, "stator": (1.0 - in_winding) * capacity},
        {("winding", "stator"): rng.uniform(10.0, 40.0) / (copper_share * watts),
         ("stator", SINK): resistance},
        {"stator": 1.0},
        copper_share,
    )  # fmt: skip


def with_housing(machine: Machine, rng: np.random.Generator) -> Machine:
    """Return a machine whose stator loses its heat through a housing of 5 % of its capacity."""
    whole, capacity = machine.resistance["stator", SINK], machine.capacity["stator"]
    inner = rng.uniform(0.15, 0.5)
    return Machine(
        machine.watts,
        {**machine.capacity, "stator": 0.95 * capacity, "housing": 0.05 * capacity},
        {("winding", "stator"): machine.resistance["winding", "stator"],
         ("stator", "housing"): inner * whole, ("housing", SINK): (1.0 - inner) * whole},
        machine.shares,
        machine.copper_share,
    )  # fmt: skip


def four_nodes(rng: np.random.Generator) -> Machine:
    watts, capacity, resistance = drawn_size(rng)
    copper_share = rng.uniform(0.3, 0.7)
    winding, tooth, rotor = rng.uniform([0.03, 0.15, 0.2], [0.10, 0.25, 0.35])
    others = (1.0 - copper_share) * watts
    yoke_share, rotor_share = np.clip(rng.normal(1.0 / 3.0, 1.0 / 6.0, 2), 0.1, 0.45)
    through_yoke = copper_share * watts + (1.0 - yoke_share) * others
    rises = rng.uniform([10.0, 3.0, 5.0], [40.0, 15.0, 20.0])
    return Machine(
        watts,
        {"winding": winding * capacity, "tooth": tooth * capacity,
         "yoke": (1.0 - winding - tooth - rotor) * capacity, "rotor": rotor * capacity},
        {("winding", "tooth"): rises[0] / (copper_share * watts),
         ("tooth", "yoke"): rises[1] / through_yoke,
         ("tooth", "rotor"): rises[2] / (rotor_share * others), ("yoke", SINK): resistance},
        {"tooth": 1.0 - yoke_share - rotor_share, "yoke": yoke_share, "rotor": rotor_share},
        copper_share,
    )  # fmt: skip


RESOLUTION_K = 0.1
NOISE_S = 60.0
NOISE_SHARE = 1e-3
"""White noise of currents and powers over their readings [1]."""


@dataclass(frozen=True)
class Sensor:
    gain: float  # Relative error of the rise [1].
    offset_K: float  # Offset [K].
    lag_s: float  # Time constant [s].

    def read(self, rng: np.random.Generator, courses: Courses, degC: np.ndarray) -> np.ndarray:
        seen = lagging(degC, self.lag_s) if self.lag_s > 0.0 else degC
        rise = seen - courses.sink_degC
        return rounded(rng, courses.sink_degC + (1.0 + self.gain) * rise + self.offset_K)


@dataclass(frozen=True)
class Bench:
    """Errors of a bench, the same in all tests of a machine."""

    loss_gain: float  # Relative error of the losses [1].
    current_gain: float  # Relative error of the current [1].
    ohm_gain: float  # Relative error of the phase resistance in the motor file [1].
    sink_offset_K: float  # Error of the sink's temperature [K].
    winding: Sensor  # The winding's sensor.


def drawn_bench(rng: np.random.Generator) -> Bench:
    """Return a bench of the declared class: 1 % of the losses and of the resistance, 0.5 % of the
    current, 0.5 K and 0.5 % of the sensor, 0.5 K of the sink."""
    return Bench(
        rng.normal(0.0, 0.01), rng.normal(0.0, 0.005), rng.normal(0.0, 0.01),
        rng.normal(0.0, 0.5), Sensor(rng.normal(0.0, 0.005), rng.normal(0.0, 0.5), 0.0),
    )  # fmt: skip


def drawn_sensor(rng: np.random.Generator) -> Sensor:
    """Return a body's sensor of the declared class: 2 %, 0.5 K, a lag of 10 s within e."""
    return Sensor(
        rng.normal(0.0, 0.02), rng.normal(0.0, 0.5), 10.0 * float(np.exp(rng.normal(0.0, 1.0)))
    )


def lagging(degC: np.ndarray, lag_s: float) -> np.ndarray:
    """Return what a first-order lag makes of samples a second apart, joined by straight lines."""
    system = ([[-1.0 / lag_s]], [[1.0 / lag_s]], [[1.0]], [[0.0]])
    return lsim(system, degC, np.arange(float(degC.size)), X0=[degC[0]])[1]


def rounded(rng: np.random.Generator, degC: np.ndarray) -> np.ndarray:
    """Return readings with noise that is correlated over a minute, rounded [degC]."""
    step = np.exp(-1.0 / NOISE_S)
    white = rng.standard_normal(degC.size + 300)
    slow = np.asarray(lfilter([np.sqrt(1.0 - step**2)], [1.0, -step], white))[300:]
    noisy = degC + 0.06 * slow + 0.05 * rng.standard_normal(degC.size)
    return RESOLUTION_K * np.rint(noisy / RESOLUTION_K)


def wandering(rng: np.random.Generator, time_s: np.ndarray) -> np.ndarray:
    period, phase = rng.uniform(1200.0, 3600.0), rng.uniform(0.0, 2.0 * np.pi)
    return 2e-3 * np.sin(2.0 * np.pi * time_s / period + phase)


def channels(rng: np.random.Generator, courses: Courses, bench: Bench) -> dict[str, np.ndarray]:
    """Return time, current, sink, winding and speed as they are read; the losses come apart."""
    first = next(iter(courses.nodes_degC.values()))
    noisy = 1.0 + NOISE_SHARE * rng.standard_normal(courses.time_s.size)
    return {
        "time_s": courses.time_s,
        "phase_current_A": courses.current_A * (1.0 + bench.current_gain) * noisy,
        "ambient_degC": rounded(rng, courses.sink_degC + bench.sink_offset_K),
        "winding_degC": bench.winding.read(rng, courses, first),
        "speed_rpm": courses.speed_rpm,
    }


def losses(rng: np.random.Generator, courses: Courses, bench: Bench) -> np.ndarray:
    true = courses.copper_W + courses.other_W
    seen = true * (1.0 + bench.loss_gain + wandering(rng, courses.time_s))
    return seen * (1.0 + NOISE_SHARE * rng.standard_normal(true.size))
