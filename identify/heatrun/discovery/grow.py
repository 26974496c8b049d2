"""One effect after another enters the model, as long as each earns its place."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..inference.networks.form import WINDING
from ..inference.noise import Noise
from .judging.acceptance import WORTH_A_REFIT, Rival, gap, judged, least_gap
from .judging.effect_values import amplitude_sd, named_values
from .judging.folds import folds, left_out_errors, rmse
from .judging.held_out import HeldOut
from .judging.refits import refit_with
from .screening.bootstrap import familywise_p
from .screening.engine import Engine, Refit
from .screening.library import Candidate
from .screening.saturated import saturated_noise
from .screening.screen import Score, Screen, signatures

MOST_EFFECTS = 3
"""Effects that are added at most."""

NUM_REFITTED = 10
"""Candidates that are refitted in each round, the best of the screening."""

FAMILYWISE = 0.05
"""Share of clean records in which any effect may be found [1]."""


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
        anchor: Fit that closed gaps are counted from: the base network, or that with an effect
            which rebuilds it. Such an effect is exact; only the laws of the others are no copies
            of the machine's own and leave a share of what they close.
        rounds: The looks at the library, in order.
        final: Fit of the final model.
        accepted: The effects in it.
        dropped: Effects that were accepted and failed the backward check.
    """

    base: Refit
    anchor: Refit
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
    held_out: HeldOut | None = None,
    seed: int = 0,
    say: Callable[[str], None] = lambda sentence: None,
) -> Growth:
    """Add effects to the base model until none earns its place.

    Args:
        engine: The extended model.
        candidates: The library.
        z: Scores of a fit of the base model.
        noise: A first guess of the noise.
        held_out: Tests that no effect may worsen; None for none.
        seed: Of the bootstrap.
        say: Told what is being done.
    """
    free = list(engine.base)
    accepted: list[Rival] = []
    rounds: list[Round] = []
    base: Refit | None = None
    anchor: Refit | None = None
    present = engine.refit(z, free, noise)
    for number in range(MOST_EFFECTS + 1):
        left = [c for c in candidates if all(c.id != a.candidate.id for a in accepted)]
        say(f"scoring {len(left)} candidates")
        screen, scores_of_noise = look(engine, present, left)
        present = screen.present
        base = present if base is None else base
        anchor = present if anchor is None else anchor
        scores = screen.scores()
        p = familywise_p(engine, screen, scores_of_noise, scores[0].log_bayes, seed + number)
        rivals: list[Rival] = []
        if p < FAMILYWISE and number < MOST_EFFECTS:
            promising = [s for s in scores if s.log_bayes > WORTH_A_REFIT][:NUM_REFITTED]
            say(f"refitting {len(promising)} of them jointly")
            rivals = sorted(
                (refitted(engine, anchor, present, score) for score in promising),
                key=lambda rival: -rival.delta_log_evidence,
            )
        rivals, chosen = _choose(present, rivals, held_out)
        rounds.append(Round(present, scores_of_noise, scores, p, rivals, chosen))
        if chosen is None:
            break
        say(f"{chosen.candidate.id} enters the model")
        accepted.append(chosen)
        present = chosen.refit
        if chosen.candidate.kind.rebuilds:
            anchor = None
    assert base is not None
    return Growth(base, present if anchor is None else anchor, rounds, present, accepted)


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


def refitted(engine: Engine, anchor: Refit, present: Refit, score: Score) -> Rival:
    """Return a candidate refitted with everything else, with the reason against it if any.

    Args:
        engine: The extended model.
        anchor: Fit that closed gaps are counted from.
        present: Fit of the present model.
        score: How the candidate fared in the screening.
    """
    candidate = score.candidate
    own = tuple(score.start)
    refit = refit_with(engine, present, score)
    masks = folds(engine, candidate.test)
    before, after = (
        engine.rms_K(left_out_errors(engine, which, masks)) for which in (present, refit)
    )
    values, sd = named_values(engine, refit, own)
    return judged(
        Rival(
            candidate=candidate,
            score=score,
            refit=refit,
            delta_log_evidence=refit.log_evidence - present.log_evidence,
            rmse_K=rmse(refit.residual[engine.sensors[WINDING]]),
            gap_K=gap(engine, present, refit),
            left_out_K=after,
            left_out_without_K=before,
            drop=present.chi2 - refit.chi2,
            least_K=least_gap(present, gap(engine, anchor, present)),
            values=values,
            sd=sd,
            amplitude_sd=amplitude_sd(engine, refit, own),
        )
    )


def _choose(
    present: Refit, rivals: Sequence[Rival], held_out: HeldOut | None
) -> tuple[list[Rival], Rival | None]:
    """Return the rivals, the first of them without a reason against it, and why others fell."""
    seen = list(rivals)
    for place, rival in enumerate(rivals):
        if rival.reason:
            continue
        if held_out is not None:
            seen[place] = held_out.judged(rival, present)
        if not seen[place].reason:
            return seen, seen[place]
    return seen, None
