"""Are the temperatures in degrees Celsius, and can the sink be what it is called?"""

from collections.abc import Iterator

import numpy as np

from ..record.channels import BODIES
from ..record.derive import constants_of
from ..record.motor import Motor
from ..record.record import Finding, Record, Severity
from ..record.samples import is_loaded, lead_in, place, samples, sink_channel, with_all_heat
from .advice import exchange_line

AS_KELVIN = {"ambient_degC": (253.0, 333.0), "coolant_degC": (253.0, 393.0),
             "winding_degC": (253.0, 393.0), "stator_degC": (253.0, 393.0)}  # fmt: skip
"""A hall or chamber between -20 and 60 degC, in kelvin; as degrees Celsius no sink at all. All else
at the start between -20 and 120 degC."""

AMBIENT_AS_FAHRENHEIT = (55.0, 110.0)
"""A hall between 13 and 43 degC, in degrees Fahrenheit; as degrees Celsius only a hot chamber."""

HOTTEST_START_DEGC, HOTTEST_DEGC = 150.0, 250.0
"""No winding starts a test hotter than the one, or stays above the other (class 220 with 30 K); a
scaled one reads so."""

FAHRENHEIT_ABOVE_K = 20.0
"""A cold winding in Fahrenheit reads so far above any ambient from -15 degC on: 32 + 0.8 T."""

SCALES = (10.0, 100.0, 1000.0)
"""What loggers and buses multiply degrees by to send integers [1]."""

AGREEMENT_K = 3.0
"""Winding and ambient agree so closely at a cold start, sensor errors included."""

COOLS_K = 2.0
"""What a cold winding falls at most below its first excess over the ambient: its sensor's noise and
the ambient's own lag."""

PLAUSIBLE_DEGC = {"ambient_degC": (-30.0, 50.0), "coolant_degC": (-40.0, 120.0)}
"""Climate chambers reach -30 degC with a motor inside, halls 50; glycol lies between -40 and
120."""

POSSIBLE_DEGC = {"ambient_degC": (-60.0, 130.0), "coolant_degC": (-60.0, 160.0)}
"""Beyond these no bench runs: a wrong column, unit or sensor."""

POSSIBLE_OF_BODIES_DEGC = (-60.0, 400.0)
"""No machine is colder or hotter [degC]."""

SAME_SHARE, LEAST_SWING_K = 0.02, 10.0
"""Excess over the sink as a part of the winding's own swing [1] below which the two are one sensor,
where it swings so far [K]: the tightest winding in oil that warms with it keeps a tenth."""

ROOM_SHARE = 0.1
"""Swing of a room over that of what a machine warms [1]."""

SINK_ABOVE_K = 5.0
"""A winding that stays this far below its sink while heat flows is not heated by it: swapped
channels."""


def _severity(record: Record, channel: str) -> Severity:
    """An error, but where the motor file itself decides the unit of a channel."""
    return "warning" if channel in record.decided else "error"


def _finding(
    record: Record, channel: str, severity: Severity, value: float, from_s: float, unit: str | float
) -> Finding:
    """Say that a temperature looks like another unit; a number is what degrees are multiplied by.

    But for kelvin, the motor file may say that degrees Celsius are right.
    """
    column = record.column_of(channel)
    line = f'{channel} = "{column or "column"}'
    values = {"value": value}
    if isinstance(unit, float):
        values |= {"as_degC": value / unit, "zero": 0.0, "factor": 1.0 / unit}
        seen = (
            f"the winding starts at {value:.0f} °C. In units of 1/{unit:.0f} °C it would start at "
            f"{value / unit:.1f} °C, the temperature of the sink. Read in the wrong unit, every "
            "parameter would be wrong."
        )
        remedy = f"Divide the column by {unit:.0f} before it is read."
    else:
        symbol = "K" if unit == "kelvin" else "degF"
        zero, factor = (273.15, 1.0) if unit == "kelvin" else (32.0, 1.0 / 1.8)
        values |= {"as_degC": factor * (value - zero), "zero": zero, "factor": factor}
        seen = (
            f"{value:.1f} looks like {unit}, which would be {values['as_degC']:.1f} °C. Read in "
            "the wrong unit, temperature rises and copper loss would be wrong."
        )
        is_constant = channel in constants_of(record.notes)
        remedy = f'Declare the unit in the motor file: [columns] {line} [{symbol}]".'
        if is_constant:
            remedy = f"Write {channel} = {values['as_degC']:.1f} under [constants]."
    if severity == "error" and unit != "kelvin" and column:
        remedy += f' If °C is right, write {line} [degC]": then this is only a warning.'
    where = place(record, channel, from_s)
    return Finding(
        "units_temperature", severity, f"Expected °C; {seen}", where, remedy, values=values
    )


