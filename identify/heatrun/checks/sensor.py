"""Does the temperature sensor hang on, or has it come off or broken?"""

from collections.abc import Iterator

import numpy as np

from ..record.channels import BODIES
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import (
    channel_of,
    is_loaded,
    pickup,
    place,
    rounding_step,
    runs,
    samples,
    sink_channel,
    slack_K,
    with_all_heat,
)
from ..record.stretch import windows, within
from .advice import Part, Remedy, exchange_line, mask_line, use_line
from .contact import lost_contact
from .frozen import Looked
from .unexplained import WINDOWS_S, Movement

MAX_RATE_K_PER_S = 5.0
"""A winding heats adiabatically at rho J^2/(c d): with copper at 100 degC (2.3e-8 ohm m, 385 J/kg
K, 8960 kg/m^3) 5 K/s needs 27 A/mm^2, which no bench holds for more than seconds."""

SPIKE_SAMPLES = 4
"""A jump that is undone within so many samples is a spike, not a shift."""

OPEN_CIRCUIT_CODES = (
    # Ends of the ranges of thermocouple types K, J, T, B and of Pt100 cards, their fault codes, and
    # the ends of 8..16 bit counters also when scaled by 10 or 100.
    *(-40.0, -50.0, -99.0, -100.0, -200.0, -210.0, -250.0, -270.0, -327.68, -999.0, -9999.0),
    *(255.0, 327.67, 655.35, 850.0, 999.0, 1200.0, 1370.0, 1372.0, 1820.0, 3276.7, 6553.5, 9999.0),
    *(32767.0, -32768.0, 65535.0),
)
CODE_TOLERANCE_K = 0.5
"""Codes come back exact or rounded to a degree."""

NOTHING = 0.0
"""What a lost signal reads [degC]; a test may begin at it."""

FROSTY_DEGC = 5.0
"""A winding that is colder shows that what reads 0 degC throughout may be that cold."""

CODE_LEAP_K = 20.0
"""A value that equals a code is one only where the reading leaps to it or away from it: a winding
may pass 255 degC, and a climate chamber may stand at -40."""

OTHERS = (*BODIES, "ambient_degC", "coolant_degC")
"""Temperatures beside that of the winding."""

BACK_SHARE = 0.5
"""Share of a jump [1] by which a later one is its return: meanwhile the winding has moved."""

PLAUSIBLE_DEGC = (-60.0, 350.0)
"""Colder than any test chamber; hotter than any enamel endures (class C ends near 240 degC)."""

FALL_SHARE = 0.5
"""Of its excess over the sink [1] that a reading loses which falls most of the way to it."""

BELOW_HOUSING_K, BELOW_HOUSING_S = 3.0, 60.0
"""Two sensors agree to 1 K each; a housing in the sun of an inverter is warmer than a cold winding
for less."""


SAME_S = 10.0
"""Within this a jump and a movement are one [s]."""


def temperature_jump(record: Record, motor: Motor, looked: Looked) -> Iterator[Finding]:
    """Report temperatures that move as no heat moves them.

    Of any machine, as `jumps_at_once`; of this one, by how it moved. What is a fall to the sink
    belongs to `sensor_detached`.
    """
    at_once = {channel_of(one): one for one in jumps_at_once(record, motor)}
    moved, of_winding = looked.moved, at_once.get("winding_degC")
    if moved is None or is_fall(record, motor, moved):
        yield from at_once.values()
        return
    # a shift while the winding warms fast looks like a spike: how it moved says that it stays
    if of_winding is not None:
        at_s = of_winding.values["from_s"] or 0.0
        is_there = moved.from_s - SAME_S <= at_s <= moved.to_s + SAME_S
        if moved.is_back or of_winding.severity == "error" or not is_there:
            yield from at_once.values()
            return
        del at_once["winding_degC"]
    yield from at_once.values()
    change = moved.to_degC - moved.from_degC
    advice = (
        _left_out(record, "winding_degC", (moved.from_s, moved.until_s))
        if moved.is_back
        else _without_jump(record, "winding_degC", moved.from_s, is_lasting=True)
    )
    back = f"; it is back at {moved.until_s:.0f} s" if moved.is_back else " and stays so"
    yield Finding(
        "temperature_jump",
        "error",
        f"The reading changes by {change:+.1f} K within {moved.to_s - moved.from_s:.0f} s, "
        f"where the heat in the record makes {moved.expected_K:+.1f} K of it{back}. The fit "
        "would follow the fault.",
        place(record, "winding_degC", moved.from_s, moved.to_s),
        Remedy("Check the sensor for a loose contact or interference.", *advice),
        values={
            "largest_K": change,
            "expected_K": moved.expected_K,
            "from_s": moved.from_s,
            "to_s": moved.to_s,
            "until_s": moved.until_s,
        },
    )


