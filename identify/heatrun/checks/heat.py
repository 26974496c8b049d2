"""Is there heat for what the winding does, and is it heat that the machine, or any machine, has?"""

from collections.abc import Iterator

import numpy as np

from ..io.quantities import rounded
from ..record.balance_errors import BLOCK_S
from ..record.derive import recorded_shaft_power
from ..record.motor import Motor
from ..record.record import ColumnReading, Finding, Record
from ..record.samples import block_means, is_loaded, place, samples, sink_channel, with_all_heat
from ..record.units import require_unit
from .advice import Part, Remedy, use_line
from .figures import MIN_RISE_K, is_brief, one_mass
from .quick_fit import MAX_RESIDUAL_SHARE, course_of, fit_of

FEWEST_BLOCKS = 30
"""A cooling of five minutes tells the time constant of a winding."""

UNHEATED_K = 5.0
"""A winding may warm by a little from a stator that nobody measured; not by this much above all
that was [K]."""

SAME_POWER = 0.03
"""Two records of one power agree to this share [1]."""

HELD_VOLTAGE = 0.05
"""A DC link holds its voltage to this share [1]."""

FOLLOWS = 1.15
"""Ratio of the 90 % to the 10 % quantile of voltage over current over copper's factor [1] that a
coil keeps within: leads that stay cold, and its instruments."""

BODIES = ("stator_degC", "tooth_degC", "yoke_degC", "housing_degC", "rotor_degC", "magnet_degC")
"""Bodies that may warm a winding."""


