"""Losses as a motor against losses as a generator: a check of the mechanical power's scale.

Losses from a balance are a small difference of two large powers. Where one of them reads too much,
the error is a share of the mechanical power and changes its sign with it: the machine seems to lose
more as a motor than at the same current and speed as a generator, or the reverse.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...motor import Motor
from ..channels.derive import recorded_shaft_power
from ..record import Finding, Record
from .losses import BLOCK_S, SHAFT_GAIN_SD
from .samples import block_means, place, samples

LEAST_SHARE = 0.1
"""Share of the blocks that each direction of the power needs [1]."""

LEAST_POWER = 0.2
"""In parts of the largest mechanical power [1]: blocks below say nothing of its scale."""

LARGEST_GAIN = 2.0 * SHAFT_GAIN_SD
"""What every fit allows for [1]."""

SIGMAS = 6.0
"""Standard deviations from which the gain is no matter of scatter [1]."""

EXPLAINED = 0.5
"""Part of the scatter that the mechanical power must explain [1]: losses that current and speed do
not tell, such as those in field weakening, may go with it by chance."""


def shaft_power_disagrees(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Report losses that go with the sign of the mechanical power.

    Losses are laid out over current squared, speed, speed squared, their product and the mechanical
    power. Needs current, speed, losses from a balance, torque or mechanical power, and a load in
    both directions.
    """
    shaft = recorded_shaft_power(record.channels) if motor.losses == "balance" else None
    if shaft is None or "speed_rpm" not in record:
        return ()
    channels = {**record.channels, "mechanical_power_W": np.asarray(shaft, dtype=float)}
    columns = samples(
        replace(record, channels=channels), "phase_current_A", "speed_rpm", "losses_W",
        "mechanical_power_W",
    )  # fmt: skip
    if columns[0].size < 2:
        return ()
    time_s, current_squared, speed, losses, power = block_means(
        columns[0], BLOCK_S, columns[1] ** 2, np.abs(columns[2]), columns[3], columns[4]
    )
    is_driven = np.abs(power) > LEAST_POWER * np.max(np.abs(power), initial=0.0)
    as_motor, as_generator = (float(np.mean(is_driven & (s * power > 0.0))) for s in (1.0, -1.0))
    if min(as_motor, as_generator) < LEAST_SHARE:
        return ()
    known = np.stack(
        [np.ones(speed.size), current_squared, speed, speed**2, current_squared * speed], axis=1
    )
    without = _rest(known, losses)
    beside = _rest(known, power)
    if np.sum(beside**2) < 1e-3 * np.sum(power**2):  # current and speed tell the power's sign
        return ()
    gain = float(beside @ without / (beside @ beside))
    left = without - gain * beside
    sd = float(np.sqrt(left @ left / max(left.size - 6, 1) / (beside @ beside)))
    explained = 1.0 - float(left @ left / (without @ without))
    if abs(gain) <= LARGEST_GAIN or abs(gain) < SIGMAS * sd or explained < EXPLAINED:
        return ()
    return (
        Finding(
            "shaft_power_disagrees",
            "warning",
            "Expected about the same losses as a motor and as a generator at the same current and "
            f"speed; they differ by {100.0 * abs(gain):.2g} % of the mechanical power to each "
            f"side, more as a {'motor' if gain > 0.0 else 'generator'}: torque and electrical "
            "power do not have one scale.",
            place(record, "losses_W", float(time_s[0]), float(time_s[-1])),
            "Check gain and zero of the torque transducer. The fit estimates shaft_power_gain with "
            "a prior of 1 %; [parameters.shaft_power_gain] sd = "
            f"{max(0.02, round(abs(gain), 2)):.2g} allows for this error.",
            values={"gain": gain, "sd": sd, "as_motor": as_motor, "as_generator": as_generator},
        ),
    )


def _rest(known: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return what is left of values after a linear fit by the known columns."""
    scaled = known / np.maximum(np.sqrt(np.mean(known**2, axis=0)), 1e-300)
    return values - scaled @ np.linalg.lstsq(scaled, values, rcond=None)[0]
