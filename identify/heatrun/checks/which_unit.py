"""Is a column in another unit than it was read in? One posterior over what may be wrong.

Each column is tried in each other unit of its quantity, as are groups of like columns and what is
mistaken with the resistance. A reading's prior says how its unit is known, its likelihood how usual
the figures of the machine become (`heatrun.checks.figures`). Beside them stand that all is right,
that another medium cools the machine, and that something else is wrong. Asked is only where a
figure lies beyond its limits; then by an error where the inputs are misread with more than nine
tenths, by a warning where it is as likely as not that something is wrong. What the motor file
itself decides is told one step milder: that question is answered. Nothing is ever applied.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..record.channels import CHANNEL
from ..record.derive import constants_of, derive, formulas
from ..record.motor import Motor
from ..record.record import ColumnReading, Finding, Record, Severity
from ..record.samples import place, samples
from ..record.units import QUANTITIES, Unit, find_unit
from .figures import RARE, Figure, figures, is_brief
from .heat import losses_of_dc_link
from .losses import losses_below_copper, losses_negative, losses_of_shaft
from .standstill import standstill_losses
from .units import ambient_implausible, units_temperature

OTHER_UNIT = {"assumed": 0.5, "name": 0.02, "stated": 0.01, "derived": 0.01}
"""Prior odds [1] that a column is in another unit, by how its unit is known, in equal parts over
the other units. Headings are copied from other files, but seldom."""

GROUP = 0.05
"""And that all columns of a quantity are, over one alone: a bench writes all powers in kW, but most
mistakes are one column's."""

RESISTANCES = (
    (0.5, 0.01, "phase_resistance_ohm was measured between two terminals in star"),
    (2.0, 1e-3, "phase_resistance_ohm was halved, and was that of one phase before"),
    (3.0, 1e-3, "phase_resistance_ohm is that of a star, and the current that inside a delta"),
    (1e-3, 1e-4, "phase_resistance_ohm is in milliohm"),
)
"""What is mistaken with the resistance, with the factor to the right one and the prior odds [1]: a
meter has two leads, and the name of the key carries its unit."""

SCALES = (
    ("phase_current_A", 0.5, 1e-3,
     "the clamp reads twice the current, by two turns through it or by its setting",
     "scale the column of the current in the file"),
    ("phase_current_A", 2.0, 1e-3,
     "the clamp reads half the current, by its setting or on one of two cables",
     "scale the column of the current in the file"),
    ("phase_current_A", 10.0, 1e-3, "the clamp reads a tenth of the current, by its setting",
     "scale the column of the current in the file"),
    ("electrical_power_W", 1.5, 0.002, "electrical_power_W is that of two phases of three",
     "take the sum of the phases, or scale the column in the file"),
    ("electrical_power_W", 3.0, 0.02, "electrical_power_W is that of one phase of three",
     "take the sum of the phases, or scale the column in the file"),
    ("torque_Nm", 0.95, 0.02, "the torque reads 5 % too much",
     "calibrate the torque sensor, or write [parameters.shaft_power_gain] sd = 0.05"),
    ("torque_Nm", 0.9, 0.005, "the torque reads 10 % too much",
     "calibrate the torque sensor, or write [parameters.shaft_power_gain] sd = 0.1"),
)  # fmt: skip
"""What is mistaken with an instrument: its channel, the factor to the right reading and the prior
odds [1], and what to do."""

OTHER_COOLING = 0.001
"""Prior odds [1] that a liquid cools a machine whose record has the temperature of the air."""

IN_ITS_WASH = {True: 0.5, False: 0.0, None: 0.005}
"""Prior odds [1] that a propeller on the shaft cools a machine in air: where torque goes with the
square of the speed, where it does not, and where the record does not tell."""

SQUARE, SPREAD = 0.2, 1.05
"""What the square of the speed leaves of the torque's range at most [1], and the largest torque
over the least that tells [1]."""

