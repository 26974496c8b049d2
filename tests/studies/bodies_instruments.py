"""What the bench reads of a machine: instruments with errors drawn from what is declared of them.

Noise of the sensors is correlated over a minute, readings are rounded to 0.1 K, and the losses
wander by 0.2 %, which no prior knows of.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from bodies_machines import Courses
from scipy.signal import lfilter, lsim

RESOLUTION_K = 0.1
NOISE_S = 60.0
NOISE_SHARE = 1e-3
"""White noise of currents and powers over their readings [1]."""


@dataclass(frozen=True)
class Sensor:
    """The sensor of a body.

    Attributes:
        gain: Relative error of the rise [1].
        offset_K: Offset [K].
        lag_s: Time constant [s].
    """

    gain: float
    offset_K: float
    lag_s: float

    def read(self, rng: np.random.Generator, courses: Courses, degC: np.ndarray) -> np.ndarray:
        """Return the readings of a body's temperature [degC]."""
        seen = lagging(degC, self.lag_s) if self.lag_s > 0.0 else degC
        rise = seen - courses.sink_degC
        return rounded(rng, courses.sink_degC + (1.0 + self.gain) * rise + self.offset_K)


@dataclass(frozen=True)
class Bench:
    """Errors of a bench, the same in all tests of a machine.

    Attributes:
        loss_gain: Relative error of the losses [1].
        current_gain: Relative error of the current [1].
        ohm_gain: Relative error of the phase resistance in the motor file [1].
        sink_offset_K: Error of the sink's temperature [K].
        winding: The winding's sensor.
    """

    loss_gain: float
    current_gain: float
    ohm_gain: float
    sink_offset_K: float
    winding: Sensor


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
    """Return the slow wander of a wattmeter [1]."""
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
    """Return the losses as they are measured [W]."""
    true = courses.copper_W + courses.other_W
    seen = true * (1.0 + bench.loss_gain + wandering(rng, courses.time_s))
    return seen * (1.0 + NOISE_SHARE * rng.standard_normal(true.size))
