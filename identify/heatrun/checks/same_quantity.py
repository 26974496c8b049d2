"""Columns that say the same thing: do they agree?

A file often holds a quantity twice: the phase current and its d and q parts, the losses and the
powers that they follow from. Where one of them is an amplitude read as rms, or in kW under a header
in W, the other one tells.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..io.quantities import rounded
from ..record.balance_errors import BLOCK_S, SHAFT_GAIN_SD
from ..record.derive import (
    AMPLITUDE_INVARIANT,
    DERIVATIONS,
    ELECTRICAL,
    SHAFT,
    WITH_INVERTER,
    Derivation,
    recorded_shaft_power,
    shaft_power,
)
from ..record.motor import Motor
from ..record.record import Finding, Record
from ..record.samples import block_means, place, samples
from .which_unit import other_readings, supposed

LOADED = 0.2
"""In parts of the largest value [1]: below, offsets of the instruments decide."""

FEWEST_BLOCKS = 6

AGREE = 0.05
"""Two ways to one quantity agree within this share [1]: two instruments of 1 %, harmonics and the
filter of one of them."""

REFUSED = 0.2
"""Beyond this share [1] one of the two columns is something else than it is read as."""

NEAR = 0.04
"""A ratio is taken for a known factor within this share [1]."""

MOST_OF_INVERTER = 0.1
"""Share of what is between DC link and shaft that is left to the motor at least [1]."""

ROOT_2, ROOT_3 = math.sqrt(2.0), math.sqrt(3.0)

THOUSANDS = {
    1e3: "{0} is in W under a unit of kW, or the other side in kW under W",
    1e-3: "{0} is in kW under a unit of W, or the other side in W under kW",
}

CURRENTS = {
    ROOT_2: "{0} is an amplitude that is read as rms, or i_d and i_q are rms values",
    1.0 / ROOT_2: "i_d and i_q hold √2 times the amplitude, or {0} is divided by √2 once too often",
    ROOT_2 / ROOT_3: "i_d and i_q come from the power-invariant transform (√(3/2) times the "
    "amplitude)",
    1.0 / ROOT_3: "{0} is the current inside a delta, or one of the two is scaled by √3",
    ROOT_3: "{0} is the current of a line that feeds a delta, or one of the two is scaled by √3",
    1e3: "{0} is in mA under a unit of A",
    1e-3: "{0} is in kA under a unit of A",
}


@dataclass(frozen=True)
class Twice:
    """A quantity that a record may hold twice: as a column of its own, and by a derivation."""

    way: Derivation  # How it follows from other channels.
    # What a ratio of the column to that would mean; {0} is the channel.
    factors: Mapping[float, str]
    # Whether the way gives more than the quantity, by a share that nobody knows: then only a column
    # above it is a contradiction, or one below by a factor of units.
    is_upper: bool = False


def _derived(channel: str, factors: Mapping[float, str]) -> tuple[Twice, ...]:
    """Return the ways to a channel; those from a DC link hold the inverter's losses too."""
    return tuple(
        Twice(way, factors, any(name.startswith("dc_") for name in way.needs))
        for way in DERIVATIONS
        if way.channel == channel
    )


POWERS: tuple[Twice, ...] = (
    Twice(Derivation("mechanical_power_W", SHAFT, lambda c, _: shaft_power(c), "torque·omega"),
          THOUSANDS),
    Twice(ELECTRICAL[1], {1.5: "d and q come from the power-invariant transform", **THOUSANDS}),
    Twice(ELECTRICAL[-1], THOUSANDS),
)  # fmt: skip
"""Powers are never derived for a record, only compared."""

TWICE = (*_derived("phase_current_A", CURRENTS), *POWERS, *_derived("losses_W", THOUSANDS))