SOMETHING_ELSE = 1e-6
"""Prior odds times likelihood [1] of a fault that is no unit and that no other check sees."""

ALSO_SAID = (losses_negative, losses_below_copper, ambient_implausible)
"""Checks whose errors break figures too, and are no unit's where no unit mends them."""

OF_COPPER = {"copper_share", "heat_of_current"}
OF_COPPER_TOO = (losses_of_shaft, losses_below_copper, standstill_losses)
"""Figures of the copper loss in the losses, and the checks that tell more of them."""

LEAST_FACTOR = 1.4
"""Units closer than this [1], such as foot-pounds and newton metres, are no matter of figures that
spread by a factor."""

MAX_SAMPLES = 20_000
"""Figures hold for means: a longer record is thinned before it is tried in thirty units."""

MAX_NAMED, WORTH_NAMING = 3, 0.1
"""More suppositions are no help, nor are those less likely than this part of the best [1]."""

ERROR, WARNING = 0.9, 0.5
"""Posterior probabilities [1] from which a unit is asked about, and told."""

PLAIN = "A_rms"
"""What the unit A of a phase current is read as."""

SPOKEN = {"time_s": "the time", "speed_rpm": "the speed", "losses_W": "the losses"}

MILDER: dict[Severity, Severity] = {"error": "warning", "warning": "note", "note": "note"}


@dataclass(frozen=True)
class OtherReading:
    """One way in which the inputs may have been misread."""

    # The other unit of each channel that is read otherwise; none for the motor file.
    units: Mapping[str, str]
    factor: float  # New value over present one [1].
    prior: float  # Prior odds against all being right [1].
    record: Record  # The record as it would be.
    motor: Motor  # The motor as it would be.
    # How the columns were read; empty where that is not known.
    readings: tuple[ColumnReading, ...] = ()
    sentence: str = ""  # What is supposed of the motor file, or of the instrument.
    of: str = "phase_resistance_ohm"  # What the factor is one of, where no unit is another one.
    remedy: str = "correct phase_resistance_ohm in [winding]"  # What to do about it then.

    @property
    def name(self) -> str:
        """Name of its factor among the values of a finding."""
        unit = " and ".join(dict.fromkeys(self.units.values())).replace(" ", "_")
        return f"factor_{'_and_'.join(self.units) or self.of}_{unit}".rstrip("_")


def other_readings(record: Record, motor: Motor) -> Iterator[OtherReading]:
    """Yield the record with each column, and each group of like columns, in each other unit.

    Powers and phase current are also tried both in thousands or in thousandths. Where a record does
    not tell how it was read, every channel counts as read.
    """
    read = {one.channel: one for one in record.mapping}
    present: dict[str, Unit] = {}
    like: dict[str, list[str]] = {}
    for name in record.channels:
        # a time from a sampling rate counts as read too
        if name in CHANNEL and (not read or name in read or name == "time_s"):
            quantity = CHANNEL[name].quantity
            unit = find_unit(read[name].unit, quantity) if name in read else None
            present[name] = unit or QUANTITIES[quantity][0]
            like.setdefault(quantity, []).append(name)
    like.pop("temperature", None)  # told by value, see `heatrun.checks.units`
    columns = [[name] for group in like.values() for name in group]
    for group in columns + [names for names in like.values() if len(names) > 1]:
        as_read = present[group[0]]
        if any(present[name] != as_read for name in group):
            continue
        others: dict[float, Unit] = {}  # Nmm says no more than mNm
        for unit in QUANTITIES[CHANNEL[group[0]].quantity]:
            factor = unit.factor / as_read.factor
            if abs(math.log(factor)) >= math.log(LEAST_FACTOR):
                others.setdefault(factor, unit)
        for factor, unit in others.items():
            yield _otherwise(record, motor, dict.fromkeys(group, unit), factor, len(others))
    both = [*like.get("power", ()), *like.get("phase current", ())]
    for prefix, factor in (("k", 1e3), ("m", 1e-3)):
        units = {n: find_unit(prefix + present[n].symbol, CHANNEL[n].quantity) for n in both}
        known = {name: unit for name, unit in units.items() if unit is not None}
        if len(known) == len(both) and {"power", "phase current"} <= like.keys():
            yield _otherwise(record, motor, known, factor, len(QUANTITIES["power"]) - 1)
    if motor.phase_resistance_ohm is not None:
        for factor, prior, sentence in RESISTANCES:
            right = replace(motor, phase_resistance_ohm=factor * motor.phase_resistance_ohm)
            yield OtherReading({}, factor, prior, record, right, sentence=sentence)
    for name, factor, prior, sentence, remedy in SCALES:
        if name in present:
            right = _scaled(record, motor, (name,), factor)
            yield OtherReading({}, factor, prior, right, motor, (), sentence, name, remedy)


