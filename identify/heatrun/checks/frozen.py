"""A reading that stands still though its heat balance does not: stuck, or at the end of its range.

A reading rounded to 1 degC stands still for minutes on any plateau, so the length of a constant
stretch says nothing by itself. What the record says elsewhere does: a two-node network is
fitted outside of the stretch and tells how far the temperature must have moved inside. Of an
amplifier that is stuck the noise goes on: there the means of a few samples stand still.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..record.channels import BODIES
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import (
    channel_of,
    is_loaded,
    median_step,
    place,
    rounding_step,
    runs,
    samples,
    with_all_heat,
)
from ..record.stretch import windows, within
from .advice import Remedy, mask_line
from .quick_fit import QuickFit, course_of, fit_of, quick_fit
from .time_axis import GAP_STEPS, MAX_GAP_S, MAX_GAP_SHARE
from .unexplained import Movement

LIVE_STEP_K = 0.05
"""Below this rounding step the last digit of a live thermocouple flickers."""

FLICKERS = 0.5
"""Share of the readings elsewhere [1] that differ from the one before, where a last digit flickers:
a mean of three quiet sensors has a fine step and stands still all the same."""

LIVE_SAMPLES = 20
LIVE_S = 10.0
"""So many equal readings in a row of a channel whose last digit flickers are no chance: even at one
chance in two of a repeat it is one in a million."""

MIN_STRETCH_S = 120.0
"""Under two minutes a rounded reading may stand still anywhere."""

MAX_TRIED = 3
"""Each stretch costs a fit; the longest ones are tried."""

OF_NOISE, MOST_MEANS, LEAST_MEANS, BAND = 10, 400, 6, 2.5
"""Samples of a mean at least, means of a record at most, and of a stretch that stands still under
noise at least; they then differ by so many standard deviations of a sample at most [1]: of 400
means of ten, noise alone makes 2."""

OF_BENDS = 1.954
"""Mean size of the second difference of white noise over its standard deviation [1]."""

MAX_TOPS = 200
"""More stretches at the highest reading than this are a rounded plateau that flickers."""

MOVED_STEPS = 3.0
"""Rounding hides one step of movement and the network is simple: three must be missing."""

AS_WELL = 1.5
"""Residual of a network that describes as well over that of another [1]; of 23 sensors that stuck
the least had 2.4."""

DOUBT = 3.0
"""Where the network describes the rest badly, a movement counts from three times its rms residual
and its own standard deviation."""


@dataclass(frozen=True)
class Stretch:
    """A stretch in which the reading did not move."""

    from_s: float  # Its first sample [s].
    to_s: float  # Its last sample [s].
    reading_degC: float  # What the sensor read all along [degC].
    # How far, from lowest to highest, the heat balance says that it should have moved [K]; 0 where
    # no network describes the rest.
    expected_K: float
    doubt_K: float  # How far that may be wrong [K].
    # Where the heat balance takes it at its lowest [degC]; infinite without one.
    lowest_degC: float
    is_live: bool  # The last digit flickers elsewhere, so that standing still is telling by itself.
    # Noise that goes on while the reading stands still; 0 where it does not [K].
    noise_K: float = 0.0


class Looked(NamedTuple):
    """What the checks of the winding's reading share."""

    moved: Movement | None  # As `unexplained_movement`.
    stretches: tuple[Stretch, ...]  # As `frozen_stretches`.


