"""The instruments: what the bench writes down of the truth."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from .thermal import Truth


@dataclass(frozen=True)
class Instruments:
    """Errors of the bench's instruments.

    Attributes:
        drift_sd_K: Standard deviation of the winding sensor's slow error, an Ornstein-Uhlenbeck
            process: contact, cable, local flow of air [K].
        drift_time_s: Its correlation time [s].
        white_sd_K: Standard deviation of the winding sensor's white noise [K].
        offset_K: Constant error of the winding sensor [K].
        resolution_K: Step of the winding channel [K]; 0 leaves it unrounded.
        truncates: The step cuts off instead of rounding.
        ambient_sd_K: White noise of the ambient sensor [K].
        ambient_resolution_K: Step of the ambient channel [K]; 0 leaves it unrounded.
        current_sd_A: White noise of the phase current [A].
        power_floor_W: White noise of the loss balance at standstill [W].
        power_noise: White noise of the loss balance in parts of the losses [1].
        power_gain_error: Constant error of the loss balance in parts of the losses [1].
        speed_sd_rpm: White noise of the speed while turning [rpm].
    """

    drift_sd_K: float = 0.2
    drift_time_s: float = 20.0
    white_sd_K: float = 0.1
    offset_K: float = 0.0
    resolution_K: float = 1.0
    truncates: bool = False
    ambient_sd_K: float = 0.03
    ambient_resolution_K: float = 0.1
    current_sd_A: float = 0.05
    power_floor_W: float = 0.5
    power_noise: float = 0.01
    power_gain_error: float = 0.0
    speed_sd_rpm: float = 0.8


def measure(
    truth: Truth, rng: np.random.Generator, instruments: Instruments | None = None
) -> dict[str, NDArray[np.float64]]:
    """Return the columns that the bench writes down.

    Every channel has its own stream of chance, so that changing one instrument leaves the noise of
    the others as it was.

    Args:
        truth: What happened, equally spaced in time.
        rng: Source of chance.
        instruments: Errors of the instruments; the defaults are those of the bundled records.

    Returns:
        Columns under the names of the thesis, each of shape (time,): `t` [s], `Is` phase current,
        rms [A], `Pd` losses, electrical in minus mechanical out [W], `Te` ambient temperature
        [degC], `Tw_m` winding temperature [degC]; and `speed_rpm`.
    """
    with_errors = instruments or Instruments()
    of_winding, of_ambient, of_current, of_power, of_speed = rng.spawn(5)
    size = truth.time_s.size
    winding = (
        truth.winding_degC
        + with_errors.offset_K
        + _drift(with_errors, truth.time_s, of_winding)
        + with_errors.white_sd_K * of_winding.standard_normal(size)
    )
    ambient = truth.ambient_degC + with_errors.ambient_sd_K * of_ambient.standard_normal(size)
    # An rms value is never negative: noise around no current shows as a small positive one.
    current = np.abs(truth.current_A + with_errors.current_sd_A * of_current.standard_normal(size))
    power_sd = np.hypot(with_errors.power_floor_W, with_errors.power_noise * truth.losses_W)
    power = truth.losses_W * (1.0 + with_errors.power_gain_error)
    turning = np.where(truth.speed_rpm > 0.0, with_errors.speed_sd_rpm, 0.0)
    return {
        "t": truth.time_s,
        "Is": current,
        "Pd": power + power_sd * of_power.standard_normal(size),
        "Te": _stepped(ambient, with_errors.ambient_resolution_K, truncates=False),
        "Tw_m": _stepped(winding, with_errors.resolution_K, truncates=with_errors.truncates),
        "speed_rpm": np.abs(truth.speed_rpm + turning * of_speed.standard_normal(size)),
    }


def _drift(
    instruments: Instruments, time_s: NDArray[np.float64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """The exact Ornstein-Uhlenbeck process on equally spaced samples, stationary from the start."""
    keep = float(np.exp(-(time_s[1] - time_s[0]) / instruments.drift_time_s))
    shocks = rng.standard_normal(time_s.size)
    shocks[1:] *= np.sqrt(1.0 - keep**2)
    course = accumulate(shocks.tolist(), lambda before, shock: keep * before + shock)
    return instruments.drift_sd_K * np.array(list(course))


def _stepped(values: NDArray[np.float64], step: float, *, truncates: bool) -> NDArray[np.float64]:
    if step == 0.0:
        return values
    return step * (np.floor(values / step) if truncates else np.rint(values / step))
