"""The verdict of a discovery, in a word and in a sentence."""

from __future__ import annotations

from dataclasses import dataclass

from ..effects.found import Found
from ..effects.missing import Missing
from ..results.discovery import VerdictWord
from .adequacy import Adequacy

ENOUGH_VISIBLE = 0.55
"""Share of the heat effects that tests must be able to show for "nothing is missing" to mean
anything [1]; on one constant load almost none can be seen."""


@dataclass(frozen=True)
class Verdict:
    """What is concluded.

    Attributes:
        word: One of the five verdicts.
        sentence: What it means here.
    """

    word: VerdictWord
    sentence: str


def verdict(
    asked: Found, screened: Missing | None, before: Adequacy, after: Adequacy, command: str
) -> Verdict:
    """Return the verdict.

    Args:
        asked: Which effects the tests ask for.
        screened: Which small ones the network may lack.
        before: What the network alone leaves.
        after: What the network with the effects leaves.
        command: What to call next where something is left.
    """
    ids = asked.ids
    names = " and ".join(ids)
    if ids and after.is_adequate:
        tied = {each.id: asked.tied(each) for each in asked.core.effects if asked.tied(each)}
        if tied:
            told = "; ".join(
                f"{name} or {', '.join(f'{o.id} ({100.0 * p:.0f} %)' for o, p in others.items())}"
                for name, others in tied.items()
            )
            return Verdict(
                "ambiguous", f"Missing is {names}; these tests do not tell apart: {told}."
            )
        return Verdict("named", f"Missing was {names}; with it only noise is left.")
    if ids:
        return Verdict(
            "unexplained",
            f"{names} explain {before.misfit_K - after.misfit_K:.2f} of {before.misfit_K:.2f} K of "
            f"slow misfit and stay in the model; {after.words} is left that no effect of the "
            f"catalogue accounts for. Next: {command}",
        )
    if not before.is_adequate:
        return Verdict(
            "unexplained",
            f"The network leaves {before.words} that no effect of the catalogue accounts for. "
            f"Next: {command}",
        )
    scores = () if screened is None else screened.sights
    heat = [s for s in scores if s.candidate.kind.card.family != "sensor"]
    visible = sum(s.is_visible for s in heat) / max(1, len(heat))
    if visible < ENOUGH_VISIBLE:
        return Verdict(
            "not_identifiable",
            f"No missing effect is seen, but these tests could show only {100 * visible:.0f} % of "
            "the effects: the others are not identifiable from them.",
        )
    return Verdict("adequate", "Nothing is missing that these tests would show.")