def losses_absent(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a winding that warms while there are no losses.

    A cooling curve has none, and a winding may be warmed by its sink or by a warmer stator: it then
    stays below them.
    """
    time_s, winding, losses, sink = samples(
        with_all_heat(record, motor), "winding_degC", "losses_W", sink_channel(motor)
    )
    if time_s.size == 0 or is_loaded(losses).any():
        return
    means_s, winding, sink = block_means(time_s, BLOCK_S, winding, sink)
    lowest = np.minimum.accumulate(winding)
    top = int(np.argmax(winding - lowest))
    rise = float(winding[top] - lowest[top])
    others = (samples(record, body)[1] for body in BODIES)
    hottest = max(np.max(sink), *(np.max(other, initial=-np.inf) for other in others))
    if rise <= UNHEATED_K or winding[top] <= hottest + UNHEATED_K:
        return
    begin = int(np.argmin(winding[: top + 1]))
    cooling = _cooling(record, means_s, winding, float(time_s[-1]))
    yield Finding(
        "losses_absent",
        "error",
        f"Expected losses where the winding warms; it rises by {rise:.0f} K while losses_W is "
        "0 W throughout. Whatever heats it is not in the record, so nothing can be fitted.",
        place(record, "losses_W", float(means_s[begin]), float(means_s[top])),
        Remedy("Record the losses, or phase current and resistance where copper is all.", *cooling),
        values={"rise_K": rise},
    )


def _cooling(
    record: Record, time_s: np.ndarray, winding: np.ndarray, end_s: float
) -> tuple[Part, ...]:
    """Return how to use the cooling at the end of a record; empty where it has none."""
    highest_after = np.maximum.accumulate(winding[::-1])[::-1]
    warms = np.flatnonzero(highest_after - winding > UNHEATED_K)
    begin = int(warms[-1]) + 1 if warms.size else 0
    if time_s.size - begin < FEWEST_BLOCKS:
        return ()
    told = " The cooling after the load needs no losses and tells time constants: "
    return told, use_line(record, (float(time_s[begin]), end_s)), "."


def losses_of_dc_link(record: Record, motor: Motor) -> Iterator[Finding]:
    """Warn of losses that are all the power of a DC link.

    A link holds its voltage while its current follows the load. In a coil under direct current,
    where all power is heat, voltage over current follows the temperature of the copper. Of a power
    that the motor file calls that of the terminals nothing is said.
    """
    if any(one.channel == "electrical_power_W" for one in record.mapping):
        return
    for name in ("dc_current_A", "phase_current_A"):
        time_s, voltage, current, losses, winding = samples(
            record, "dc_voltage_V", name, "losses_W", "winding_degC"
        )
        if time_s.size < 3:
            continue
        _, voltage, current, losses, winding, power = block_means(
            time_s, BLOCK_S, voltage, current, losses, winding, voltage * current
        )
        loaded = is_loaded(losses) & (power > 0.0)
        if np.sum(loaded) < 3:
            continue
        voltage, current, winding = voltage[loaded], np.abs(current[loaded]), winding[loaded]
        ratio = losses[loaded] / power[loaded]
        factor = voltage / current / (motor.resistance_coefficient_degC + winding)
        low, high = np.quantile(factor, [0.1, 0.9])
        is_link = np.std(voltage) < HELD_VOLTAGE * np.mean(voltage) and high > FOLLOWS * low
        if not is_link or np.quantile(np.abs(ratio - 1.0), 0.9) > SAME_POWER:
            continue
        is_shaft_known = recorded_shaft_power(record.channels) is not None
        shaft = "" if is_shaft_known else " and what the shaft takes out"
        remedy = "Record torque_Nm and speed_rpm beside the DC power, or the phase current; where "
        remedy += "the rotor is locked, subtract the losses of the inverter."
        if is_shaft_known:
            remedy = "Record electrical_power_W at the motor's terminals, or subtract the losses "
            remedy += "of the inverter."
        yield Finding(
            "losses_of_dc_link",
            "warning",
            f"Expected the heat of the machine; losses_W is all the power of the DC link "
            f"(dc_voltage_V·{name}), with the losses of the inverter{shaft}. Capacities come "
            "out too large and resistances too small by as much: bounds, no estimates.",
            place(record, "losses_W", float(time_s[0]), float(time_s[-1])),
            remedy,
            values={"ratio": float(np.median(ratio))},
        )
        return


LEAST_SWING_K = 10.0
"""Below, rounding and drifts are no small part of the course."""


def load_of_another(record: Record, motor: Motor) -> Iterator[Finding]:
    """Warn of a winding that two nodes of any size, heated by the record's losses, do not follow.

    What a machine does beside, a fan on its shaft, a lag, a third body, leaves a fourth of that.
    """
    course = course_of(record, motor)
    if course is None or np.ptp(course.winding_degC) < LEAST_SWING_K:
        return
    fit = fit_of(course, most=np.inf)
    swing = float(np.ptp(course.winding_degC))
    if fit is None or fit.rms_K < MAX_RESIDUAL_SHARE * swing:
        return
    yield Finding(
        "load_of_another",
        "warning",
        "Expected the winding to follow the losses; two nodes of any size leave "
        f"{fit.rms_K:.1f} K (RMS) of a course of {swing:.0f} K.",
        place(record, "losses_W", *map(float, record.time_s[[0, -1]])),
        "Check whether load and temperatures are of one test and one clock, and whether an "
        "instrument was switched over in it.",
        values={"rms_K": fit.rms_K, "swing_K": swing},
    )


LARGEST_W, SMALLEST_W = 2e6, 1e-3
"""Losses of a generator of 100 MW, overloaded, and of a watch."""

LARGEST_W_PER_K = 5e4
"""Losses over temperature rise [W/K]: 20 µK/W; a machine of 1 MW with water jacket has some
thousands."""

OTHER_UNITS = {"W": ("kW", "mW"), "kW": ("W", "MW"), "MW": ("kW", "W"), "mW": ("W",)}
"""By the unit that losses were read in, those that they may be in."""


def losses_absurd(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report losses beyond those of any machine on a bench, with the unit that would explain them.

    An error; a warning where the motor file decides the unit, so that a giant can be measured too.
    """
    names = ("losses_W", "winding_degC", sink_channel(motor))
    time_s, losses, winding, sink = samples(record, *names)
    if time_s.size == 0:
        return
    time_s, losses, rise = block_means(time_s, BLOCK_S, losses, winding - sink)
    largest = float(np.max(np.abs(losses)))
    top = int(np.argmax(rise))
    # the highest rise comes late in a load: then the heat flows out, unless the test is so short
    # that it is stored
    is_warm = rise[top] > MIN_RISE_K
    per_K = float(np.mean(np.abs(losses))) / float(rise[top]) if is_warm else 0.0
    is_small = 0.0 < largest < SMALLEST_W and rise[top] > 1.0
    if not (is_small or largest > LARGEST_W or per_K > LARGEST_W_PER_K):
        return
    seen = one_mass(record, motor)
    if seen is not None and seen.conductance_W_per_K < per_K:  # no comparison is true of a NaN
        per_K = seen.conductance_W_per_K
    if is_brief(float(time_s[-1] - time_s[0]) + BLOCK_S, per_K, motor.sink):
        per_K = 0.0  # what has warmed is a winding, and the heat is in it
    is_large = largest > LARGEST_W or per_K > LARGEST_W_PER_K
    if not is_large and not is_small:
        return
    reading = record.read_of("losses_W")
    shown = f"{rounded(largest)} W"
    shown += f", {rounded(per_K)} W for each kelvin of rise" if per_K else ""
    yield Finding(
        "losses_absurd",
        "warning" if "losses_W" in record.decided else "error",
        f"Expected losses between {SMALLEST_W:g} W and {LARGEST_W / 1e6:g} MW, and at most "
        f"{LARGEST_W_PER_K:g} W/K; the largest are {shown}.{_explained(reading, largest)}",
        place(record, "losses_W", float(time_s[0]), float(time_s[-1])),
        _remedy(reading, is_large),
        values={"largest_W": largest, "largest_W_per_K": per_K},
    )


def _explained(reading: ColumnReading | None, largest_W: float) -> str:
    """Return what the losses would be in other units than the one that they were read in."""
    if reading is None or reading.unit not in OTHER_UNITS:
        return ""
    shown = [
        f"{rounded(largest_W * _factor(unit) / _factor(reading.unit))} W if in {unit}"
        for unit in OTHER_UNITS[reading.unit]
    ]
    return f" Column '{reading.column}' is read as {reading.unit}; it would be {', '.join(shown)}."


def _remedy(reading: ColumnReading | None, is_large: bool) -> str:
    if reading is None:
        return "Check the units of the powers that the losses follow from, and their signs."
    # the heading whole: its own unit alone would repeat what is in doubt
    line = f'losses_W = "{reading.column} '
    if reading.unit not in OTHER_UNITS:
        return f'State the unit in [columns]: {line}[UNIT]".'
    units = sorted(OTHER_UNITS[reading.unit], key=_factor)
    likely = units[0] if is_large else units[-1]
    return (
        f'State the unit in [columns]: {line}[{likely}]". If {reading.unit} is right, write '
        f'{line}[{reading.unit}]": then this is only a warning.'
    )


def _factor(symbol: str) -> float:
    """Return the watts of a unit of power."""
    return require_unit(symbol, "power", where="").factor
