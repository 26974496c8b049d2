"""From the columns of a file to canonical channels, by the motor file or by known names."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..errors import InputError, did_you_mean
from ..io.quantities import printable
from ..record.channels import (
    CHANNEL,
    COLUMN_MAPS,
    NOT_RECORDED,
    REQUIRED,
    Claim,
    ColumnMap,
    Columns,
    instead_of,
    parse_claims,
)
from ..record.header import read_heading
from ..record.record import Finding
from ..record.table import Column, Table
from ..record.units import QUANTITIES, find_unit, quantities_of
from .labels import columns_of, is_sure, named_unit, speaks_of, words_in
from .likely_names import SURE, read_name
from .mapping import MappedColumns, overridden, statements, unit_of

ONLY_CLOCK, ITS_WORDS = "the one column of times", "its words"
"""What says that a column is the time where nobody has named it: a rate goes before both."""


def map_columns(
    table: Table, columns: Columns | None = None, *, where: str, is_part: bool = False
) -> MappedColumns:
    """Return the canonical channels of a table.

    The motor file's `[columns]` come first, then exact canonical names, then the built-in maps in
    their order, then names of which every word speaks for one channel; a channel found earlier is
    not looked for again. Of a file that is part of a test, a column that `[columns]` names and the
    file does not have is a note, not an error.

    Raises:
        InputError: If a named channel or column does not exist, two columns claim one channel, a
            unit is not known or belongs to another quantity.
    """
    mapping = MappedColumns(where)
    pool = table.columns + _constants(table)
    for claim in parse_claims(columns or {}, where):
        may_lack = is_part or claim.is_choice
        if claim.is_choice and claim.channel in mapping.channels:
            continue  # the first of several counts
        if claim.rate_Hz is not None:
            mapping.rate_Hz = claim.rate_Hz
            continue
        if claim.text == NOT_RECORDED:
            mapping.excluded.add(claim.channel)
            continue
        if claim.parts and all(column.name != claim.text for column in pool):
            _add_combined(mapping, claim, pool, table, may_lack)
            continue
        column = _claimed(claim, pool, table, where, may_lack)
        if column is None:
            mapping.notes.append(f"{claim.channel}: no column '{claim.text}' in this file.")
            continue
        claim = _by_resistance(claim, column, where)
        _add_claimed(mapping, claim, column)
    _add_canonical(mapping, table.columns)
    for one in COLUMN_MAPS:
        labels = [*one.entries.items(), *((label, "") for label in one.refused)]
        if sum(bool(columns_of(*label, pool)) for label in labels) >= one.num_needed:
            _add_by_map(mapping, one, pool)
    if mapping.rate_Hz is not None:
        mapping.excluded.add("time_s")  # a rate that is stated goes before a word
    _add_by_words(mapping, table.columns)
    if mapping.rate_Hz is None:
        _add_only_clock(mapping, pool)
    used = mapping.used
    unused = [column.name for column in table.columns if id(column) not in used]
    mapping.unused = (*unused, *table.text_columns)
    mapping.findings += [*mapping.used_twice(), *_texts_for_numbers(mapping, table)]
    return mapping


def _texts_for_numbers(mapping: MappedColumns, table: Table) -> Iterator[Finding]:
    """Yield a finding for each column that would be a channel if it did not hold text."""
    for name, text in table.text_columns.items():
        label = read_heading(name).label
        spoken = {label} | {
            channel
            for quantity in QUANTITIES
            for channel, score in speaks_of(label, quantity, None).items()
            if score == SURE
        }
        lost = [channel for channel in REQUIRED if channel in spoken and mapping.wants(channel)]
        if text and lost:
            yield Finding(
                "text_for_numbers",
                "warning",
                f"Expected numbers, got text, '{printable(text[:40])}' in its first cell: "
                f"{lost[0]} is left out.",
                f"{mapping.where}, column '{name}'",
                "Export numbers, with their unit in the heading.",
            )


def _constants(table: Table) -> tuple[Column, ...]:
    """Return the scalars of a file as columns that stay the same, such as a fixed ambient."""
    present = {column.name for column in table.columns}
    return tuple(
        Column(name, name, None, np.full(table.num_rows, value), "a constant of the file")
        for name, value in table.constants.items()
        if name not in present
    )


def _claimed(
    claim: Claim, pool: Sequence[Column], table: Table, where: str, is_part: bool
) -> Column | None:
    """Return the column that a line of `[columns]` names."""
    quantity = CHANNEL[claim.channel].quantity
    longer = [column for column in pool if column.label.startswith(claim.label)]
    for matches in (
        [column for column in pool if column.name == claim.text],
        [column for column in pool if claim.base and column.name == claim.base],
        [column for column in pool if claim.label in (column.name, column.label)],
        [column for column in pool if claim.text == column.label],
        [
            one
            for one in pool
            if one.heading and claim.label in (one.heading, read_heading(one.heading).label)
        ],
        [column for column in pool if claim.label == _stem(column, quantity)],
        # the one whose name goes on with a unit alone behind the name in `[columns]`
        [one for one in longer if _unit_left(claim, one)] if len(longer) == 1 else [],
    ):
        if len(matches) > 1:
            raise _two_columns(claim.channel, matches, where)
        if matches:
            return matches[0]
    for name, text in table.text_columns.items():
        if name in (claim.text, claim.label):
            held = f"the text '{text[:40]}'" if text else "no values"
            raise InputError(
                f"Column '{name}' for {claim.channel} holds {held}, expected numbers.",
                where=where,
                remedy="Name a column of numbers in [columns].",
            )
    if is_part:
        return None
    names = [column.name for column in pool]
    labels = [column.label for column in pool]
    raise InputError(
        f"[columns] names '{claim.text}' for {claim.channel}, which the file does not have. "
        f"{did_you_mean(claim.label, [*names, *labels])}".strip(),
        where=where,
        remedy=f"{instead_of(claim)} Columns are: {', '.join(names)}.".strip(),
    )


def _by_resistance(claim: Claim, column: Column, where: str) -> Claim:
    """Return the claim of a winding's resistance for what is claimed as its temperature in ohm.

    Raises:
        InputError: If a resistance is claimed as a temperature in degrees.
    """
    if CHANNEL[claim.channel].quantity != "temperature":
        return claim
    said = claim.bracket if column.name == claim.base else claim.unit
    units = [one.text for one in statements(column)]
    named = named_unit(column.label, "resistance")
    units += [named.unit] if named and named.is_sure else []
    is_ohmic = any(find_unit(unit, "resistance") for unit in units)
    if said is not None and find_unit(said, "resistance"):
        is_ohmic, said = True, None
    if not is_ohmic:
        return claim
    if said is not None or claim.channel != "winding_degC":
        raise InputError(
            f"The column is a resistance in {units[0] if units else 'ohm'}, which no unit turns "
            "into a temperature.",
            where=f"{where}, column '{column.name}' as {claim.channel}",
            remedy="Of the winding, write [columns] winding_resistance_ohm = "
            f'"{column.name}": its temperature follows by R(T). Of a Pt100 or an NTC, have the '
            "logger convert it.",
        )
    return replace(claim, channel="winding_resistance_ohm")


def _stem(column: Column, quantity: str) -> str | None:
    """Return the label of a column without a unit in it that can be nothing else."""
    named = named_unit(column.label, quantity)
    return named.stem if named and is_sure(named.unit) and named.stem else None


def _unit_left(claim: Claim, column: Column) -> str | None:
    """Return the unit that stands behind the name in `[columns]`, as K in "T_wdg K" for T_wdg."""
    if claim.unit is not None or not column.label.startswith(claim.label):
        return None
    named = named_unit(column.label, CHANNEL[claim.channel].quantity)
    is_left = named is not None and column.label == f"{claim.label} {named.unit}"
    return named.unit if named and is_left else None


def _add_combined(
    mapping: MappedColumns, claim: Claim, pool: Sequence[Column], table: Table, is_part: bool
) -> None:
    """Take the mean, the hottest or the sum of several columns for a channel."""
    found = [_claimed(part, pool, table, mapping.where, is_part) for part in claim.parts]
    columns = [column for column in found if column is not None]
    if len(columns) < len(found):
        mapping.notes.append(f"{claim.channel}: not all columns of '{claim.text}' in this file.")
        return
    if len({id(column) for column in columns}) < len(columns):
        raise InputError(
            f"'{claim.text}' names one column twice.",
            where=f"{mapping.where}, {claim.channel}",
            remedy="Name each sensor once.",
        )
    each = [MappedColumns(mapping.where) for _ in columns]
    for one, part, column in zip(each, claim.parts, columns, strict=True):
        _add_claimed(one, part, column)
    mapping.add_combined(claim.channel, claim.text, claim.how, columns, each)


def _add_claimed(mapping: MappedColumns, claim: Claim, column: Column) -> None:
    channel = CHANNEL[claim.channel]
    decided = claim.bracket if column.name == claim.base else claim.unit
    says_two = len(read_heading(claim.text).units) > 1
    if column.name == claim.text and (says_two or (column.heading and not claim.bracket)):
        decided = None  # slashes of a path mark no unit; two units say two things
    if decided is None or column.is_seconds:
        left = None if statements(column) else _unit_left(claim, column)
        if left:
            mapping.add(channel, column, left, "[columns]", "name")
        else:
            mapping.take(channel, column, "[columns]")
        return
    known = mapping.require_unit(decided, channel, column)
    if against := overridden(column, channel, decided):
        mapping.findings.append(
            Finding(
                "unit_overridden",
                "warning",
                f"{against.at_start} gives {against.text}, [columns] says {known.symbol}; "
                f"{known.symbol} is used.",
                f"{mapping.where}, column '{column.name}'",
                "Remove the unit from [columns] if the file is right.",
            )
        )
    # the name as it stands in the file says nothing of its own
    is_decided = claim.text not in (column.name, column.heading)
    mapping.add(channel, column, decided, "[columns]", "stated", is_decided=is_decided)


def _add_canonical(mapping: MappedColumns, columns: Sequence[Column]) -> None:
    for channel in filter(lambda one: mapping.wants(one.name), CHANNEL.values()):
        matches = [column for column in columns if column.label == channel.name]
        if len(matches) > 1:
            raise _two_columns(channel.name, matches, mapping.where)
        for column in matches:
            mapping.take(channel, column, "canonical name")


def _add_only_clock(mapping: MappedColumns, pool: Iterable[Column]) -> None:
    """Take the one column that holds times of day for the time, whatever it is called."""
    if not mapping.wants("time_s"):
        return
    clocks = []
    for column in pool:
        steps = np.diff(column.values[np.isfinite(column.values)])
        is_clock = bool(column.note) and column.is_seconds and column.question is None
        if is_clock and id(column) not in mapping.used and (steps >= 0.0).all() and steps.any():
            clocks.append(column)
    if len(clocks) == 1:
        mapping.add(CHANNEL["time_s"], clocks[0], "s", ONLY_CLOCK, "stated")


def _add_by_map(mapping: MappedColumns, column_map: ColumnMap, pool: Iterable[Column]) -> None:
    used = mapping.used
    free = [column for column in pool if id(column) not in used]
    claims: dict[str, list[tuple[Column, str]]] = {}
    for label, channel in column_map.entries.items():
        if not mapping.wants(channel):
            continue
        for column in columns_of(label, channel, free):
            claims.setdefault(channel, []).append((column, label))
    for name, found in claims.items():
        if len(found) > 1:
            raise _two_columns(name, [column for column, _ in found], mapping.where)
        (column, label) = found[0]
        if label in column_map.zero_means_absent and not np.nan_to_num(column.values).any():
            mapping.absent.add(id(column))
            mapping.findings.append(
                Finding(
                    "not_recorded",
                    "warning",
                    "All values are 0, which this bench writes for a channel that it does not "
                    f"record: {name} is not read from it.",
                    f"{mapping.where}, column '{column.name}'",
                    f'If the zeros were measured, say so in [columns]: {name} = "{label}".',
                )
            )
            continue
        try:
            mapping.take(CHANNEL[name], column, column_map.name, column_map.units.get(label))
        except InputError as error:
            raise InputError(
                error.problem,
                where=error.where,
                remedy=f"{error.remedy} Or leave the column out by "
                f'[columns] {name} = "{NOT_RECORDED}".',
            ) from error
    for label, reason in column_map.refused.items():
        for column in columns_of(label, "", free):
            mapping.notes.append(f"Column '{column.name}' is not mapped: {reason}.")
            mapping.refused[column.name] = reason


def _add_by_words(mapping: MappedColumns, columns: Iterable[Column]) -> None:
    """Take the columns whose every word speaks for one channel, where no other column does."""
    used = mapping.used
    speaking: dict[str, list[Column]] = {}
    for column in columns:
        is_open = column.name in mapping.refused or column.question is not None
        if is_open or id(column) in used | mapping.absent:
            continue
        stated = statements(column)
        quantities = quantities_of(stated[0].text) if stated else tuple(QUANTITIES)
        for quantity in quantities:
            spoken = speaks_of(column.label, quantity, stated[0].text if stated else None)
            for name in [name for name, score in spoken.items() if score == SURE]:
                if CHANNEL[name].quantity == quantity and mapping.wants(name):
                    speaking.setdefault(name, []).append(column)
    for name, (column, *others) in speaking.items():
        channel = CHANNEL[name]
        if others or not read_name(words_in(column.label, channel.quantity)).is_clear:
            continue
        try:
            unit, unit_from = unit_of(column, channel, "")
        except InputError:
            continue
        if unit is not None:
            mapping.add(channel, column, unit, ITS_WORDS, unit_from)


def _two_columns(channel: str, columns: Sequence[Column], where: str) -> InputError:
    names = " and ".join(f"'{column.name}'" for column in columns)
    return InputError(
        f"The columns {names} both stand for {channel}.",
        where=where,
        remedy=f'Decide in the motor file: [columns] {channel} = "{columns[0].name}".',
    )
