"""Whether a record will do: one sentence from the findings about it, with no physics of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...io.quantities import rounded
from ..record import Finding
from .doubts import DOUBTS, SIMULATED, doubts

WEAK = {
    "too_short": "it is too short for the slow time constant",
    "single_step": "it holds a single load step",
}
"""Warnings after which the second order is calibrated, and its stator parameters stay uncertain."""

LONGEST_REASON = 140


@dataclass(frozen=True)
class Suitability:
    """Whether a record can be calibrated.

    Attributes:
        test: Name of the record.
        will_do: No error forbids it, it was measured, and the motor file says what the network
            needs.
        sentence: The answer with its reason.
    """

    test: str
    will_do: bool
    sentence: str


def suitability(
    test: str, findings: Sequence[Finding], aim: str, refusal: Finding | None = None
) -> Suitability:
    """Return whether a record will do.

    Args:
        test: Its name.
        findings: Those about it.
        aim: What is to be calibrated, such as `"a second-order calibration"`.
        refusal: What the network lacks, where that is known and not among the findings.
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
    others = sorted(warnings - set(WEAK) - set(DOUBTS))
    doubtful = doubts(findings)
    told = [f"{words} ({', '.join(ids)})" for words, ids in doubtful.items()]
    if SIMULATED in warnings:
        return Suitability(test, False, f"This record will not do for {aim}: {told[0]}.")
    sentence = f"This record will do for {aim}"
    if told:
        sentence = f"To be cleared up first: {', '.join(told)}. Then this record will do for {aim}"
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
