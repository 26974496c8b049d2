r"""Figures by which a record can be told to be that of a machine, and how usual they are.

A figure compares what belongs to one machine: a time with a size, a power with another, a speed
with a speed. Machines from 1 W to 1 MW differ by a million in watts and by thirty in time, so no
limit here is one of watts or amperes, but for the largest machine of all. Each figure has four
limits: what is usual lies between the inner two, and one machine in three hundred beyond each of
the outer two. `heatrun.checks.which_unit` makes a probability of them.

The time scale comes from one lumped mass. Integrated over time, its balance is linear in what is
unknown:

$$ T(t) - T(0) = \frac{1}{C} \int P\,dt - \frac{1}{\tau} \int (T - T_0)\,dt $$

so that a least-squares solution of two numbers gives the time constant tau whatever the unit of
the losses, and the capacity C and conductance G = C/tau in their unit. A machine is more than one
mass: what comes out lies between its winding's time constant and its slow one. That is enough to
see whether a clock or a power is wrong by a factor of 60 or 1000, and for nothing else.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..io.quantities import rounded
from ..record.derive import ELECTRICAL, SHAFT, shaft_power
from ..record.motor import Motor
from ..record.record import Record
from ..record.samples import block_means, integral, samples
from .losses import (
    COPPER_TOLERANCE,
    FIRM_TOLERANCE,
    copper_shares,
    heat_of_current,
    shaft_explains,
    share_in_words,
)
from .quick_fit import course_of, quick_fit

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
"""A time constant of more than three test lengths is an extrapolation; it is that or more."""

MIN_RISE_K = 5.0
"""Below, drifts of sink and sensors make up the course."""


@dataclass(frozen=True)
class OneMass:
    """The record as one mass sees it."""

    tau_s: float  # Time constant [s].
    capacity_J_per_K: float  # C [J/K]; NaN where no heat flows.
    conductance_W_per_K: float  # G [W/K]; NaN where no heat flows.
    duration_s: float  # Length of what was fitted [s].
    # The record is too short to show more than the least time constant that is possible, and the
    # largest conductance.
    is_least: bool = False


def one_mass(record: Record, motor: Motor) -> OneMass | None:
    """Fit one mass to a record.

    Returns:
        The fit, or None where the record is too short, does not move, or is no such course.
    """
    course = course_of(record, motor, most_blocks=BLOCKS)
    if course is None or np.ptp(course.winding_degC) < MIN_RISE_K:
        return None
    winding, excess = course.winding_degC, course.winding_degC - course.sink_degC
    longest_s = MAX_CONSTANTS * course.duration_s
    is_heated = bool(np.any(course.all_W > 0.0))
    heat, lost = integral(course.all_W, course.step_s), integral(excess, course.step_s)
    start = np.ones(winding.size)
    terms = [-lost, start, heat] if is_heated else [-lost, start]
    found = _solved(terms, winding, winding, MIN_EXPLAINED)
    if found is not None and found[0] * longest_s >= 1.0:
        tau_s = 1.0 / float(found[0])
        C = 1.0 / float(found[2]) if is_heated and found[2] > 0.0 else float("nan")
        return OneMass(tau_s, C, C / tau_s, course.duration_s)
    # A winding that follows its sink through the days warms by no heat of its own.
    rise = float(np.ptp(excess))
    if rise < MIN_RISE_K or abs(excess[0]) > COLD * rise or not is_heated:
        return None
    found = _solved([heat, start], excess + lost / longest_s, excess, LINEAR)
    if found is None or not found[0] > 0.0:
        return None
    C = 1.0 / float(found[0])
    return OneMass(longest_s, C, C / longest_s, course.duration_s, is_least=True)


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


RARE = math.log(300.0)
"""Minus the logarithm of the likelihood of a figure at an outer limit [1]: one machine in three
hundred, as of three standard deviations."""


class Limits(NamedTuple):
    """Where a figure lies over machines: outer limits, and what is usual between them.

    Below the least, or above the most, it may be no less likely than at the limit: rare tests and
    machines are so.
    """

    least: float
    low: float
    high: float
    most: float
    is_rare_below: bool = False
    is_rare_above: bool = False

    def cost(self, value: float) -> float:
        """Return minus the logarithm of the likelihood [1]: log-normal outside what is usual."""
        if self.low <= value <= self.high:
            return 0.0
        if value < self.low:
            edge, limit, is_rare = self.low, self.least, self.is_rare_below
        else:
            edge, limit, is_rare = self.high, self.most, self.is_rare_above
        z = math.inf
        if value > 0.0 and limit != edge:  # a ratio of the smallest numbers would be 0
            z = (math.log(value) - math.log(edge)) / math.log(limit / edge)
        return min(RARE * z**2, RARE if is_rare else math.inf)


@dataclass(frozen=True)
class Figure:
    """One figure of a record."""

    id: str  # Short name.
    cost: float  # Minus the logarithm of its likelihood [1].
    sentence: str  # What was expected and what came; empty within the outer limits.
    channels: tuple[str, ...]  # The channels that it compares.
    values: Mapping[str, float]  # Numbers behind it by name with unit suffix.


def _figure(
    id: str,
    value: float,
    limits: Limits,
    channels: tuple[str, ...],
    below: str,
    above: str,
    values: Mapping[str, float] | None = None,
) -> Figure:
    sentence = below if value < limits.least else above if value > limits.most else ""
    return Figure(id, limits.cost(value), sentence, channels, values or {id: value})


LENGTH_S = Limits(60.0, 300.0, 2.2e5, 3e7)
"""Test [s]: five minutes to two and a half days are usual, one of less than a minute has another
clock, and no heat run lasts a year, nor does any network of a machine need it."""

TIME_BY_SIZE_S = {
    "ambient": Limits(25.0, 60.0, 2500.0, 18e3),
    "wash": Limits(6.0, 14.0, 800.0, 18e3),
    "coolant": Limits(1.5, 5.0, 800.0, 18e3),
}
"""Time constant [s] at a conductance of 1 W/K. In air from fans (100) to still air (600 to 2000,
from 3 g to 1 MW); nine times as slow is none, even wrapped up. In the wash of a propeller a motor
of 100 g has 50 s, one of 3 kW 15. By a coolant from oil in the slots (2) to a jacket (800)."""

TIME_S = Limits(5.0, 20.0, 4e4, 360e3)
"""And of any size [s]; the largest hydro generators take ten hours."""

SETTLES = 4.0
"""Time constants [1] that a test must last to call a machine too fast: a shorter one may have shown
its winding alone."""

BRIEF = 0.5
"""A test that lasts less than this part of the least time constant of a machine's size [1] may show
its winding alone, as a body that settles."""

SIZE_W_PER_K = {
    "ambient": Limits(0.0, 0.0, 2e3, 2e3, is_rare_above=True),
    "wash": Limits(0.0, 0.0, 100.0, 300.0),
    "coolant": Limits(0.0, 0.0, 1e3, 1e4, is_rare_above=True),
}
"""Conductance [W/K]: fan-cooled 1 MW has 700, the largest that air draws through some thousands,
water jackets of such ten times as much as those of a car."""

CAPACITY_PER_TORQUE = Limits(2.0, 6.0, math.inf, math.inf)
"""Capacity over the largest torque [J/(K Nm)]: the lightest axial-flux traction motors have 0.05
kg/Nm at peak torque, times 430 J/(kg K) 20, of which the winding alone, all that a short test
shows, is a tenth; servo motors have 450, standard motors 700."""

COPPER_SHARE = Limits(0.005, 0.1, 1.0, 1.0 + FIRM_TOLERANCE, is_rare_below=True)
"""Copper loss over total [1]; with less copper a machine runs without load."""

HEAT_OF_CURRENT = Limits(0.0, 0.0, 1.6, 2.6)
"""What of the losses goes with the squared current, over the copper loss [1], at least: with stray
losses and the slip of a squirrel cage 1.9, with bars as high as the slot and their eddies more."""

EFFICIENCY = Limits(0.12, 0.5, 1.0, 1.0 + COPPER_TOLERANCE, is_rare_below=True)
"""Power of the shaft over electrical power [1]. Behind the least an error of 2 pi/60 in the shaft's
may hide: 1.15/9.55."""

MOST_COPPER = 0.3
"""Share of the copper loss in the total [1] above which it is the copper that takes the power."""

LOSSES_OVER_SHAFT = Limits(0.003, 0.01, math.inf, math.inf)
"""Losses over shaft power [1]: the largest generators reach an efficiency of 99 %, no machine
99.7."""

SHARE_OF_INVERTER = Limits(0.0, 0.0, 0.3, 0.5, is_rare_above=True)
"""Share of the DC power [1] that neither the shaft nor the machine's losses take; small drives
reach 0.3. At standstill it may be more."""

TURNS = 0.95
"""Share of the loaded time [1] in which the shaft must turn the same way: at standstill its power
is the noise of two instruments, whatever the unit."""

SPEED_OVER_RATED = Limits(0.0, 0.0, 2.0, 4.0, is_rare_above=True)
"""Speed over rated speed [1]; field weakening ends at three to four."""

SPEED_OVER_WHEEL = Limits(0.5, 0.8, 1.2, 1.5)
"""Shaft's speed over the wheel's times the gear [1]; a slipping wheel or a worn tyre makes less."""


def figures(record: Record, motor: Motor, cooled_by: str = "") -> Iterator[Figure]:
    """Yield every figure that a record gives, the time scale, which takes a fit, last.

    It is judged as if "ambient", "coolant", or the "wash" of a propeller cooled it, if given.
    """
    yield from _length(record)
    yield from _copper(record, motor)
    yield from _powers(record, motor)
    yield from _speeds(record, motor)
    yield from _time_scale(record, motor, cooled_by or motor.sink)


def _length(record: Record) -> Iterator[Figure]:
    time_s = samples(record)[0]
    if time_s.size:
        length_s = float(time_s[-1] - time_s[0])
        years = rounded(length_s / 31557600.0)
        above = f"Expected a test of days at most; it lasts {years} years."
        yield _figure("duration_s", length_s, LENGTH_S, ("time_s",), "", above)


def _copper(record: Record, motor: Motor) -> Iterator[Figure]:
    """Copper loss of the current against the measured total."""
    _, share = copper_shares(record, motor)
    if share.size < 3:
        return
    typical = float(np.median(share))
    # what the error that is allowed for the shaft's power explains says nothing of a unit
    if typical > COPPER_SHARE.most and shaft_explains(record, motor):
        typical = 1.0
    below = f"The copper loss is only {rounded(typical, 2)} of the losses under load."
    above = f"Expected losses above the copper loss; they are {share_in_words(typical)}."
    channels = ("phase_current_A", "losses_W")
    yield _figure("copper_share", typical, COPPER_SHARE, channels, below, above)
    ratio = heat_of_current(record, motor)
    if ratio is not None:
        above = (
            "Expected the copper loss to be most of what goes with the square of the current; "
            f"of the losses at least {rounded(ratio, 2)} times as much does."
        )
        ratio = max(ratio, 0.0)
        yield _figure("heat_of_current", ratio, HEAT_OF_CURRENT, channels, "", above)


def _is_high(power: np.ndarray) -> np.ndarray:
    """Where a power is no small part of its largest, so that its ratios mean something."""
    return power > 0.3 * float(np.max(power, initial=0.0))


def _powers(record: Record, motor: Motor) -> Iterator[Figure]:
    """Electrical power, the shaft's, and the losses against each other, in means over blocks."""
    rods = ("mechanical_power_W",) if "mechanical_power_W" in record else SHAFT
    if not all(rod in record for rod in rods):
        return
    shaft = record[rods[0]] if len(rods) == 1 else shaft_power(record.channels)
    powers = {"time_s": record.time_s, "shaft": np.asarray(shaft, dtype=float)}
    # losses that were derived from the powers agree with them
    is_read = not record.mapping or any(one.channel == "losses_W" for one in record.mapping)
    if motor.losses == "balance" and "losses_W" in record and is_read:
        powers["losses"] = record["losses_W"]
    way = next((one for one in ELECTRICAL if one.is_open(record.channels)), None)
    if way is not None:
        powers["electrical"] = np.asarray(way.compute(record.channels, motor.phases), dtype=float)
    time_s, *columns = samples(Record("", powers), *list(powers)[1:])
    if time_s.size < 3:
        return
    means = block_means(time_s, max(10.0, float(np.ptp(time_s)) / 200.0), *columns)[1:]
    power = dict(zip(list(powers)[1:], means, strict=True))
    if "losses" in power:
        yield from _losses_over_shaft(np.abs(power["shaft"]), power["losses"], rods)
    if way is not None:
        _, copper = copper_shares(record, motor)
        is_copper = copper.size >= 3 and float(np.median(copper)) >= MOST_COPPER
        yield from _efficiency(power["electrical"], power["shaft"], is_copper, (*way.needs, *rods))
    if way is not None and way.channel == "dc_power_W" and "losses" in power:
        yield from _share_of_inverter(**power, channels=("losses_W", *way.needs, *rods))


