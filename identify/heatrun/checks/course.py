"""Does the test start cold, does it heat, does the sink keep still, how finely was it written down?

The time constants need no network: a machine of many nodes under one load settles as a sum of
exponentials, late in the stretch by the last and slow one. They stand beside those of the two-node
fit, which books a slow rotor or a wandering coolant as a slow stator.
"""

from collections.abc import Iterator

import numpy as np

from ..io.quantities import rounded
from ..record.derive import constants_of
from ..record.motor import Motor
from ..record.record import Finding, Record, Severity
from ..record.samples import (
    EQUILIBRIUM_K,
    START_S,
    block_means,
    is_loaded,
    lead_in,
    place,
    rounding_step,
    samples,
    sink_channel,
    with_all_heat,
)
from ..record.stretch import runs
from .advice import section_of
from .quick_fit import solved_decays

BLOCK_S = 30.0
"""A third of a winding's time constant."""

STEP_SHARE = 0.1
"""A change of current or losses between blocks by this share of the peak [1] ends a stretch."""

MIN_BLOCKS = 20
"""Ten minutes: several of a winding's time constants, so that its own transient is over."""

SKIPPED_SHARE = 0.25
"""Share of the stretch at its start that belongs to the faster exponentials [1]."""

SETTLED_SHARE = 0.02
"""Means that differ by less than this share of the excess over the sink are equal [1]: the losses
themselves hold no better."""

SHORTEST_TAU, LONGEST_TAU, NUM_TAU = 0.1, 20.0, 60
"""Time constants that a stretch is asked for, in its lengths [1]; a course without an end has the
longest."""


MOST_BLOCKS = 400
"""Means of a cool-down [1]."""

GRID, LOOKS, NEAR = 24, 25, 9
"""Time constants that a cool-down is looked for with, how often, and how many of them on either
side of the best the next look spans: the valley of two is narrow and bent."""

UNLOADED, LEAST_REST = 0.1, 0.05
"""Share of a cool-down without load [1] by which it is one, and of the fall [1] that what flows
else may hold at its end."""

APART = 2.0
"""Factor between two time constants [1] below which a record shows one."""

BETTER = 0.7
"""Rms residual of two over that of one [1] below which there are two."""


def cooling_constants(record: Record, motor: Motor) -> tuple[float, ...]:
    """Return the time constants of a cool-down [s], the fastest first: two, one or none.

    They are those of its longest part without load: under one it ends at no temperature that is
    known. What never rests, as a wattmeter does not read 0, ends near the sink, or has none. One as
    long as is looked for is none that the record shows.
    """
    loads = ["losses_W"] * ("losses_W" in record)
    time_s, winding, sink, *losses = samples(
        with_all_heat(record, motor), "winding_degC", sink_channel(motor), *loads
    )
    rests = True
    if losses:
        parts = [*zip(*runs(~is_loaded(losses[0])), strict=True)]
        rests = sum(end - begin for begin, end in parts) > UNLOADED * time_s.size
        begin, end = max(parts, key=lambda part: part[1] - part[0]) if rests else (0, time_s.size)
        time_s, winding, sink = (each[begin:end] for each in (time_s, winding, sink))
    if time_s.size < MIN_BLOCKS:
        return ()
    step_s = float(np.median(np.diff(time_s)))
    # whole steps, so that each mean is of as many samples; a hair less than they, for their edge
    width_s = step_s * max(1.0, np.ceil(np.ptp(time_s) / (MOST_BLOCKS * step_s))) * (1.0 - 1e-9)
    time_s, excess = block_means(time_s, width_s, winding - sink)
    time_s = time_s - time_s[0]
    if time_s.size < MIN_BLOCKS:
        return ()
    shortest_s, longest_s = 0.5 * float(np.median(np.diff(time_s))), 2.0 * float(time_s[-1])
    grid = np.geomspace(shortest_s, longest_s, GRID)
    found = [_decays(time_s, excess, grid, num, has_rest=not rests) for num in (1, 2)]
    (one, alone, _), (two, both, rest_K) = found
    if abs(rest_K) > LEAST_REST * float(np.ptp(excess)):
        return ()
    is_two = both < BETTER * alone and two[1] > APART * two[0] and two[1] < longest_s
    return tuple(float(tau) for tau in (two if is_two else one) if tau < longest_s)


