"""Does a calibrated network miss an effect that its tests show, and what would that move?

A fit alone cannot say: its noise swallows the misfit, and what is left looks like noise. So the
noise is estimated with room for the catalogue, as a search for effects does it, and every effect
is scored in one pass around the fit. Nothing is refitted, which takes seconds.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..bench.record import Finding
from ..inference.catalogue import all_effects
from ..inference.fitting.fit_result import Fit
from .grow import look
from .screening.bootstrap import familywise_p
from .screening.engine import Engine, Refit
from .screening.extension import extended_engine
from .screening.library import Candidate
from .screening.screen import Score

CHANCE = 0.01
"""Share of clean records in which chance alone would raise the finding [1]."""

NAMED = 0.1
"""Effects of less than this probability are not named [1]."""

ON_A_RESISTANCE = ("surface", "cooling", "winding path", "event")
"""Families of effects that add to a resistance of the network or scale it: with such an effect the
resistance means something else."""

MOVED = 1.0
"""A parameter is told to move if it does by more than this many of its standard deviations [1]."""


@dataclass(frozen=True)
class Suspect:
    """An effect that the tests point to.

    Attributes:
        candidate: The effect.
        test: Name of the test that it happens in; None if it acts in all of them.
        probability: That it is the one that is missing, if one of the catalogue is [1].
        moves: By parameter of the network: relative change with the effect in the model [1], and
            the same in standard deviations of the posterior [1].
    """

    candidate: Candidate
    test: str | None
    probability: float
    moves: Mapping[str, tuple[float, float]]

    @property
    def words(self) -> str:
        """The effect with its probability, as printed."""
        place = "" if self.test is None else f" in {self.test}"
        return f"{self.candidate.id}{place} ({100.0 * self.probability:.0f} %)"


@dataclass(frozen=True)
class Missing:
    """What a screening of the catalogue says of a fit.

    Attributes:
        p: Share of clean records whose best effect scores as high [1].
        log_bayes: Log Bayes factor of the best effect [nat].
        suspects: Effects by probability, the most probable first.
    """

    p: float
    log_bayes: float
    suspects: tuple[Suspect, ...]

    @property
    def is_seen(self) -> bool:
        """Whether the tests show that something is missing."""
        return self.p < CHANCE and self.log_bayes > 0.0


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
    z = np.zeros(len(engine.slots))
    for slot, score in zip(fit.slots, fit.z, strict=True):
        place = engine.find(slot.parameter.name, slot.test)
        assert place is not None
        z[place] = score
    present = engine.refit(z, engine.base, fit.noise)
    screen, noise_scores = look(engine, present, found.candidates)
    scores = screen.scores()
    p = familywise_p(engine, screen, noise_scores, scores[0].log_bayes, seed)
    return Missing(p, scores[0].log_bayes, _suspects(engine, fit, screen.present, scores))


def missing_finding(fit: Fit, found: Missing) -> Finding | None:
    """Return the finding that a network misses an effect; None if the tests do not show it."""
    if not found.is_seen:
        return None
    named = [s for s in found.suspects if s.probability >= NAMED] or [*found.suspects[:1]]
    first = named[0]
    moves = {name: move for name, move in first.moves.items() if abs(move[1]) > MOVED}
    message = (
        f"the {fit.problem.model.words} is incomplete: its residuals show an effect that it lacks "
        f"(p = {found.p:.2g}, the share of clean records that would look so). Most likely: "
        f"{', '.join(s.words for s in named)}. {_moved(first, moves)}"
    )
    with_effects = ",".join([kind.card.id for kind in fit.problem.model.effects]
                            + [first.candidate.id])  # fmt: skip
    return Finding(
        id="missing_effect",
        severity="warning",
        message=message,
        where=fit.problem.label,
        remedy="Search with `heatrun discover`, which tests each effect and keeps what it can "
        f"show; or, where the cause is known, calibrate --with {with_effects}.",
        values={
            "familywise_p": found.p,
            "log_bayes_factor": found.log_bayes,
            **{f"change_of_{name}": change for name, (change, _) in first.moves.items()},
        },
    )


def _moved(first: Suspect, moves: Mapping[str, tuple[float, float]]) -> str:
    if not moves:
        return (
            f"With {first.candidate.id} in the model, no parameter of the network would move by "
            "more than its standard deviation."
        )
    told = ", ".join(
        f"{name} {100.0 * abs(change):.2g} % {'higher' if change > 0 else 'lower'}"
        for name, (change, _) in moves.items()
    )
    scaled = (
        " A resistance that the effect acts on is told where the effect vanishes."
        if first.candidate.kind.card.family in ON_A_RESISTANCE
        else ""
    )
    return (
        f"With {first.candidate.id} in the model: {told}.{scaled} The 95 % intervals do not allow "
        "for this."
    )


def _suspects(
    engine: Engine, fit: Fit, present: Refit, scores: Sequence[Score]
) -> tuple[Suspect, ...]:
    log_bayes = np.array([score.log_bayes for score in scores])
    weight = np.exp(log_bayes - log_bayes.max())
    share = weight / weight.sum()
    order = np.argsort(-share)
    return tuple(
        Suspect(
            candidate=scores[i].candidate,
            test=scores[i].candidate.test_name(engine.tests),
            probability=float(share[i]),
            moves=_moves(engine, fit, present, scores[i]),
        )
        for i in order
    )


def _moves(
    engine: Engine, fit: Fit, present: Refit, score: Score
) -> dict[str, tuple[float, float]]:
    """Return where the network's parameters would be with an effect, against the fit.

    The screening has a fit of its own, under a noise that has not swallowed the misfit.
    """
    places = {slot.name: place for place, slot in enumerate(fit.slots)}
    result = {}
    for shift, position in zip(score.shift, present.free, strict=True):
        slot = engine.slots[position]
        if slot.parameter.role != "network":
            continue
        parameter, place = slot.parameter, places[slot.name]
        sd = float(np.sqrt(fit.covariance[place, place]))
        before = float(parameter.value(np.float64(fit.z[place])))
        there = float(present.z[position] + shift)
        after = float(parameter.value(np.float64(there)))
        result[slot.name] = (after / before - 1.0, (there - float(fit.z[place])) / sd)
    return result
