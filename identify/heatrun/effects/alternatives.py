"""The network with one effect of the catalogue, held against the network alone.

A machine has effects that its network lacks, most of them too small to be found. Each would move
the parameters. So each that the tests speak for is refitted jointly with the network, noise and
unmodelled heat, and the posterior is averaged over these models by their probabilities.

References: J. A. Hoeting, D. Madigan, A. E. Raftery, C. T. Volinsky, Bayesian model averaging: a
    tutorial, Statistical Science 14 (1999) 382-417. J. Brynjarsdottir, A. O'Hagan, Learning about
    physical parameters: the importance of model discrepancy, Inverse Problems 30 (2014) 114007.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.optimize import minimize_scalar

from lptn.effects import placed_link

from ..inference.effect_parameters import amplitudes
from ..inference.fitting.fit_result import Fit
from ..inference.fitting.restricted import estimate_noise, log_evidence
from ..inference.noise import from_scores
from ..inference.plausible_effects import PlausibleEffect
from .engine import Engine, Refit
from .refits import refit_with
from .saturated import filled, padded
from .screen import Score, typical
from .shrinkage import Part, shrunk

PROBABILITY_OF_NONE = 0.2
"""Of the network alone before the tests have spoken; the effects share the rest evenly [1]. Most
machines have one, most of these too small to matter."""

LEAST_OF_NONE = 0.5
"""Of the network alone after them [1]. What matters is in the network by then; what is left closes
less of the gap than its laws leave open, and evidence of that size decides nothing."""

MOST = 8
"""Effects that are refitted, the best of the screening."""

NUM_ROUNDS = 2
"""Rounds of noise and least squares for each."""

LEAST = 0.3
"""Share of the typical amplitude at least, at which an effect is told from none [1]."""

MOST_FACTOR = 1e4
"""By how much an effect may change a resistance [1]: a fit may leave next to nothing to it."""

LEAST_PROBABILITY = 1e-3
"""Effects of less than this are dropped [1]."""

OF_A_RESISTANCE = ("surface", "cooling", "winding path")
"""Families of effects that scale a resistance or lie beside it, which then has no one value."""

SAME_AS_AN_INSTRUMENT = ("loss_gain", "sensor_gain", "copper_coefficient", "winding_resistance")
"""Effects whose amplitude has a prior among the parameters of every network already, or that of a
four-wire measurement."""


@dataclass(frozen=True)
class Alternative:
    """The network with one effect.

    Attributes:
        effect: With its probability.
        parts: By scale of the amplitude.
        amplitude: Scores of the amplitudes that count as a size of 1, shape (amplitude,).
        found: Scores of the amplitudes that the refit found, shape (amplitude,).
        amplitude_places: Their places among the parameters of the effect.
        has_one_sign: Whether the amplitudes cannot fall below zero.
        shift: What the effect, as it was found, adds to the scores of the fit's parameters, so that
            a resistance that it scales stands for its mean over the tests.
        slope: How a resistance that the effect scales has to fall with the scores of the amplitudes
            for the tests to be explained as well, shape (parameter, amplitude). Its mean over the
            tests does not change along this line.
        noise_z: Scores of noise and unmodelled heat.
        log_evidence: Marginal likelihood, up to what all models of these tests share [nat].
    """

    effect: PlausibleEffect
    parts: tuple[Part, ...]
    amplitude: Float[np.ndarray, " amplitude"]
    found: Float[np.ndarray, " amplitude"]
    amplitude_places: tuple[int, ...]
    has_one_sign: bool
    shift: Float[np.ndarray, " parameter"]
    slope: Float[np.ndarray, "parameter amplitude"]
    noise_z: Float[np.ndarray, " noise"]
    log_evidence: float

    @property
    def strong(self) -> list[int]:
        """Places of the amplitudes among the scores of network and effect."""
        return [self.shift.size + place for place in self.amplitude_places]

    def sizes(self, scores: Float[np.ndarray, "... all"]) -> Float[np.ndarray, "..."]:
        """Return the size of the effect for scores of network and effect [1]."""
        return scores[..., self.strong] @ (self.amplitude / np.sum(self.amplitude**2))

    def centred(self, scores: Float[np.ndarray, "... all"]) -> Float[np.ndarray, "... parameter"]:
        """Return the scores of the fit's parameters, resistances at their mean over the tests."""
        beyond = scores[..., self.strong] - self.found
        return scores[..., : self.shift.size] + self.shift + beyond @ self.slope.T

    def mean(self) -> Float[np.ndarray, " parameter"]:
        """Return the mean scores of the fit's parameters."""
        whole = np.sum([part.share * part.mean for part in self.parts], axis=0)
        return self.centred(whole)