def _decays(
    time_s: np.ndarray, values: np.ndarray, grid: np.ndarray, num: int, *, has_rest: bool
) -> tuple[np.ndarray, float, float]:
    """Time constants of so many decays [s], the rms they leave, and where they end."""
    axes, taus, left, rest = [grid] * num, np.empty(num), 0.0, 0.0
    for _ in range(LOOKS):
        tried = np.stack(np.meshgrid(*axes, indexing="ij"))
        places = np.argwhere(np.all(np.diff(tried, axis=0) > 0.0, axis=0))
        points = np.stack([axis[at] for axis, at in zip(axes, places.T, strict=True)], axis=1)
        solved = solved_decays(time_s, values, points, has_rest=has_rest)
        best = int(np.argmin(solved.squares))
        taus, left = points[best], float(np.sqrt(solved.squares[best] / time_s.size))
        rest = float(solved.solution[best, -1]) if has_rest else 0.0
        near = [(axis[1] / axis[0]) ** NEAR for axis in axes]
        axes = [
            np.geomspace(max(tau / by, grid[0]), min(tau * by, grid[-1]), GRID)
            for tau, by in zip(taus, near, strict=True)
        ]
    return taus, left, rest


def settling_constants(record: Record, motor: Motor) -> float:
    """Return how many slow time constants the longest stretch of steady load lasts [1].

    It is inf where it has settled, 0 where there is no such stretch.
    """
    channels = ["winding_degC", sink_channel(motor), "losses_W"]
    channels += ["phase_current_A"] * ("phase_current_A" in record)
    time_s, winding, sink, *loads = samples(record, *channels)
    means_s, excess, *levels = block_means(time_s, BLOCK_S, winding - sink, *loads)
    if means_s.size < MIN_BLOCKS:
        return 0.0
    steps = np.zeros(means_s.size - 1, dtype=bool)
    for values in levels:
        steps |= np.abs(np.diff(values)) > STEP_SHARE * np.max(np.abs(values))
    edges = np.concatenate(([0], np.flatnonzero(steps) + 1, [means_s.size]))
    longest = int(np.argmax(np.diff(edges)))
    stretch = excess[edges[longest] : edges[longest + 1]]
    if stretch.size < MIN_BLOCKS:
        return 0.0
    late = stretch[int(SKIPPED_SHARE * stretch.size) :]
    _, middle, last = (float(np.mean(third)) for third in np.array_split(late, 3))
    if abs(last - middle) < SETTLED_SHARE * float(np.max(np.abs(stretch))):
        return float("inf")
    taus = late.size * np.geomspace(SHORTEST_TAU, LONGEST_TAU, NUM_TAU)
    left = solved_decays(np.arange(late.size), late, taus[:, None], has_rest=True).squares
    return stretch.size / float(taus[np.argmin(left)])


HEATED_STEPS = 5.0
HEATED_K = 2.0
"""Sensors agree to 0.5..1 K; a rise that does not exceed twice that, or five rounding steps,
carries no information on four parameters."""

STEADY_K = 10.0
"""Rise of a steady load that tells a resistance: sensors of 1 K make 10 % of it."""

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


def warming(record: Record) -> tuple[float, float, np.ndarray, np.ndarray]:
    """Return by how much the winding warms at most [K], how much a heating must [K], and times [s]
    and values [degC] of the means over which that counts.
    """
    time_s, winding = samples(record, "winding_degC")
    width_s = max(10.0, float(np.ptp(time_s)) / 200.0) if time_s.size else 10.0
    means_s, means = block_means(time_s, width_s, winding)
    rise = float(np.max(means - np.minimum.accumulate(means), initial=0.0))
    return rise, max(HEATED_STEPS * (rounding_step(winding) or 0.0), HEATED_K), means_s, means


