"""Each accepted effect against none and against its rivals, with all others in the model."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp

from ..inference.fitting.fit_result import Fit
from .grow import Growth, Round, refitted
from .judging.acceptance import Rival, holds_null, refusal
from .judging.effect_values import amplitude_sd, named_values, of_fit
from .judging.held_out import HeldOut
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
        score: How the rival fared in the screening.
        refit: Fit with it.
        delta_log_evidence: Of the accepted effect over it [nat].
        share: Share of the gap that it closes, the accepted effect closing all [1].
        values: Its parameters [their units].
        reason: Why it is rejected; empty if it is tied.
    """

    score: Score
    refit: Refit
    delta_log_evidence: float
    share: float
    values: dict[str, float]
    reason: str

    @property
    def candidate(self) -> Candidate:
        """The rival."""
        return self.score.candidate


@dataclass(frozen=True)
class Named:
    """An accepted effect and what it is held against.

    Attributes:
        rival: As it was accepted.
        delta_log_evidence: Over the final model without it [nat].
        swaps: Rivals in its place, the best first.
        probability: Among itself, nothing, and the rivals that may be it [1].
        familywise_p: Of the best score in the round that it was found in [1].
    """

    rival: Rival
    delta_log_evidence: float
    swaps: list[Swap]
    probability: float
    familywise_p: float = 0.0

    @property
    def lead(self) -> Swap | None:
        """The best of the rivals that are not rejected; None if there is none."""
        return next((swap for swap in self.swaps if not swap.reason), None)

    @property
    def lead_log_bayes(self) -> float:
        """Log Bayes factor of that rival over the effect [nat]; minus infinity without one."""
        return -np.inf if self.lead is None else -self.lead.delta_log_evidence

    @property
    def tied(self) -> list[Swap]:
        """The rivals that these tests cannot tell from it."""
        return [swap for swap in self.swaps if not swap.reason]

    @property
    def equivalents(self) -> list[Candidate]:
        """The effects that these tests cannot tell from it."""
        return [swap.candidate for swap in self.tied]

    @property
    def ids(self) -> list[str]:
        """Ids of the effect and of those that these tests cannot tell from it."""
        return [self.rival.candidate.id, *(candidate.id for candidate in self.equivalents)]


def settle(
    engine: Engine, growth: Growth, excess: float, held_out: HeldOut | None = None
) -> tuple[Refit, list[Named], list[Rival]]:
    """Return the final model, its effects with their rivals, and effects that were dropped.

    An effect is dropped, with the reason, if the final model does not need it, if its interval
    there holds no effect at all, or if a rival that shows all that an effect must show explains the
    tests far better in its place; the rival then takes it.

    Args:
        engine: The extended model.
        growth: How the model grew.
        excess: Of slow residuals of the final model [1]; evidence is worth that much less.
        held_out: Tests that no effect may worsen; None for none.
    """
    tie = TIE_NATS * max(1.0, excess)
    rounds = {r.accepted.candidate: r for r in growth.rounds if r.accepted is not None}
    accepted, final = list(growth.accepted), growth.final
    dropped: list[Rival] = []
    refused: dict[Candidate, str] = {}
    while True:
        final, accepted, unneeded = _needed(engine, final, accepted, tie)
        dropped += unneeded
        named = [
            _against(engine, final, rival, rounds[rival.candidate], accepted, excess, refused)
            for rival in accepted
        ]
        lost = next((n for n in named if n.lead is not None and n.lead_log_bayes > tie), None)
        if lost is None:
            return final, named, dropped
        assert lost.lead is not None
        better, round_ = lost.lead.candidate, rounds[lost.rival.candidate]
        score = next(score for score in round_.scores if score.candidate == better)
        bare = without(engine, final, lost.rival)
        entering = refitted(engine, growth.anchor, bare, score)
        if held_out is not None and not entering.reason:
            entering = held_out.judged(entering, bare)
        # what was dropped once does not come back: the loop ends
        if entering.reason or any(rival.candidate == better for rival in dropped):
            refused[better] = entering.reason or "it was dropped before"
            continue
        reason = (
            f"{better.id} explains the tests better in its place (log Bayes factor "
            f"{lost.lead_log_bayes:+.1f})"
        )
        dropped.append(replace(lost.rival, reason=reason))
        accepted = [entering if rival is lost.rival else rival for rival in accepted]
        rounds[better] = round_
        final = entering.refit


def confirmed(named: Sequence[Named], fit: Fit) -> tuple[list[Named], list[Rival]]:
    """Return the effects that the fit of the final model still shows, and the others.

    That fit has a noise of its own; its intervals are the ones that are printed.

    Args:
        named: The effects of the final model.
        fit: Its fit, as it is sampled.
    """
    kept, gone = [], []
    for each in named:
        candidate = each.rival.candidate
        reason = holds_null(candidate, *of_fit(fit, candidate.kind, candidate.test))
        if reason:
            gone.append(replace(each.rival, reason=f"in the final model, {reason}"))
        else:
            kept.append(each)
    return kept, gone