def frozen_stretches(record: Record, motor: Motor) -> Iterator[Stretch]:
    """Yield where the winding stands still though heat must have moved it, in order of time."""
    time_s, winding, losses = samples(with_all_heat(record, motor), "winding_degC", "losses_W")
    if time_s.size < LIVE_SAMPLES:
        return
    step = rounding_step(winding)
    goes_on = np.diff(time_s) <= GAP_STEPS * median_step(time_s)
    first, past = runs((np.diff(winding) == 0.0) & goes_on)
    elsewhere = winding.size - 1 - np.max(past - first, initial=0)
    flickers = np.count_nonzero(np.diff(winding)) >= FLICKERS * elsewhere
    is_live = flickers and (step is None or step < LIVE_STEP_K)
    length_s = time_s[past] - time_s[first]
    if is_live:
        long = (past - first >= LIVE_SAMPLES) & (length_s >= LIVE_S)
    else:
        long = length_s >= MIN_STRETCH_S
    if long.sum() > MAX_TRIED:
        long &= length_s >= np.sort(length_s)[-MAX_TRIED]
    loaded = is_loaded(losses)
    exact = [(a, b, 0.0) for a, b in zip(first[long], past[long], strict=True)]
    stretches = sorted([*exact, *_under_noise(time_s, winding)])
    whole = quick_fit(record, motor) if stretches else None
    for a, b, under_K in stretches:
        is_told = is_live and not under_K
        if is_told and not loaded[a : b + 1].any():
            continue
        from_s, to_s = float(time_s[a]), float(time_s[b])
        hidden_K = MOVED_STEPS * max(step or 0.0, under_K)
        if under_K and whole is not None:
            moves = whole.fitted_degC[within(whole.time_s, [(from_s, to_s)])]
            if moves.size == 0 or np.ptp(moves) <= hidden_K:
                continue
        lowest, expected, doubt, has_moved = np.inf, 0.0, 0.0, False
        fit = quick_fit(record, motor, left_out_s=[(from_s, to_s)])
        if fit is not None and (inside := within(fit.time_s, [(from_s, to_s)])).any():
            course, doubt = fit.fitted_degC[inside], _doubt(fit, inside)
            lowest, expected = float(np.min(course)), float(np.ptp(course))
            has_moved = expected > hidden_K + doubt and not _is_as_well(whole, fit)
            if under_K and has_moved and np.max(winding[a : b + 1]) == np.max(winding):
                has_moved = not hidden_above_top(record, motor)  # `saturation` tells it
        if is_told or has_moved:
            reading = float(np.median(winding[a : b + 1]))
            yield Stretch(from_s, to_s, reading, expected, doubt, lowest, is_told, under_K)