def jumps_at_once(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report temperatures that move faster than the heat of any machine allows.

    The limit is 5 K/s times the step, beyond what the sample before or after goes the same way,
    plus two rounding steps and six standard deviations of the noise: a small winding falls by 8 K/s
    as its load goes, and by nearly as much a second later. A spike is a warning; a shift of the
    winding temperature that stays is an error, since a fit would explain it by heat.
    """
    for channel in ("winding_degC", *OTHERS):
        time_s, temperature = samples(record, channel)
        if time_s.size < 3:
            continue
        steps = np.diff(time_s)
        slack = slack_K(temperature)
        rates = np.diff(temperature) / steps
        earlier, later = np.append(0.0, rates[:-1]), np.append(rates[1:], 0.0)
        beside = np.maximum(np.sign(rates) * earlier, np.sign(rates) * later)
        limits = (MAX_RATE_K_PER_S + np.maximum(beside, 0.0)) * steps + slack
        jumps = np.flatnonzero(np.abs(np.diff(temperature)) > limits)
        if jumps.size == 0:
            continue
        after = np.minimum(jumps + SPIKE_SAMPLES, time_s.size - 1)
        before = np.maximum(jumps - SPIKE_SAMPLES, 0)
        # A spike comes back after its first jump, and had been there before its second.
        shift = np.minimum(
            np.abs(temperature[after] - temperature[jumps]),
            np.abs(temperature[jumps + 1] - temperature[before]),
        )
        lasting = shift > limits[jumps]
        is_error = channel == "winding_degC" and bool(lasting.any())
        worst = int(jumps[np.argmax(np.abs(np.diff(temperature))[jumps])])
        change = float(temperature[worst + 1] - temperature[worst])
        step, away = time_s[worst : worst + 2], np.diff(temperature)[jumps[lasting]]
        is_back = away.size > 1 and -np.sign(away[0]) * away[-1] > BACK_SHARE * abs(away[0])
        if is_back:
            first, last = jumps[lasting][[0, -1]]
            span = (float(time_s[first + 1]), float(time_s[last]))
            advice = _left_out(record, channel, span)
            until = {"until_s": span[1]}
        else:
            span, until = (float(time_s[worst]), 0.0), {}
            advice = _without_jump(record, channel, float(time_s[worst]), bool(lasting.any()))
        limit = float(limits[worst])
        yield Finding(
            "temperature_jump",
            "error" if is_error else "warning",
            f"Expected changes within {limit:.2f} K in {steps[worst]:.3g} s; the largest is "
            f"{change:+.1f} K ({jumps.size} such jumps, {int(lasting.sum())} of them lasting). "
            "No temperature of a machine jumps; the fit would follow the fault.",
            place(record, channel, *(span if is_back else map(float, step))),
            Remedy("Check the sensor for a loose contact or interference.", *advice),
            values={
                "num_jumps": float(jumps.size),
                "num_lasting": float(lasting.sum()),
                "largest_K": change,
                "limit_K": limit,
                "from_s": span[0],
                **until,
            },
        )


def sensor_pickup(record: Record, motor: Motor) -> Iterator[Finding]:
    """Warn of a winding's reading that jumps with the current, up and down.

    Below what `jumps_at_once` allows it is the fit's to see.
    """
    found = pickup(record, MAX_RATE_K_PER_S)
    if found is None:
        return
    yield Finding(
        "sensor_pickup",
        "warning",
        f"The reading jumps with the current at {found.num_steps} load steps, by "
        f"{found.rated_K:+.1f} K at {found.largest_A:.3g} A, and back: its line picks up the "
        "current.",
        place(record, "winding_degC", *found.span_s),
        "Shield the sensor's line, twist it, keep it off the phases. A fit takes it out as the "
        "effect sensor_pickup.",
        values={"rated_K": found.rated_K, "exponent": found.exponent,
                "largest_A": found.largest_A},
    )  # fmt: skip


def _left_out(record: Record, channel: str, *spans: tuple[float, float]) -> tuple[Part, ...]:
    """Return what to write to do without readings; of the sink, which no fit does without, none."""
    if channel == "winding_degC":
        return " To leave its readings out: ", mask_line(record, spans), "."
    without = f' To do without it: {channel} = "none" under [columns].'
    return (without,) if channel in BODIES else ()


def _without_sensor(
    record: Record, channel: str, spans: list[tuple[float, float]]
) -> tuple[Part, ...]:
    """Return what to write to do without what an open circuit reads: of a sink, a constant."""
    if channel == "winding_degC" or channel in BODIES:
        return _left_out(record, channel, *spans)
    time_s, reading = samples(record, channel)
    known = reading[~within(time_s, spans)]
    number = f"{np.median(known):.1f}" if known.size else "NUMBER"
    return (
        f' To do without it: {channel} = "none" under [columns] and {channel} = {number} under '
        "[constants].",
    )


def _up_to(record: Record, begin_s: float, at_s: float, where: str) -> tuple[Part, ...]:
    """Return what to write to use a test up to a time [s]."""
    return f" To use the test up to {where}: ", use_line(record, (begin_s, at_s)), "."


def _without_jump(record: Record, channel: str, at_s: float, is_lasting: bool) -> tuple[Part, ...]:
    """Return what to write to use a test without a jump; nothing for a spike of the sink."""
    time_s = samples(record, channel)[0]
    if channel not in BODIES and is_lasting and at_s > time_s[0]:
        return _up_to(record, float(time_s[0]), at_s, "it")
    past = float(time_s[min(np.searchsorted(time_s, at_s) + SPIKE_SAMPLES, time_s.size - 1)])
    return _left_out(record, channel, (at_s, past))


def _open_circuit(temperature: np.ndarray) -> np.ndarray:
    """Where a temperature is a fault code that it leaps to, or one that no machine has."""
    is_code = np.zeros(temperature.size, dtype=bool)
    for code in OPEN_CIRCUIT_CODES:
        is_code |= np.abs(temperature - code) < CODE_TOLERANCE_K
    is_nothing = temperature == NOTHING
    first, past = runs(is_code | is_nothing)
    last = temperature.size - 1
    entry = np.abs(temperature[first] - temperature[np.maximum(first - 1, 0)])
    leaving = np.abs(temperature[past - 1] - temperature[np.minimum(past, last)])
    is_open = (temperature < PLAUSIBLE_DEGC[0]) | (temperature > PLAUSIBLE_DEGC[1])
    leaps = np.where(is_nothing[first], entry, np.maximum(entry, leaving)) > CODE_LEAP_K
    for a, b in zip(first[leaps], past[leaps], strict=True):
        is_open[a:b] = True
    return is_open


def open_spans(record: Record, channel: str) -> list[tuple[float, float]]:
    """Return first and last times [s] of where a temperature reads what an open circuit does."""
    time_s, reading = samples(record, channel)
    # of kelvin, all off by 273, `units_temperature` has the say
    if time_s.size < 3 or (np.min(reading) > 230.0 and np.median(reading) < 500.0):
        return []
    is_column = not record.mapping or channel in {one.channel for one in record.mapping}
    if np.all(reading == NOTHING) and channel != "winding_degC" and is_column:
        winding = samples(record, "winding_degC")[1]
        is_cold = winding.size and np.min(winding) < FROSTY_DEGC
        return [] if is_cold else [(float(time_s[0]), float(time_s[-1]))]
    return windows(time_s, _open_circuit(reading))


WHENEVER_LOADED, RISES_TOO = 0.95, 0.2
"""Share of the loaded time [1] in which a winding reads less than its housing that stands for it,
and its swing and its rise over the housing's [1]: those of a sensor in the air are none."""


def sensor_detached(record: Record, motor: Motor, looked: Looked) -> Iterator[Finding]:
    """Report open-circuit readings of any temperature, and one that leaves the winding for the air.

    Fault codes such as 850, 1372, 32767 or -327.68 are told by value and by the leap to them. A
    sensor that has come off is told by a fall that the heat in the record does not explain, or by
    a reading below the housing while the winding is heated.
    """
    for channel in ("winding_degC", *OTHERS):
        spans = open_spans(record, channel)
        if not spans:
            continue
        time_s, reading = samples(record, channel)
        is_open = within(time_s, spans)
        (from_s, to_s), value = spans[0], float(reading[is_open][0])
        is_fitted = channel in ("winding_degC", sink_channel(motor))
        yield Finding(
            "sensor_detached",
            "error" if is_fitted else "warning",
            f"Expected a temperature, got {value:.1f} °C, the reading of an open "
            f"circuit ({int(is_open.sum())} samples in {len(spans)} stretches). Fitted, they "
            "would bias every parameter.",
            place(record, channel, from_s, to_s),
            Remedy("Check the sensor and its line.", *_without_sensor(record, channel, spans)),
            values={
                "reading_degC": value,
                "num_samples": float(is_open.sum()),
                "from_s": from_s,
                "to_s": to_s,
            },
        )
        if channel == "winding_degC":
            return
    fallen = _fallen(record, motor, looked.moved)
    if fallen is not None:
        yield fallen


def _fallen(record: Record, motor: Motor, moved: Movement | None) -> Finding | None:
    """Return the finding on a reading that leaves the winding for the air, None if none does."""
    if moved is not None and is_fall(record, motor, moved):
        stays = (
            f", until {moved.until_s:.0f} s."
            if moved.is_back
            else ". From there on it does not show the winding."
        )
        return _detached(
            record,
            f"The reading falls from {moved.from_degC:.1f} to {moved.to_degC:.1f} °C within "
            f"{moved.to_s - moved.from_s:.0f} s, where the heat in the record makes "
            f"{moved.expected_K:+.1f} K of it{stays}",
            (moved.from_s, moved.to_s, moved.until_s),
            moved.is_back,
            {"from_degC": moved.from_degC, "to_degC": moved.to_degC,
             "expected_K": moved.expected_K},
        )  # fmt: skip
    time_s, winding, housing, losses = samples(
        with_all_heat(record, motor), "winding_degC", "housing_degC", "losses_W"
    )
    if time_s.size < 3:
        return None
    room = BELOW_HOUSING_K + (rounding_step(winding) or 0.0)
    first, past = runs((winding < housing - room) & ~_open_circuit(housing))
    heated_s = np.cumsum(np.append(0.0, np.diff(time_s)) * is_loaded(losses))
    lasting = np.flatnonzero(heated_s[past - 1] - heated_s[first] >= BELOW_HOUSING_S)
    if lasting.size == 0:
        return None
    below, past_it = int(first[lasting[0]]), int(past[lasting[0]])
    loaded = is_loaded(losses)
    is_less = float(np.mean((winding < housing + room)[loaded])) > WHENEVER_LOADED
    known_s, known = samples(record, sink_channel(motor))
    sink = np.interp(time_s, known_s, known) if known_s.size else 0.0
    pair = (np.array([winding, housing]) - sink)[:, loaded]
    moves = np.array([np.ptp(pair, axis=1), np.max(pair, axis=1)])
    if is_less and np.all(moves[:, 0] > RISES_TOO * moves[:, 1]):
        return _exchanged(record, winding, housing)
    for jump in jumps_at_once(record, motor):
        if jump.severity == "error" and (jump.values["from_s"] or 0.0) <= time_s[below]:
            return None  # that tells it
    # it fell from the highest reading just before
    before = int(np.searchsorted(time_s, time_s[below] - WINDOWS_S[-1]))
    begin = before + int(np.argmax(winding[before : below + 1]))
    above = np.flatnonzero(winding[below:] > housing[below:])
    until = below + int(above[0]) - 1 if above.size else time_s.size - 1
    least = float(np.min((winding - housing)[below : until + 1]))
    return _detached(
        record,
        f"The winding reads less than its housing under load, {-least:.1f} K less at most: heat "
        "would flow into the winding that makes it.",
        (float(time_s[begin]), float(time_s[past_it - 1]), float(time_s[until])),
        bool(above.size),
        {"below_housing_K": -least},
    )


def loses_contact(record: Record, motor: Motor) -> Iterator[Finding]:
    """Warn of a winding's reading that over many minutes comes to show less of its rise.

    A cooling that was changed on the bench does the same to a record.
    """
    lost = lost_contact(record, motor)
    if lost is None:
        return
    yield Finding(
        "sensor_detached",
        "warning",
        f"Within {(lost.to_s - lost.from_s) / 60.0:.0f} min the reading comes to show "
        f"{100.0 * lost.share:.0f} % less of its rise than the heat makes: of the readings a "
        f"simple network leaves {lost.misfit_K:.2g} K, with that given back "
        f"{lost.misfit_put_right_K:.2g} K. The sensor lost contact, or the cooling changed.",
        place(record, "winding_degC", lost.from_s, lost.to_s),
        Remedy(
            "Check the sensor's contact, and fan, flow and doors.",
            *_up_to(record, float(samples(record)[0][0]), lost.from_s, "there"),
        ),
        values={"from_s": lost.from_s, "to_s": lost.to_s, "share": lost.share},
    )


HOUSING = "housing_degC"


def _exchanged(record: Record, winding: np.ndarray, housing: np.ndarray) -> Finding:
    """Return the finding that winding and housing stand for each other, or in two units."""
    column = record.column_of(HOUSING, HOUSING)
    is_fahrenheit = abs((housing[0] - 32.0) / 1.8 - winding[0]) < BELOW_HOUSING_K
    return Finding(
        "sensor_detached",
        "error",
        "The winding reads less than its housing whenever the machine is loaded, "
        f"{float(np.max(housing - winding)):.1f} K less at most, and both rise: "
        + ("the housing looks like °F." if is_fahrenheit else "the two columns are exchanged."),
        place(record, "winding_degC", *map(float, record.time_s[[0, -1]])),
        f'Write {HOUSING} = "{column} [degF]" under [columns].'
        if is_fahrenheit
        else exchange_line(record, "winding_degC", HOUSING),
        values={"below_housing_K": float(np.max(housing - winding))},
    )


def _detached(
    record: Record,
    message: str,
    span: tuple[float, float, float],
    is_back: bool,
    values: dict[str, float],
) -> Finding:
    from_s, to_s, until_s = span
    begin_s = float(samples(record)[0][0])
    if is_back or from_s <= begin_s:
        advice = _left_out(record, "winding_degC", (from_s, until_s))
    else:
        advice = _up_to(record, begin_s, from_s, "there")
    return Finding(
        "sensor_detached",
        "error",
        message,
        place(record, "winding_degC", from_s, to_s),
        Remedy("Check whether the sensor has come off.", *advice),
        values=values | {"from_s": from_s, "to_s": to_s, "until_s": until_s},
    )


def is_fall(record: Record, motor: Motor, moved: Movement) -> bool:
    """Return whether a movement brings the reading most of the way to the sink."""
    time_s, sink = samples(record, sink_channel(motor))
    around = float(np.interp(moved.from_s, time_s, sink))
    left = (moved.to_degC - around) / max(moved.from_degC - around, 1e-9)
    return moved.to_degC - moved.from_degC < moved.expected_K and left < 1.0 - FALL_SHARE