def _needed(
    engine: Engine, final: Refit, accepted: Sequence[Rival], tie: float
) -> tuple[Refit, list[Rival], list[Rival]]:
    """Return the model with the effects that it needs and shows, these effects, and the others."""
    kept, dropped = list(accepted), []
    while kept:
        fewer = [without(engine, final, rival) for rival in kept]
        losses = [final.log_evidence - each.log_evidence for each in fewer]
        place = int(np.argmin(losses))
        reason = (
            f"the final model does not need it (log Bayes factor {losses[place]:+.1f})"
            if losses[place] <= tie
            else ""
        )
        for number, rival in enumerate(kept):
            if not reason and (absent := _absent(engine, final, rival.candidate)):
                place, reason = number, f"in the final model, {absent}"
        if not reason:
            break
        dropped.append(replace(kept.pop(place), reason=reason))
        final = fewer[place]
    return final, kept, dropped


def _absent(engine: Engine, final: Refit, candidate: Candidate) -> str:
    """Return why an effect may as well be absent from a fit, empty if it may not."""
    own = _own(engine, final, candidate)
    values, _ = named_values(engine, final, own)
    return holds_null(candidate, values, amplitude_sd(engine, final, own))


def _against(
    engine: Engine,
    final: Refit,
    rival: Rival,
    round_: Round,
    accepted: Sequence[Rival],
    excess: float,
    refused: Mapping[Candidate, str],
) -> Named:
    """Return an effect of the final model held against none and against its rivals."""
    bare = without(engine, final, rival)
    swaps = [
        replace(swap, reason=swap.reason or refused.get(swap.candidate, ""))
        for swap in _swaps(engine, final, bare, rival, round_.scores, accepted, excess)
    ]
    delta = final.log_evidence - bare.log_evidence
    return Named(rival, delta, swaps, probability(delta, swaps, excess), round_.familywise_p)


def probability(delta: float, swaps: Sequence[Swap], excess: float) -> float:
    """Return the probability of an effect among itself, nothing, and rivals that may be it [1].

    A rival that fits better and cannot be the cause, such as one whose amplitude is not physical,
    takes no part.

    Args:
        delta: Log Bayes factor of the effect over nothing [nat].
        swaps: Its rivals.
        excess: Of slow residuals [1]; evidence is worth that much less.
    """
    others = [s.delta_log_evidence for s in swaps if not s.reason or s.delta_log_evidence > 0.0]
    weights = -np.array([0.0, delta, *others]) / max(1.0, excess)
    return float(np.exp(weights[0] - logsumexp(weights)))


def _own(engine: Engine, refit: Refit, candidate: Candidate) -> list[int]:
    return [
        slot
        for slot in refit.free
        if engine.slots[slot].parameter.name.split(".", 1)[0] == candidate.id
        and engine.slots[slot].test == candidate.test
    ]


def without(engine: Engine, final: Refit, rival: Rival) -> Refit:
    """Return the fit of the final model without one of its effects."""
    own = _own(engine, final, rival.candidate)
    z = final.z.copy()
    z[own] = 0.0
    return engine.refit(z, [slot for slot in final.free if slot not in own], final.noise)


def _swaps(
    engine: Engine,
    final: Refit,
    bare: Refit,
    rival: Rival,
    scores: Sequence[Score],
    accepted: Sequence[Rival],
    excess: float,
) -> list[Swap]:
    taken = {r.candidate.id for r in accepted}
    swaps = []
    for score in [s for s in scores if s.candidate.id not in taken][:MOST_SWAPS]:
        refit = refit_with(engine, bare, score)
        delta = final.log_evidence - refit.log_evidence
        gap = _squares(engine, bare) - _squares(engine, final)
        share = (_squares(engine, bare) - _squares(engine, refit)) / max(gap, 1e-12)
        values, sd = named_values(engine, refit, score.start)
        reason = refusal(
            score.candidate, values, sd, bare.chi2 - refit.chi2,
            amplitude_sd=amplitude_sd(engine, refit, score.start),
        )  # fmt: skip
        is_tied = delta < TIE_NATS * max(1.0, excess) or share > TIE_SHARE
        if not reason and not is_tied:
            reason = (
                f"{rival.candidate.id} explains the tests better (log Bayes {delta:+.1f}; it "
                f"closes {100 * max(share, 0.0):.0f} % of the gap that {rival.candidate.id} closes)"
            )
        swaps.append(Swap(score, refit, delta, share, values, reason))
    return sorted(swaps, key=lambda swap: swap.delta_log_evidence)


def _squares(engine: Engine, refit: Refit) -> float:
    return engine.rms_K(refit.residual) ** 2
