"""Whether a record will do: one sentence from the findings about it, with no physics of its own.

Behind it stands what is said of tests that are predicted only, of `[tests.NAME]` for tests that
were not given, and of records that were simulated.
"""

import difflib
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

from ..io.own_files import is_simulated
from ..io.quantities import rounded
from ..io.toml_text import table_header
from ..record.findings import SAID, with_doubt
from ..record.motor import Motor
from ..record.record import Finding, Record

SIMULATED = "simulated_by_heatrun"

DOUBTS = {id: SAID[id] for id in with_doubt("parameters", "inputs") if id in SAID}
"""Id to what is in doubt, said of the record."""


def doubts(findings: Sequence[Finding]) -> dict[str, list[str]]:
    """Return what is in doubt about the inputs of a record, with the ids that say so.

    Only warnings count, since errors forbid a calibration.
    """
    ids = {one.id for one in findings if one.severity == "warning"}
    found: dict[str, list[str]] = {}
    for id, words in DOUBTS.items():
        if id in ids:
            found.setdefault(words, []).append(id)
    return found


WEAK = {id: words for id, words in SAID.items() if id not in DOUBTS}
"""Warnings after which the second order is calibrated, and its stator parameters stay uncertain."""

LONGEST_REASON = 140


@dataclass(frozen=True)
class Suitability:
    """Whether a record can be calibrated."""

    test: str  # Name of the record.
    # No error forbids it, it was measured, and the motor file says what the network needs.
    will_do: bool
    sentence: str  # The answer with its reason.


def suitability(
    test: str, findings: Sequence[Finding], aim: str, refusal: Finding | None = None
) -> Suitability:
    """Return whether a record will do for an aim, such as `"a second-order calibration"`.

    The refusal is what the network lacks, where that is known and not among the findings.
    """
    errors = [finding for finding in findings if finding.severity == "error"]
    if errors:
        return Suitability(test, False, f"This record will not do for {aim}: {_reasons(errors)}")
    if refusal is not None:
        reason = refusal.message.partition(": ")[2] or refusal.message
        sentence = f"This record will do for {aim} once the motor file is complete: {reason}"
        return Suitability(test, False, sentence)
    warnings = {finding.id for finding in findings if finding.severity == "warning"}
    cooling = next((one for one in findings if one.id == "no_heating"), None)
    if cooling is not None:
        taus = [tau for name, tau in cooling.values.items() if name.startswith("tau_") and tau]
        told = f": {' and '.join(f'{rounded(tau)} s' for tau in taus)}" if taus else ""
        return Suitability(
            test,
            True,
            f"This record gives time constants only{told}. Heat capacities and resistances need a "
            "test under load beside it.",
        )
    weak = [words for id, words in WEAK.items() if id in warnings]
    answer = f"This record will do for {aim}"
    short = next((one.values for one in findings if "fast_from_s" in one.values), None)
    if short is not None:
        ends = dict.fromkeys(rounded(short[name] or 0.0) for name in ("fast_from_s", "fast_to_s"))
        answer = (
            f"This record tells the fast time constant of the winding alone ({' to '.join(ends)} "
            "s) and leaves the slow one open: Ceq_sr and Req_sr need a longer test beside it"
        )
        weak.remove(WEAK["too_short"])
    others = sorted(warnings - set(WEAK) - set(DOUBTS))
    doubtful = doubts(findings)
    told = [f"{words} ({', '.join(ids)})" for words, ids in doubtful.items()]
    if SIMULATED in warnings:
        return Suitability(test, False, f"This record will not do for {aim}: {told[0]}.")
    sentence = answer
    if told:
        then = f"{answer[:1].lower()}{answer[1:]}"
        sentence = f"To be cleared up first: {', '.join(told)}. Then {then}"
    if weak:
        sentence += f", with wide intervals: {' and '.join(weak)}"
    if others:
        sentence += f"{';' if weak else ','} read the warnings first ({', '.join(others)})"
    return Suitability(test, True, f"{sentence}.")


def _reasons(errors: Sequence[Finding]) -> str:
    """Return the first reason in short, and how many more there are."""
    missing = [one.where.rpartition(", ")[2] for one in errors if one.id == "missing_channel"]
    if missing:
        return f"it has no {', '.join(missing)}."
    first = errors[0].message
    reason = first if len(first) <= LONGEST_REASON else f"{first[:LONGEST_REASON].rstrip()}…"
    more = f" And {len(errors) - 1} more." if len(errors) > 1 else ""
    return f"{reason} ({errors[0].id}){more}"


LITTLE = (
    "The winding hardly changes: the prediction of this test says how the model holds a level, "
    "not how it follows a load."
)


def as_holdout(findings: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Return the findings of a record as they stand where nothing is fitted to it.

    What only a fit wants, several steps of load, length, a winding that warms, is no fault of a
    test that is predicted. Of one whose winding hardly changes it is said what it can show.
    """
    found = []
    for each in findings:
        if each.id == "no_heating" and "rise_K" in each.values:
            if each.severity == "error":
                found.append(replace(each, severity="warning", message=LITTLE, remedy=""))
        elif each.id not in WEAK:
            found.append(each)
    return tuple(found)


NEAR = 0.8
"""Likeness from which a name is one letter or two away from another."""


def other_tests(motor: Motor, names: Iterable[str]) -> Iterator[Finding]:
    """Yield a finding for each `[tests.NAME]` for none of the tests, whose parts end in `_1`, `_2`.

    A motor file serves many tests of a machine, so that this is a note; a name that is nearly that
    of a test is a warning, for then a part or a mask is not used that was meant to be.
    """
    given = tuple(dict.fromkeys(names))
    whole = {re.sub(r"_[0-9]+$", "", name) for name in given} | set(given)
    free = [name for name in given if name not in motor.tests]
    for name in motor.tests:
        if name in whole:
            continue
        header = table_header("tests", name)
        meant = next((one for one in free if _is_nearly(name, one)), None)
        message = f"{header} of the motor file is for none of the tests that were given ("
        message += f"{', '.join(given)}): what it says of use and mask changes nothing here."
        remedy = "Nothing need be done if it is for another test."
        if meant:
            remedy = f"Did you mean {table_header('tests', meant)}? The name is that of the file "
            remedy += "without its ending."
        yield Finding("other_test", "warning" if meant else "note", message, remedy=remedy)


def _is_nearly(written: str, name: str) -> bool:
    """Return whether a name was mistyped; names that differ in a number are different tests."""
    if written.startswith(f"{name}."):
        return True  # with the ending of the file
    one, other = written.casefold(), name.casefold()
    is_like = difflib.SequenceMatcher(None, one, other).ratio() >= NEAR
    return is_like and re.findall("[0-9]+", one) == re.findall("[0-9]+", other)


def simulated_by_heatrun(record: Record, motor: Motor) -> Iterator[Finding]:
    """Report a virtual record of heatrun's: its temperatures are a model's, and have no noise."""
    columns = (*record.unused, *(reading.column for reading in record.mapping))
    if not is_simulated(columns):
        return
    yield Finding(
        id="simulated_by_heatrun",
        severity="warning",
        message="Expected a measurement; the columns copper_loss_W, other_loss_W and flow_… "
        "are those of a virtual record that heatrun simulated. A calibration on it gives back "
        "the parameters that it was made with, and its intervals say nothing of a machine.",
        where=record.name,
        remedy="Name the bench file that the simulation was made from.",
    )
