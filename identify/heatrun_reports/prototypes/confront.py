"""Any number of prototypes on one clock, compared pair by pair over the time common to all."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from heatrun.errors import InputError
from heatrun.record.motor import Motor
from heatrun.record.record import Finding

from ..analysis.general_information import GeneralInformation, general_information
from ..analysis.pair import Pair
from ..analysis.validation import Validation, align, judge, within
from .prototype import OnNetwork, Prototype

CLOSES = 3.0
"""Combined standard uncertainties by which two ways between two clocks may differ [1]."""


@dataclass(frozen=True)
class Compared:
    """Two of the prototypes; differences are the later less the earlier one.

    Attributes:
        later: Whose clock the comparison is on; a simulation is never the later of a mixed pair.
        earlier: The reference.
        validation: Signal by signal and figure by figure, over the time common to all.
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
    """Several prototypes beside each other.

    Attributes:
        prototypes: In the order given.
        base: The one whose clock is kept: the first that was measured, or what drove a run.
        shift_s: What is added to each prototype's clock to give the base's [s], by role.
        window_s: First and last moment common to all, on the base's clock [s].
        pairs: Every pair that shares a signal.
        information: General Information over the time in common, by role; None where the record
            does not allow it.
        networks: The same network against each measured winding.
        findings: Doubts.
    """

    prototypes: tuple[Prototype, ...]
    base: Prototype
    shift_s: Mapping[str, float]
    window_s: tuple[float, float]
    pairs: tuple[Compared, ...]
    information: Mapping[str, GeneralInformation | None]
    networks: tuple[OnNetwork, ...] = ()
    findings: tuple[Finding, ...] = ()


def confront(
    prototypes: Sequence[Prototype],
    motor: Motor,
    tolerances: Mapping[str, float] | None = None,
) -> Confrontation:
    """Align prototypes and compare each pair.

    The offset of each pair of clocks is searched by what the two records share. A pair that does
    not allow it stands by the way over the base.

    Args:
        prototypes: Two or more.
        motor: The machine.
        tolerances: By channel or figure, in its unit (K for temperatures).

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
        driven_s = _driven_offset(later, earlier, base, shift_s)
        try:
            pair = align(later.record, earlier.reference, motor, driven_s)
        except InputError as error:
            if base is later or base is earlier:
                raise
            offset_s = shift_s[earlier.role] - shift_s[later.role]
            try:
                pair = align(later.record, earlier.reference, motor, offset_s)
            except InputError:  # they have nothing in common, each only with the base
                findings.append(_without(later, earlier, error))
                continue
            pair = _by_way_of(base, later, earlier, aligned, pair)
            findings.append(_by_base(later, earlier, base, error))
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
        tuple(prototypes), base, shift_s, window_s, tuple(pairs), information, (), tuple(findings)
    )


def base_of(prototypes: Sequence[Prototype]) -> Prototype:
    """Return the prototype whose clock is kept: what drove a run, else the first measured one."""
    drivers = {p.driven_by for p in prototypes}
    measured = [p for p in prototypes if not p.is_simulated]
    driving = [p for p in measured if p.role in drivers]
    return [*driving, *measured, *prototypes][0]


def _driven_offset(
    later: Prototype, earlier: Prototype, base: Prototype, shift_s: Mapping[str, float]
) -> float | None:
    """The offset of a run that the base drove: it is on the base's clock; None for a file."""
    if not earlier.reference.run or base is later or base is earlier:
        return None
    return -shift_s[later.role]


def _by_way_of(
    base: Prototype,
    later: Prototype,
    earlier: Prototype,
    aligned: Mapping[tuple[str, str], Pair],
    pair: Pair,
) -> Pair:
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


def _by_base(later: Prototype, earlier: Prototype, base: Prototype, error: InputError) -> Finding:
    return Finding(
        "offset_by_base",
        "note",
        f"{later.role} and {earlier.role} were aligned by way of {base.role}: {error.problem}",
        f"{later.record.name}, {earlier.record.name}",
        "The uncertainties of both ways add up.",
        base.record.name,
    )


def _without(later: Prototype, earlier: Prototype, error: InputError) -> Finding:
    return Finding(
        "pair_not_compared",
        "warning",
        f"{later.role} and {earlier.role} are not compared: {error.problem}",
        f"{later.record.name}, {earlier.record.name}",
        error.remedy,
        later.record.name,
    )


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
