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
from ..rounding import rounding_step
from .crude_fit import crude_fit
from .samples import is_loaded, runs, samples, with_all_heat

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

MAX_TOPS = 200
"""More stretches at the highest reading than this are a rounded plateau that flickers."""

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
    """

    from_s: float
    to_s: float
    reading_degC: float
    expected_K: float
    doubt_K: float
    is_live: bool


def frozen_stretches(record: Record, motor: Motor) -> tuple[Stretch, ...]:
    """Return where the winding temperature stands still though heat must have moved it.

    Args:
        record: Any record.
        motor: Says which channel is the sink.

    Returns:
        The stretches in time order; none where the record is too short to tell.
    """
    time_s, winding, losses = samples(with_all_heat(record, motor), "winding_degC", "losses_W")
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
            found.append(Stretch(from_s, to_s, float(winding[a]), expected, doubt, is_live))
    return tuple(found)


def _expected_move(record: Record, motor: Motor, from_s: float, to_s: float) -> tuple[float, float]:
    """How far a network fitted without a stretch moves inside it [K], and its own doubt [K]."""
    fit = crude_fit(record, motor, left_out_s=[(from_s, to_s)])
    if fit is None:
        return 0.0, 0.0
    inside = (fit.time_s > from_s) & (fit.time_s < to_s)
    if not inside.any():
        return 0.0, 0.0
    return float(np.ptp(fit.fitted_degC[inside])), DOUBT_RMS * fit.rms_K


def hidden_above_top(record: Record, motor: Motor) -> float:
    """Return how far a rounded winding temperature is cut off at its highest reading.

    The network is fitted to all but the samples at the highest reading, and tells how far they
    should have gone beyond it.

    Args:
        record: Any record.
        motor: Says which channel is the sink.

    Returns:
        Hidden temperature [K]; 0 where no more than rounding and the network's own doubt explain.
    """
    time_s, winding = samples(record, "winding_degC")
    step = rounding_step(winding)
    if step is None or step < LIVE_STEP_K:
        return 0.0
    top = float(winding.max())
    first, past = runs(winding == top)
    # A single crest of a live reading is no top; thousands of runs are flicker, not a cut.
    if not 0 < first.size <= MAX_TOPS:
        return 0.0
    spans = [(float(time_s[a]), float(time_s[b - 1])) for a, b in zip(first, past, strict=True)]
    fit = crude_fit(record, motor, left_out_s=spans)
    if fit is None:
        return 0.0
    inside = np.zeros(fit.time_s.size, dtype=bool)
    for from_s, to_s in spans:
        inside |= (fit.time_s >= from_s) & (fit.time_s <= to_s)
    if not inside.any():
        return 0.0
    hidden = float(np.max(fit.fitted_degC[inside])) - top
    return hidden if hidden > MOVED_STEPS * step + DOUBT_RMS * fit.rms_K else 0.0