def alternatives(
    fit: Fit, engine: Engine, present: Refit, scores: Sequence[Score], num_candidates: int
) -> tuple[Alternative, ...]:
    """Return the models with one effect that the tests leave possible, the most probable first.

    Args:
        fit: Of the network alone.
        engine: With all effects, and with the unmodelled heat of the fit.
        present: The network alone under the noise of the screening.
        scores: Of the screening, the best first.
        num_candidates: Effects that share the prior probability.
    """
    padding = padded(np.concatenate(fit.jacobian))
    alone = log_evidence(
        engine.problem, fit.noise_z, filled(fit.z, padding), np.concatenate(fit.residual), padding
    )
    worth = [s for s in scores if s.log_bayes > 0.0 and s.candidate.id not in SAME_AS_AN_INSTRUMENT]
    found = [_refitted(fit, engine, present, score) for score in worth[:MOST]]
    weight = np.array([each.log_evidence - alone for each in found])
    weight += np.log((1.0 - PROBABILITY_OF_NONE) / num_candidates)
    total = np.logaddexp.reduce([*weight, np.log(PROBABILITY_OF_NONE)])
    probability = np.exp(weight - total)
    if probability.sum() > 1.0 - LEAST_OF_NONE:
        probability *= (1.0 - LEAST_OF_NONE) / probability.sum()
    return _by_probability(engine, found, probability)


def _by_probability(
    engine: Engine, found: Sequence[_Refitted], probability: Float[np.ndarray, " model"]
) -> tuple[Alternative, ...]:
    """Return those that are worth it, the most probable first."""
    kept = [i for i in np.argsort(-probability) if probability[i] > LEAST_PROBABILITY]
    return tuple(_alternative(engine, found[i], float(probability[i])) for i in kept)


@dataclass(frozen=True)
class _Refitted:
    """A joint refit of network and effect."""

    score: Score
    found: Refit
    base: tuple[int, ...]
    own: tuple[int, ...]
    parts: tuple[Part, ...]
    log_evidence: float
    noise_z: np.ndarray


def _refitted(fit: Fit, engine: Engine, present: Refit, score: Score) -> _Refitted:
    found = refit_with(engine, present, score)
    noise_z = fit.noise_z
    for _ in range(NUM_ROUNDS):
        columns = padded(found.jacobian)
        z = filled(found.z[list(found.free)], columns)
        noise_z = estimate_noise(engine.problem, z, found.residual, columns, start=noise_z)
        found = engine.refit(found.z, found.free, from_scores(noise_z))
    columns = padded(found.jacobian)
    z = filled(found.z[list(found.free)], columns)
    evidence = log_evidence(engine.problem, noise_z, z, found.residual, columns)
    order = list(found.free)
    whitened = engine.whiten(found.noise, found.jacobian)
    residual = engine.whiten(found.noise, found.residual)
    precision = whitened.T @ whitened + np.eye(len(order))
    # at a bound of the amplitude the slope is not zero
    information = precision @ found.z[order] - (whitened.T @ residual + found.z[order])
    base = present.free
    own = tuple(slot for slot in order if slot not in base)
    strong = [order.index(slot) for slot in _amplitude_slots(engine, score, own)]
    one_sign = _has_one_sign(engine, score)
    usual = np.array([typical(engine, order[place]) for place in strong])
    parts, gain = shrunk(information, precision, strong, usual, has_one_sign=one_sign)
    return _Refitted(
        score=score,
        found=found,
        base=base,
        own=own,
        parts=parts,
        log_evidence=evidence + gain,
        noise_z=noise_z,
    )