def _under_noise(time_s: np.ndarray, winding: np.ndarray) -> list[tuple[int, int, float]]:
    """Return first and last samples of the longest stretches in which a reading stands still but
    for noise, and that noise [K]; none of them overlap.
    """
    width = max(OF_NOISE, winding.size // MOST_MEANS)
    num = winding.size // width
    if num < LEAST_MEANS:
        return []
    gap_s = GAP_STEPS * median_step(time_s)
    parts = winding[: num * width].reshape(num, width)
    means, bent = np.mean(parts, axis=1), np.mean(np.abs(np.diff(parts, 2)), axis=1) / OF_BENDS
    noise = np.array([np.median(bent[i : i + LEAST_MEANS]) for i in range(num)])
    reach = np.zeros(num, dtype=int)
    for i in np.flatnonzero(noise > 0.0):
        spread = np.maximum.accumulate(means[i:]) - np.minimum.accumulate(means[i:])
        reach[i] = np.count_nonzero(spread <= BAND * noise[i])
    found: list[tuple[int, int, float]] = []
    for _ in range(MAX_TRIED):
        i = int(np.argmax(reach))
        j = i + int(reach[i])
        a, b = i * width, j * width - 1
        if j - i < LEAST_MEANS:
            break
        reach[i:j] = 0
        reach[:i] = np.minimum(reach[:i], i - np.arange(i))
        # up to where the reading goes away for good
        is_off = np.abs(winding - np.median(winding[a : b + 1])) > 2.0 * BAND * noise[i]
        before, behind = np.flatnonzero(is_off[:a]), np.flatnonzero(is_off[b + 1 :])
        a = max(int(before[-1]) + 1 if before.size else 0, a - width)
        b = min(b + int(behind[0]) if behind.size else winding.size - 1, b + width)
        longest_s = np.max(np.diff(time_s[a : b + 1]))
        if time_s[b] - time_s[a] >= MIN_STRETCH_S and longest_s <= gap_s:
            found.append((a, b, float(noise[i])))
    return found


def _is_as_well(whole: QuickFit | None, fit: QuickFit) -> bool:
    """Whether a network fitted to all describes it as well as one that was fitted to less: then
    nothing stands still or is cut off, a steady load is steady.
    """
    return whole is not None and whole.rms_K < AS_WELL * fit.rms_K


def _doubt(fit: QuickFit, inside: np.ndarray) -> float:
    return DOUBT * float(np.hypot(fit.rms_K, np.max(fit.sd_K[inside])))


def hidden_above_top(record: Record, motor: Motor) -> float:
    """Return how far a rounded winding temperature is cut off at its highest reading [K].

    The network is fitted to all but the samples at the highest reading, and tells how far they
    should have gone beyond it. Where a steady load ends in them, the rest leaves the plateau open:
    nothing is cut off of what a network fitted to all describes as well, nor where rounding and the
    network's own doubt explain it.
    """
    time_s, winding = samples(record, "winding_degC")
    step = rounding_step(winding)
    if step is None or step < LIVE_STEP_K:
        return 0.0
    top = float(winding.max())
    spans = windows(time_s, winding == top)
    # A single crest of a live reading is no top; thousands of runs are flicker, not a cut.
    course = course_of(record, motor, left_out_s=spans) if len(spans) <= MAX_TOPS else None
    # most tops last less than a block, and no fit tells of them
    if course is None or not (inside := within(course.time_s, spans)).any():
        return 0.0
    fit = fit_of(course)
    hidden = -np.inf if fit is None else float(np.max(fit.fitted_degC[inside])) - top
    if fit is None or hidden <= MOVED_STEPS * step + _doubt(fit, inside):
        return 0.0
    return 0.0 if _is_as_well(quick_fit(record, motor), fit) else hidden


FLAT_RUN = 5
FLAT_SAMPLES = 20
"""A flat top is made of runs of at least `FLAT_RUN` equal samples and of `FLAT_SAMPLES` in all: two
or three equal readings at a crest are chance."""

HARMFUL_K = 2.0
"""Two kelvin is what a two-node network is expected to leave on a test; less hides in that."""

LETS_GO = 7
"""Samples from the last one at the end of a range that show how a reading leaves it [1]; the first
fall exceeds the mean of the others by half at most, where it decays within ten samples."""

STEADY = 0.05
"""In parts of the largest value [1]: a load that changes less is the same."""

REST_SHARE = 0.01
"""In parts of the largest value [1]: what an instrument reads of nothing."""

LIVE_SHARE = 0.9
"""A channel is live, so that equal readings mean something, if at least this share of its other
samples differ from the one before [1]; set-points and rounded readings are not."""


def sensor_stuck(record: Record, _: Motor, looked: Looked) -> Iterator[Finding]:
    """Report a winding temperature that stands still though heat flows.

    An error if more than 2 K of movement are missing, or the stretch is as long as a gap that is an
    error; otherwise a warning. Of another temperature a warning where its last digit flickers
    elsewhere.
    """
    yield from _stuck_beside(record)
    time_s, winding = samples(record, "winding_degC")
    if time_s.size > 2 and np.ptp(winding) == 0.0:
        yield Finding(
            "sensor_stuck",
            "error",
            f"Expected a temperature that changes; all {time_s.size} samples read "
            f"{winding[0]:.2f} °C: nothing can be fitted to them.",
            place(record, "winding_degC", float(time_s[0]), float(time_s[-1])),
            "Check the sensor, and which column is mapped as winding_degC.",
            values={"reading_degC": float(winding[0]), "from_s": float(time_s[0])},
        )
        return
    for stretch in looked.stretches:
        lasts_s = stretch.to_s - stretch.from_s
        line = mask_line(record, [(stretch.from_s, stretch.to_s)])
        is_harmful = lasts_s > min(MAX_GAP_S, MAX_GAP_SHARE * (time_s[-1] - time_s[0]))
        is_harmful |= stretch.expected_K - stretch.doubt_K > HARMFUL_K
        expected = (
            "its last digit changes elsewhere in the test"
            if stretch.is_live
            else f"by the heat balance it should change by {stretch.expected_K:.1f} K"
        )
        yield Finding(
            "sensor_stuck",
            "error" if is_harmful else "warning",
            f"The reading is frozen at {stretch.reading_degC:.2f} °C for {lasts_s:.0f} s"
            f"{f', {stretch.noise_K:.2g} K of noise aside' if stretch.noise_K else ''}, but "
            f"{expected}: these samples would bias the fit.",
            place(record, "winding_degC", stretch.from_s, stretch.to_s),
            Remedy("Check the sensor. To leave these readings out: ", line, "."),
            values={
                "reading_degC": stretch.reading_degC,
                "from_s": stretch.from_s,
                "to_s": stretch.to_s,
                "expected_K": stretch.expected_K,
            },
        )


def _stuck_beside(record: Record) -> Iterator[Finding]:
    """Yield the longest stretch in which a temperature beside the winding's stands still."""
    for channel in (*BODIES, "ambient_degC", "coolant_degC"):
        time_s, values = samples(record, channel)
        held = longest_held(time_s, values)
        if held is None:
            continue
        from_s, to_s, reading = held
        without = f' To do without it: {channel} = "none" under [columns].'
        yield Finding(
            "sensor_stuck",
            "warning",
            f"The reading is frozen at {reading:.2f} °C for {to_s - from_s:.0f} s, but "
            "its last digit changes elsewhere in the test.",
            place(record, channel, from_s, to_s),
            f"Check the sensor.{without if channel in BODIES else ''}",
            values={"reading_degC": reading, "from_s": from_s, "to_s": to_s},
        )


def longest_held(
    time_s: np.ndarray, values: np.ndarray, least_s: float = MIN_STRETCH_S, rest: float = -np.inf
) -> tuple[float, float, float] | None:
    """Return begin and end [s] of the longest stretch in which a channel stands still whose last
    digit changes elsewhere, and what it reads there; None where none lasts so long. What it reads
    at rest, up to that size, says nothing.
    """
    works = (np.abs(values) > rest)[1:]
    first, past = runs((np.diff(values) == 0.0) & works)
    if first.size == 0 or np.ptp(values) == 0.0:
        return None
    longest = int(np.argmax(past - first))
    a, b = int(first[longest]), int(past[longest])
    elsewhere = np.delete(np.diff(values), slice(a, b))[np.delete(works, slice(a, b))]
    is_live = elsewhere.size > b - a and float(np.mean(elsewhere != 0.0)) >= LIVE_SHARE
    if b - a < LIVE_SAMPLES or time_s[b] - time_s[a] < least_s or not is_live:
        return None
    return float(time_s[a]), float(time_s[b]), float(values[a])


def _flat_top(values: np.ndarray, extreme: float) -> np.ndarray:
    """Which samples stand in long runs at an extreme; none if the channel is not live elsewhere."""
    at_extreme, flat = values == extreme, np.zeros(values.size, dtype=bool)
    changes = np.diff(values)[~(at_extreme[1:] & at_extreme[:-1])]
    if changes.size == 0 or np.mean(changes != 0.0) < LIVE_SHARE:
        return flat
    for first, past in zip(*runs(at_extreme), strict=True):
        flat[first:past] = past - first >= FLAT_RUN
    return flat if flat.sum() >= FLAT_SAMPLES else np.zeros_like(flat)


def saturation(record: Record, motor: Motor, looked: Looked) -> Iterator[Finding]:
    """Report flat tops: the extreme of a channel repeated as no live signal repeats it.

    A winding temperature that is rounded repeats values anyway; it is at the end of its range where
    its heat balance takes it well beyond its highest reading. What stays there where the balance
    takes it below is stuck, which `sensor_stuck` tells.
    """
    found: list[Finding] = []
    for channel in ("winding_degC", "phase_current_A", "losses_W", "stator_degC"):
        time_s, values = samples(record, channel)
        if time_s.size <= FLAT_SAMPLES or np.ptp(values) == 0.0:
            continue
        for extreme, word in ((values.max(), "highest"), (values.min(), "lowest")):
            # What current and losses read at rest is no end of a range.
            is_rest = abs(extreme) < REST_SHARE * np.max(np.abs(values))
            if is_rest or (word == "lowest" and channel == "winding_degC"):
                continue
            flat = _flat_top(values, extreme)
            if flat.any():
                found.append(_flat(record, channel, word, extreme, time_s[flat]))
    time_s, winding = samples(record, "winding_degC")
    if hidden_above_top(record, motor) > 0.0:
        top = winding.max()
        found.append(_flat(record, "winding_degC", "highest", top, time_s[winding == top]))
    of_winding = [one for one in found if channel_of(one) == "winding_degC"]
    is_stuck = bool(of_winding) and _sticks(record, looked.stretches)
    yield from (one for one in found if not (is_stuck and one in of_winding))


def _sticks(record: Record, stretches: Sequence[Stretch]) -> bool:
    """Whether the highest reading stands where the heat balance takes it below, or ends in a jump.

    What is clipped comes back as it went: it falls on at the rate at which it leaves the end of its
    range.
    """
    time_s, winding = samples(record, "winding_degC")
    step = rounding_step(winding) or 0.0
    top = float(winding.max())
    for one in stretches:
        if one.reading_degC != top:
            continue
        if one.lowest_degC < top - MOVED_STEPS * step - one.doubt_K:
            return True
        past = int(np.searchsorted(time_s, one.to_s))
        drop, *then = -np.diff(winding[past : past + LETS_GO]) if past + 2 < time_s.size else (0.0,)
        scatter = 3.0 * float(np.std(then)) if one.is_live and then else step
        if then and drop > 1.5 * max(float(np.mean(then)), 0.0) + scatter:
            return True
    return False


def _flat(record: Record, channel: str, word: str, extreme: float, at_s: np.ndarray) -> Finding:
    unit = channel.rsplit("_", 1)[1]
    from_s, to_s = float(at_s[0]), float(at_s[-1])
    remedy = "Check the range of the amplifier and the logger."
    if channel == "winding_degC":
        line = mask_line(record, [(from_s, to_s)])
        remedy = Remedy(remedy, " To leave these readings out: ", line, ".")
    return Finding(
        "saturation",
        "error" if channel == "winding_degC" else "warning",
        f"The signal appears clipped at its {word} value {extreme:.6g} {unit} ({at_s.size} samples)"
        ": what lies beyond is missing from the fit.",
        place(record, channel, from_s, to_s),
        remedy,
        values={
            "extreme": float(extreme),
            "num_samples": float(at_s.size),
            "from_s": from_s,
            "to_s": to_s,
        },
    )