def _losses_over_shaft(
    shaft: np.ndarray, losses: np.ndarray, rods: tuple[str, ...]
) -> Iterator[Figure]:
    driven = _is_high(shaft)
    loaded = driven & (losses > 0.0)
    if np.sum(loaded) < max(3, 0.5 * np.sum(driven)):
        return
    share = float(np.median(losses[loaded] / shaft[loaded]))
    below = (
        f"Expected losses above {100.0 * LOSSES_OVER_SHAFT.least:.1f} % of the shaft's power of "
        f"{rounded(float(np.median(shaft[loaded])))} W; they are {100.0 * share:.2f} % of it."
    )
    channels = ("losses_W", *rods)
    yield _figure("losses_over_shaft", share, LOSSES_OVER_SHAFT, channels, below, "")


def _efficiency(
    electrical: np.ndarray, shaft: np.ndarray, is_copper: bool, channels: tuple[str, ...]
) -> Iterator[Figure]:
    # As a generator the roles are exchanged.
    given = np.where(electrical + shaft > 0.0, electrical, -shaft)
    taken = np.where(electrical + shaft > 0.0, shaft, -electrical)
    loaded = _is_high(given)
    if not loaded.any():
        return
    ratio = taken[loaded] / given[loaded]
    typical, best = float(np.median(ratio)), float(np.quantile(ratio, 0.9))
    if best < 1e-6 or is_copper:
        best = 1.0  # it stands, or its copper takes the power: then it says nothing
    below = f"The highest efficiency is only {rounded(best, 2)}."
    above = f"Expected an efficiency below 1; it is {rounded(typical)}."
    value = typical if typical > 1.0 else min(best, 1.0)
    yield _figure("efficiency", value, EFFICIENCY, channels, below, above)


