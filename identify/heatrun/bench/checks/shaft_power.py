"""Losses that are nearly torque times speed: are they losses at all?"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...motor import Motor
from ..channels.derive import recorded_shaft_power
from ..record import Finding, Record
from .balance_errors import BLOCK_S, LEAST_POWER
from .losses import copper_shares
from .samples import block_means, place, samples

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
