"""Does a calibrated network miss an effect that its tests show, and what would that move?

A fit alone cannot say: its noise swallows the misfit, and what is left looks like noise. So the
noise is estimated with room for the catalogue, as a search for effects does it, and every effect
is scored in one pass around the fit. Those that the tests speak for are then refitted with the
network (`alternatives`), so that the posterior can be averaged over them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from lptn.effects import AbstractEffect

from ..bench.record import Finding
from ..inference.catalogue import all_effects
from ..inference.fitting.fit_result import Fit
from ..inference.plausible_effects import PlausibleEffect
from .alternatives import Alternative, alternatives
from .bootstrap import familywise_p
from .engine import Engine, Refit, placed
from .extension import extended_engine
from .library import Candidate
from .saturated import saturated_noise
from .screen import Score, Screen, signatures

CHANCE = 0.01
"""Share of clean records in which chance alone would raise the finding [1]."""

NAMED = 0.1
"""Effects of less than this probability are not named [1]."""

MOVED = 1.0
"""A parameter is told to move if it does by more than this many of its standard deviations [1]."""


@dataclass(frozen=True)
class Missing:
    """What a screening of the catalogue says of a fit.

    Attributes:
        p: Share of clean records whose best effect scores as high [1].
        log_bayes: Log Bayes factor of the best effect [nat].
        alternatives: Models with one effect that the tests leave possible, the most probable
            first.
        scores: Of all effects that the network lacks, the best first.
    """

    p: float
    log_bayes: float
    alternatives: tuple[Alternative, ...]
    scores: tuple[Score, ...] = ()

    @property
    def is_seen(self) -> bool:
        """Whether the tests show that something is missing."""
        return self.p < CHANCE and len(self.alternatives) > 0

    @property
    def probability_of_none(self) -> float:
        """Probability that the network with its unmodelled heat lacks no effect of these [1]."""
        return max(0.0, 1.0 - sum(each.effect.probability for each in self.alternatives))


def missing(
    fit: Fit, kinds: Sequence[type[AbstractEffect]] | None = None, *, seed: int = 0
) -> Missing | None:
    """Return what the fitted network misses, None if no effect can be looked for.

    Args:
        fit: A fit that went well.
        kinds: Effects that it may lack; by default the catalogue and installed ones.
        seed: Of the records that are drawn for comparison.
    """
    problem = fit.problem
    found, engine = extended_engine(
        problem.model, problem.motor, problem.tests, kinds or all_effects()
    )
    if not found.candidates:
        return None
    z, order = placed(engine, fit)
    assert problem.heat is not None
    engine = engine.with_loggers(problem.loggers)
    heated = engine.with_heat(problem.heat)
    engine = engine.with_heat(tuple(np.zeros_like(columns) for columns in problem.heat))
    present = engine.refit(z, order, fit.noise)
    screen, noise_scores = look(engine, present, found.candidates)
    scores = screen.scores()
    p = familywise_p(engine, screen, noise_scores, scores[0].log_bayes, seed)
    others = alternatives(fit, heated, screen.present, scores, len(found.candidates))
    return Missing(p, scores[0].log_bayes, others, tuple(scores))


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


def missing_finding(fit: Fit, found: Missing) -> Finding | None:
    """Return the finding that a network may lack a small effect; None if the tests show none.

    What matters is in the network by now (`effects.found`). What is left closes less of the gap
    than the laws in it leave open, so the tests do not decide whether it is there: the intervals
    allow for both.
    """
    if not found.is_seen:
        return None
    first = found.alternatives[0]
    named = [a for a in found.alternatives if a.effect.probability >= NAMED] or [first]
    moves = _moves(fit, first)
    listed = ", ".join(_words(each.effect) for each in named)
    return Finding(
        id="missing_effect",
        severity="note",
        message=f"the residuals of the {fit.problem.model.words} hold more than noise (p = "
        f"{found.p:.2g}, the share of clean records that would look so), too little for a name. "
        f"The 95 % intervals allow for {listed}. {_moved(first, moves)}",
        where=fit.problem.label,
        remedy="Where the cause is known, name it with --with.",
        values={
            "familywise_p": found.p,
            "log_bayes_factor": found.log_bayes,
            "probability_of_none": found.probability_of_none,
            **{f"change_of_{n}": change for n, (change, _) in moves.items()},
        },
    )


def _words(effect: PlausibleEffect) -> str:
    """Return an effect with its probability, as printed."""
    place = "" if effect.test is None else f" in {effect.test}"
    return f"{effect.id}{place} ({100.0 * effect.probability:.0f} %)"


def _moves(fit: Fit, first: Alternative) -> dict[str, tuple[float, float]]:
    """Return where an effect puts the network's parameters, against the network alone.

    Returns:
        By name: relative change [1], and the same in standard deviations of the fit [1].
    """
    moved = first.mean()
    result = {}
    for place, slot in enumerate(fit.slots):
        parameter = slot.parameter
        if parameter.role == "network":
            before, after = (float(parameter.value(np.float64(z[place]))) for z in (fit.z, moved))
            sd = float(np.sqrt(fit.covariance[place, place]))
            result[slot.name] = (after / before - 1.0, float(moved[place] - fit.z[place]) / sd)
    return result


def _moved(first: Alternative, moves: Mapping[str, tuple[float, float]]) -> str:
    told = ", ".join(
        f"{name} {100.0 * abs(change):.2g} % {'higher' if change > 0 else 'lower'}"
        for name, (change, in_sds) in moves.items()
        if abs(in_sds) > MOVED
    )
    if not told:
        return (
            f"With {first.effect.id} in the model, no parameter of the network would move by more "
            "than its standard deviation."
        )
    return (
        f"With {first.effect.id} in the model, against the network alone: {told}. The 95 % "
        "intervals allow for it."
    )