def _share_of_inverter(
    electrical: np.ndarray, shaft: np.ndarray, losses: np.ndarray, channels: tuple[str, ...]
) -> Iterator[Figure]:
    loaded = _is_high(electrical)
    if np.sum(loaded) < 3 or np.mean(shaft[loaded] > 0.0) < TURNS:
        return
    share = float(np.median((1.0 - (shaft + losses) / electrical)[loaded]))
    told = 100.0 * (1.0 - share)
    above = f"Shaft power and losses_W account for {told:.0f} % of the DC power only."
    share = max(share, 0.0)
    yield _figure("share_to_inverter", share, SHARE_OF_INVERTER, channels, "", above)


def _speeds(record: Record, motor: Motor) -> Iterator[Figure]:
    """Speed of the shaft against the rated speed and the vehicle's."""
    speed = samples(record, "speed_rpm")[1]
    if speed.size and motor.rated_speed_rpm:
        ratio = float(np.quantile(np.abs(speed), 0.99)) / motor.rated_speed_rpm
        above = f"The speed reaches {rounded(ratio)} times rated_speed_rpm."
        yield _figure("speed_over_rated", ratio, SPEED_OVER_RATED, ("speed_rpm",), "", above)
    if motor.gear_ratio and motor.wheel_radius_m:
        channels = ("speed_rpm", "vehicle_speed_km_per_h")
        _, speed, vehicle = samples(record, *channels)
        wheel = vehicle / 3.6 / motor.wheel_radius_m * 30.0 / math.pi * motor.gear_ratio
        moving = _is_high(np.abs(wheel))
        if moving.any():
            ratio = float(np.median(np.abs(speed[moving] / wheel[moving])))
            said = f"The shaft turns at {rounded(ratio)} times wheel speed times gear ratio."
            yield _figure("speed_over_wheel", ratio, SPEED_OVER_WHEEL, channels, said, said)