def unit_assumed(record: Record, motor: Motor) -> Iterator[Finding]:
    """Note the columns whose unit neither the file nor a name gives."""
    assumed = [one for one in record.mapping if one.unit_from == "assumed"]
    if not assumed:
        return
    lines = [f'{one.channel} = "{one.column} [{one.unit}]"' for one in assumed]
    yield Finding(
        "unit_assumed",
        "note",
        f"No unit is given in the file or in [columns]; assumed: {', '.join(lines)}. A wrong "
        "unit scales the parameters.",
        record.name,
        f"State them: [columns] {lines[0]}.",
        values={"num_columns": float(len(assumed))},
    )


def units_temperature(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report temperatures that look like kelvin or degrees Fahrenheit.

    Kelvin is told by value. Fahrenheit is told only where ambient and winding agree at a cold start
    between 55 and 110, or where one of the two at the start equals the other converted. A hot
    climate chamber looks the same: where the motor file decides the unit it is a warning. Tenths of
    degrees are told where the winding is hotter than any and a tenth of its start is the ambient.
    """
    is_kelvin = False
    for channel, (low, high) in AS_KELVIN.items():
        time_s, temperature = samples(record, channel)
        # Start and end both: a winding may reach 253 degC, but it does not start there.
        if time_s.size and low < temperature[0] < high and float(np.min(temperature)) > low:
            is_kelvin, value = True, float(temperature[0])
            yield _finding(record, channel, "error", value, float(time_s[0]), "kelvin")
    time_s, winding, ambient, losses = samples(
        with_all_heat(record, motor), "winding_degC", "ambient_degC", "losses_W"
    )
    lead = lead_in(time_s, losses)
    if is_kelvin or lead == 0:
        return
    from_s, (low, high) = float(time_s[0]), AMBIENT_AS_FAHRENHEIT
    at_start = float(np.median(winding[:lead]))
    around = float(np.median(ambient[:lead]))
    # A winding tens of kelvin colder than the air around it has no way to be so.
    apart_K = min(abs(at_start - around), abs((around - 32.0) / 1.8 - at_start))
    is_far = at_start - around > FAHRENHEIT_ABOVE_K
    if low < around < high and apart_K < AGREEMENT_K:
        severity = _severity(record, "ambient_degC")
        yield _finding(record, "ambient_degC", severity, around, from_s, "Fahrenheit")
    elif around < low and is_far and _starts_cold(winding, ambient, lead):
        yield _finding(record, "winding_degC", "warning", at_start, from_s, "Fahrenheit")
    elif at_start > HOTTEST_START_DEGC or float(np.quantile(winding, 0.9)) > HOTTEST_DEGC:
        scale = next((s for s in SCALES if abs(at_start / s - around) < AGREEMENT_K), None)
        if scale is not None:
            severity = _severity(record, "winding_degC")
            yield _finding(record, "winding_degC", severity, at_start, from_s, scale)


def _starts_cold(winding: np.ndarray, ambient: np.ndarray, lead: int) -> bool:
    """Whether a winding that starts hot starts at the ambient's temperature in Fahrenheit.

    A hot start may lie there by chance; then the winding cools at rest, and read as Fahrenheit it
    would fall below the ambient.
    """
    above = (winding - 32.0) / 1.8 - ambient
    at_start = float(np.median(above[:lead]))
    stays = float(np.quantile(above, 0.01)) > at_start - COOLS_K
    return abs(at_start) < AGREEMENT_K and stays


def ambient_implausible(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a sink temperature that no bench has, that lies above the loaded winding or is it."""
    channel = sink_channel(motor)
    time_s, sink = samples(record, channel)
    if time_s.size == 0:
        return
    where = place(record, channel, float(time_s[0]), float(time_s[-1]))
    typical = float(np.median(sink))
    # what an open circuit reads is no temperature
    warm = {n: record[n] for n in ("winding_degC", *BODIES) if n in record}
    low, high = POSSIBLE_OF_BODIES_DEGC
    warm = {n: np.where((low < T) & (high > T), T, np.nan) for n, T in warm.items()}
    heated = with_all_heat(record.having(warm), motor)
    time_s, sink, winding, losses = samples(heated, channel, "winding_degC", "losses_W")
    loaded = is_loaded(losses)
    swing = float(np.ptp(winding)) if winding.size else 0.0
    excess = float(np.quantile(np.abs(winding - sink), 0.95)) if winding.size else 0.0
    if loaded.any() and swing > LEAST_SWING_K and excess < SAME_SHARE * swing:
        # that it is as hot as a winding follows from it
        yield Finding(
            "ambient_implausible",
            "error",
            f"Expected the winding above {channel} under load; they stay within {excess:.2g} K of "
            f"each other while the winding swings by {swing:.0f} K. They are one temperature, so "
            "no resistance can be fitted.",
            place(record, channel, float(time_s[0]), float(time_s[-1])),
            f"Give {channel} the column of the cooling medium in [columns]; where it was "
            f"steady and not recorded, its value under [constants], as {channel} = 22.0.",
            values={"excess_K": excess, "swing_K": swing},
        )
        return
    for body in ("winding_degC", *BODIES):
        is_winding = body == "winding_degC"
        time_s, sink, T, losses = samples(heated, channel, body, "losses_W")
        loaded = is_loaded(losses)
        below = float(np.median((T - sink)[loaded])) if loaded.any() else 0.0
        is_exchanged = bool(loaded.any() and np.ptp(T) < ROOM_SHARE * np.ptp(sink))
        if not below < -SINK_ABOVE_K or not (is_exchanged or is_winding):
            continue
        fallen = float(T[0] - np.median(T[loaded]))
        is_mirrored = not is_exchanged and max(SINK_ABOVE_K, float(np.ptp(sink))) < fallen
        name, it = ("the winding", "the loaded winding") if is_winding else (body, "it")
        cause = ", which stays as it is: the two columns are exchanged." * is_exchanged
        cause += ": it falls as the load comes, so its two wires are exchanged." * is_mirrored
        remedy = "Check whether the two columns are exchanged."
        if is_exchanged:
            remedy = exchange_line(record, body, channel)
        elif is_mirrored:
            remedy = "Exchange the wires of the thermocouple; this record cannot be used."
        yield Finding(
            "ambient_implausible",
            "error",
            f"Expected {name} above {channel} under load; it is {-below:.1f} K below. Heat would "
            f"flow from the sink into {it}{cause or '.'}",
            place(record, channel if not cause else body, *map(float, time_s[loaded][[0, -1]])),
            remedy,
            values={"winding_above_sink_K": below, "is_exchanged": is_exchanged}
            | ({"mirrored_about_degC": float(T[0])} if is_mirrored else {}),
        )
        return
    low, high = PLAUSIBLE_DEGC[channel]
    lowest, highest = POSSIBLE_DEGC[channel]
    if not low <= typical <= high:
        yield Finding(
            "ambient_implausible",
            "warning" if lowest <= typical <= highest else "error",
            f"Expected {low:.0f} to {high:.0f} °C; the median is {typical:.1f} °C. The fit counts "
            "every temperature rise from it.",
            where,
            "Check the sensor, its unit, and which column is mapped.",
            values={"median_degC": typical},
        )
