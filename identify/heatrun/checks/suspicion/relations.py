r"""Relations between channels that no machine breaks, whatever its size.

A relation compares what belongs to one machine: a time with a size, a power with another, a speed
with a speed. Machines from 1 W to 1 MW differ by a million in watts and by thirty in time, so no
limit here is one of watts or amperes, but for the largest machine of all. Where a relation is
broken, a unit has been misread as a rule; `heatrun.checks.suspicion` then tries which.

One lumped mass behind a record: how fast it answers, and how much heat leaves it per kelvin.

Integrated over time, the balance of one mass is linear in what is unknown:

$$ T(t) - T(0) = \frac{1}{C} \int P\,dt - \frac{1}{\tau} \int (T - T_0)\,dt $$

so that a least-squares solution of two numbers gives the time constant tau whatever the unit of
the losses, and the capacity C and conductance G = C/tau in their unit. A machine is more than one
mass: what comes out lies between its winding's time constant and its slow one. That is enough to
see whether a clock or a power is wrong by a factor of 60 or 1000, and for nothing else.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from ...io.quantities import rounded
from ...record.motor import Motor
from ...record.record import Record
from ...record.samples import samples
from ..losses import FIRM_TOLERANCE, copper_shares, shaft_explains, share_in_words
from ..quick_fit import Course, course_of, quick_fit
from .power_relations import Conflict, power_conflicts, speed_conflicts

BLOCKS = 300
"""Of a record, at most: the fit is made once for each unit that a column may have."""

MIN_EXPLAINED = 0.4
"""Share of the temperature's variance [1]: short pulses on a winding leave half to one mass."""

LINEAR = 0.9
"""Share of the temperature's variance [1] that stored heat alone must explain before a record is
called unsettled: one that settles bends, and is explained no better than by half."""

COLD = 0.2
"""Start above the sink over the rise [1]; a warmer start has heat in masses that are not seen."""

MAX_CONSTANTS = 3.0
"""A time constant of more than three test lengths is an extrapolation, and none is given."""

MIN_RISE_K = 5.0
"""Below, drifts of sink and sensors make up the course."""


@dataclass(frozen=True)
class OneNode:
    """The record as one mass sees it.

    Attributes:
        tau_s: Time constant [s].
        capacity_J_per_K: C [J/K]; NaN where no heat flows.
        conductance_W_per_K: G [W/K]; NaN where no heat flows.
        duration_s: Length of what was fitted [s].
    """

    tau_s: float
    capacity_J_per_K: float
    conductance_W_per_K: float
    duration_s: float


def one_node(record: Record, motor: Motor) -> OneNode | None:
    """Fit one mass to a record.

    Returns:
        The fit, or None where the record is too short, does not move, or is no such course.
    """
    course = _course(record, motor)
    if course is None:
        return None
    winding, heat, step_s = course.winding_degC, course.all_W, course.step_s
    is_heated = bool(np.any(heat > 0.0))
    terms = [-_integral(winding - course.sink_degC, step_s), np.ones(winding.size)]
    if is_heated:
        terms.append(_integral(heat, step_s))
    found = _solved(terms, winding, winding, MIN_EXPLAINED)
    if found is None or not found[0] > 0.0:
        return None
    tau_s = 1.0 / float(found[0])
    if tau_s > MAX_CONSTANTS * course.duration_s:
        return None
    C = 1.0 / float(found[2]) if is_heated and found[2] > 0.0 else float("nan")
    return OneNode(tau_s, C, C / tau_s, course.duration_s)


def unsettled(record: Record, motor: Motor) -> OneNode | None:
    """Fit one mass to a record that is too short to show its time constant.

    Returns:
        The capacity with the shortest time constant that is possible and the largest conductance,
        or None where `one_node` finds them, or no heat is seen to warm the winding.
    """
    course = _course(record, motor)
    if course is None or one_node(record, motor) is not None:
        return None
    excess, heat = course.winding_degC - course.sink_degC, course.all_W
    # A winding that follows its sink through the days warms by no heat of its own.
    rise = float(np.ptp(excess))
    if rise < MIN_RISE_K or abs(excess[0]) > COLD * rise or not np.any(heat > 0.0):
        return None
    tau_s = MAX_CONSTANTS * course.duration_s
    lost = _integral(excess, course.step_s) / tau_s
    terms = [_integral(heat, course.step_s), np.ones(excess.size)]
    found = _solved(terms, excess + lost, excess, LINEAR)
    if found is None or not found[0] > 0.0:
        return None
    C = 1.0 / float(found[0])
    return OneNode(tau_s, C, C / tau_s, course.duration_s)


