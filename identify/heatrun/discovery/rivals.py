"""Each accepted effect against none and against its rivals, with all others in the model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from .grow import Growth
from .judging.acceptance import Rival, refusal
from .judging.folds import rmse
from .judging.refits import refit_with
from .screening.engine import Engine, Refit
from .screening.library import Candidate
from .screening.screen import Score

TIE_NATS = 3.0
"""Log Bayes factor below which two effects are tied [nat], times the excess of the best model."""

TIE_SHARE = 0.95
"""A rival that closes this share of the gap (in mean squares) is tied whatever the evidence: the
laws of the catalogue stand for the machine's own to no better than that [1]."""

MOST_SWAPS = 8
"""Rivals that are put in the place of an accepted effect."""


@dataclass(frozen=True)
class Swap:
    """A rival in the place of an accepted effect.

    Attributes:
        candidate: The rival.
        refit: Fit with it.
        delta_log_evidence: Of the accepted effect over it [nat].
        share: Share of the gap that it closes, the accepted effect closing all [1].
        values: Its parameters [their units].
        reason: Why it is rejected; empty if it is tied.
    """

    candidate: Candidate
    refit: Refit
    delta_log_evidence: float
    share: float
    values: dict[str, float]
    reason: str


@dataclass(frozen=True)
class Named:
    """An accepted effect and what it is held against.

    Attributes:
        rival: As it was accepted.
        delta_log_evidence: Over the final model without it [nat].
        swaps: Rivals in its place, the best first.
        probability: Among itself, its rivals and nothing [1].
    """

    rival: Rival
    delta_log_evidence: float
    swaps: list[Swap]
    probability: float

    @property
    def equivalents(self) -> list[Candidate]:
        """The rivals that these tests cannot tell from it."""
        return [swap.candidate for swap in self.swaps if not swap.reason]


def settle(engine: Engine, growth: Growth, excess: float) -> tuple[Refit, list[Named], list[Rival]]:
    """Return the final model, its effects with their rivals, and effects that were dropped.

    Args:
        engine: The extended model.
        growth: How the model grew.
        excess: Of slow residuals of the final model [1]; evidence is worth that much less.
    """
    accepted, dropped = list(growth.accepted), []
    final = growth.final
    while len(accepted) > 1:
        without = {rival.candidate: _without(engine, final, rival) for rival in accepted}
        weakest = max(accepted, key=lambda rival: without[rival.candidate].log_evidence)
        simpler = without[weakest.candidate]
        if final.log_evidence - simpler.log_evidence > TIE_NATS * max(1.0, excess):
            break
        accepted.remove(weakest)
        dropped.append(weakest)
        final = simpler
    named = []
    for rival in accepted:
        round_ = next(r for r in growth.rounds if r.accepted is rival)
        bare = _without(engine, final, rival)
        swaps = _swaps(engine, final, bare, rival, round_.scores, accepted, excess)
        delta = final.log_evidence - bare.log_evidence
        weights = np.array([0.0, -delta, *(-s.delta_log_evidence for s in swaps)])
        weights = np.exp((weights - weights.max()) / max(1.0, excess))
        named.append(Named(rival, delta, swaps, float(weights[0] / weights.sum())))
    return final, named, dropped


def _own(engine: Engine, refit: Refit, candidate: Candidate) -> list[int]:
    return [
        slot
        for slot in refit.free
        if engine.slots[slot].parameter.name.split(".", 1)[0] == candidate.id
        and engine.slots[slot].test == candidate.test
    ]


def _without(engine: Engine, final: Refit, rival: Rival) -> Refit:
    own = _own(engine, final, rival.candidate)
    z = final.z.copy()
    z[own] = 0.0
    return engine.refit(z, [slot for slot in final.free if slot not in own], final.noise)


def _swaps(
    engine: Engine,
    final: Refit,
    without: Refit,
    rival: Rival,
    scores: Sequence[Score],
    accepted: Sequence[Rival],
    excess: float,
) -> list[Swap]:
    taken = {r.candidate.id for r in accepted}
    swaps = []
    for score in [s for s in scores if s.candidate.id not in taken][:MOST_SWAPS]:
        refit = refit_with(engine, without, score)
        delta = final.log_evidence - refit.log_evidence
        gap = _squares(engine, without) - _squares(engine, final)
        share = (_squares(engine, without) - _squares(engine, refit)) / max(gap, 1e-12)
        values, sd = engine.named_values(refit, score.start)
        reason = refusal(score.candidate, values, sd, without.chi2 - refit.chi2)
        is_tied = delta < TIE_NATS * max(1.0, excess) or share > TIE_SHARE
        if not reason and not is_tied:
            reason = (
                f"{rival.candidate.id} explains the tests better (log Bayes {delta:+.1f}; it "
                f"closes {100 * max(share, 0.0):.0f} % of the gap that {rival.candidate.id} closes)"
            )
        swaps.append(Swap(score.candidate, refit, delta, share, values, reason))
    return sorted(swaps, key=lambda swap: swap.delta_log_evidence)


def _squares(engine: Engine, refit: Refit) -> float:
    return rmse(refit.residual[engine.is_observed]) ** 2
