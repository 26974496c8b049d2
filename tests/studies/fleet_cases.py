"""Simulated fleets with a known population: law, machines, instruments and bench files.

Independent of heatrun and lptn: two nodes by NumPy, integrated after Runge and Kutta for all
machines at once, and written as the text files that a bench would leave.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

NAMES = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")
CENTRE = np.array([666.75, 15060.1, 0.14485, 0.11625])
"""Of the types: J/K, J/K, K/W, K/W."""

SPREADS = np.array([0.03, 0.04, 0.06, 0.05])
"""Middle of the spreads of the types, of the logarithm [1]; each type's are up to 1.5 times as
large or as small."""

SUPPLIER = np.array([0.0, 0.0, 0.05, 0.06])
"""Standard deviation of what the supplier does to a type, of the logarithm [1]."""

OUTLIERS, FAR = 0.05, (0.35, 0.55)
"""Share of machines that are something else, and by how much in one parameter, of the logarithm: a
winding that sits loose, a housing with poor contact, a core of another length."""

ERRORS = {"current": 0.005, "power": 0.01, "sensor_gain": 0.005, "sensor_K": 0.5, "ambient_K": 0.5,
          "resistance": 0.01}  # fmt: skip
"""Standard deviations of the errors of the instruments, as a bench of class 0.5 has them."""

SLOW_K, SLOW_S, WHITE_K = 0.15, 40.0, 0.10
"""Noise of a reading: a slow part with its correlation time, and a white part."""

OHM, REFERENCE_degC, B_degC = 0.0062, 25.0, 234.5
ROOM_degC = 22.0
SAMPLE_S = 2.0
EVERY = slice(None, None, round(SAMPLE_S))
SHORT_MIN, LONG_MIN = 30.0, 120.0

MOTOR = f"""[motor]
name = "simulated type"
[winding]
phase_resistance_ohm = {OHM}
reference_temperature_degC = {REFERENCE_degC}
"""


@dataclass(frozen=True)
class Fleet:
    mean: np.ndarray  # Of the logarithms over machines of the supplier north, shape (parameter,).
    sd: np.ndarray  # Over machines of one supplier, outliers left aside, shape (parameter,).
    correlation: np.ndarray  # Likewise, shape (parameter, parameter).
    supplier: np.ndarray  # What the supplier south adds, shape (parameter,).
    logs: np.ndarray  # Logarithms of the machines' parameters, shape (machine, parameter).
    is_south: np.ndarray  # Shape (machine,).
    # Place of the parameter in which a machine is something else; -1 in one that fits, shape
    # (machine,).
    odd: np.ndarray
    minutes: np.ndarray  # Length of each machine's test [min], shape (machine,).

    @property
    def is_outlier(self) -> np.ndarray:
        return self.odd >= 0

    @property
    def machines(self) -> list[str]:
        return [f"M{number:04d}" for number in range(len(self.logs))]

    def middle(self, machines: Sequence[str]) -> np.ndarray:
        places = [int(name[1:]) for name in machines]
        return self.mean + self.is_south[places].mean() * self.supplier


def draw_fleet(seed: int, num: int, *, outliers: float = OUTLIERS, short: float = 0.5) -> Fleet:
    """Return a fleet of a type that is drawn too."""
    rng = np.random.default_rng([seed, 1])
    mean = np.log(CENTRE) + 0.2 * rng.standard_normal(4)
    sd = SPREADS * 1.5 ** rng.uniform(-1.0, 1.0, 4)
    loose = rng.standard_normal((4, 12))
    correlation = np.corrcoef(loose)
    supplier = SUPPLIER * rng.standard_normal(4)
    is_south = rng.permutation(np.arange(num) % 3 == 0)
    logs = mean + is_south[:, None] * supplier
    logs = logs + rng.multivariate_normal(np.zeros(4), correlation * np.outer(sd, sd), num)
    is_outlier = rng.permutation(np.arange(num) < round(outliers * num))
    odd = np.where(is_outlier, rng.integers(4, size=num), -1)
    for place in np.flatnonzero(is_outlier):
        logs[place, odd[place]] += rng.choice([-1.0, 1.0]) * rng.uniform(*FAR)
    minutes = np.where(rng.permutation(np.arange(num) < round(short * num)), SHORT_MIN, LONG_MIN)
    return Fleet(mean, sd, correlation, supplier, logs, is_south, odd, minutes)


def write_fleet(fleet: Fleet, folder: Path, seed: int) -> Path:
    rows, tests = [], []
    for place, name in enumerate(fleet.machines):
        supplier = "south" if fleet.is_south[place] else "north"
        rows.append(f"{name},simulated,tests/{name}.csv,{supplier}")
    for minutes in np.unique(fleet.minutes):
        places = np.flatnonzero(fleet.minutes == minutes)
        rng = np.random.default_rng([seed, 2, round(minutes)])
        columns = readings(np.exp(fleet.logs[places]), minutes, rng)
        tests += [(fleet.machines[place], {name: column[row] for name, column in columns.items()})
                  for row, place in enumerate(places)]  # fmt: skip
    return write_bench(folder, MOTOR, "simulated", ["machine,type,test,supplier", *rows], tests)


def write_bench(
    folder: Path, motor: str, fleet: str, table: Sequence[str],
    tests: Iterable[tuple[str, Mapping[str, np.ndarray]]],
) -> Path:  # fmt: skip
    """Write motor file, tests, table of machines and fleet file; return the last."""
    (folder / "tests").mkdir(parents=True, exist_ok=True)
    (folder / "motor.toml").write_text(motor)
    for name, columns in tests:
        values = np.stack(list(columns.values()), axis=1)
        np.savetxt(folder / "tests" / f"{name}.csv", values, "%.6g", ",",
                   header=",".join(columns), comments="")  # fmt: skip
    (folder / "machines.csv").write_text("\n".join(table) + "\n")
    path = folder / "FLEET.toml"
    path.write_text(f'[fleet]\nname = "{fleet}"\nmotor = "motor.toml"\nmanifest = "machines.csv"\n')
    return path


def readings(values: np.ndarray, minutes: float, rng: np.random.Generator) -> dict[str, Any]:
    """Return what the bench writes of machines, by column, shape (machine, sample) each."""
    loads = loaded(len(values), minutes, (60.0, 170.0), (150.0, 400.0), rng)
    winding, copper = courses(values, loads.current, loads.other, loads.ohm)
    noise = _noise(*winding.shape, rng)[:, EVERY]
    return loads.read(winding, copper, noise)


@dataclass(frozen=True)
class Loads:
    """A test of each machine, second by second, and the errors of its instruments."""

    current: np.ndarray  # Rms phase current [A], shape (machine, second).
    other: np.ndarray  # Losses other than copper [W].
    error: Mapping[str, np.ndarray]  # By name in `ERRORS`, shape (machine, 1).

    @property
    def ohm(self) -> np.ndarray:
        return OHM * np.exp(self.error["resistance"][:, 0])

    def read(self, winding: np.ndarray, copper: np.ndarray, noise: np.ndarray) -> dict[str, Any]:
        error, shape = self.error, noise.shape
        rise = (winding[:, EVERY] - ROOM_degC) * (1.0 + error["sensor_gain"]) + ROOM_degC
        return {
            "t": np.broadcast_to(np.arange(winding.shape[1], dtype=float)[EVERY], shape),
            "Is": self.current[:, EVERY] / (1.0 + error["current"]),
            "Pd": (copper + self.other)[:, EVERY] / (1.0 + error["power"]),
            "Te": np.broadcast_to(ROOM_degC - error["ambient_K"], shape),
            "Tw_m": rise + error["sensor_K"] + noise,
        }


def loaded(
    num: int, minutes: float, amperes: tuple[float, float], watts: tuple[float, float],
    rng: np.random.Generator,
) -> Loads:  # fmt: skip
    """A minute at rest, then one load as off the line, or a staircase of eight minutes each."""
    steps = round(minutes * 60.0)
    num_loads = 1 if minutes < 60.0 else round(minutes / 8.0)
    stretch = np.minimum((np.arange(steps) * num_loads / steps).astype(int), 63)
    current, other = (rng.uniform(*ends, (num, 64))[:, stretch] for ends in (amperes, watts))
    current[:, :60] = other[:, :60] = 0.0
    error = {name: sd * rng.standard_normal((num, 1)) for name, sd in ERRORS.items()}
    return Loads(current, other, error)


def courses(
    values: np.ndarray, current: np.ndarray, other: np.ndarray, ohm: np.ndarray,
    into_winding: np.ndarray | float = 0.0, missed: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
    """Return winding temperature [degC] and copper loss [W] of machines second by second.

    Two nodes: copper loss enters the winding, the other losses the stator; the resistance follows
    the winding's temperature. Loads hold over each second.

    Args:
        values: Parameters, shape (machine, parameter).
        current: Rms phase current [A], shape (machine, second).
        other: Losses other than copper [W], likewise.
        ohm: Phase resistance at 25 degC [ohm], shape (machine,).
        into_winding: Part of the other losses that warms the winding first, shape (machine,) [W].
        missed: Heat into winding and stator beside the losses [W], shape (2, machine, second).
    """
    C_w, C_sr, R_w, R_sr = values.T

    def copper_at(winding: np.ndarray, amperes: np.ndarray) -> np.ndarray:
        warm = (B_degC + winding) / (B_degC + REFERENCE_degC)
        return 3.0 * ohm * warm * amperes**2

    def slope(
        T: np.ndarray, amperes: np.ndarray, watts: np.ndarray, more: np.ndarray
    ) -> np.ndarray:
        flow = (T[0] - T[1]) / R_w
        out = (T[1] - ROOM_degC) / R_sr
        moved = into_winding * (watts > 0.0)
        winding = copper_at(T[0], amperes) + moved + more[0]
        stator = watts - moved + more[1]
        return np.stack([(winding - flow) / C_w, (stator + flow - out) / C_sr])

    T, none = np.full((2, len(values)), ROOM_degC), np.zeros((2, 1))
    winding, copper = np.empty_like(current), np.empty_like(current)
    for second in range(current.shape[1]):
        more = none if missed is None else missed[:, :, second]
        load = current[:, second], other[:, second], more
        winding[:, second], copper[:, second] = T[0], copper_at(T[0], load[0])
        first = slope(T, *load)
        middle = slope(T + 0.5 * first, *load)
        again = slope(T + 0.5 * middle, *load)
        last = slope(T + again, *load)
        T = T + (first + 2.0 * middle + 2.0 * again + last) / 6.0
    return winding, copper


def _noise(num: int, steps: int, rng: np.random.Generator) -> np.ndarray:
    slow = slowly(num, steps, SLOW_S, rng)
    return SLOW_K * slow + WHITE_K * rng.standard_normal((num, steps))


def slowly(
    num: int, steps: int, time_s: np.ndarray | float, rng: np.random.Generator
) -> np.ndarray:
    """Return Gauss-Markov processes of unit variance a second apart, shape (process, second)."""
    kept = np.exp(-1.0 / np.broadcast_to(time_s, num))
    slow = np.empty((num, steps))
    slow[:, 0] = rng.standard_normal(num)
    shocks = np.sqrt(1.0 - kept**2)[:, None] * rng.standard_normal((num, steps))
    for second in range(1, steps):
        slow[:, second] = kept * slow[:, second - 1] + shocks[:, second]
    return slow
