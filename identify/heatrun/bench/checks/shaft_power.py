"""Losses against the power of the shaft: as a motor and as a generator, and are they losses at all?

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
from .losses import BLOCK_S, SHAFT_GAIN_SD, copper_shares
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


LEAST_RATIO, MOST_RATIO = 0.97, 2.0
"""Losses over mechanical power [1] between which they may be the input power: an efficiency of 50 %
and more, and instruments of 3 %."""

SAME_POWER = 0.03
"""Losses that are the mechanical power itself agree with it to this share [1]."""

HOLDS = 0.9
"""Part of the loaded blocks in which it must be so [1]."""

SPREAD = 0.15
"""Standard deviation of the logarithm of that ratio [1]; losses of a machine go with its square."""

MOST_COPPER = 0.5
"""Copper loss over such losses [1] above which they may be losses all the same."""


def losses_of_shaft(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Report recorded losses that are nearly torque times speed.

    They are the input power, or the shaft's own. An error where the load varies and the copper
    loss is known to be a small part of them, else a warning: an efficiency may be below 50 %.
    """
    shaft = recorded_shaft_power(record.channels) if motor.losses == "balance" else None
    reading = next((one for one in record.mapping if one.channel == "losses_W"), None)
    if shaft is None or reading is None or reading.unit_from == "derived":
        return ()
    channels = {**record.channels, "mechanical_power_W": np.abs(shaft)}
    time_s, losses, power = samples(
        replace(record, channels=channels), "losses_W", "mechanical_power_W"
    )
    time_s, losses, power = block_means(time_s, BLOCK_S, losses, power)
    is_driven = power > LEAST_POWER * np.max(power, initial=0.0)
    if np.sum(is_driven) < 6 or not np.all(losses[is_driven] > 0.0):
        return ()
    ratio = losses[is_driven] / power[is_driven]
    is_near = (ratio > LEAST_RATIO) & (ratio < MOST_RATIO)
    _, share = copper_shares(record, motor)
    copper = float(np.median(share)) if share.size else None
    if (
        float(np.mean(is_near)) < HOLDS
        or float(np.std(np.log(ratio))) > SPREAD
        or (copper is not None and copper > MOST_COPPER)
    ):
        return ()
    typical = float(np.median(ratio))
    is_output = float(np.quantile(np.abs(ratio - 1.0), HOLDS)) < SAME_POWER
    is_varied = float(np.ptp(power[is_driven])) > 0.3 * float(np.max(power))
    line = f'"{reading.column}" under [columns]'
    return (
        Finding(
            "losses_of_shaft",
            "error" if is_varied and copper is not None else "warning",
            f"Expected losses; losses_W is {typical:.3g} times torque·omega at every load: "
            + (
                "it is the power of the shaft."
                if is_output
                else f"it is the input power, at an efficiency of {100.0 / typical:.0f} %."
            ),
            place(record, "losses_W", float(time_s[0]), float(time_s[-1])),
            f"Write mechanical_power_W = {line} in place of losses_W, and record the electrical "
            "power: the losses are the difference."
            if is_output
            else f"Write electrical_power_W = {line} in place of losses_W: the losses are then "
            "what the shaft does not take.",
            values={"ratio": typical, "is_output": float(is_output)},
        ),
    )


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