def _solved(
    terms: list[np.ndarray], known: np.ndarray, course: np.ndarray, least: float
) -> np.ndarray | None:
    """Return the least-squares solution, or None where it does not explain the course."""
    matrix = np.stack(terms, axis=1)
    scale = np.linalg.norm(matrix, axis=0)
    if not np.all(np.isfinite(matrix)) or not np.all(scale > 0.0):
        return None
    found = np.linalg.lstsq(matrix / scale, known, rcond=None)[0] / scale
    explained = 1.0 - float(np.var(known - matrix @ found) / np.var(course))
    return found if explained > least else None


def _course(record: Record, motor: Motor) -> Course | None:
    course = course_of(record, motor, most_blocks=BLOCKS)
    return course if course is not None and np.ptp(course.winding_degC) >= MIN_RISE_K else None


def _integral(values: np.ndarray, step_s: float) -> np.ndarray:
    return np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1])))) * step_s


SHORTEST_S = {"ambient": 25.0, "coolant": 1.5}
"""Time constants [s] at 1 W/K below which no machine lies. In air a motor of 100 g has 50 s in the
wash of its propeller; a coolant may run in the slots themselves."""

LEAST_SHORTEST_S = 5.0
"""And below which none lies at all."""

LARGER, SMALLER = 0.5, 0.25
"""Powers of the conductance in W/K that this goes with, above and below 1 W/K. Heat leaves through
a surface (L²) and is stored in a volume (L³): at one kind of cooling the time constant goes with L,
that is with the root of the conductance. Fan-cooled 1 MW (700 W/K) has 1000 s and more, a
water-cooled traction motor (30 W/K) 100 s, a winding with oil in its slots (100 W/K) 20 s. Small
bodies lose heat better than that: a motor of 3 g (0.01 W/K) has 60 s in still air, and 10 s if the
test shows its winding alone."""

SETTLES = 4.0
"""Time constants [1] that a test must last to call a machine too fast: a shorter one may have shown
its winding alone."""

BRIEF = 0.5
"""Shortest time constants of a machine of its size [1] that a test must last to be sure of it: in a
shorter one a large machine may show its winding alone, as a body that settles."""

LEAST_TEST_S = 60.0
"""No heat run is shorter [s]: what seems to be has another clock."""

LONGEST_BY_SIZE_S = 18e3
"""Machines in still air have 600 to 2000 s times the root of the conductance in W/K, from 3 g
(0.01 W/K, 60 s) over 10 kg (3 W/K, 2000 s) to 1 MW (700 W/K, 5 h); nine times as slow is none, even
wrapped up."""

USUAL_BY_SIZE_S = {"ambient": 200.0, "coolant": 40.0}
"""Middle of what machines have [s], again over the root of the conductance in W/K: from fan-cooled
(20) to still air (2000), from oil in the slots (2) to a jacket (800)."""

FROM_USUAL = 20.0
"""Factor [1] within which of it a reading that is to repair a clock must lie."""

LONGEST_S = 360e3
"""100 h; the largest hydro generators take about ten."""

LONGEST_TEST_S = 3e7
"""A year: no heat run lasts as long, nor does any network of a machine need it."""

USUAL_TEST_S = 2.2e5
"""Two and a half days: what a reading that is to repair a clock stays below [s]. Seconds of a test
of more than an hour are then no minutes."""

LARGEST_W_PER_K = {"ambient": 2e3, "coolant": 1e4}
"""Conductance [W/K] above which no machine is on a bench: fan-cooled 1 MW has 700, the largest that
air draws through some thousands, water jackets of such ten times as much as those of a car."""

