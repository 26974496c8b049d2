"""A record that breaks a relation of physics: which unit, read otherwise, would mend it?

Each column is tried in each other unit of its quantity, and every relation asked again. What mends
all of them is named; it is never applied. It is asked by an error, also of a unit that the file
states, since headings are copied; by a warning where the motor file decided the unit, or where a
single relation is broken that another kind of cooling explains and something gave the unit, or
where a machine of unusual size is as slow as its size says.

A record as it would be if one column were in another unit than it was read in.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...record.channels import CHANNEL
from ...record.derive import constants_of, derive, formulas
from ...record.motor import Motor
from ...record.record import ColumnReading, Finding, Record
from ...record.samples import is_measured, place, samples
from ...record.units import QUANTITIES, Unit, find_unit, to_canonical
from ..losses import losses_negative
from ..sensor import falls_at_once, jumps_at_once
from ..unexplained import unexplained_movement
from ..units import ambient_implausible, units_temperature
from .power_relations import Conflict
from .relations import USUAL_BY_SIZE_S, conflicts, holds, one_node, unsettled

LEAST_FACTOR = 1.4
"""Units closer than this [1], such as foot-pounds and newton metres, are no matter of relations
that hold within a factor."""

RESISTANCES = (
    (1e-3, "phase_resistance_ohm is in milliohm"),
    (0.5, "phase_resistance_ohm was measured between two terminals in star"),
)
"""What is mistaken with the resistance, with the factor to the right one [1]."""


@dataclass(frozen=True)
class OtherReading:
    """One way in which the inputs may have been misread.

    Attributes:
        channels: Channels whose columns would be in another unit; none for the motor file.
        units: Symbol of that unit for each channel; none for the motor file.
        factor: New value over present one [1].
        record: The record as it would be.
        motor: The motor as it would be.
        readings: How the columns were read; empty where that is not known.
        sentence: What is supposed, for the message.
    """

    channels: tuple[str, ...]
    units: tuple[str, ...]
    factor: float
    record: Record
    motor: Motor
    readings: tuple[ColumnReading, ...]
    sentence: str

    @property
    def unit(self) -> str:
        """The units in one word or more, empty for the motor file."""
        return " and ".join(dict.fromkeys(self.units))

    @property
    def is_decided(self) -> bool:
        """Whether the motor file itself gives what it denies."""
        return self.record.decided.issuperset(self.channels)

    @property
    def is_assumed(self) -> bool:
        """Whether nothing at all said the unit that it denies."""
        return any(one.unit_from == "assumed" for one in self.readings)


def other_readings(record: Record, motor: Motor) -> Iterator[OtherReading]:
    """Yield the record with each column, and each group of like columns, in each other unit.

    Where a record does not tell how it was read, every channel counts as read.
    """
    read = {one.channel: one for one in record.mapping}
    for group in _groups(_columns(record, read)):
        quantity = CHANNEL[group[0]].quantity
        present = {_unit_of(name, read) for name in group}
        if len(present) > 1 or quantity == "temperature":
            continue  # temperatures are told by value, see `heatrun.checks.units`
        (as_read,) = present
        alike = {(as_read.factor, as_read.offset)}  # Nmm says no more than mNm
        for unit in QUANTITIES[quantity]:
            factor = unit.factor / as_read.factor
            is_near = abs(math.log(factor)) < math.log(LEAST_FACTOR)
            is_same = (unit.factor, unit.offset) in alike
            if is_same or (is_near and unit.offset == as_read.offset):
                continue
            alike.add((unit.factor, unit.offset))
            other = _otherwise(record, motor, dict.fromkeys(group, unit), factor)
            if any(_num_measured(other.record, n) < _num_measured(record, n) for n in group):
                continue  # beyond all measure, where no relation has a say
            said = f"{' and '.join(group)} {'are' if len(group) > 1 else 'is'} in {unit.symbol}"
            yield replace(other, sentence=said)
    if motor.phase_resistance_ohm is not None:
        for factor, sentence in RESISTANCES:
            right = replace(motor, phase_resistance_ohm=factor * motor.phase_resistance_ohm)
            yield OtherReading((), (), factor, record, right, (), sentence)


def scaled_readings(record: Record, motor: Motor) -> Iterator[OtherReading]:
    """Yield the record with powers and phase current both in thousands, or in thousandths."""
    read = {one.channel: one for one in record.mapping}
    like = _like(_columns(record, read))
    names = (*like.get("power", ()), *like.get("phase current", ()))
    if not {"power", "phase current"} <= like.keys():
        return
    for prefix, factor in (("k", 1e3), ("m", 1e-3)):
        found = {
            name: find_unit(prefix + _unit_of(name, read).symbol, CHANNEL[name].quantity)
            for name in names
        }
        units = {name: unit for name, unit in found.items() if unit is not None}
        if len(units) == len(names):
            yield _otherwise(record, motor, units, factor)


def _columns(record: Record, read: Mapping[str, ColumnReading]) -> list[str]:
    """Channels that came from a file; a time from a sampling rate counts as read too."""
    known = [name for name in record.channels if name in CHANNEL]
    return [name for name in known if not read or name in read or name == "time_s"]


def _like(names: Sequence[str]) -> dict[str, list[str]]:
    """Channels by quantity: a bench writes all powers in kW."""
    like: dict[str, list[str]] = {}
    for name in names:
        like.setdefault(CHANNEL[name].quantity, []).append(name)
    return like


def _groups(names: Sequence[str]) -> list[list[str]]:
    """Each channel alone, then all channels of one quantity."""
    return [[name] for name in names] + [g for g in _like(names).values() if len(g) > 1]


def _unit_of(name: str, read: Mapping[str, ColumnReading]) -> Unit:
    quantity = CHANNEL[name].quantity
    found = find_unit(read[name].unit, quantity) if name in read else None
    return found or QUANTITIES[quantity][0]


def _otherwise(
    record: Record, motor: Motor, units: Mapping[str, Unit], factor: float
) -> OtherReading:
    """The record with columns in other units, and what was derived from them anew."""
    read = {one.channel: one for one in record.mapping}
    channels = dict(record.channels)
    for name, unit in units.items():
        as_read = _unit_of(name, read)
        raw = (np.asarray(channels[name], dtype=float) - as_read.offset) / as_read.factor
        channels[name] = to_canonical(raw, unit)
    if read:
        for name in formulas(channels, read.keys() | constants_of(record.notes)):
            del channels[name]
        channels, _ = derive(channels, phases=motor.phases, losses=motor.losses)
    return OtherReading(
        tuple(units),
        tuple(unit.symbol for unit in units.values()),
        factor,
        replace(record, channels=channels, findings=()),
        motor,
        tuple(read[name] for name in units if name in read),
        " and ".join(f"{name} is in {unit.symbol}" for name, unit in units.items()),
    )


def _num_measured(record: Record, name: str) -> int:
    return int(np.sum(is_measured(np.asarray(record[name], dtype=float))))


PLAIN = "A_rms"
"""What the unit A of a phase current is read as."""

MAX_SAMPLES = 20_000
"""Relations hold for means: a longer record is thinned before it is tried in thirty units."""

MAX_NAMED = 3
"""More suppositions than this are no help."""

MUCH_BETTER = 2.5
"""A supposition that leaves the time constant so many times [1] further from the usual one than
the best is not named beside it."""

SYMPTOMS = (jumps_at_once, falls_at_once, losses_negative, ambient_implausible)
"""Checks whose errors a misread unit brings about too; what mends the unit must end them."""

OF_THE_SENSOR = frozenset({"jumps_at_once", "falls_at_once"})
"""Those that another unit of the time may bring about, and no other unit."""

CLOCK = frozenset({"too_long", "too_fast", "too_slow", "too_light"})
FAMILIES = (
    CLOCK,
    frozenset({"losses_below_copper", "little_copper"}),
    frozenset(
        {
            "power_from_nothing",
            "little_efficiency",
            "losses_disagree",
            "lost_behind_dc",
            "too_efficient",
        }
    ),
    frozenset({"too_quick", "wheel_disagrees"}),
)
"""Relations that say the same of a unit: where one is broken, its family must become usual."""

SPOKEN = {"time_s": "the time", "speed_rpm": "the speed", "losses_W": "the losses"}


def unit_suspected(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report relations between channels that the record breaks, and the units that would mend it.

    An error where a unit explains it that the motor file has not decided, else a warning; a note of
    a machine that is only larger than others, where it has decided; nothing for what is only odd
    and explained by no unit.
    """
    record = _thinned(record)
    broken = conflicts(record, motor)
    if not broken or any(f.severity == "error" for f in units_temperature(record, motor)):
        return
    symptoms = _symptoms(record, motor)
    is_shown = one_node(record, motor) is not None
    is_whole = not OF_THE_SENSOR & {*symptoms} and unexplained_movement(record, motor) is None
    ids = {conflict.id for conflict in broken}
    unusual = {conflict.id for conflict in conflicts(record, motor, is_strict=True)}
    settled = unusual - {id for family in FAMILIES if family & ids for id in family} - CLOCK

    def mends(one: OtherReading, *, may_be_mild: bool = False) -> bool:
        stays = unusual & _kept(one, record) - ids
        must_show = is_shown and (is_whole or "time_s" in one.channels)
        return _is_asked(one, ids) and _mends(one, settled | stays, must_show, may_be_mild)

    mending = [one for one in other_readings(record, motor) if mends(one)]
    # A resistance that is in doubt does not free the columns from it, nor does a machine that is
    # cooled better than others.
    if not any(one.channels for one in mending) and not all(c.is_odd or c.is_mild for c in broken):
        found = (one for one in other_readings(record, motor) if one.channels)
        mending += [one for one in found if mends(one, may_be_mild=True)]
    if not any(one.channels for one in mending) and not all(c.is_odd for c in broken):
        mending += [one for one in scaled_readings(record, motor) if mends(one)]
    mending = _ranked(mending)
    is_odd = all(conflict.is_odd for conflict in broken)
    if not mending:
        # what another kind of cooling explains, and no unit, is the cooling
        told = (c for c in broken if not (c.is_odd or c.is_mild or c.id == "losses_below_copper"))
        broken = tuple(told)
        if broken and not symptoms:
            yield _unexplained(record, broken)
        return
    # two that one unit explains are no matter of cooling, nor of a machine without load
    is_alone = len({next((family for family in FAMILIES if id in family), id) for id in ids}) < 2
    is_giant = ids == {"too_large"} and _is_as_usual(record, motor, mending)
    is_mild = is_giant or (
        is_alone and all(conflict.is_odd or conflict.is_mild for conflict in broken)
    )
    is_odd = is_odd and is_alone
    is_decided = all(one.is_decided for one in mending)
    asked = any(one.is_assumed for one in mending) if is_mild else not is_decided
    lesser = "note" if is_giant and is_decided else "warning"
    severity = "error" if asked and not is_odd else lesser
    if ids == {"losses_below_copper"} and severity == "warning":
        return  # the check of that name tells it, as an error
    left = "note" if is_giant else "warning"
    sentences = ", or if ".join(_supposed(one) for one in mending)
    otherwise = [c.otherwise for c in broken if c.otherwise and is_mild and not is_odd]
    yield Finding(
        "unit_suspected",
        severity,
        f"{_told(broken, is_alone)} The channels are consistent if {sentences}.",
        place(record, broken[0].channels[0], float(samples(record)[0][0])),
        " ".join([_remedy(mending, record, severity, left=left), *otherwise]),
        values=_figures(broken) | _factors(mending),
    )


