"""The verdict of a discovery, in a word and in a sentence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from .grow import FAMILYWISE, Growth, Round
from .judging.final_check import Adequacy
from .rivals import Named
from .traces import Trace

Word = Literal["adequate", "named", "ambiguous", "unexplained", "not_identifiable"]

ENOUGH_VISIBLE = 0.55
"""Share of the heat effects that tests must be able to show for "nothing is missing" to mean
anything [1]; on one constant load almost none can be seen."""


HALF = 0.7
"""Share of the slow misfit, in kelvin, from which on an effect closes half of it in squares [1]."""


APART_SHARE, APART_K = 1.5, 0.1
"""The sampled model is told to be off if its error is so many times that of the search's fit [1],
and this much above it [K]: under its own noise, a posterior may leave the fit that the verdict
rests on."""


@dataclass(frozen=True)
class Verdict:
    """What is concluded.

    Attributes:
        word: One of the five verdicts.
        sentence: What it means here.
    """

    word: Word
    sentence: str


def verdict(
    growth: Growth,
    named: Sequence[Named],
    before: Adequacy,
    after: Adequacy,
    traces: Sequence[Trace] = (),
) -> Verdict:
    """Return the verdict.

    Args:
        growth: How the model grew.
        named: The effects in the final model, with their rivals.
        before: Adequacy of the base model.
        after: Adequacy of the final model.
        traces: Effects that are there and do not matter.
    """
    if named and after.is_adequate:
        tied = [n for n in named if n.equivalents]
        names = " and ".join(_with_rivals(n) for n in named)
        if tied:
            return Verdict("ambiguous", f"Missing is {names}; these tests do not distinguish them.")
        return Verdict("named", f"Missing was {names}; with it only noise is left.")
    if named:
        names = " and ".join(n.rival.candidate.id for n in named)
        return Verdict(
            "unexplained",
            f"Something is missing that is not in the catalogue: {names} helps, but {after.words} "
            "is left, so no cause is claimed.",
        )
    first = growth.rounds[0]
    if not before.is_adequate:
        close = [r.candidate.id for r in first.rivals if r.gap_K > HALF * before.misfit_K]
        several = (
            f"; {', '.join(close[:4])} would each close much of it, but none has a physical "
            "amplitude, passes cross-validation and explains the rest of the residuals"
            if close
            else ""
        )
        return Verdict(
            "unexplained",
            f"The network leaves {before.words} that no effect of the catalogue accounts "
            f"for{several}.",
        )
    heat = [s for s in first.scores if s.candidate.kind.card.family != "sensor"]
    visible = sum(s.is_visible for s in heat) / max(1, len(heat))
    if visible < ENOUGH_VISIBLE:
        return Verdict(
            "not_identifiable",
            f"No missing effect is seen, but these tests could show only {100 * visible:.0f} % of "
            "the effects: the others are not identifiable from them.",
        )
    return Verdict(
        "adequate", f"Nothing is missing that these tests would show{_beside(first, traces)}."
    )


def sampled_apart(left: Adequacy, rmse_K: float) -> str:
    """Return what is to be said where the sampled model errs far more than the fit, else nothing.

    Args:
        left: What the fit leaves that the verdict rests on.
        rmse_K: Error of the winding by the sampled model on the same tests [K].
    """
    of_fit_K = left.rmse_K if left.winding_rmse_K is None else left.winding_rmse_K
    if rmse_K <= max(APART_SHARE * of_fit_K, of_fit_K + APART_K):
        return ""
    return (
        f" The sampled model has an RMSE of {rmse_K:.2f} K on the same tests, against "
        f"{of_fit_K:.2f} K of the fit that this verdict rests on: its parameters and intervals "
        "are not reliable."
    )


def _beside(first: Round, traces: Sequence[Trace]) -> str:
    """Return what is there all the same."""
    if traces:
        told = "; ".join(trace.words for trace in traces)
        return f", except for a trace that is too small to matter ({told})"
    if first.familywise_p >= FAMILYWISE:
        return ""
    return " (a trace is there, too small to matter or to be predicted from one test to another)"


def _with_rivals(named: Named) -> str:
    ids = named.ids
    return ids[0] if len(ids) == 1 else f"one of {', '.join(ids)}"
