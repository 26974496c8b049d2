"""The unit that a column is read in: everything that its file says of it, against each other.

Statements are the marked units of the name, the row of units, comment lines and what the file
keeps beside the name. All of them must be units of the channel's quantity and mean the same; what
does not is a question for `[columns]` and never decided here. Without a statement, a unit that is
part of the name counts (`heatrun.bench.channels.labels`), and without that nobody says.
"""

from __future__ import annotations

import json
import math

from ...errors import InputError
from ..readers.table import Column, Stated
from ..record import UnitSource
from .header import read_heading
from .labels import named_unit, rival_unit
from .schema import CHANNEL, Channel
from .unit_table import AMPERE, KILOAMPERE, MILLIAMPERE, ROOT_2
from .units import find_unit, quantities_of, require_unit

PLAIN_AMPERES = frozenset((*AMPERE, *MILLIAMPERE, *KILOAMPERE))


def line_of(channel: Channel, column: Column, unit: str | None = None) -> str:
    """Return the line of a motor file that reads a column as a channel in a unit.

    Args:
        channel: What the column is to become.
        column: The column.
        unit: Unit text, None for the canonical one.
    """
    text = json.dumps(f"{column.name} [{unit or channel.unit}]", ensure_ascii=False)
    return f"[columns] {channel.name} = {text}"


def statements(column: Column) -> tuple[Stated, ...]:
    """Return what the file says about the unit of a column, of this one alone, in its order."""
    if column.is_seconds:
        return (Stated("s", "the column"),)
    marked = tuple(
        Stated(unit, "the name") for unit in read_heading(column.heading or column.name).units
    )
    beside = tuple(one for one in column.beside if one.scope == "column")
    known = [one.text for one in (*marked, *beside)]
    if column.unit is None or column.unit in known:
        return marked + beside
    return (*marked, *beside, Stated(column.unit, "the file"))


def unit_of(column: Column, channel: Channel, where: str) -> tuple[str | None, UnitSource]:
    """Return the unit text of a column that becomes a channel, and how it is known.

    Args:
        column: The column.
        channel: What it becomes.
        where: File and column, for the message.

    Returns:
        The text, None if nobody says.

    Raises:
        InputError: If a statement is no unit of the channel's quantity, two of them contradict
            each other, or what is part of the name may be read in two ways.
    """
    if column.is_seconds:
        return "s", column.unit_from
    quantity = channel.quantity
    stated = statements(column)
    for one in stated:
        require_unit(one.text, quantity, where=where, remedy=unit_wanted(channel, column))
    binding = _binding(column, quantity)
    said = (*binding, *stated)
    rival = rival_unit(column.label, quantity) if stated and not binding else None
    against = (Stated(rival, "the name"), *said) if rival else said
    may_refine = bool(rival or binding) and column.label not in CHANNEL
    for one in against[1:]:
        if not _agrees(against[0], one, quantity, may_refine=may_refine):
            raise _conflict(against[0], one, channel, column, where)
    if stated:
        return stated[0].text, "stated"
    if binding:
        return binding[0].text, "name"
    named = named_unit(column.label, quantity)
    if named is not None:
        if named.doubt:
            raise _doubt(f"{named.doubt}.", (named.unit,), channel, column, where)
        require_unit(named.unit, quantity, where=where, remedy=unit_wanted(channel, column))
        return named.unit, "name"
    return _by_general(column, channel, where)


def _binding(column: Column, quantity: str) -> tuple[Stated, ...]:
    """Return the unit in the name that binds as much as one that is marked.

    It does if it can be nothing else than a unit, or if the name is that of a channel.
    """
    canonical = CHANNEL.get(column.label)
    if canonical is not None and canonical.unit != "1" and find_unit(canonical.unit, quantity):
        return (Stated(canonical.unit, "the name"),)
    named = named_unit(column.label, quantity)
    if named is None or not named.is_sure or named.doubt or not find_unit(named.unit, quantity):
        return ()
    return (Stated(named.unit, "the name"),)


def _agrees(first: Stated, second: Stated, quantity: str, *, may_refine: bool) -> bool:
    """Return whether two statements mean the same unit.

    Args:
        first: One of them.
        second: The other.
        quantity: Of both.
        may_refine: The first is a part of the name: a plain A in it says nothing of rms or peak,
            so that a unit that does is no contradiction.
    """
    one, other = find_unit(first.text, quantity), find_unit(second.text, quantity)
    if one == other:
        return True
    if not (may_refine and first.text in PLAIN_AMPERES and one and other):
        return False
    return any(math.isclose(other.factor, one.factor * kind) for kind in (1 / ROOT_2, 1.0, ROOT_2))


def _by_general(column: Column, channel: Channel, where: str) -> tuple[str | None, UnitSource]:
    """Return the unit that lines of the file give for more than this column."""
    general = [
        one
        for one in column.beside
        if one.scope != "column" and find_unit(one.text, channel.quantity)
    ]
    clear = [one for one in general if one.scope == "quantity"]
    for one in clear[1:]:
        if find_unit(one.text, channel.quantity) != find_unit(clear[0].text, channel.quantity):
            raise _conflict(clear[0], one, channel, column, where)
    if clear:
        return clear[0].text, "stated"
    for one in general:
        if find_unit(one.text, channel.quantity) != find_unit(channel.unit, channel.quantity):
            problem = f"{one.source[:1].upper()}{one.source[1:]} mentions {one.text}; nothing "
            raise _doubt(
                f"{problem}states whether it is the unit of this column.",
                (one.text,),
                channel,
                column,
                where,
            )
    return None, "assumed"


def overridden(column: Column, channel: Channel, decided: str) -> Stated | None:
    """Return the first statement of a file that `[columns]` decides against, or None.

    Args:
        column: The column.
        channel: What it becomes.
        decided: Unit text in `[columns]`.
    """
    quantity = channel.quantity
    unit = find_unit(decided, quantity)
    rival = rival_unit(column.label, quantity)
    in_name = _binding(column, quantity) or ((Stated(rival, "the name"),) if rival else ())
    for one in (*statements(column), *in_name):
        if find_unit(one.text, quantity) != unit:
            return one
    return None


def unit_wanted(channel: Channel, column: Column) -> str:
    """Return the remedy where a unit is not understood; none is offered, it may be any of them."""
    return f"Say it in the motor file, with the unit for UNIT: {line_of(channel, column, 'UNIT')}."


def _conflict(
    first: Stated, second: Stated, channel: Channel, column: Column, where: str
) -> InputError:
    source = "the unit behind it" if first.source == second.source else second.source
    return InputError(
        f"{first.source[:1].upper()}{first.source[1:]} says {first.text}, {source} {second.text}.",
        where=where,
        remedy=f"Decide in the motor file: {line_of(channel, column, first.text)} or "
        f"{line_of(channel, column, second.text)}.",
    )


def _doubt(
    problem: str, units: tuple[str, ...], channel: Channel, column: Column, where: str
) -> InputError:
    known = [unit for unit in units if channel.quantity in quantities_of(unit)]
    lines = " or ".join(line_of(channel, column, unit) for unit in (None, *known))
    return InputError(problem, where=where, remedy=f"Say it in the motor file: {lines}.")
