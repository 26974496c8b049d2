"""Does the test start cold, does it heat, and does the sink keep still?"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...io.quantities import rounded
from ...motor import Motor
from ..record import Finding, Record
from ..rounding import rounding_step
from .samples import block_means, is_loaded, place, samples, sink_channel, with_all_heat
from .settling import cooling_constants

START_S = 2.0
"""A winding under full load moves about 2 K in its first second at most, and less than 0.5 K as a
rule; the first 2 s therefore still show the start where a record begins with the load already
on."""

HEATED_STEPS = 5.0
HEATED_K = 2.0
"""Sensors agree to 0.5..1 K; a rise that does not exceed twice that, or five rounding steps,
carries no information on four parameters."""

STEADY_K = 10.0
"""Rise of a steady load that tells a resistance: sensors of 1 K make 10 % of it."""

EQUILIBRIUM_K = 2.0
"""Two sensors of a bench agree to about 1 K each; a larger difference is heat left in the
machine."""

MASKED_FROM_S = 60.0
"""The first readings of a test say where it starts; 40 s of them are used."""

LEAD_DRIFT_K = 1.0
"""Change of the winding before heat flows that says the machine is still cooling."""

STATOR = ("stator_degC", "tooth_degC", "yoke_degC")
"""Sensors that tell where the stator starts."""

DRIFT_K = 2.0
DRIFT_K_PER_H = 1.0
MIN_DRIFT_K = 0.5
"""A sink that moves by 2 K, or by 1 K/h, moves the end temperature by as much, some per cent of a
heat run's rise. A rate is only counted from 0.5 K on: below, a short test has no rate to speak
of."""


def lead_in(time_s: np.ndarray, losses_W: np.ndarray) -> int:
    """Return how many samples at the start show the temperatures before heat has changed them.

    Args:
        time_s: Increasing times [s], shape (usable,).
        losses_W: Losses [W], shape (usable,).

    Returns:
        The samples before heat flows; where it flows from the first sample on, those of the first
        two seconds.
    """
    if time_s.size == 0:
        return 0
    idle = int(np.argmax(is_loaded(losses_W))) if is_loaded(losses_W).any() else time_s.size
    return max(idle, int(np.searchsorted(time_s, time_s[0] + START_S)))


def no_heating(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Report a winding that never warms: an error, or a warning where the test is a cooling
    curve.
    """
    time_s, winding = samples(record, "winding_degC")
    if time_s.size < 3:
        return ()
    means_s, means = block_means(time_s, max(10.0, float(np.ptp(time_s)) / 200.0), winding)
    if means_s.size < 2:
        return (_no_time(record, time_s),)
    limit = max(HEATED_STEPS * (rounding_step(winding) or 0.0), HEATED_K)
    lowest = np.minimum.accumulate(means)
    rise = float(np.max(means - lowest))
    fall = float(np.max(np.maximum.accumulate(means) - means))
    if rise > limit:
        return ()
    is_cooling = fall > limit
    constants = cooling_constants(record, motor) if is_cooling else ()
    names = ("tau_fast_s", "tau_slow_s")[2 - len(constants) :]
    return (
        Finding(
            "no_heating",
            "warning" if is_cooling else "error",
            f"Expected the winding to warm by more than {limit:.1f} K; it rises by {rise:.1f} K"
            + (
                f" and falls by {fall:.1f} K. A cooling curve alone determines time constants"
                f"{_told(constants)}, not heat capacities."
                if is_cooling
                else ": without heating, no thermal parameter can be identified."
                + _steady(record, motor)
            ),
            place(record, "winding_degC", float(means_s[0]), float(means_s[-1])),
            "Fit it together with a test under load."
            if is_cooling
            else "Check which column is mapped as winding_degC, and whether the load was on.",
            values={"rise_K": rise, "fall_K": fall, "limit_K": limit}
            | dict(zip(names, constants, strict=True)),
        ),
    )


def _told(constants: Sequence[float]) -> str:
    return f" ({' and '.join(f'{rounded(tau)} s' for tau in constants)})" if constants else ""


def _steady(record: Record, motor: Motor) -> str:
    """Return what a record at one temperature says all the same; empty if nothing."""
    _, winding, sink, losses = samples(
        with_all_heat(record, motor), "winding_degC", sink_channel(motor), "losses_W"
    )
    loaded = is_loaded(losses)
    excess = float(np.mean(winding - sink)) if winding.size else 0.0
    if loaded.size == 0 or not loaded.all() or excess < STEADY_K:
        return ""
    watts = float(np.mean(losses))
    return (
        f" What it says is the rise of a steady load: {excess:.1f} K at {rounded(watts)} W, "
        f"{rounded(excess / watts)} K/W from the winding to {sink_channel(motor)}."
    )


def _no_time(record: Record, time_s: np.ndarray) -> Finding:
    """Return the finding on a test in which no winding has time to show anything."""
    lasts_s = float(np.ptp(time_s))
    return Finding(
        "no_heating",
        "error",
        f"Expected a test of minutes; this one lasts {lasts_s:.0f} s, too short for a winding to "
        "show a thermal parameter.",
        place(record, "winding_degC", float(time_s[0]), float(time_s[-1])),
        "Record the whole heat run, or the cooling until it settles.",
        values={"duration_s": lasts_s},
    )