def time_limits(conductance_W_per_K: float, sink: str) -> Limits:
    """Return the limits of the time constant [s] of a machine of a size; of any where it is NaN.

    Heat leaves through a surface (L²) and is stored in a volume (L³): at one kind of cooling the
    time constant goes with L, that is with the root of the conductance. Fan-cooled 1 MW (700 W/K)
    has 1000 s and more, a water-cooled traction motor (30 W/K) 100 s, a winding with oil in its
    slots (100 W/K) 20 s. Small bodies lose heat better than that: a motor of 3 g (0.01 W/K) has
    60 s in still air, and 10 s if the test shows its winding alone; below 1 W/K the fast side goes
    with the fourth root.
    """
    if not math.isfinite(conductance_W_per_K):
        return TIME_S
    slow = math.sqrt(conductance_W_per_K)
    fast = slow if slow > 1.0 else math.sqrt(slow)
    least, low, high, most, *_ = TIME_BY_SIZE_S[sink]
    least, most = max(TIME_S.least, fast * least), min(TIME_S.most, slow * most)
    low = max(fast * low, 2.0 * least)
    return Limits(least, low, max(low, min(slow * high, 0.5 * most)), most)


def is_brief(duration_s: float, conductance_W_per_K: float, sink: str) -> bool:
    """Return whether a test may show the winding alone of a machine of such a size."""
    return LENGTH_S.least <= duration_s < BRIEF * time_limits(conductance_W_per_K, sink).least