def _otherwise(
    record: Record, motor: Motor, units: Mapping[str, Unit], factor: float, num_others: int
) -> OtherReading:
    """The record with columns in other units, and what was derived from them anew."""
    read = {one.channel: one for one in record.mapping}
    readings = tuple(read[name] for name in units if name in read)
    prior = max((OTHER_UNIT[one.unit_from] for one in readings), default=OTHER_UNIT["name"])
    return OtherReading(
        {name: unit.symbol for name, unit in units.items()},
        factor,
        prior / num_others * (GROUP if len(units) > 1 else 1.0),
        _scaled(record, motor, tuple(units), factor),
        motor,
        readings,
    )


def _scaled(record: Record, motor: Motor, names: Sequence[str], factor: float) -> Record:
    """Return the record with some columns times a factor, and what was derived from them anew."""
    read = {one.channel for one in record.mapping}
    channels = dict(record.channels)
    for name in names:
        channels[name] = factor * np.asarray(channels[name], dtype=float)
    if read:
        for name in formulas(channels, read | constants_of(record.notes)):
            del channels[name]
        channels, _ = derive(channels, phases=motor.phases, losses=motor.losses)
    return replace(record, channels=channels, findings=())


def _posterior(
    record: Record, motor: Motor, found: Sequence[Figure]
) -> tuple[list[tuple[float, OtherReading]], float, float]:
    """Return the probability of each reading, likely ones first, of a liquid, of something else."""
    shown = {figure.id: figure.cost for figure in found}

    def cost(record: Record, motor: Motor, most: float, cooled_by: str = "") -> float:
        """Minus the logarithm of the likelihood [1], or something above `most`."""
        total, missing = 0.0, dict(shown)
        for figure in figures(record, motor, cooled_by):
            missing.pop(figure.id, None)
            total += figure.cost
            if total > most:
                return total
        # what a reading no longer shows is no better than it was, nor than at its limit
        return total + sum(max(each, RARE) for each in missing.values())

    as_read = sum(figure.cost for figure in found)
    weights: list[tuple[float, OtherReading]] = []
    for one in other_readings(record, motor):
        negligible = math.log(one.prior / (0.01 * SOMETHING_ELSE))
        other = cost(one.record, one.motor, min(negligible, as_read))
        if other < as_read:  # else the record is no more usual, and no news of its unit
            weights.append((one.prior * math.exp(-other), one))
    liquid = wash = 0.0
    if motor.sink == "ambient":
        liquid = OTHER_COOLING * math.exp(-cost(record, motor, math.inf, "coolant"))
        propeller = IN_ITS_WASH[has_propeller(record)]
        wash = propeller * math.exp(-cost(record, motor, math.inf, "wash"))
    right = math.exp(-as_read) + wash  # as the motor file has it, which knows no propeller
    total = right + sum(weight for weight, _ in weights) + liquid + SOMETHING_ELSE
    probable = sorted(((w / total, one) for w, one in weights), key=lambda pair: -pair[0])
    return probable, liquid / total, SOMETHING_ELSE / total


