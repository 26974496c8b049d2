"""Records with a known truth for the coverage study: motors, tests, instruments and noise.

The temperatures come from the simulated bench of `data/synthetic`, which integrates in plain NumPy
and shares no code with the packages; what its instruments do not know (type B errors, heavy tails,
noise that changes during the test) is added here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np
from bench_package import bench

DURATIONS_S = (1800.0, 3600.0, 5400.0)
"""Lengths of the calibration tests: few, because each length is compiled once."""

KINDS = ("staircase", "constant_load", "duty", "drive_cycle")
HELD_OUT = {"staircase": "duty", "constant_load": "staircase", "duty": "drive_cycle",
            "drive_cycle": "duty"}  # fmt: skip

PERIOD_S = 0.25
"""Sampling period of the electrical channels [s]. Torque ramps take half a second: point samples
at 1 Hz would misjudge the energy of a duty of pulses by up to a percent."""

READING_S = 1.0
"""Time between readings of the winding [s]; the record holds no number in between."""

STEP_S = 0.125
"""Runge-Kutta step [s], far below what any winding notices."""

POWER_NOISE = 0.01
POWER_FLOOR_W = 0.5
AMBIENT_SD_K = 0.03
HEAT_KNOT_S = 10.0
CURRENT_SD_A = 0.05


@dataclass(frozen=True)
class Errors:
    """Constant errors of the bench, the same in all tests of a machine."""

    current_gain: float = 0.0  # What the current is to be multiplied by, less 1 [1].
    power_gain: float = 0.0  # What the loss channel is to be multiplied by, less 1 [1].
    sensor_gain: float = 0.0  # Relative error of the measured rise [1].
    sensor_offset: float = 0.0  # Error of the winding sensor [K].
    ambient_offset: float = 0.0  # What is to be added to the measured sink [K].
    Rs0: float = 0.0  # Logarithm of true over stated phase resistance [1].

    @classmethod
    def drawn(cls, scores: np.ndarray, sd: Mapping[str, float]) -> Errors:
        names = cls.__dataclass_fields__
        return cls(**{name: float(sd[name] * z) for name, z in zip(names, scores, strict=True)})


@dataclass(frozen=True)
class SensorNoise:
    sd_K: float  # Standard deviation of the Ornstein-Uhlenbeck part [K].
    time_s: float  # Its correlation time [s].
    white_sd_K: float  # Standard deviation of the white part of one sample at 1 Hz [K].
    resolution_K: float = 0.1  # Step of the reading [K].
    truncates: bool = False  # The step cuts off instead of rounding.
    is_heavy: bool = False  # Shocks of both parts are Student t with three degrees of freedom.
    grows: float = 1.0  # Factor on the level in the second half of the test [1].

    def draw(self, time_s: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Return the error of each sample before rounding [K], shape (time,)."""
        period = float(time_s[1] - time_s[0])
        keep = float(np.exp(-period / self.time_s))
        shocks = self._shocks(rng, time_s.size)
        shocks[1:] *= np.sqrt(1.0 - keep**2)
        slow = np.array(list(accumulate(shocks.tolist(), lambda x, s: keep * x + s)))
        white = self.white_sd_K / np.sqrt(period) * self._shocks(rng, time_s.size)
        level = np.where(time_s > 0.5 * time_s[-1], self.grows, 1.0)
        return level * (self.sd_K * slow + white)

    def _shocks(self, rng: np.random.Generator, num: int) -> np.ndarray:
        if not self.is_heavy:
            return rng.standard_normal(num)
        return rng.standard_t(3.0, num) / np.sqrt(3.0)  # of variance 1

    def rounded(self, reading: np.ndarray) -> np.ndarray:
        steps = reading / self.resolution_K
        return self.resolution_K * (np.floor(steps) if self.truncates else np.rint(steps))