def _time_scale(record: Record, motor: Motor, sink: str) -> Iterator[Figure]:
    """Time constant and capacity against the size of the machine."""
    seen = one_mass(record, motor)
    if seen is None:
        return
    tau, C, G = seen.tau_s, seen.capacity_J_per_K, seen.conductance_W_per_K
    has_settled = seen.duration_s > SETTLES * tau
    is_alone = not has_settled or is_brief(seen.duration_s, G, sink)
    limits = time_limits(G, sink)._replace(is_rare_below=is_alone)
    if tau < limits.least:  # one mass takes a short test's winding for the machine, two do not
        fit = quick_fit(record, motor)
        tau = tau if fit is None else max(tau, fit.tau_s)
    values = {"tau_s": tau, "capacity_J_per_K": C, "conductance_W_per_K": G}
    values = {name: value for name, value in values.items() if math.isfinite(value)}
    size = f" at {rounded(G)} W/K" if math.isfinite(G) else ""
    came = f"the record shows {rounded(tau)} s"
    if seen.is_least:
        size += " at most"
        came = f"after {rounded(seen.duration_s)} s the winding has hardly begun to settle"
        tau = max(tau, limits.low)
    channels = ("time_s", "winding_degC", "losses_W")
    below, above = (
        f"Expected a time constant {side} {rounded(limit, 2)} s{size}; {came}."
        for side, limit in (("above", limits.least), ("below", limits.most))
    )
    below *= has_settled
    yield _figure("time_constant", tau, limits, channels, below, above, values)
    if seen.is_least or not math.isfinite(G):
        return
    largest, cooled = SIZE_W_PER_K[sink], "a liquid" if sink == "coolant" else "air"
    above = (
        f"Expected at most {largest.most:g} W/K where {cooled} cools the machine "
        f'(sink = "{sink}"); the record shows {rounded(G)} W/K.'
    )
    yield _figure("size", G, largest, channels[1:], "", above, values)
    torque = samples(record, "torque_Nm")[1]
    peak = float(np.quantile(np.abs(torque), 0.99)) if torque.size else 0.0
    if peak > 0.0:
        below = (
            f"Expected a heat capacity above {CAPACITY_PER_TORQUE.least:.0f} J/K for each Nm of "
            f"torque; the record shows {rounded(C)} J/K at {rounded(peak)} Nm."
        )
        values, channels = values | {"torque_Nm": peak}, (*channels, "torque_Nm")
        yield _figure("capacity", C / peak, CAPACITY_PER_TORQUE, channels, below, "", values)
