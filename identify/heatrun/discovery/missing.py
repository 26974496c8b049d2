"""Does a calibrated network miss an effect that its tests show, and what would that move?

A fit alone cannot say: its noise swallows the misfit, and what is left looks like noise. So the
noise is estimated with room for the catalogue, as a search for effects does it, and every effect
is scored in one pass around the fit. Those that the tests speak for are then refitted with the
network (`alternatives`), so that the posterior can be averaged over them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..bench.record import Finding
from ..inference.catalogue import all_effects
from ..inference.fitting.fit_result import Fit
from ..inference.plausible_effects import PlausibleEffect
from .alternatives import PROBABILITY_OF_NONE, Alternative, alternatives
from .extended import placed
from .grow import look
from .screening.bootstrap import familywise_p
from .screening.extension import extended_engine

CHANCE = 0.01
"""Share of clean records in which chance alone would raise the finding [1]."""

NAMED = 0.1
"""Effects of less than this probability are not named [1]."""

LIKELY = 0.5
"""Probability that some effect is missing from which on it is a warning [1], by what the tests say
alone: at even odds before them, while the posterior is averaged with those of `alternatives`, where
most machines have one. Below, it is a note, if no effect as probable as `NAMED`, again at even
odds, would move a parameter."""

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
    """

    p: float
    log_bayes: float
    alternatives: tuple[Alternative, ...]

    @property
    def is_seen(self) -> bool:
        """Whether the tests show that something is missing."""
        return self.p < CHANCE and len(self.alternatives) > 0

    @property
    def probability_of_none(self) -> float:
        """Probability that the network with its unmodelled heat lacks no effect of these [1]."""
        return max(0.0, 1.0 - sum(each.effect.probability for each in self.alternatives))

    def at_even_odds(self, probability: float) -> float:
        """Return a probability of effects, had none been as probable as some before the tests."""
        of_none = (1.0 - PROBABILITY_OF_NONE) / PROBABILITY_OF_NONE * self.probability_of_none
        return probability / (of_none + 1.0 - self.probability_of_none)


def missing(fit: Fit, *, seed: int = 0) -> Missing | None:
    """Return what the fitted network misses, None if no effect can be looked for.

    Args:
        fit: A fit that went well.
        seed: Of the records that are drawn for comparison.
    """
    problem = fit.problem
    found, engine = extended_engine(problem.model, problem.motor, problem.tests, all_effects())
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
    return Missing(p, scores[0].log_bayes, others)


def missing_finding(fit: Fit, found: Missing) -> Finding | None:
    """Return the finding that a network misses an effect; None if the tests do not show it."""
    if not found.is_seen:
        return None
    first = found.alternatives[0]
    named = [a for a in found.alternatives if a.effect.probability >= NAMED] or [first]
    moves = [_moves(fit, each) for each in named]  # of the first effect first
    has_moved = any(
        abs(sds) > MOVED
        for each, of in zip(named, moves, strict=True)
        if found.at_even_odds(each.effect.probability) >= NAMED
        for _, sds in of.values()
    )
    is_doubt = has_moved or found.at_even_odds(1.0 - found.probability_of_none) >= LIKELY
    words = fit.problem.model.words
    p = f"(p = {found.p:.2g}, the share of clean records that would look so)"
    listed = ", ".join(_words(each.effect) for each in named)
    nameless = 100.0 * found.probability_of_none
    if is_doubt:
        message = (
            f"the {words} is incomplete: its residuals show an effect that it lacks {p}. Most "
            f"likely: {listed}"
        )
        if found.probability_of_none >= NAMED:
            message += f"; heat without a name, or errors of the power ({nameless:.0f} %)"
    else:
        heat = f"heat without a name, or errors of the power ({nameless:.0f} %)"
        of_what = (
            f"most likely {heat}, for which the 95 % intervals allow; possible: {listed}"
            if found.probability_of_none >= LIKELY
            else f"the tests do not tell of what. The 95 % intervals allow for {heat}, and {listed}"
        )
        message = f"the residuals of the {words} hold more than noise {p}: {of_what}"
    with_effects = ",".join([kind.card.id for kind in fit.problem.model.effects]
                            + [first.effect.id])  # fmt: skip
    return Finding(
        id="missing_effect",
        severity="warning" if is_doubt else "note",
        message=f"{message}. {_moved(first, moves[0])}",
        where=fit.problem.label,
        remedy="Search with `heatrun discover`, which tests each effect and keeps what it can "
        f"show; or, where the cause is known, calibrate --with {with_effects}.",
        values={
            "familywise_p": found.p,
            "log_bayes_factor": found.log_bayes,
            "probability_of_none": found.probability_of_none,
            **{f"change_of_{n}": change for n, (change, _) in moves[0].items()},
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
