"""One effect after another enters the model, as long as each earns its place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ..inference.noise import Noise
from .bootstrap import familywise_p
from .engine import Engine, Refit
from .folds import folds, left_out_errors, rmse
from .library import Candidate
from .saturated import saturated_noise
from .screen import VISIBLE_K, Score, Screen, signatures

MOST_EFFECTS = 3
"""Effects that are added at most."""

NUM_REFITTED = 10
"""Candidates that are refitted in each round, the best of the screening."""

WORTH_A_REFIT = 3.0
"""Log Bayes factor of the screening from which on a candidate is refitted [nat]."""

FAMILYWISE = 0.05
"""Share of clean records in which any effect may be found [1]."""

BETTER_SHARE, BETTER_K = 0.10, 0.05
"""By how much the error on tests left out must fall: of itself [1], and in kelvin."""

RELEVANT_K, RELEVANT_NOISE, RELEVANT_SHARE = VISIBLE_K, 0.5, 0.15
"""Least gap that an effect must close: in kelvin, in parts of the noise of a block mean [1], and
of the gap that the effects before it have closed [1], whose laws are no exact copies of the
machine's either."""

SLACK = 0.15
"""An amplitude may lie outside of its physical range by two standard deviations, and by this share
of the range at most [1]: the law that carries it is not the machine's own."""

SEPARATED = 3.0
"""Standard deviations that an amplitude must lie from its null [1]."""


@dataclass(frozen=True)
class Rival:
    """A candidate, refitted with everything else.

    Attributes:
        candidate: The candidate.
        score: How it fared in the screening.
        refit: The joint fit.
        delta_log_evidence: Over the model without it [nat].
        rmse_K: Of the calibration tests with it [K].
        gap_K: What it closes of the gap, the root of the difference of mean squares [K].
        left_out_K: Root mean square error on parts left out, with it [K].
        left_out_without_K: And without it [K].
        values: Its parameters [their units].
        sd: Their standard deviations [their units].
        reason: Why it is rejected; empty if it is not.
    """

    candidate: Candidate
    score: Score
    refit: Refit
    delta_log_evidence: float
    rmse_K: float
    gap_K: float
    left_out_K: float
    left_out_without_K: float
    values: dict[str, float]
    sd: dict[str, float]
    reason: str = ""


@dataclass(frozen=True)
class Round:
    """One look at the library.

    Attributes:
        present: The model before.
        noise_scores: Scores of its noise.
        scores: All candidates as screened, the best first.
        familywise_p: Of the best score [1].
        rivals: The refitted ones, the best first.
        accepted: What entered the model; None ends the search.
    """

    present: Refit
    noise_scores: np.ndarray
    scores: list[Score]
    familywise_p: float
    rivals: list[Rival]
    accepted: Rival | None


@dataclass(frozen=True)
class Growth:
    """How the model grew.

    Attributes:
        base: Fit of the base network under the saturated noise.
        rounds: The looks at the library, in order.
        final: Fit of the final model.
        accepted: The effects in it.
        dropped: Effects that were accepted and failed the backward check.
    """

    base: Refit
    rounds: list[Round]
    final: Refit
    accepted: list[Rival]
    dropped: list[Rival] = field(default_factory=list)


def grow(
    engine: Engine,
    candidates: Sequence[Candidate],
    z: np.ndarray,
    noise: Noise,
    *,
    seed: int = 0,
    say: Callable[[str], None] = lambda sentence: None,
) -> Growth:
    """Add effects to the base model until none earns its place.

    Args:
        engine: The extended model.
        candidates: The library.
        z: Scores of a fit of the base model.
        noise: A first guess of the noise.
        seed: Of the bootstrap.
        say: Told what is being done.
    """
    free = list(engine.base)
    accepted: list[Rival] = []
    rounds: list[Round] = []
    base: Refit | None = None
    present = engine.refit(z, free, noise)
    for number in range(MOST_EFFECTS + 1):
        left = [c for c in candidates if all(c.id != a.candidate.id for a in accepted)]
        say(f"scoring {len(left)} candidates")
        screen, scores_of_noise = look(engine, present, left)
        present = screen.present
        base = present if base is None else base
        scores = screen.scores()
        p = familywise_p(engine, screen, scores_of_noise, scores[0].log_bayes, seed + number)
        rivals: list[Rival] = []
        if p < FAMILYWISE and number < MOST_EFFECTS:
            promising = [s for s in scores if s.log_bayes > WORTH_A_REFIT][:NUM_REFITTED]
            say(f"refitting {len(promising)} of them jointly")
            rivals = sorted(
                (_rival(engine, base, present, score) for score in promising),
                key=lambda rival: -rival.delta_log_evidence,
            )
        chosen = next((rival for rival in rivals if not rival.reason), None)
        rounds.append(Round(present, scores_of_noise, scores, p, rivals, chosen))
        if chosen is None:
            break
        say(f"{chosen.candidate.id} enters the model")
        accepted.append(chosen)
        present = chosen.refit
    assert base is not None
    return Growth(base, rounds, present, accepted)


