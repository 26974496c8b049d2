"""Stretches in which the reading of the winding stands still although its heat balance does not.

A reading rounded to 1 degC stands still for minutes on any plateau, so the length of a constant
stretch says nothing by itself. What the record says elsewhere does: a crude two-node network is
fitted outside of the stretch and tells how far the temperature must have moved inside.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...motor import Motor
from ..record import Record
from .crude_fit import crude_fit
from .rounding import rounding_step
from .samples import is_loaded, runs, samples

LIVE_STEP_K = 0.05
"""Below this rounding step the last digit of a live thermocouple flickers."""

LIVE_SAMPLES = 20
LIVE_S = 10.0
"""So many equal readings in a row of a channel whose last digit flickers are no chance: even at one
chance in two of a repeat it is one in a million."""

MIN_STRETCH_S = 120.0
"""Under two minutes a rounded reading may stand still anywhere."""

MAX_TRIED = 3
"""Each stretch costs a fit; the longest ones are tried."""

MOVED_STEPS = 3.0
"""Rounding hides one step of movement and the network is crude: three must be missing."""

DOUBT_RMS = 3.0
"""Where the network describes the rest badly, a movement counts from three times its rms
residual."""


@dataclass(frozen=True)
class Stretch:
    """A stretch in which the reading did not move.

    Attributes:
        from_s: Its first sample [s].
        to_s: Its last sample [s].
        reading_degC: What the sensor read all along [degC].
        expected_K: How far, from lowest to highest, the heat balance says that it should have moved
            [K]; 0 where no network describes the rest.
        doubt_K: How far that may be wrong [K].
        is_live: The last digit flickers elsewhere, so that standing still is telling by itself.
        is_left_by_jump: The reading moves on by more than two rounding steps at once.
    """

    from_s: float
    to_s: float
    reading_degC: float
    expected_K: float
    doubt_K: float
    is_live: bool
    is_left_by_jump: bool


def frozen_stretches(record: Record, motor: Motor) -> tuple[Stretch, ...]:
    """Return where the winding temperature stands still though heat must have moved it.

    Args:
        record: Any record.
        motor: Says which channel is the sink.

    Returns:
        The stretches in time order; none where the record is too short to tell.
    """
    time_s, winding, losses = samples(record, "winding_degC", "losses_W")
    if time_s.size < LIVE_SAMPLES:
        return ()
    step = rounding_step(winding)
    is_live = step is None or step < LIVE_STEP_K
    first, past = runs(np.diff(winding) == 0.0)
    length_s = time_s[past] - time_s[first]
    if is_live:
        long = (past - first >= LIVE_SAMPLES) & (length_s >= LIVE_S)
    else:
        long = length_s >= MIN_STRETCH_S
    if long.sum() > MAX_TRIED:
        long &= length_s >= np.sort(length_s)[-MAX_TRIED]
    loaded = is_loaded(losses)
    found = []
    for a, b in zip(first[long], past[long], strict=True):
        from_s, to_s = float(time_s[a]), float(time_s[b])
        expected, doubt = _expected_move(record, motor, from_s, to_s)
        if is_live:
            is_frozen = bool(loaded[a : b + 1].any())
        else:
            is_frozen = expected > MOVED_STEPS * (step or 0.0) + doubt
        if is_frozen:
            leap = abs(float(winding[min(b + 1, winding.size - 1)] - winding[b]))
            is_jump = leap > 2.0 * (step or LIVE_STEP_K)
            found.append(
                Stretch(from_s, to_s, float(winding[a]), expected, doubt, is_live, is_jump)
            )
    return tuple(found)


def _expected_move(record: Record, motor: Motor, from_s: float, to_s: float) -> tuple[float, float]:
    """How far a network fitted without a stretch moves inside it [K], and its own doubt [K]."""
    fit = crude_fit(record, motor, left_out_s=(from_s, to_s))
    if fit is None:
        return 0.0, 0.0
    inside = (fit.time_s > from_s) & (fit.time_s < to_s)
    if not inside.any():
        return 0.0, 0.0
    return float(np.ptp(fit.fitted_degC[inside])), DOUBT_RMS * fit.rms_K
