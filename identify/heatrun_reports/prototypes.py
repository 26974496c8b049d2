"""Prototypes of a comparison, and any number of them on one clock, compared pair by pair.

Each has a role and a record, and one network is held against each.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

from heatrun.errors import InputError, UsageError
from heatrun.readers.joined import parts_of, read_test
from heatrun.record.motor import Motor
from heatrun.record.record import Finding, Record
from heatrun.record.samples import sink_channel

from .analysis.drive import has
from .analysis.general_information import GeneralInformation, general_information
from .analysis.pair import Pair
from .analysis.validation import Validation, align, judge, validate, within
from .simulated import Reference, read_reference, reference_of_run


@dataclass(frozen=True)
class Prototype:
    """One prototype."""

    role: str  # As given on the command line, such as `"semi-real"`.
    reference: Reference  # Its record with bands, and what is known of how it came about.
    # Role of the record that drove the run that stands for it; empty for a file.
    driven_by: str = ""

    @property
    def record(self) -> Record:
        """The record on its own clock."""
        return self.reference.record

    @property
    def is_simulated(self) -> bool:
        """Whether it is a simulation, by heatrun or, as its role says, by another program."""
        return self.reference.is_simulated


def read_prototypes(roles: Sequence[tuple[str, Path]], motor: Motor) -> tuple[Prototype, ...]:
    """Read the record of each prototype, in the order of roles and files.

    The folder of a run stands for a virtual one, driven by the first measured one that can.

    Raises:
        InputError: If a file or run cannot be read.
        UsageError: If there is a run and no measured record to drive it.
    """
    records = {
        role: Prototype(role, replace(_read(path, motor), is_model=is_virtual(role)))
        for role, path in roles
        if not path.is_dir()
    }
    measured = [p for p in records.values() if not p.is_simulated]
    driver = next((p for p in measured if drives(p.record, motor)), next(iter(measured), None))
    found = []
    for role, path in roles:
        if role in records:
            found.append(records[role])
            continue
        if driver is None:
            raise UsageError(f"{role}: a run needs a measured record among the others to drive it.")
        reference = reference_of_run(path, driver.record, motor)
        found.append(Prototype(role, reference, driver.role))
    return tuple(found)


def is_virtual(role: str) -> bool:
    """Return whether a role is that of a model."""
    return role.lower().startswith("virtual")


def drives(record: Record, motor: Motor) -> bool:
    """Return whether a record holds what drives a network: current, losses and sink."""
    return has(record, "phase_current_A", "losses_W", sink_channel(motor))


def _read(path: Path, motor: Motor) -> Reference:
    """A file that is there is read with its bands; any other word is a test of several files."""
    if not path.exists():
        return Reference(read_test(path, motor))
    reference = read_reference(path, motor)
    first, *others = parts_of(reference.record, motor)
    if others:
        raise InputError(
            f"The motor file uses {1 + len(others)} stretches of this test: "
            f"{', '.join(part.stretch for part in (first, *others))}.",
            where=str(path),
            remedy=f"Name the one that is meant, such as {path}@{first.stretch}.",
        )
    # a band is on the axis of the whole file
    return reference if reference.bands else replace(reference, record=first)


@dataclass(frozen=True)
class OnNetwork:
    """A measured prototype's temperatures less the network's prediction, on its own clock."""

    prototype: Prototype
    driven_by: str  # Role whose currents, losses and sink drove the network.
    is_seen: bool  # Whether the run was calibrated on the record that is judged.
    validation: Validation


def judge_network(
    run: Path,
    prototypes: Sequence[Prototype],
    shift_s: Mapping[str, float],
    motor: Motor,
    tolerances: Mapping[str, float] | None = None,
) -> tuple[tuple[OnNetwork, ...], tuple[Finding, ...]]:
    """Judge one network on every measured prototype.

    A record without current, losses or sink is judged by the network that the first record with
    them drives, shifted to its clock: both drove the same manoeuvre. What is added to each clock
    to give the base's [s] stands by role. Returns what was judged, and why the rest was not.

    Raises:
        InputError: If the run cannot be read, or a prediction leaves all temperatures.
    """
    measured = [p for p in prototypes if not p.is_simulated]
    drivers = [p for p in measured if drives(p.record, motor)]
    found, findings = [], []
    driven: dict[str, Reference] = {}
    for prototype in measured:
        if not drivers or not has(prototype.record, "winding_degC"):
            load = "current, losses and sink, as do all the others"
            lacking, name = "winding_degC" if drivers else load, prototype.record.name
            message = f"The network is not judged on {prototype.role}: it lacks {lacking}."
            remedy = "Map the columns in the motor file, or record them."
            findings.append(Finding("network_not_judged", "warning", message, name, remedy, name))
            continue
        driver = prototype if prototype in drivers else drivers[0]
        if driver.role not in driven:
            of_run = reference_of_run(run, driver.record, motor)
            driven[driver.role] = replace(of_run, inputs=frozenset())
        reference = driven[driver.role]
        offset_s = shift_s[driver.role] - shift_s[prototype.role]
        temperatures = [c for c in prototype.record.channels if c.endswith("_degC")]
        thermal = {c: prototype.record[c] for c in ("time_s", *temperatures)}
        validation = validate(
            replace(prototype.record, channels=thermal), reference, motor,
            tolerances=tolerances, offset_s=offset_s,
        )  # fmt: skip
        is_seen = reference.is_seen and driver is prototype
        found.append(OnNetwork(prototype, driver.role, is_seen, validation))
    return tuple(found), tuple(findings)


LONGEST_ROLE = 24
"""Characters of a role: it heads a column."""

FORM = "virtual=FILE semi-real=FILE real=FILE"


def parse_roles(texts: Sequence[str]) -> tuple[tuple[str, Path], ...]:
    """Return role and file of each prototype from texts `ROLE=FILE`, in the order given.

    The role is any short word, the file may be the folder of a run.

    Raises:
        UsageError: If a text is no such pair, a role stands twice, or there are fewer than two.
    """
    found: dict[str, Path] = {}
    for text in texts:
        role, sign, file = text.partition("=")
        role = role.strip()
        if not (sign and file and role.isprintable() and 0 < len(role) <= LONGEST_ROLE):
            raise UsageError(
                f"{text!r}: a prototypes report expects ROLE=FILE, such as {FORM}, with a role of "
                f"at most {LONGEST_ROLE} characters."
            )
        if role in found:
            raise UsageError(f"the role {role!r} stands twice; call a repeat {role}-2.")
        found[role] = Path(file)
    if len(found) < 2:
        raise UsageError(f"a prototypes report compares two or more: {FORM}.")
    return tuple(found.items())


CLOSES = 3.0
"""Combined standard uncertainties by which two ways between two clocks may differ [1]."""


@dataclass(frozen=True)
class Compared:
    """Two of the prototypes over the time common to all; differences are later less earlier.

    The comparison is on the later one's clock; a simulation is never the later of a mixed pair.
    """

    later: Prototype
    earlier: Prototype
    validation: Validation

    @property
    def name(self) -> str:
        """What the differences are, such as `"real − semi-real"`."""
        return f"{self.later.role} − {self.earlier.role}"


@dataclass(frozen=True)
class Confrontation:
    """Several prototypes beside each other, in the order given."""

    prototypes: tuple[Prototype, ...]
    # The one whose clock is kept: the first that was measured, or what drove a run.
    base: Prototype
    # What is added to each prototype's clock to give the base's [s], by role.
    shift_s: Mapping[str, float]
    window_s: tuple[float, float]  # First and last moment common to all, on the base's clock [s].
    pairs: tuple[Compared, ...]  # Every pair that shares a signal.
    # General Information over the time in common, by role; None where the record does not allow it.
    information: Mapping[str, GeneralInformation | None]
    findings: tuple[Finding, ...]
    networks: tuple[OnNetwork, ...] = ()  # The same network against each measured winding.

    def in_window(self, role: str, record: Record) -> Record:
        """Return a record of a prototype on the clock kept, cut to the time in common."""
        channels = {**record.channels, "time_s": record.time_s + self.shift_s[role]}
        return within(replace(record, channels=channels), *self.window_s)


def confront(
    prototypes: Sequence[Prototype], motor: Motor, tolerances: Mapping[str, float] | None = None
) -> Confrontation:
    """Align prototypes and compare each pair.

    The offset of each pair of clocks is searched by what the two records share. A pair that does
    not allow it stands by the way over the base. Tolerances are by channel or figure, in its unit
    (K for temperatures).

    Raises:
        InputError: If a prototype cannot be aligned with the base, or there is no time in common.
    """
    base = base_of(prototypes)
    given, aligned, findings = tolerances or {}, {}, []
    couples = [_ordered(a, b) for a, b in combinations(prototypes, 2)]
    # those with the base first: the others may have to go by them
    couples.sort(key=lambda couple: all(each is not base for each in couple))
    shift_s = {base.role: 0.0}
    for later, earlier in couples:
        # a run that the base drove is on the base's clock
        is_driven = bool(earlier.reference.run) and base is not later and base is not earlier
        driven_s = -shift_s[later.role] if is_driven else None
        try:
            pair = align(later.record, earlier.reference, motor, driven_s)
        except InputError as error:
            if base is later or base is earlier:
                raise
            offset_s = shift_s[earlier.role] - shift_s[later.role]
            try:
                pair = align(later.record, earlier.reference, motor, offset_s)
            except InputError:  # they have nothing in common, each only with the base
                findings.append(
                    Finding(
                        "pair_not_compared",
                        "warning",
                        f"{later.role} and {earlier.role} are not compared: {error.problem}",
                        f"{later.record.name}, {earlier.record.name}",
                        error.remedy,
                        later.record.name,
                    )
                )
                continue
            pair = _by_way_of(base, later, earlier, aligned, pair)
            findings.append(
                Finding(
                    "offset_by_base",
                    "note",
                    f"{later.role} and {earlier.role} were aligned by way of {base.role}: "
                    f"{error.problem}",
                    f"{later.record.name}, {earlier.record.name}",
                    "The uncertainties of both ways add up.",
                    base.record.name,
                )
            )
        if driven_s is not None:
            pair = _by_way_of(base, later, earlier, aligned, pair)
        aligned[later.role, earlier.role] = pair
        if earlier is base:
            shift_s[later.role] = -pair.offset.offset_s
        elif later is base:
            shift_s[earlier.role] = pair.offset.offset_s
    findings += _closure(aligned, shift_s, base)
    window_s = _window(prototypes, shift_s)
    pairs = []
    for later, earlier in (_ordered(a, b) for a, b in combinations(prototypes, 2)):
        if (later.role, earlier.role) not in aligned:
            continue
        from_s, to_s = (moment - shift_s[later.role] for moment in window_s)
        pair = aligned[later.role, earlier.role].within(from_s, to_s)
        found = judge(later.record, earlier.reference, motor, pair, given)
        pairs.append(Compared(later, earlier, found))
    information = {p.role: _information(p, shift_s, window_s, motor) for p in prototypes}
    return Confrontation(
        tuple(prototypes), base, shift_s, window_s, tuple(pairs), information, tuple(findings)
    )


def base_of(prototypes: Sequence[Prototype]) -> Prototype:
    """Return the prototype whose clock is kept: what drove a run, else the first measured one."""
    drivers = {p.driven_by for p in prototypes}
    measured = [p for p in prototypes if not p.is_simulated]
    driving = [p for p in measured if p.role in drivers]
    return [*driving, *measured, *prototypes][0]


def _by_way_of(
    base: Prototype, later: Prototype, earlier: Prototype,
    aligned: Mapping[tuple[str, str], Pair], pair: Pair,
) -> Pair:  # fmt: skip
    """The pair with how its offset came about, and the uncertainties of both ways together."""
    ways = [p.offset.sd_s for roles, p in aligned.items()
            if base.role in roles and {later.role, earlier.role} & set(roles)]  # fmt: skip
    sd_s = sum(sd_s**2 for sd_s in ways) ** 0.5
    return replace(pair, offset=replace(pair.offset, sd_s=sd_s, method=f"by way of {base.role}"))


def _ordered(first: Prototype, second: Prototype) -> tuple[Prototype, Prototype]:
    """Later and earlier of two: in the order given, but a simulation is the reference."""
    if second.is_simulated and not first.is_simulated:
        return first, second
    return second, first


def _window(prototypes: Sequence[Prototype], shift_s: Mapping[str, float]) -> tuple[float, float]:
    spans = [
        (float(p.record.time_s[0]) + shift_s[p.role], float(p.record.time_s[-1]) + shift_s[p.role])
        for p in prototypes
    ]
    from_s, to_s = max(first for first, _ in spans), min(last for _, last in spans)
    if from_s < to_s:
        return from_s, to_s
    raise InputError(
        "Expected a time common to all prototypes; pair by pair they overlap, together they do "
        "not.",
        where=", ".join(p.record.name for p in prototypes),
        remedy="Compare fewer of them.",
    )


def _information(
    prototype: Prototype, shift_s: Mapping[str, float], window_s: tuple[float, float], motor: Motor
) -> GeneralInformation | None:
    from_s, to_s = (moment - shift_s[prototype.role] for moment in window_s)
    try:
        return general_information(within(prototype.record, from_s, to_s), motor)
    except InputError:
        return None


def _closure(
    aligned: Mapping[tuple[str, str], Pair], shift_s: Mapping[str, float], base: Prototype
) -> list[Finding]:
    """Where the direct offset of two clocks and the way over the base contradict each other."""
    sd_s = {
        (set(roles) - {base.role}).pop(): pair.offset.sd_s
        for roles, pair in aligned.items()
        if base.role in roles
    }
    found = []
    for (later, earlier), pair in aligned.items():
        if base.role in (later, earlier) or pair.offset.sd_s == 0.0:
            continue
        way_s = shift_s[earlier] - shift_s[later]
        left_s = pair.offset.offset_s - way_s
        allowed_s = CLOSES * (pair.offset.sd_s**2 + sd_s[later] ** 2 + sd_s[earlier] ** 2) ** 0.5
        if abs(left_s) > allowed_s:
            found.append(
                Finding(
                    "clocks_do_not_close",
                    "warning",
                    f"Expected one set of clocks; between {later} and {earlier} the direct offset "
                    f"is {pair.offset.offset_s:+.1f} s, by way of {base.role} {way_s:+.1f} s "
                    f"(at most {allowed_s:.1f} s apart).",
                    f"{pair.test}, {pair.reference}",
                    "Does a signal of one of them lag, or does the manoeuvre repeat?",
                    base.record.name,
                    {"left_s": left_s},
                )
            )
    return found