def no_heating(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a winding that never warms: an error, or of a cooling curve a warning."""
    time_s = samples(record, "winding_degC")[0]
    if time_s.size < 3:
        return
    rise, limit, means_s, means = warming(record)
    if means_s.size < 2:
        lasts_s = float(np.ptp(time_s))
        yield Finding(
            "no_heating",
            "error",
            f"Expected a test of minutes; this one lasts {lasts_s:.0f} s, too short for a winding "
            "to show a thermal parameter.",
            place(record, "winding_degC", float(time_s[0]), float(time_s[-1])),
            "Record the whole heat run, or the cooling until it settles.",
            values={"duration_s": lasts_s},
        )
        return
    fall = float(np.max(np.maximum.accumulate(means) - means))
    if rise > limit:
        return
    is_cooling = fall > limit
    constants = cooling_constants(record, motor) if is_cooling else ()
    told = " and ".join(f"{rounded(tau)} s" for tau in constants)
    told = f" ({told})" if told else ""
    names = ("tau_fast_s", "tau_slow_s")[2 - len(constants) :]
    message = f"Expected the winding to warm by more than {limit:.1f} K; it rises by {rise:.1f} K"
    if is_cooling:
        message += f" and falls by {fall:.1f} K. A cooling curve alone determines time constants"
        message += f"{told}, not heat capacities."
        remedy = "Fit it together with a test under load."
    else:
        message += ": without heating, no thermal parameter can be identified."
        message += _steady(record, motor)
        remedy = "Check which column is mapped as winding_degC, and whether the load was on."
    yield Finding(
        "no_heating",
        "warning" if is_cooling else "error",
        message,
        place(record, "winding_degC", float(means_s[0]), float(means_s[-1])),
        remedy,
        values={"rise_K": rise, "fall_K": fall, "limit_K": limit}
        | dict(zip(names, constants, strict=True)),
    )


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


RESTED_S = 600.0
"""A winding that stands still for so long without load is as warm as what cools it [s]."""


EXCEEDS = 0.2
"""Part of a rise [1] from which it has begun."""


def start_not_in_equilibrium(record: Record, motor: Motor) -> Iterator[Finding]:
    """Warn if the machine is not at the temperature of its sink when the test begins.

    Then the stator's start temperature, which no channel of the five shows, is unknown too.
    """
    sink_name = sink_channel(motor)
    time_s, winding, sink, losses = samples(
        with_all_heat(record, motor), "winding_degC", sink_name, "losses_W"
    )
    lead = lead_in(time_s, losses)
    if lead == 0 or _begins_at_gap(record):
        return
    step = rounding_step(winding) or 0.0
    excess = float(np.median(winding[:lead] - sink[:lead]))
    part = max(1, lead // 5)
    drift = float(np.mean(winding[lead - part : lead]) - np.mean(winding[:part]))
    is_drifting = abs(drift) > LEAD_DRIFT_K + step
    if is_drifting:  # then where it starts is what the first samples say
        excess = float(np.median((winding - sink)[time_s <= time_s[0] + START_S]))
    is_hot = abs(excess) > EQUILIBRIUM_K + 0.5 * step
    if not (is_hot or is_drifting):
        return
    rested_s = float(time_s[lead - 1] - time_s[0])
    if sink_name in constants_of(record.notes) and not is_drifting and rested_s > RESTED_S:
        meaning = "It stands still there, so that it is the constant that is wrong."
        at_rest = float(np.median(winding[:lead]))
        remedy = f"Correct it under [constants]: {sink_name} = {at_rest:.1f}."
    elif is_drifting and drift > 0.0 and not is_hot:
        begins = winding[:lead] > np.mean(winding[:part]) + EXCEEDS * drift
        late_s = float(time_s[lead - 1] - time_s[np.argmax(begins)])
        meaning = "It warms before any load: the load is recorded late, or began unrecorded."
        remedy = (
            f"Check the clocks of the loggers; to move the load, at least {late_s:.0f} s: "
            f"{section_of(record)} load_offset = -SECONDS in the motor file."
        )
    elif any(body in record for body in STATOR):
        meaning = "Bodies that no sensor reads then start at an unknown temperature."
        remedy = "Start the next test after a soak."
    else:
        meaning = (
            "The start temperature of the stator is then unknown and estimated with a wide prior."
        )
        remedy = "Map `stator_degC` if it was measured, or start the next test after a soak."
    yield Finding(
        "start_not_in_equilibrium",
        "warning",
        f"Expected the winding within {EQUILIBRIUM_K:.0f} K of {sink_name} at the start; it is "
        f"{excess:+.1f} K away"
        f"{f' and drifts by {drift:+.1f} K before the load' if lead < time_s.size else ''}. "
        f"{meaning}",
        place(record, "winding_degC", float(time_s[0]), float(time_s[lead - 1])),
        remedy,
        values={"excess_K": excess, "drift_K": drift, "lead_s": rested_s},
    )


def _begins_at_gap(record: Record) -> bool:
    """Return whether a record is the part behind a gap, of which the finding on the gap speaks."""
    begin_s = record.time_s[0]
    return any(f.id == "time_gap" and f.values.get("to_s") == begin_s for f in record.findings)


def cut_while_warm(record: Record, motor: Motor) -> Iterator[Finding]:
    """Say of a test that is cut out of a record while warm that the part before it may tell more.

    What is cut off is not simulated, and whether its losses can be trusted, which may be why it
    was cut off, only the bench knows. Where they can, a mask in place of the cut lets the network
    run up to that time: the stator is then known as well as the parameters allow.
    """
    if not record.stretch or _begins_at_gap(record) or any(body in record for body in STATOR):
        return
    sink_name = sink_channel(motor)
    time_s, winding, sink = samples(record, "winding_degC", sink_name)
    if time_s.size == 0 or time_s[0] <= MASKED_FROM_S:
        return
    first = time_s <= time_s[0] + START_S
    excess = float(np.median(winding[first] - sink[first]))
    if abs(excess) <= EQUILIBRIUM_K + 0.5 * (rounding_step(winding) or 0.0):
        return
    begin_s = float(time_s[0])
    yield Finding(
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
    )


def ambient_moving(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a sink temperature that moves: a warning in the air, a note for a coolant.

    The measured course enters the fit; what remains is that one sensor seldom shows the mean of
    what the machine feels, and that its own slow response matters once the sink moves. A coolant
    moves by nature and is measured where it acts.
    """
    channel = sink_channel(motor)
    time_s, sink = samples(record, channel)
    duration_s = float(time_s[-1] - time_s[0]) if time_s.size > 2 else 0.0
    if duration_s <= 0.0:
        return
    means_s, means = block_means(time_s, max(60.0, duration_s / 100.0), sink)
    travel = float(np.ptp(means))
    hours = (means_s - means_s[0]) / 3600.0
    slope = float(np.polyfit(hours, means, 1)[0]) if means.size > 2 else 0.0
    drift = slope * duration_s / 3600.0
    step = rounding_step(sink) or 0.0
    drifts = abs(slope) > DRIFT_K_PER_H and abs(drift) > MIN_DRIFT_K + step
    if not (travel > DRIFT_K + step or drifts):
        return
    yield Finding(
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
    )


NOTED_STEP_K = 0.05
"""A step of 0.05 K adds 0.015 K rms, below the noise of any sensor on a bench."""

HARMFUL_STEP_K = 0.2
"""Truncation shifts a reading by half a step on average: 0.1 K, a third of what a thermocouple is
good for, and a fifth of the cost that is known for 1 degC."""

COMPANION_SHARE = 0.25
"""The sink must be at least four times finer than the winding to show which way that was
rounded."""

TELLING_MARGIN = 0.1
"""Distance, in steps, by which an offset must lie outside of what rounding or truncation allows."""

EQUILIBRIUM_STEPS = 2.0
"""A start further from the sink than this, in steps, is no common equilibrium of both sensors."""


def resolution(record: Record, motor: Motor) -> Iterator[Finding]:
    """Note the step that the winding temperature was rounded to."""
    time_s, winding = samples(record, "winding_degC")
    step = rounding_step(winding)
    if step is None or step < NOTED_STEP_K * (1.0 - 1e-6):
        return
    yield Finding(
        "resolution",
        "note",
        f"The resolution is {step:.3g} K, which adds {step / np.sqrt(12.0):.2g} K rms of "
        "rounding noise: a smaller RMSE would be overfitting.",
        place(record, "winding_degC", float(time_s[0]), float(time_s[-1])),
        "Export more decimals if the logger has them.",
        values={"step_K": step},
    )


def truncation(record: Record, motor: Motor) -> Iterator[Finding]:
    """Tell, as far as the record can, whether readings were rounded or cut off.

    Cutting off is rounding with an offset of half a step, so the shape of the record does not show
    it; only a start in equilibrium with a finer sink does. There a rounded reading lies within half
    a step of the sink, a cut-off one between one step below and the sink itself. In the common part
    of the two, or without such a start, the record cannot tell, and the note asks. On the reference
    motor truncation to 1 degC costs +3.5 % on Ceq_w and -4.2 % on Req_sr.
    """
    time_s, winding = samples(record, "winding_degC")
    step = rounding_step(winding)
    if step is None or step < HARMFUL_STEP_K * (1.0 - 1e-6):
        return
    offset = _offset_at_start(record, motor, step)
    values = {"step_K": step} if offset is None else {"step_K": step, "offset_K": offset}
    share = float("nan") if offset is None else offset / step
    cost = (
        f"Truncation to {step:.3g} K reads {step / 2.0:.2g} K low on average; truncation to 1 K "
        "biases Ceq_w of the reference motor by +3.5 % and Req_sr by -4.2 %."
    )
    severity: Severity = "note"
    message = f"Rounded or truncated: the record does not show which. {cost}"
    remedy = "Look up in the logger's manual whether it rounds or truncates."
    if share < -0.5 - TELLING_MARGIN:
        severity, values["is_suspected"] = "warning", 1.0
        message = (
            f"In equilibrium at the start the winding reads {offset:+.2f} K against the sink, "
            f"where rounding allows {step / 2.0:.2g} K: the values are truncated, or the "
            f"sensor reads low. {cost}"
        )
    elif TELLING_MARGIN < share <= 0.5 + TELLING_MARGIN:
        remedy, values["is_suspected"] = "", 0.0
        message = (
            f"Rounded, not truncated: the winding starts {offset:+.2f} K above the sink. The "
            "readings are not biased by it."
        )
    where = place(record, "winding_degC", float(time_s[0]))
    yield Finding("truncation", severity, message, where, remedy, values=values)


def _offset_at_start(record: Record, motor: Motor, step: float) -> float | None:
    """Winding less sink [K] before heat flows, or None if the record does not show it."""
    time_s, winding, sink, losses = samples(
        with_all_heat(record, motor), "winding_degC", sink_channel(motor), "losses_W"
    )
    lead = lead_in(time_s, losses)
    if lead == 0:
        return None
    sink_step = rounding_step(samples(record, sink_channel(motor))[1])
    if sink_step is not None and sink_step > COMPANION_SHARE * step:
        return None
    offset = float(np.mean(winding[:lead] - sink[:lead]))
    return offset if abs(offset) <= EQUILIBRIUM_STEPS * step else None