def read_otherwise(record: Record, motor: Motor, finding: Finding) -> tuple[Record, Motor]:
    """Return record and motor as the unit that a finding of `unit_suspected` asks about makes them.

    It is the first of its suppositions; both are as they are where it has none.
    """
    likely = next((name for name in finding.values if name.startswith("factor_")), None)
    for one in (*other_readings(record, motor), *scaled_readings(record, motor)):
        if likely in _factors([one]):
            return one.record, one.motor
    return record, motor


def _thinned(record: Record) -> Record:
    size = np.size(record.time_s)
    if size <= MAX_SAMPLES:
        return record
    step = -(-size // MAX_SAMPLES)
    return replace(record, channels={k: np.asarray(v)[::step] for k, v in record.channels.items()})


def _symptoms(record: Record, motor: Motor) -> list[str]:
    return [check.__name__ for check in SYMPTOMS if _is_shown(check(record, motor))]


def _is_shown(found: bool | Iterator[Finding]) -> bool:
    return found if isinstance(found, bool) else any(one.severity == "error" for one in found)


def _is_asked(one: OtherReading, ids: set[str]) -> bool:
    """Whether a relation that is broken speaks of what is read otherwise at all."""
    if not one.channels:
        return "losses_below_copper" in ids
    return bool(ids & CLOCK) or one.channels != ("time_s",)


def _kept(one: OtherReading, record: Record) -> set[str]:
    """Relations of size and time that a reading leaves as they were: no evidence against it."""
    if not one.channels:
        return set()  # a resistance is no matter of powers; the size must be usual as well
    changed = {
        name
        for name in ("time_s", "losses_W", "phase_current_A", "torque_Nm")
        if name in record and not np.array_equal(one.record[name], record[name], equal_nan=True)
    }
    if not changed:
        return {"too_fast", "too_slow", "too_light"}
    return {"too_fast", "too_slow"} if changed == {"torque_Nm"} else set()


def _mends(one: OtherReading, left: set[str], is_shown: bool, may_be_mild: bool) -> bool:
    """Whether nothing is broken any longer, and nothing unusual either but what was so and is
    `left`.

    Where the record showed a time constant as it was read, it must still do so; what another kind
    of cooling explains may stay broken if it `may_be_mild`.
    """
    record, motor = one.record, one.motor
    if is_shown and one_node(record, motor) is None:
        return False
    mild = {c.id for c in conflicts(record, motor) if c.is_mild} if may_be_mild else set[str]()
    left_symptoms = OF_THE_SENSOR if "time_s" not in one.channels else frozenset()
    return (
        holds(record, motor, left | mild, is_strict=True)  # most suppositions end here
        and holds(record, motor, mild)
        and not set(_symptoms(record, motor)) - left_symptoms
        and not any(f.severity == "error" for f in units_temperature(record, motor))
    )


def _ranked(mending: Sequence[OtherReading]) -> list[OtherReading]:
    """Those that bring the machine nearest to the usual ones, single columns for groups."""
    distance = [_from_usual(one.record, one.motor) for one in mending]
    least = min(distance, default=0.0)
    pairs = zip(mending, distance, strict=True)
    least_of_columns = min((far for one, far in pairs if one.channels), default=least)
    # Of what is equally usual the smaller mistake comes first.
    near = sorted(
        (abs(math.log(one.factor)), len(one.channels), position)
        for position, (one, far) in enumerate(zip(mending, distance, strict=True))
        # a resistance that is in doubt frees no column from it
        if far < (least_of_columns if one.channels else least) + math.log(MUCH_BETTER)
    )
    chosen = [mending[position] for _, _, position in near]
    single = {(*one.channels, one.unit) for one in chosen if len(one.channels) == 1}
    # A group whose single column is enough says more than is known.
    chosen = [
        one
        for one in chosen
        if len(one.channels) < 2 or not any((name, one.unit) in single for name in one.channels)
    ]
    return chosen[:MAX_NAMED]


def _is_as_usual(record: Record, motor: Motor, mending: Sequence[OtherReading]) -> bool:
    """Whether a record's time constant fits its size about as well as that of any other reading."""
    least = min(_from_usual(one.record, one.motor) for one in mending)
    return _from_usual(record, motor) < least + math.log(MUCH_BETTER)


def _from_usual(record: Record, motor: Motor) -> float:
    """Logarithm of the time constant over the usual one of that size, without its sign."""
    seen = one_node(record, motor) or unsettled(record, motor)
    if seen is None or not math.isfinite(seen.conductance_W_per_K):
        return 0.0
    usual = USUAL_BY_SIZE_S[motor.sink] * math.sqrt(seen.conductance_W_per_K)
    return abs(math.log(seen.tau_s / usual))


def _told(broken: Sequence[Conflict], is_alone: bool = True) -> str:
    """The conflicts in words; odd ones where they are all there is, or bear the others out."""
    firm = [c for c in broken if not c.is_odd]
    odd = [c for c in broken if c.is_odd]
    told = [*firm, *odd] if not is_alone else firm or odd
    return " ".join(c.sentence for c in told)


def _supposed(one: OtherReading) -> str:
    if not one.readings:
        return one.sentence
    was = ", ".join(dict.fromkeys(read_as(reading) for reading in one.readings))
    return f"{_spoken(one)} (read as {was})"


def read_as(reading: ColumnReading) -> str:
    """Return the unit that a column was read in and how it is known, in words."""
    if reading.unit == PLAIN and reading.unit_from == "stated":
        return f"{PLAIN}, as the file or [columns] states; a plain A counts as rms"
    how = {"stated": "as the file or [columns] states", "name": "by the name",
           "assumed": "assumed, no unit given"}  # fmt: skip
    return f"{reading.unit}, {how[reading.unit_from]}"


def _spoken(one: OtherReading) -> str:
    if len(one.channels) == 1 and one.channels[0] in SPOKEN:
        verb = "were" if one.channels[0] == "losses_W" else "was"
        return f"{SPOKEN[one.channels[0]]} {verb} in {one.unit}"
    return one.sentence.replace(" is in", " was in").replace(" are in", " were in")


def _remedy(mending: Sequence[OtherReading], record: Record, severity: str, *, left: str) -> str:
    """What to write if the unit is another one, and if it is right: `left` is then left of it."""
    words = []
    for one in mending:
        columns = {r.channel: r for r in one.readings}
        lines = " and ".join(
            f'{name} = "{columns[name].column if name in columns else "COLUMN"} [{unit}]"'
            for name, unit in zip(one.channels, one.units, strict=True)
        )
        if one.channels == ("time_s",) and record.mapping and not columns:
            words.append("check the sampling rate")
        elif lines:
            words.append(f"write {lines} into [columns]")
        else:
            words.append("correct phase_resistance_ohm in [winding]")
    if any("time_s" in one.channels for one in mending) and _counts_samples(record):
        words.append(
            'if the time column counts samples, write time_s = "rate 10 Hz" with the logger\'s rate'
        )
    told = "; or ".join(words)
    readings = (reading for one in mending for reading in one.readings)
    stays = next((one for one in readings if one.channel not in record.decided), None)
    if stays is None or left == severity:
        return f"If so, {told}."
    kept = f'{stays.channel} = "{stays.column} [{stays.unit}]"'
    return f"If so, {told}. If {stays.unit} is right, write {kept}: then this is only a {left}."


def _counts_samples(record: Record) -> bool:
    steps = np.diff(record.time_s)
    return bool(steps.size) and bool(np.all(steps == np.round(steps)) and np.ptp(steps) == 0.0)


def _figures(broken: Sequence[Conflict]) -> dict[str, float]:
    return {name: value for conflict in broken for name, value in conflict.values.items()}


def _factors(mending: Sequence[OtherReading]) -> dict[str, float]:
    return {
        f"factor_{'_and_'.join(one.channels) or 'phase_resistance_ohm'}_"
        f"{one.unit.replace(' ', '_')}".rstrip("_"): one.factor
        for one in mending
    }  # fmt: skip


def _unexplained(record: Record, broken: Sequence[Conflict]) -> Finding:
    return Finding(
        "unit_suspected",
        "warning",
        f"{_told(broken)} No other unit of a single column resolves the contradiction; fitted "
        "parameters may be wrong.",
        place(record, broken[0].channels[0], float(samples(record)[0][0])),
        "Check the columns and their units, and sink and losses in the motor file.",
        values=_figures(broken),
    )