def look(
    engine: Engine, present: Refit, candidates: Sequence[Candidate]
) -> tuple[Screen, np.ndarray]:
    """Return the library against the present model under the saturated noise, and its scores."""
    library = signatures(engine, present.z, candidates)
    screen = Screen(engine, present, library)
    noise, _ = saturated_noise(engine, screen)
    screen = Screen(engine, engine.refit(present.z, present.free, noise), library)
    noise, scores = saturated_noise(engine, screen)
    screen = Screen(engine, engine.refit(present.z, present.free, noise), library)
    return screen, scores


def _rival(engine: Engine, base: Refit, present: Refit, score: Score) -> Rival:
    candidate = score.candidate
    z = present.z.copy()
    for slot, value in score.start.items():
        z[slot] = value
    own = tuple(score.start)
    refit = engine.refit(z, (*present.free, *own), present.noise)
    masks = folds(engine, candidate.test)
    before, after = (rmse(left_out_errors(engine, which, masks)) for which in (present, refit))
    values, sd = engine.named_values(refit, own)
    rival = Rival(
        candidate=candidate,
        score=score,
        refit=refit,
        delta_log_evidence=refit.log_evidence - present.log_evidence,
        rmse_K=rmse(refit.residual[engine.is_observed]),
        gap_K=gap(engine, present, refit),
        left_out_K=after,
        left_out_without_K=before,
        values=values,
        sd=sd,
    )
    return replace(rival, reason=_reason(rival, present, gap(engine, base, present)))


def gap(engine: Engine, before: Refit, after: Refit) -> float:
    """Return what a model closes of the gap: the root of the difference of mean squares [K]."""
    seen = engine.is_observed
    fall = np.mean(before.residual[seen] ** 2) - np.mean(after.residual[seen] ** 2)
    return float(np.sqrt(max(fall, 0.0)))


def _reason(rival: Rival, present: Refit, closed_K: float) -> str:
    """Return why a candidate is rejected, empty if it is not."""
    if rival.delta_log_evidence < WORTH_A_REFIT:
        return f"the evidence does not call for it (log Bayes {rival.delta_log_evidence:+.1f})"
    unsound = refusal(rival.candidate, rival.values, rival.sd)
    if unsound:
        return unsound
    least = max(
        RELEVANT_K, RELEVANT_NOISE * float(present.noise.total()), RELEVANT_SHARE * closed_K
    )
    if rival.gap_K < least:
        return (
            f"it closes {rival.gap_K:.2f} K of the gap; less than {least:.2f} K is within what "
            "lumping, instruments and noise leave"
        )
    fall = rival.left_out_without_K - rival.left_out_K
    if fall < BETTER_K or fall < BETTER_SHARE * rival.left_out_without_K:
        return (
            f"it does not predict parts left out better ({rival.left_out_without_K:.2f} K "
            f"without it, {rival.left_out_K:.2f} K with it)"
        )
    return ""


def refusal(candidate: Candidate, values: dict[str, float], sd: dict[str, float]) -> str:
    """Return why an effect cannot be what was found, empty if it can.

    Args:
        candidate: The effect.
        values: Its parameters [their units].
        sd: Their standard deviations [their units].
    """
    card = candidate.kind.card
    for name, quantity in card.parameters.items():
        value = values[name]
        if quantity.null is None:
            continue
        reach = quantity.high - quantity.low
        slack = min(max(0.02 * reach, 2.0 * sd[name]), SLACK * reach)
        low, high = min(quantity.low, quantity.null), max(quantity.high, quantity.null)
        if not low - slack <= value <= high + slack:
            return (
                f"{name} = {value:.3g} {quantity.unit} is outside of what is physical "
                f"({low:g} to {high:g})"
            )
    strengths = [
        abs(values[n] - q.null) / max(sd[n], 1e-300)
        for n, q in card.parameters.items()
        if q.null is not None
    ]
    if max(strengths) < SEPARATED:
        return "its amplitude cannot be told from nothing"
    return ""