def has_propeller(record: Record) -> bool | None:
    """Return whether torque, or current, goes with the square of the speed; None if not told."""
    load = "torque_Nm" if "torque_Nm" in record else "phase_current_A"
    if load not in record or "speed_rpm" not in record:
        return None
    _, speed, torque = samples(record, "speed_rpm", load)
    square, torque = speed**2, np.abs(torque)
    turns = square > 0.04 * np.max(square, initial=0.0)
    if np.sum(turns) < 10:
        return False if np.any(torque > 0.0) and not np.any(square > 0.0) else None
    square, torque = square[turns], torque[turns]
    low, high = np.quantile(torque, [0.05, 0.95])
    if high < SPREAD * low:
        return None
    left = torque - square * float(np.median(torque / square))
    return bool(np.quantile(np.abs(left), 0.9) < SQUARE * (high - low))


def unit_suspected(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report figures that no machine has, and the units in which the record would have usual ones.

    An error where another reading is more than nine tenths likely, a warning where it is as likely
    as not that something is wrong; one step milder where the motor file decides the units.
    """
    step = max(1, -(-np.size(record.time_s) // MAX_SAMPLES))
    thin = {name: np.asarray(each)[::step] for name, each in record.channels.items()}
    record = replace(record, channels=thin)
    found = list(figures(record, motor))
    beyond = sorted((f for f in found if f.sentence), key=lambda f: -f.cost)
    if not beyond:
        return
    is_decided = record.decided.issuperset(("winding_degC", "ambient_degC"))
    if any(f.severity == "error" or not is_decided for f in units_temperature(record, motor)):
        return  # in another unit the temperatures make every figure wrong
    readings, liquid, else_ = _posterior(record, motor, found)
    likely = sum(probability for probability, _ in readings)
    if likely + liquid + else_ <= WARNING:
        return
    least = WORTH_NAMING * max([liquid, else_, *(p for p, _ in readings[:1])])
    named = [one for probability, one in readings[:MAX_NAMED] if probability >= least]
    severity: Severity = "error" if likely > ERROR else "warning"
    left = MILDER[severity]
    if not named:
        if liquid > else_ or _is_impossible(record, motor):
            return  # no unit, but the cooling, or what another check names
        consistent = (
            "No other unit of a single column resolves the contradiction; fitted parameters may be "
            "wrong."
        )
        remedy = "Check the columns and their units, and sink and losses in the motor file."
    else:
        units = {name for one in named for name in one.units}
        if not units:  # nobody can answer: refused is only what is impossible as it was read
            severity = "error" if _is_impossible(record, motor) else "warning"
        elif record.decided.issuperset(units):
            severity = left
        consistent = f"The channels are consistent if {', or if '.join(map(supposed, named))}."
        remedy = " ".join([_remedy(named, record, left), *_or_else(record, motor, beyond)])
    if {figure.id for figure in beyond} <= OF_COPPER:
        # an error of a unit asks for an answer in [columns]; of nothing else there is none
        is_asked = severity == "error" and any(one.units for one in named)
        more = (losses_of_dc_link, *(() if is_asked else OF_COPPER_TOO))
        if any(one.severity != "note" for check in more for one in check(record, motor)):
            return  # which tells more
    values = {name: value for figure in beyond for name, value in figure.values.items()}
    factors: dict[str, float] = {}
    for one in named:
        factors.setdefault(one.name, one.factor)
    yield Finding(
        "unit_suspected",
        severity,
        " ".join([*(figure.sentence for figure in beyond), consistent]),
        place(record, beyond[0].channels[0], float(samples(record)[0][0])),
        remedy,
        values=values | factors,
    )


def _is_impossible(record: Record, motor: Motor) -> bool:
    """Return whether another check forbids the record as it was read."""
    found = (one for check in ALSO_SAID for one in check(record, motor))
    return any(one.severity == "error" for one in found)


def read_otherwise(record: Record, motor: Motor, finding: Finding) -> tuple[Record, Motor]:
    """Return record and motor as the unit that a finding of `unit_suspected` asks about makes them.

    It is the first of its suppositions; both are as they are where it has none, and where the motor
    file has answered.
    """
    likely = next((item for item in finding.values.items() if item[0].startswith("factor_")), None)
    for one in other_readings(record, motor):
        if (one.name, one.factor) == likely and not (
            one.units and record.decided.issuperset(one.units)
        ):
            return one.record, one.motor
    return record, motor


def supposed(one: OtherReading) -> str:
    """Return what is supposed of a record that was read otherwise, in words."""
    units = list(dict.fromkeys(one.units.values()))
    if not units:
        return one.sentence
    if len(units) > 1:
        said = " and ".join(f"{name} was in {unit}" for name, unit in one.units.items())
    else:
        name = " and ".join(one.units)
        verb = "were" if len(one.units) > 1 or name == "losses_W" else "was"
        said = f"{SPOKEN.get(name, name)} {verb} in {units[0]}"
    was = ", ".join(dict.fromkeys(read_as(reading) for reading in one.readings))
    return f"{said} (read as {was})" if was else said


def read_as(reading: ColumnReading) -> str:
    """Return the unit that a column was read in and how it is known, in words."""
    if reading.unit == PLAIN and reading.unit_from == "stated":
        return f"{PLAIN}, as the file or [columns] states; a plain A counts as rms"
    how = {"stated": "as the file or [columns] states", "name": "by the name",
           "assumed": "assumed, no unit given"}  # fmt: skip
    return f"{reading.unit}, {how[reading.unit_from]}"


def _remedy(named: Sequence[OtherReading], record: Record, left: str) -> str:
    """What to write if the unit is another one, and if it is right: `left` is then left of it."""
    words = []
    for one in named:
        columns = {r.channel: r for r in one.readings}
        lines = " and ".join(
            f'{name} = "{columns[name].column if name in columns else "COLUMN"} [{unit}]"'
            for name, unit in one.units.items()
        )
        if list(one.units) == ["time_s"] and record.mapping and not columns:
            words.append("check the sampling rate")
        elif lines:
            words.append(f"write {lines} into [columns]")
        else:
            words.append(one.remedy)
    steps = np.diff(record.time_s)
    is_count = steps.size > 0 and np.all(steps == np.round(steps)) and np.ptp(steps) == 0.0
    if is_count and any("time_s" in one.units for one in named):
        words.append(
            'if the time column counts samples, write time_s = "rate 10 Hz" with the logger\'s rate'
        )
    told = f"If so, {'; or '.join(dict.fromkeys(words))}."
    readings = (reading for one in named for reading in one.readings)
    stays = next((one for one in readings if one.channel not in record.decided), None)
    if stays is None:
        return told
    kept = f'{stays.channel} = "{stays.column} [{stays.unit}]"'
    return f"{told} If {stays.unit} is right, write {kept}: then this is only a {left}."


def _or_else(record: Record, motor: Motor, beyond: Sequence[Figure]) -> list[str]:
    """What to do if no unit is wrong, but the machine is cooled otherwise or the test is short."""
    scale = next((f for f in beyond if f.id in ("time_constant", "size")), None)
    if scale is None:
        return []
    if motor.sink != "coolant" and not any(f.sentence for f in figures(record, motor, "coolant")):
        return ['Or set sink = "coolant" in [motor] if a liquid cools the machine.']
    G = scale.values.get("conductance_W_per_K", math.nan)
    is_alone = scale.id == "time_constant" and is_brief(np.ptp(record.time_s), G, motor.sink)
    large = (
        "Or the machine is large and so short a test shows its winding alone: a longer one tells."
    )
    return [large] if is_alone else []