LEAST_PER_TORQUE = 2.0
"""Capacity over the largest torque [J/(K Nm)]: the lightest axial-flux traction motors have 0.05
kg/Nm at peak torque, times 430 J/(kg K) 20, of which the winding alone, all that a short test
shows, is a tenth; servo motors have 450, standard motors 700."""

LEAST_COPPER = 0.005
"""Copper loss over total [1] below which a machine runs without load, if the units are right."""

USUAL_COPPER = 0.1
"""And what a reading that is to repair it must reach."""

OTHER_COOLING = 'Or set sink = "coolant" in [motor] if a liquid cools the machine.'
LONGER = "Or the machine is large and so short a test shows its winding alone: a longer one tells."


def conflicts(record: Record, motor: Motor, *, is_strict: bool = False) -> tuple[Conflict, ...]:
    """Return the relations that a record breaks.

    Strictly asked, it must be usual, not only possible: for a reading that is to repair another.
    """
    return (
        *_length(record, is_strict),
        *_time_scale(record, motor, is_strict),
        *_at_once(record, motor, is_strict),
    )


def holds(record: Record, motor: Motor, but: Collection[str], *, is_strict: bool = False) -> bool:
    """Whether a record breaks no relation, as `conflicts`, but those of some ids.

    The time scale, which takes a fit, is asked last.
    """
    of_all = chain(
        _length(record, is_strict),
        _at_once(record, motor, is_strict),
        _time_scale(record, motor, is_strict),
    )
    return all(conflict.id in but for conflict in of_all)


def _at_once(record: Record, motor: Motor, is_strict: bool) -> Iterator[Conflict]:
    """Relations that hold at each time."""
    yield from _copper(record, motor, is_strict)
    yield from power_conflicts(record, motor, is_strict)
    yield from speed_conflicts(record, motor)


def _length(record: Record, is_strict: bool) -> Iterator[Conflict]:
    """The length of the test against a year, or what is usual."""
    time_s = samples(record)[0]
    length_s = float(time_s[-1] - time_s[0]) if time_s.size else 0.0
    if length_s <= (USUAL_TEST_S if is_strict else LONGEST_TEST_S):
        return
    sentence = f"Expected a test of days at most; it lasts {rounded(length_s / 31557600.0)} years."
    yield Conflict("too_long", sentence, ("time_s",), False, {"duration_s": length_s})


def _time_scale(record: Record, motor: Motor, is_strict: bool) -> Iterator[Conflict]:
    """Time constant and capacity against the size of the machine."""
    seen = one_node(record, motor)
    if seen is None:
        yield from _slow_start(record, motor)
        return
    tau, C, G = seen.tau_s, seen.capacity_J_per_K, seen.conductance_W_per_K
    shortest, longest = _shortest(G, motor.sink), LONGEST_S
    if math.isfinite(G):
        root = math.sqrt(G)
        longest = min(longest, LONGEST_BY_SIZE_S * root)
        if is_strict:
            usual = USUAL_BY_SIZE_S[motor.sink] * root
            shortest = max(shortest, usual / FROM_USUAL)
            longest = min(longest, usual * FROM_USUAL)
    values = {"tau_s": tau, "capacity_J_per_K": C, "conductance_W_per_K": G}
    values = {name: value for name, value in values.items() if math.isfinite(value)}
    size = f" at {rounded(G)} W/K" if math.isfinite(G) else ""
    came = f"the record shows {rounded(tau)} s"
    channels = ("time_s", "winding_degC", "losses_W")
    has_settled = seen.duration_s > SETTLES * tau
    is_judged = is_strict or has_settled
    if tau < shortest and is_judged and _stays_short(record, motor, shortest):
        sentence = f"Expected a time constant above {rounded(shortest, 2)} s{size}; {came}."
        is_of_air = tau > _shortest(G, "coolant")
        is_mild = is_of_air or is_brief(seen.duration_s, G, motor.sink)
        otherwise = OTHER_COOLING if is_of_air else LONGER
        yield Conflict("too_fast", sentence, channels, False, values, is_mild, otherwise)
    if math.isfinite(G) and LARGEST_W_PER_K[motor.sink] < G:
        cooled = "air" if motor.sink == "ambient" else "a liquid"
        sentence = (
            f"Expected at most {LARGEST_W_PER_K[motor.sink]:g} W/K where {cooled} cools the "
            f'machine (sink = "{motor.sink}"); the record shows {rounded(G)} W/K.'
        )
        otherwise = OTHER_COOLING if cooled == "air" and LARGEST_W_PER_K["coolant"] >= G else ""
        yield Conflict("too_large", sentence, channels[1:], False, values, otherwise=otherwise)
    if tau > longest:
        sentence = f"Expected a time constant below {rounded(longest, 2)} s{size}; {came}."
        yield Conflict("too_slow", sentence, channels, False, values)
    torque = samples(record, "torque_Nm")[1]
    peak = float(np.quantile(np.abs(torque), 0.99)) if torque.size else 0.0
    is_light = math.isfinite(C) and LEAST_PER_TORQUE * peak > C
    if is_light and (is_strict or has_settled):
        sentence = (
            f"Expected a heat capacity above {LEAST_PER_TORQUE:.0f} J/K for each Nm of torque; "
            f"the record shows {rounded(C)} J/K at {rounded(peak)} Nm."
        )
        values = values | {"torque_Nm": peak}
        yield Conflict("too_light", sentence, (*channels, "torque_Nm"), False, values)


