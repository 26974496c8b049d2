"""Simulated fleets whose machines differ in noise, in heat that no network tells, and in an effect.

Independent of heatrun and lptn: the machines of `fleet_cases`, into whose nodes heat comes and goes
that nobody measures. That heat is smoother than the Gauss-Markov process that heatrun takes it for:
a random force through two lags, whose time is another in each machine.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from fleet_cases import (
    EVERY,
    SAMPLE_S,
    Fleet,
    courses,
    draw_fleet,
    loaded,
    slowly,
    write_bench,
)
from fleet_cases import MOTOR as TYPE

NOISE = ("noise_sd", "noise_time", "noise_white", "unmodelled_heat")
NOISE_CENTRE = np.array([0.15, 45.0, 0.04, 1.0])
"""Of the types: K, s, K (of a mean over 20 s); the heat is one of `HEATS`."""

HEATS = (0.0015, 0.005)
"""Heat that nobody measures, over the mean loss [1]: half of the types have the one, half the
other. The smaller is what heatrun takes as usual."""

NOISE_SPREAD = np.array([0.25, 0.15, 0.20, 0.40])
"""Middle of the spreads of the types, of the logarithm [1]; as for the parameters, each type's are
up to 1.5 times as large or as small. The types' centres differ by as much again."""

OTHER_NOISE = 0.05
"""Share of machines with noise of another kind: their slow part or their heat is larger by a factor
drawn between the two numbers of `TIMES`."""

TIMES = (5.0, 9.0)

EFFECT, IRON_W, IRON_SPREAD = "iron_loss_in_winding", 33.0, 0.13
"""What half of the types have: loss that warms the winding first, centre of the types [W], and
standard deviation of the logarithm over machines; the centres differ by 20 %."""

HEAT_S = (400.0, 900.0)
"""Each of the two lags of the heat that nobody measures [s]."""

MOTOR = f'{TYPE}[columns]\nspeed_rpm = "n"\n'


@dataclass(frozen=True)
class NoisyFleet:
    machines: Fleet  # Their thermal parameters.
    noise_mean: np.ndarray  # Of the logarithms over machines, shape (noise,).
    noise_sd: np.ndarray  # Likewise, machines of another noise left aside, shape (noise,).
    noise: np.ndarray  # Logarithms of each machine's noise, shape (machine, noise).
    is_other: np.ndarray  # Machines with another noise, shape (machine,).
    iron_median_W: float  # Of the effect over machines [W]; 0 where the type has none.
    iron_W: np.ndarray  # Of each machine, shape (machine,).


def draw_noisy_fleet(
    seed: int, num: int, *, has_effect: bool, heat: float = HEATS[0]
) -> NoisyFleet:
    """Return a fleet of a type that is drawn too."""
    rng = np.random.default_rng([seed, 3])
    mean = np.log(NOISE_CENTRE * [1.0, 1.0, 1.0, heat]) + NOISE_SPREAD * rng.standard_normal(4)
    sd = NOISE_SPREAD * 1.5 ** rng.uniform(-1.0, 1.0, 4)
    noise = mean + sd * rng.standard_normal((num, 4))
    is_other = rng.permutation(np.arange(num) < round(OTHER_NOISE * num))
    for place in np.flatnonzero(is_other):
        noise[place, rng.choice([0, 3])] += np.log(rng.uniform(*TIMES))
    median = IRON_W * np.exp(0.2 * rng.standard_normal()) * has_effect
    iron_W = median * np.exp(IRON_SPREAD * rng.standard_normal(num))
    machines = draw_fleet(seed, num, outliers=0.0, short=0.0)
    return NoisyFleet(machines, mean, sd, noise, is_other, float(median), iron_W)


def write_noisy_fleet(
    fleet: NoisyFleet, folder: Path, seed: int, *, minutes: float, places: range, motor: str = ""
) -> Path:
    """Write motor file, tests, table of machines and fleet file; return the last.

    Args:
        fleet: The machines.
        folder: Where they go; made.
        seed: Random seed of loads, instruments and noise.
        minutes: Length of the tests [min]; one of less than an hour is under one load.
        places: Of the machines that are tested.
        motor: Further sections of the motor file.
    """
    has_effect = fleet.iron_median_W > 0.0 and "[population]" not in motor
    effects = f'[model]\neffects = ["{EFFECT}"]\n' if has_effect else ""
    rng = np.random.default_rng([seed, 4, round(minutes)])
    columns = _readings(fleet, np.array(places), minutes, rng)
    names = [fleet.machines.machines[place] for place in places]
    table = ["machine,type,test", *(f"{name},simulated,tests/{name}.csv" for name in names)]
    tests = [(machine, {name: column[row] for name, column in columns.items()})
             for row, machine in enumerate(names)]  # fmt: skip
    return write_bench(folder, MOTOR + effects + motor, "simulated", table, tests)


def _readings(
    fleet: NoisyFleet, places: np.ndarray, minutes: float, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """Return what the bench writes, by column, shape (machine, sample) each."""
    loads = loaded(places.size, minutes, (50.0, 120.0), (120.0, 320.0), rng)
    num, steps = loads.current.shape
    slow_K, slow_s, white_K, heat = np.exp(fleet.noise[places]).T
    # of the loss as it would be at 60 degC: what is missed does not follow the temperature
    warm = 3.0 * loads.ohm[:, None] * 1.14 * loads.current**2 + loads.other
    size = (heat * warm.mean(axis=1))[:, None]
    lasting = rng.uniform(*HEAT_S, num)
    missed = np.stack([size * smoothly(num, steps, lasting, rng) for _ in range(2)])
    values, iron_W = np.exp(fleet.machines.logs[places]), fleet.iron_W[places]
    winding, copper = courses(values, loads.current, loads.other, loads.ohm, iron_W, missed)
    slow = slow_K[:, None] * slowly(num, steps, slow_s, rng)[:, EVERY]
    white = white_K[:, None] * np.sqrt(20.0 / SAMPLE_S) * rng.standard_normal(slow.shape)
    turning = np.where(np.arange(steps) >= 60, 3000.0, 0.0)[EVERY]
    read = loads.read(winding, copper, slow + white)
    return read | {"n": np.broadcast_to(turning, slow.shape)}


def smoothly(num: int, steps: int, lag_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """Return processes of unit variance whose slope is continuous, shape (process, second)."""
    warm_up = round(8.0 * lag_s.max())
    once = slowly(num, steps + warm_up, lag_s, rng)
    kept = np.exp(-1.0 / lag_s)
    twice = np.empty_like(once)
    twice[:, 0] = once[:, 0]
    for second in range(1, once.shape[1]):
        twice[:, second] = kept * twice[:, second - 1] + (1.0 - kept) * once[:, second]
    return np.sqrt(2.0) * twice[:, warm_up:]  # a lag as long as the process takes half its variance
