"""An effect that the tests do not tell from its rivals: the posterior averaged over the set."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from ..inference.fitting.fit_result import Fit
from ..inference.posterior import Posterior, weighted_draws
from .alternatives import Alternative, members
from .averaging import averaged
from .extended import extended_fit, placed
from .rivals import Named, without
from .screening.engine import Engine, Refit
from .screening.library import Candidate
from .screening.screen import Score


@dataclass(frozen=True)
class Ties:
    """One ambiguous effect with its rivals, each refitted in the final model.

    Attributes:
        named: The effect.
        fit: Of the final model without it.
        members: The final model with each of the set, the most probable first.
    """

    named: Named
    fit: Fit
    members: tuple[Alternative, ...]

    def probability(self, candidate: Candidate) -> float:
        """Return the probability of a member of the set among all of them [1]."""
        return sum(
            each.effect.probability for each in self.members if each.effect.kind is candidate.kind
        )

    def posterior(self, *, seed: int = 0) -> Posterior:
        """Return the posterior of the model without the effect, averaged over the set."""
        return averaged(weighted_draws(self.fit, seed=seed), self.members, seed=seed)


def ties(engine: Engine, final: Refit, named: Sequence[Named]) -> Ties | None:
    """Return the least certain of the ambiguous effects with its rivals; None if all are named.

    Where more than one is ambiguous, the others stay in the model as they are.

    Args:
        engine: The extended model.
        final: Fit of the final model.
        named: The effects in it, with their rivals.
    """
    ambiguous = [each for each in named if each.equivalents]
    if not ambiguous:
        return None
    chosen = min(ambiguous, key=lambda each: each.probability)
    bare = without(engine, final, chosen.rival)
    fit = extended_fit(
        engine, bare.z, [each.rival.candidate for each in named if each is not chosen]
    )
    assert fit.problem.heat is not None
    heated = engine.with_heat(fit.problem.heat)
    z, order = placed(engine, fit)
    present = heated.refit(z, order, fit.noise)
    scores = [_from(chosen.rival.score, final)]
    scores += [_from(swap.score, swap.refit) for swap in chosen.tied]
    return Ties(chosen, fit, members(fit, heated, present, scores))


def _from(score: Score, refit: Refit) -> Score:
    """Return a score whose refit starts where the effect stands in a fit."""
    start = {slot: float(refit.z[slot]) for slot in score.start}
    return replace(score, start=start, other_starts=())