def start_not_in_equilibrium(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Warn if the machine is not at the temperature of its sink when the test begins.

    Then the stator's start temperature, which no channel of the five shows, is unknown too.
    """
    sink_name = sink_channel(motor)
    time_s, winding, sink, losses = samples(
        with_all_heat(record, motor), "winding_degC", sink_name, "losses_W"
    )
    lead = lead_in(time_s, losses)
    if lead == 0 or _begins_at_gap(record):
        return ()
    step = rounding_step(winding) or 0.0
    excess = float(np.median(winding[:lead] - sink[:lead]))
    part = max(1, lead // 5)
    drift = float(np.mean(winding[lead - part : lead]) - np.mean(winding[:part]))
    is_drifting = abs(drift) > LEAD_DRIFT_K + step
    if is_drifting:  # then where it starts is what the first samples say
        excess = float(np.median((winding - sink)[time_s <= time_s[0] + START_S]))
    is_hot = abs(excess) > EQUILIBRIUM_K + 0.5 * step
    if not (is_hot or is_drifting):
        return ()
    if any(body in record for body in STATOR):
        meaning = "Bodies that no sensor reads then start at an unknown temperature."
        remedy = "Start the next test after a soak."
    else:
        meaning = (
            "The start temperature of the stator is then unknown and estimated with a wide prior."
        )
        remedy = "Map `stator_degC` if it was measured, or start the next test after a soak."
    return (
        Finding(
            "start_not_in_equilibrium",
            "warning",
            f"Expected the winding within {EQUILIBRIUM_K:.0f} K of {sink_name} at the start; it is "
            f"{excess:+.1f} K away"
            f"{f' and drifts by {drift:+.1f} K before the load' if lead < time_s.size else ''}. "
            f"{meaning}",
            place(record, "winding_degC", float(time_s[0]), float(time_s[lead - 1])),
            remedy,
            values={
                "excess_K": excess,
                "drift_K": drift,
                "lead_s": float(time_s[lead - 1] - time_s[0]),
            },
        ),
    )


def _begins_at_gap(record: Record) -> bool:
    """Return whether a record is the part behind a gap, of which the finding on the gap speaks."""
    begin_s = record.time_s[0]
    return any(f.id == "time_gap" and f.values.get("to_s") == begin_s for f in record.findings)


def cut_while_warm(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Say of a test that is cut out of a record while warm that the part before it may tell more.

    What is cut off is not simulated, and whether its losses can be trusted, which may be why it
    was cut off, only the bench knows. Where they can, a mask in place of the cut lets the network
    run up to that time: the stator is then known as well as the parameters allow.
    """
    if not record.stretch or _begins_at_gap(record) or any(body in record for body in STATOR):
        return ()
    sink_name = sink_channel(motor)
    time_s, winding, sink = samples(record, "winding_degC", sink_name)
    if time_s.size == 0 or time_s[0] <= MASKED_FROM_S:
        return ()
    first = time_s <= time_s[0] + START_S
    excess = float(np.median(winding[first] - sink[first]))
    if abs(excess) <= EQUILIBRIUM_K + 0.5 * (rounding_step(winding) or 0.0):
        return ()
    begin_s = float(time_s[0])
    return (
        Finding(
            "cut_while_warm",
            "note",
            f"The test begins {begin_s:.0f} s into its record, with the winding {excess:+.1f} K "
            f"from {sink_name}. What lies before is not simulated, so the start temperature of the "
            "stator has a wide prior, and predictions a wide band for its time constant or two.",
            place(record, "winding_degC", begin_s, float(time_s[first][-1])),
            "If current and losses before it are right, leave out the readings alone: "
            f"mask = [[{MASKED_FROM_S:.0f}, {begin_s:.0f}]] under [tests.NAME] of the motor file "
            "in place of the cut.",
            values={"excess_K": excess, "begin_s": begin_s},
        ),
    )


def ambient_moving(record: Record, motor: Motor) -> tuple[Finding, ...]:
    """Report a sink temperature that moves: a warning in the air, a note for a coolant.

    The measured course enters the fit; what remains is that one sensor seldom shows the mean of
    what the machine feels, and that its own slow response matters once the sink moves. A coolant
    moves by nature and is measured where it acts.
    """
    channel = sink_channel(motor)
    time_s, sink = samples(record, channel)
    duration_s = float(time_s[-1] - time_s[0]) if time_s.size > 2 else 0.0
    if duration_s <= 0.0:
        return ()
    means_s, means = block_means(time_s, max(60.0, duration_s / 100.0), sink)
    travel = float(np.ptp(means))
    slope = (
        float(np.polyfit((means_s - means_s[0]) / 3600.0, means, 1)[0]) if means.size > 2 else 0.0
    )
    drift = slope * duration_s / 3600.0
    step = rounding_step(sink) or 0.0
    drifts = abs(slope) > DRIFT_K_PER_H and abs(drift) > MIN_DRIFT_K + step
    if not (travel > DRIFT_K + step or drifts):
        return ()
    return (
        Finding(
            "ambient_moving",
            "note" if motor.sink == "coolant" else "warning",
            f"Expected a steady sink temperature; it varies by {travel:.1f} K and drifts by "
            f"{slope:+.2f} K/h. The fit follows the measured course; where the sensor does not "
            "show what the machine feels, Req_sr is biased.",
            place(record, channel, float(time_s[0]), float(time_s[-1])),
            "Measure the coolant where it enters the machine."
            if motor.sink == "coolant"
            else "Shield the sensor from the warm air of the machine.",
            values={"travel_K": travel, "slope_K_per_h": slope, "drift_K": drift},
        ),
    )
