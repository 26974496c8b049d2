"""What is known of how far a reading may be off, and the rise that it is held against."""

from __future__ import annotations

import numpy as np

from heatrun.bench.channels.schema import CHANNEL
from heatrun.bench.checks.samples import samples, sink_channel
from heatrun.bench.record import Record
from heatrun.bench.rounding import rounding_step
from heatrun.inference.instruments import CURRENT_GAIN, INSTRUMENTS
from heatrun.motor import Motor

from ..card import NOT_OF_THE_MACHINE
from ..reference import Limits, Reference
from .pair import Pair
from .tolerances import Scale

HELD = 0.95
"""The rise is what is exceeded for the rest of the time [1]: a spike is no rise."""

TWO_SIDED_95 = 1.96
"""Standard deviations from the middle of a 95 % band to its limits [1]."""

GAINS = {"phase_current_A": "current_gain", "dc_current_A": "current_gain",
         "losses_W": "power_gain"}  # fmt: skip
"""Channels whose relative error has a class among the instruments of a calibration."""

CLASSES = {p.name: p.sd for p in (*INSTRUMENTS, CURRENT_GAIN)}


def scale_of(channel: str, pair: Pair, reference: Record, motor: Motor) -> Scale:
    """Return what a difference in a signal matters against.

    Args:
        channel: A signal of the pair.
        pair: Both on one axis.
        reference: The reference on its own clock.
        motor: Says which channel is the sink.
    """
    symbol = CHANNEL[channel].unit
    theirs = pair.theirs[channel]
    known = theirs[np.isfinite(theirs)]
    if symbol != "degC":
        return Scale(float(np.max(np.abs(known), initial=0.0)), "magnitude", symbol)
    if channel in NOT_OF_THE_MACHINE or known.size == 0:
        return Scale(0.0, "rise", "K")
    clock, part, cold = samples(reference, channel, sink_channel(motor))
    clock = clock + pair.offset.offset_s
    inside = (clock >= pair.time_s[0]) & (clock <= pair.time_s[-1])
    rise = (part - cold)[inside] if inside.any() else known - np.min(known)
    return Scale(max(float(np.quantile(rise, HELD)), 0.0), "rise", "K")


def combined_uncertainty(
    channel: str,
    scale: Scale,
    test: Record,
    reference: Reference,
    band: Limits | None,
    motor: Motor,
) -> float:
    """Return the combined standard uncertainty of a difference, in the unit of the channel.

    Args:
        channel: A signal of both.
        scale: Rise or largest magnitude.
        test: The test.
        reference: The other prototype's record; of a simulation only its band counts.
        band: Its 95 % limits, or None.
        motor: Holds what the motor file says of the instruments.
    """
    ours = reading_uncertainty(channel, scale, test, motor)
    if band is not None:
        half = 0.5 * (band[1] - band[0])
        known = half[np.isfinite(half)]
        theirs = float(np.sqrt(np.mean(known**2))) / TWO_SIDED_95 if known.size else 0.0
    elif reference.is_simulated:
        theirs = 0.0
    else:
        theirs = reading_uncertainty(channel, scale, reference.record, motor)
    return float(np.hypot(ours, theirs))


def reading_uncertainty(channel: str, scale: Scale, record: Record, motor: Motor) -> float:
    """Return the standard uncertainty of a reading: class of its sensor, and step of its readings.

    Args:
        channel: A measured signal.
        scale: Rise [K] or largest magnitude.
        record: Where it stands.
        motor: Holds what the motor file says of the instruments.
    """
    step = rounding_step(samples(record, channel)[1]) or 0.0
    parts = [step / np.sqrt(12.0)]
    if channel == sink_channel(motor):
        parts.append(instrument_class("ambient_offset", motor))
    elif channel.endswith("_degC"):
        parts += [
            instrument_class("sensor_offset", motor),
            instrument_class("sensor_gain", motor) * scale.value,
        ]
    elif channel in GAINS:
        parts.append(instrument_class(GAINS[channel], motor) * scale.value)
    return float(np.sqrt(np.sum(np.square(parts))))


def instrument_class(name: str, motor: Motor) -> float:
    """Return the standard uncertainty of an instrument: the motor file's, else that of its class.

    Args:
        name: Such as `"current_gain"`, as `[parameters]` of the motor file calls it.
        motor: Its overrides; 0 where it holds the value fixed.
    """
    given = motor.parameters.get(name)
    if given is not None and given.fixed is not None:
        return 0.0
    return CLASSES[name] if given is None or given.sd is None else given.sd