def _slow_start(record: Record, motor: Motor) -> Iterator[Conflict]:
    """A winding that is still warming after a time in which any machine has settled."""
    seen = unsettled(record, motor)
    if seen is None:
        return
    G = seen.conductance_W_per_K
    longest = min(LONGEST_S, LONGEST_BY_SIZE_S * math.sqrt(G))
    if seen.tau_s <= longest:
        return
    sentence = (
        f"Expected a time constant below {rounded(longest, 2)} s at {rounded(G)} W/K at most; "
        f"after {rounded(seen.duration_s)} s the winding has hardly begun to settle."
    )
    values = {
        "tau_s": seen.tau_s,
        "capacity_J_per_K": seen.capacity_J_per_K,
        "conductance_W_per_K": G,
    }
    yield Conflict("too_slow", sentence, ("time_s", "winding_degC", "losses_W"), False, values)


def is_brief(duration_s: float, conductance_W_per_K: float, sink: str) -> bool:
    """Return whether a test may show the winding alone of a machine of such a size."""
    return LEAST_TEST_S <= duration_s < BRIEF * _shortest(conductance_W_per_K, sink)


def _shortest(conductance_W_per_K: float, sink: str) -> float:
    """Shortest time constant [s] of any machine of a size; without a size that of the smallest."""
    if not math.isfinite(conductance_W_per_K):
        return LEAST_SHORTEST_S
    power = LARGER if conductance_W_per_K > 1.0 else SMALLER
    return max(LEAST_SHORTEST_S, SHORTEST_S[sink] * conductance_W_per_K**power)


def _stays_short(record: Record, motor: Motor, shortest_s: float) -> bool:
    """Whether two masses say the same: one mass takes a short test's winding for the machine."""
    fit = quick_fit(record, motor)
    return fit is None or fit.tau_s < shortest_s


def _copper(record: Record, motor: Motor, is_strict: bool) -> Iterator[Conflict]:
    """Copper loss of the current against the measured total."""
    _, share = copper_shares(record, motor)
    if share.size < 3:
        return
    typical = float(np.median(share))
    channels = ("phase_current_A", "losses_W")
    values = {"copper_share": typical}
    is_below = float(np.mean(share > 1.0 + FIRM_TOLERANCE)) > 0.5
    if is_below and not shaft_explains(record, motor):
        sentence = f"Expected losses above the copper loss; they are {share_in_words(typical)}."
        yield Conflict("losses_below_copper", sentence, channels, False, values)
    elif typical < (USUAL_COPPER if is_strict else LEAST_COPPER):
        sentence = f"The copper loss is only {rounded(typical, 2)} of the losses under load."
        yield Conflict("little_copper", sentence, channels, True, values)