def _alternative(engine: Engine, refitted: _Refitted, probability: float) -> Alternative:
    """Return the alternative, with what its effect is told from."""
    found, candidate = refitted.found, refitted.score.candidate
    strong = _amplitude_slots(engine, refitted.score, refitted.own)
    usual = np.array([typical(engine, slot) for slot in strong])
    amplitude = found.z[strong]
    if np.linalg.norm(amplitude) < LEAST * np.linalg.norm(usual):
        amplitude = LEAST * usual
    reference = found.z.copy()
    reference[strong] = amplitude
    without = reference.copy()
    without[strong] = 0.0
    shift = np.zeros(len(refitted.base))
    slope = np.zeros((shift.size, len(strong)))
    place = _scaled_resistance(engine, refitted)
    if place is not None:
        slot = refitted.base[place]
        without[slot] = nearest_resistance(engine, reference, without, slot)
        bare = found.z.copy()
        bare[strong] = 0.0
        shift[place] = nearest_resistance(engine, found.z, bare, slot) - found.z[slot]
        amplitudes_at = [shift.size + refitted.own.index(slot) for slot in strong]
        wide = refitted.parts[-1].covariance
        among = wide[np.ix_(amplitudes_at, amplitudes_at)]
        slope[place] = -np.linalg.solve(among, wide[amplitudes_at, place])
    shared = [
        slot for slot in (*refitted.base, *refitted.own)
        if engine.slots[slot].test in (None, candidate.test)
        and (engine.slots[slot].test is None or slot in refitted.own)
    ]  # fmt: skip
    return Alternative(
        effect=PlausibleEffect(
            kind=candidate.kind,
            test=candidate.test_name(engine.tests),
            probability=probability,
            with_effect=_values(engine, reference, shared),
            without=_values(engine, without, shared),
        ),
        parts=refitted.parts,
        amplitude=amplitude,
        found=found.z[strong],
        amplitude_places=tuple(refitted.own.index(slot) for slot in strong),
        has_one_sign=_has_one_sign(engine, refitted.score),
        shift=shift,
        slope=slope,
        noise_z=refitted.noise_z,
        log_evidence=refitted.log_evidence,
    )


def nearest_resistance(
    engine: Engine, reference: np.ndarray, without: np.ndarray, slot: int
) -> float:
    """Return the score of a resistance that comes nearest to what the network does with an effect.

    Within bounds, not by Newton's method: radiation may double what the rest of the surface has,
    and from there its steps may lead to a resistance of nothing.

    Args:
        engine: The extended model.
        reference: Scores of all its slots, with the effect.
        without: The same without the effect.
        slot: Place of the resistance.
    """
    changed, _ = engine.linearise(reference, [])
    widest = math.log(MOST_FACTOR) / engine.slots[slot].parameter.sd

    def apart(score: float) -> float:
        z = without.copy()
        z[slot] = score
        return float(np.sum((engine.linearise(z, [])[0] - changed) ** 2))

    bounds = (without[slot] - widest, without[slot] + widest)
    found: Any = minimize_scalar(apart, bounds=bounds, method="bounded")
    return float(found.x)


def _values(engine: Engine, z: np.ndarray, slots: Sequence[int]) -> dict[str, float]:
    return {
        engine.slots[slot].parameter.name: float(engine.slots[slot].parameter.value(z[slot]))
        for slot in slots
    }


def _amplitude_slots(engine: Engine, score: Score, own: Sequence[int]) -> list[int]:
    names = amplitudes(score.candidate.kind)
    return [slot for slot in own if engine.slots[slot].parameter.name.split(".", 1)[1] in names]


def _has_one_sign(engine: Engine, score: Score) -> bool:
    quantities = score.candidate.kind.card.parameters
    strong = [quantities[name] for name in amplitudes(score.candidate.kind)]
    return all(q.null is not None and q.null <= q.low for q in strong)


def _scaled_resistance(engine: Engine, refitted: _Refitted) -> int | None:
    """Return the place of the resistance that the effect scales among the fit's parameters."""
    kind = refitted.score.candidate.kind
    if kind.card.family not in OF_A_RESISTANCE:
        return None
    model = engine.problem.model
    network = model.topology()
    link = placed_link(kind, network)
    if link is None:  # the surface of the machine
        link = next(ends for ends in network.links if network.boundary in ends)
    names = [parameter.name for ends, parameter in model.form.resistance if ends == link]
    for place, slot in enumerate(refitted.base):
        if engine.slots[slot].parameter.name in names:
            return place
    return None