@dataclass(frozen=True)
class HiddenHeat:
    """Heat into both nodes that the network knows nothing of, as its prior has it."""

    share: float  # Standard deviation over the mean loss of the test [1].
    time_s: float = 1200.0  # Correlation time [s].

    def course(
        self, mean_loss_W: float, duration_s: float, rng: np.random.Generator
    ) -> Callable[[np.ndarray], np.ndarray]:
        """Return one course: heat into winding and stator [W] at given times [s]."""
        knots = np.arange(0.0, duration_s + HEAT_KNOT_S, HEAT_KNOT_S)
        keep = float(np.exp(-HEAT_KNOT_S / self.time_s))
        shocks = rng.standard_normal((2, knots.size))
        shocks[:, 1:] *= np.sqrt(1.0 - keep**2)
        sd = self.share * mean_loss_W
        courses = [list(accumulate(row.tolist(), lambda x, s: keep * x + s)) for row in shocks]
        return lambda time_s: np.stack([sd * np.interp(time_s, knots, row) for row in courses])


@dataclass(frozen=True)
class Simulated:
    channels: dict[str, np.ndarray]  # Canonical channels, each of shape (time,).
    # What the sensor would read without noise and rounding, shape (reading,).
    sensor_degC: np.ndarray
    start_degC: tuple[float, float]  # True winding and stator temperature at the start.


def run_test(
    machine: Any,
    kind: str,
    duration_s: float,
    errors: Errors,
    noise: SensorNoise,
    rng: np.random.Generator,
    period_s: float = PERIOD_S,
    stator_above_K: float = 0.0,
    heat: HiddenHeat | None = None,
) -> Simulated:
    """Return one test of a machine."""
    source = bench()
    cold = float(source.Room().temperature(np.zeros(1))[0])
    of_winding, of_ambient, of_current, of_power, of_heat = rng.spawn(5)

    def run(course: Callable[[np.ndarray], np.ndarray] | None = None) -> Any:
        return source.simulate(
            machine,
            getattr(source, kind)(duration_s),
            sample_s=period_s,
            steps_per_sample=round(period_s / STEP_S),
            start_degC=(cold, cold + stator_above_K),
            hidden_heat=course,
        )

    truth = run()
    if heat is not None:
        truth = run(heat.course(float(np.mean(truth.losses_W)), duration_s, of_heat))
    size = truth.time_s.size
    is_read = slice(None, None, round(READING_S / period_s))
    winding, ambient = truth.winding_degC[is_read], truth.ambient_degC[is_read]
    sensor = winding + errors.sensor_gain * (winding - ambient) + errors.sensor_offset
    reading = np.full(size, np.nan)
    reading[is_read] = noise.rounded(sensor + noise.draw(truth.time_s[is_read], of_winding))
    power_sd = np.hypot(POWER_FLOOR_W, POWER_NOISE * truth.losses_W)
    power = (truth.losses_W + power_sd * of_power.standard_normal(size)) / (1 + errors.power_gain)
    sink = truth.ambient_degC - errors.ambient_offset
    sink = sink + AMBIENT_SD_K * of_ambient.standard_normal(size)
    current = truth.current_A + CURRENT_SD_A * of_current.standard_normal(size)
    channels = {
        "time_s": truth.time_s,
        "phase_current_A": np.abs(current) / (1.0 + errors.current_gain),
        "losses_W": power,
        "ambient_degC": 0.1 * np.rint(sink / 0.1),
        "winding_degC": reading,
        "speed_rpm": truth.speed_rpm,
    }
    start = (float(truth.winding_degC[0]), float(truth.stator_degC[0]))
    return Simulated(channels, sensor, start)


def time_constants(values: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Return products and eigenvalues of the network as time constants [s], over draws."""
    C_w, C_sr, R_w, R_sr = (np.asarray(values[n]) for n in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"))
    sum_of_times = C_sr * R_sr + C_w * (R_w + R_sr)
    product = C_w * R_w * C_sr * R_sr
    root = np.sqrt(sum_of_times**2 - 4.0 * product)
    return {
        "tau_winding": R_w * C_w,
        "tau_stator": R_sr * C_sr,
        "tau_fast": 2.0 * product / (sum_of_times + root),
        "tau_slow": 0.5 * (sum_of_times + root),
    }


def nearest_duration(machine: Any, spans: float) -> float:
    network = {name: getattr(machine, name) for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")}
    wanted = spans * float(time_constants(network)["tau_slow"])
    return min(DURATIONS_S, key=lambda duration: abs(np.log(duration / wanted)))