def columns_disagree(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report quantities that the columns of a record give twice and not alike.

    A warning beyond `AGREE`, an error beyond `REFUSED`: then a unit, a factor or a column is wrong,
    and which of the two it is nobody can tell from here. Losses are allowed what an error of the
    shaft's power makes of their difference.
    """
    columns = {reading.channel: reading.column for reading in record.mapping}
    told: set[str] = set()
    for twice in TWICE:
        given = twice.way.channel
        if given in told or not all(name in columns for name in (given, *twice.way.needs)):
            continue
        if given == "losses_W" and motor.losses == "map":
            continue
        finding = _compared(record, motor, twice, columns)
        if finding is not None:
            yield finding
            told.add(given)


class Difference(NamedTuple):
    """How a column stands to what follows from others.

    Attributes:
        ratio: The column over that, under load [1].
        allowed: What an error of the shaft's power makes of it [1].
        off: What it is off, as a logarithm [1].
        from_s: Where it was compared [s], from here to `to_s`.
    """

    ratio: float
    allowed: float
    off: float
    from_s: float
    to_s: float


def _difference(record: Record, motor: Motor, twice: Twice) -> Difference | None:
    """Return how a column differs from what follows from others, None where that cannot be told."""
    way = twice.way
    time_s, given, *others = samples(record, way.channel, *way.needs)
    if time_s.size < FEWEST_BLOCKS:
        return None
    parts = dict(zip(way.needs, others, strict=True))
    if not way.holds(parts):
        return None
    computed = way.compute(parts, motor.phases)
    # a difference of two powers takes the error of the shaft's along
    part = recorded_shaft_power(parts) if way.channel == "losses_W" else None
    shaft = np.zeros(time_s.size) if part is None else np.abs(part)
    time_s, given, computed, shaft = block_means(time_s, BLOCK_S, given, computed, shaft)
    sides = np.abs(given), np.abs(computed)
    loaded = np.logical_and.reduce([side > LOADED * np.max(side, initial=0.0) for side in sides])
    if np.sum(loaded) < FEWEST_BLOCKS:
        return None
    time_s, given, computed, shaft = (a[loaded] for a in (time_s, given, computed, shaft))
    ratio = float(np.median(given / computed))
    allowed = 2.0 * SHAFT_GAIN_SD * float(np.median(shaft / np.abs(computed)))
    off = abs(math.log(ratio)) if ratio > 0.0 else math.inf
    return Difference(ratio, allowed, off, float(time_s[0]), float(time_s[-1]))


def _compared(
    record: Record, motor: Motor, twice: Twice, columns: Mapping[str, str]
) -> Finding | None:
    """Return the finding about one quantity, None where both ways agree or cannot be compared."""
    way, found = twice.way, _difference(record, motor, twice)
    if found is None or found.off <= AGREE + found.allowed:
        return None
    ratio, allowed = found.ratio, found.allowed
    is_error = found.off > REFUSED + allowed
    cause = _meaning(ratio, twice, MOST_OF_INVERTER if twice.is_upper else 1.0)
    if is_error and not cause and not twice.is_upper:
        cause = _misread(record, motor, twice)
    if twice.is_upper and (not is_error or (ratio < 1.0 and not cause) or ratio < 0.0):
        return None  # within the errors of a small difference, or the inverter's
    likely = f" They agree if {cause}." if cause else ""
    named = ", ".join(f"'{columns[name]}'" for name in (way.channel, *way.needs))
    # without these the other way to the quantity is gone
    needed = way.needs if way.needs == ("i_d_A", "i_q_A") else way.needs[:1]
    silence = " and ".join(f'{name} = "none"' for name in needed)
    formula = way.formula.removesuffix(AMPLITUDE_INVARIANT).removesuffix(WITH_INVERTER)
    limit = "at most " if twice.is_upper else ""
    return Finding(
        "columns_disagree",
        "error" if is_error else "warning",
        f"Expected {way.channel} {limit or '= '}{formula}; under load it is {rounded(ratio)} times "
        f"that (columns {named}).{likely}",
        place(record, way.channel, found.from_s, found.to_s),
        "Find out which of the columns is wrong. State its unit in [columns], or leave it out "
        f'there: {way.channel} = "none" or {silence}.',
        values={"ratio": ratio, "allowed": AGREE + allowed},
    )


def _misread(record: Record, motor: Motor, twice: Twice) -> str:
    """Return the likeliest other unit of a column in which both ways agree, in words, if any."""
    names = {twice.way.channel, *twice.way.needs}
    agreeing = [
        one
        for one in other_readings(record, motor)
        if names & one.units.keys()
        if (found := _difference(one.record, motor, twice)) is not None
        if found.off <= AGREE + found.allowed
    ]
    return supposed(max(agreeing, key=lambda one: one.prior)) if agreeing else ""


def _meaning(ratio: float, twice: Twice, room: float) -> str:
    """Return what the ratio of a column to what was computed would mean, empty if it is no known
    factor.

    Of what was computed the quantity may be a share at least; 1 for all of it.
    """
    if ratio < 0.0:
        return f"one of the two has the other sign: {twice.way.channel} or the powers"
    for factor, text in twice.factors.items():
        if math.log(room) - NEAR < math.log(ratio / factor) < NEAR:
            return text.format(twice.way.channel)
    return ""
