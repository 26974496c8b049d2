"""Which small effects may a calibrated network lack, and what would each move?

What matters is in the network by now (`found`). Of the rest a machine has some, each too small to
be told, and each moves the parameters. So every effect that the network lacks is held against the
network alone once more, at the sizes that small ones have: by the linear evidence around the fit
(`linear`), and the best of them by a fit with a noise of its own. The posterior is averaged over
these models by their probabilities (`averaging`).

References: J. A. Hoeting, D. Madigan, A. E. Raftery, C. T. Volinsky, Bayesian model averaging: a
    tutorial, Statistical Science 14 (1999) 382-417. J. Brynjarsdottir, A. O'Hagan, Learning about
    physical parameters: the importance of model discrepancy, Inverse Problems 30 (2014) 114007.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.stats import norm

from lptn.effects import AbstractEffect, placed_link

from ..bench.record import Finding
from ..inference.discrepancy import no_heat
from ..inference.effect_parameters import amplitudes
from ..inference.fitting.fit_result import Fit
from ..inference.noise import from_scores
from ..inference.plausible_effects import PlausibleEffect
from ..inference.problem import Problem
from .engine import Engine, Refit, placed
from .extension import with_catalogue
from .library import Candidate
from .linear import Linear, evidence
from .search import Member, Search, heated

CHANCE = 0.01
"""Bound of the share of clean records in which chance alone would raise the finding [1]."""

NAMED = 0.1
"""Effects of less than this probability are not named [1]."""

MOVED = 1.0
"""A parameter is told to move if it does by more than this many of its standard deviations [1]."""

SCALES = (0.1, 0.3, 1.0)
"""Standard deviations of a small effect's size over the usual one, equally probable [1]."""

PROBABILITY_OF_NONE = 0.2
"""Of the network alone before the tests have spoken; the effects share the rest evenly [1]. Most
machines have one, most of these too small to matter."""

LEAST_OF_NONE = 0.5
"""Of the network alone after them [1]. What is left closes less of the gap than the laws in the
network leave open, and evidence of that size decides nothing."""

MOST = 8
"""Effects that are fitted, the best by the linear evidence."""

LEAST = 0.3
"""Share of the usual size at least, at which an effect is told from none [1]."""

LEAST_PROBABILITY = 1e-3
"""Effects of less than this are dropped [1]."""

VISIBLE, VISIBLE_K = 3.0, 0.12
"""Standard deviations of its size, and kelvins, from which on tests could show an effect of the
usual size: fewer kelvins are within what lumping and instruments leave on any bench."""

OF_A_RESISTANCE = ("surface", "cooling", "winding path")
"""Families of effects that scale a resistance or lie beside it, which then has no one value."""

SAME_AS_AN_INSTRUMENT = ("loss_gain", "sensor_gain", "copper_coefficient", "winding_resistance")
"""Effects whose amplitude has a prior among the parameters of every network already, or that of a
four-wire measurement."""


@dataclass(frozen=True)
class Sight:
    """What tests show of an effect that the network lacks.

    Attributes:
        candidate: The effect.
        visibility: The usual size over the standard deviation that the tests leave it [1].
        visible_K: What an effect of that size leaves when all else is fitted anew, root mean
            square as `Engine.rms_K` [K].
        log_bayes: Log Bayes factor of a small one over none where no heat is unmodelled, by the
            linear evidence [nat].
    """

    candidate: Candidate
    visibility: float
    visible_K: float
    log_bayes: float

    @property
    def is_visible(self) -> bool:
        """Whether these tests could show the effect at all."""
        return self.visibility >= VISIBLE and self.visible_K >= VISIBLE_K


@dataclass(frozen=True)
class Part:
    """A Gaussian law of the scores of network and effect, the size of the effect last [1].

    Attributes:
        share: Its weight within the alternative [1].
        mean: Shape (all,): the fit's parameters, the effect's shape, its size.
        covariance: Shape (all, all).
    """

    share: float
    mean: Float[np.ndarray, " all"]
    covariance: Float[np.ndarray, "all all"]


@dataclass(frozen=True)
class Alternative:
    """The network with one effect.

    Attributes:
        effect: With its probability; a size of 1 is that of its `with_effect`.
        parts: By scale of the size.
        has_one_sign: Whether the size cannot fall below zero.
        turn: What a size of 1 does to the fit's parameters as they are stated: a resistance that
            the effect scales stands for its mean over the tests, shape (parameter,).
        noise_z: Scores of noise and unmodelled heat.
        log_bayes: Over the network alone [nat].
    """

    effect: PlausibleEffect
    parts: tuple[Part, ...]
    has_one_sign: bool
    turn: Float[np.ndarray, " parameter"]
    noise_z: Float[np.ndarray, " noise"]
    log_bayes: float

    def stated(self, scores: Float[np.ndarray, "... all"]) -> Float[np.ndarray, "... parameter"]:
        """Return the scores of the fit's parameters, resistances at their mean over the tests."""
        return scores[..., : self.turn.size] + scores[..., -1:] * self.turn

    def mean(self) -> Float[np.ndarray, " parameter"]:
        """Return the mean scores of the fit's parameters."""
        return self.stated(np.sum([part.share * part.mean for part in self.parts], axis=0))


@dataclass(frozen=True)
class Missing:
    """What a fitted network may lack.

    Attributes:
        p: Bound of the chance that clean tests ask as loudly for any small effect [1].
        log_bayes: Log Bayes factor of all small effects together over none [nat].
        alternatives: Models with one effect that the tests leave possible, the most probable
            first.
        sights: Of all effects that the network lacks, the best first.
    """

    p: float
    log_bayes: float
    alternatives: tuple[Alternative, ...]
    sights: tuple[Sight, ...] = ()

    @property
    def is_seen(self) -> bool:
        """Whether the tests show that something is missing."""
        return self.p < CHANCE and len(self.alternatives) > 0

    @property
    def probability_of_none(self) -> float:
        """Probability that the network with its unmodelled heat lacks no effect of these [1]."""
        return max(0.0, 1.0 - sum(each.effect.probability for each in self.alternatives))


def missing(fit: Fit, kinds: Sequence[type[AbstractEffect]] | None = None) -> Missing | None:
    """Return what the fitted network may lack, None if no effect can be looked for.

    Args:
        fit: A fit that went well.
        kinds: Effects that it may lack; by default the catalogue and installed ones.
    """
    problem = fit.problem
    usable, extended = with_catalogue(problem.model, problem.motor, problem.tests, kinds)
    if not usable.candidates:
        return None
    engine = Engine(Problem.of(extended, problem.motor, problem.tests))
    engine = engine.with_loggers(problem.loggers)
    z, order = placed(engine, fit)
    search = Search(engine, usable.candidates, tuple(order))
    alone = search.fit(frozenset(), z, fit.noise_z)
    linear = Linear(heated(search.engine, alone.z), search.own, search.base, alone, {})
    bare = search.without_heat(alone)
    sights = [_sight(search, linear, bare, each) for each in usable.candidates]
    sights = sorted(sights, key=lambda each: -each.log_bayes)
    worth = [each.candidate for each in sights if each.candidate.id not in SAME_AS_AN_INSTRUMENT]
    found = {
        each: _alternative(search, alone, search.fit(frozenset({each}), linear.scores(
            frozenset({each})), fit.noise_z), each)
        for each in worth[:MOST]
    }  # fmt: skip
    of_all = [each.log_bayes for each in found.values()] + [0.0] * (len(sights) - len(found))
    together = float(np.logaddexp.reduce(of_all)) - math.log(len(of_all))
    return Missing(
        p=min(1.0, math.exp(-max(together, 0.0))),
        log_bayes=together,
        alternatives=_weighed(list(found.values()), len(sights)),
        sights=tuple(sights),
    )


def _weighed(found: Sequence[Alternative], num_candidates: int) -> tuple[Alternative, ...]:
    """Return the alternatives with their probabilities, the most probable first."""
    weight = np.array([each.log_bayes for each in found])
    weight += math.log((1.0 - PROBABILITY_OF_NONE) / num_candidates)
    total = np.logaddexp.reduce([*weight, math.log(PROBABILITY_OF_NONE)])
    probability = np.exp(weight - total)
    if probability.sum() > 1.0 - LEAST_OF_NONE:
        probability *= (1.0 - LEAST_OF_NONE) / probability.sum()
    return tuple(
        replace(found[i], effect=replace(found[i].effect, probability=float(probability[i])))
        for i in np.argsort(-probability)
        if probability[i] > LEAST_PROBABILITY
    )


def _small(
    products: Float[np.ndarray, "column column"],
    scores: Float[np.ndarray, " parameter"],
    size: float,
    *,
    has_one_sign: bool,
) -> tuple[float, tuple[Part, ...]]:
    """Return the log evidence of an effect whose size is small [nat], and the laws by its scale.

    Args:
        products: Inner products of whitened rows: the residual, its derivatives by scores, and
            that by the size, in units of the usual one.
        scores: At which these stand.
        size: Likewise [1].
        has_one_sign: Whether the size cannot fall below zero; its prior is then folded.
    """
    laws = []
    for scale in SCALES:
        turn = np.append(np.ones(products.shape[0] - 1), scale)
        scaled = products * turn * turn[:, None]
        at = np.append(scores, size / scale)
        value, step = evidence(scaled, at)
        mean = (at + step) * turn[1:]
        precision = scaled[1:, 1:] + np.eye(at.size)
        covariance = np.linalg.inv(precision) * turn[1:] * turn[1:, None]
        if has_one_sign:
            value += math.log(2.0) + float(norm.logcdf(mean[-1] / math.sqrt(covariance[-1, -1])))
        laws.append((value, mean, covariance))
    together = float(np.logaddexp.reduce([value for value, _, _ in laws]))
    parts = tuple(Part(math.exp(v - together), mean, covariance) for v, mean, covariance in laws)
    return together - math.log(len(SCALES)), parts


def _sight(search: Search, linear: Linear, bare: Refit, candidate: Candidate) -> Sight:
    """Return what tests show of an effect, by the linear evidence around the network alone.

    Args:
        search: The network without effects, and the means to add one.
        linear: What effects do around it.
        bare: It fitted without unmodelled heat, which takes up what is slow.
        candidate: The effect.
    """
    engine = search.engine.with_heat(no_heat(search.engine.problem))
    own = list(search.own[candidate])
    size, per_size = _size(engine, own, linear.at)
    column = linear.shifts[candidate] / size if size else linear.slopes[candidate] @ per_size
    usual = linear.centre.z.copy()
    usual[own] = 0.0
    size, per_size = _size(engine, own, usual)
    residual, slopes = engine.linearise(usual, own)
    at_usual = (residual - linear.centre.residual) / size if size else slopes @ per_size
    rows = engine.whiten(bare.noise, np.column_stack([bare.residual, bare.jacobian, column]))
    products, scores = rows.T @ rows, bare.z[list(bare.free)]
    found, _ = _small(products, scores, 0.0, has_one_sign=_has_one_sign(candidate))
    shown = engine.whiten(bare.noise, at_usual)
    across = rows[:, 1:-1].T @ shown
    mimicked = np.linalg.solve(products[1:-1, 1:-1] + np.eye(scores.size), across)
    return Sight(
        candidate,
        visibility=math.sqrt(max(shown @ shown - across @ mimicked, 0.0)),
        visible_K=engine.rms_K(at_usual - bare.jacobian @ mimicked),
        log_bayes=found - evidence(products[:-1, :-1], scores)[0],
    )


def _alternative(
    search: Search, alone: Member, member: Member, candidate: Candidate
) -> Alternative:
    """Return the network with an effect, as small as such effects are, from their joint fit."""
    engine, own = search.engine, search.own[candidate]
    size, per_size = _size(engine, own, member.z)
    strong = [slot for slot, each in zip(own, per_size, strict=True) if each]
    kept = [place for place, slot in enumerate(member.free) if slot not in strong]
    of_size = sum(
        member.jacobian[:, member.free.index(slot)] * each
        for slot, each in zip(own, per_size, strict=True)
    )
    joined = np.column_stack([member.residual, member.jacobian, of_size])
    rows = heated(engine, member.z).whiten(from_scores(member.noise_z), joined)
    products, scores = rows.T @ rows, member.z[list(member.free)]
    as_fitted = evidence(products[:-1, :-1], scores)[0]
    chosen = [0, *(1 + place for place in kept), products.shape[0] - 1]
    one_sign = _has_one_sign(candidate)
    small, parts = _small(
        products[np.ix_(chosen, chosen)], scores[kept], size, has_one_sign=one_sign
    )
    unit = max(abs(size), LEAST) * (-1.0 if size < 0.0 else 1.0)
    with_effect, without = member.z.copy(), member.z.copy()
    for slot, each in zip(own, per_size, strict=True):
        if each:
            parameter = engine.slots[slot].parameter
            null = engine.quantity(parameter).null or 0.0
            beyond = float(parameter.value(member.z[slot])) - null
            with_effect[slot] = (
                parameter.score(null + unit / size * beyond) if size else unit * each
            )
            without[slot] = np.nan
    turn = np.zeros(len(search.base))
    place = _scaled_resistance(engine, search.base, candidate)
    if place is not None:
        at = 1 + member.free.index(search.base[place])
        turn[place] = unit * products[at, -1] / products[at, at]
        without[search.base[place]] += turn[place]
    shared = [
        slot for slot in (*search.base, *own)
        if engine.slots[slot].test in (None, candidate.test)
        and (engine.slots[slot].test is None or slot in own)
    ]  # fmt: skip
    return Alternative(
        effect=PlausibleEffect(
            kind=candidate.kind,
            test=candidate.test_name(engine.tests),
            probability=0.0,
            with_effect=_values(engine, with_effect, shared),
            without=_values(engine, without, shared),
        ),
        parts=tuple(_per_unit(part, unit) for part in parts),
        has_one_sign=one_sign,
        turn=turn,
        noise_z=member.noise_z,
        log_bayes=member.log_evidence - as_fitted + small - alone.log_evidence,
    )


def _per_unit(part: Part, unit: float) -> Part:
    """Return a law with the size in units of another size."""
    turn = np.append(np.ones(part.mean.size - 1), 1.0 / unit)
    return Part(part.share, part.mean * turn, part.covariance * turn * turn[:, None])


def _size(
    engine: Engine, own: Sequence[int], z: Float[np.ndarray, " slot"]
) -> tuple[float, list[float]]:
    """Return the size of an effect over the usual one, and its slopes: scores per size.

    Several amplitudes grow together. The slope is zero for a parameter of its shape.

    Args:
        engine: The extended model.
        own: Slots of the effect.
        z: Scores.
    """
    usual, values, slopes = [], [], []
    for slot in own:
        parameter = engine.slots[slot].parameter
        quantity = engine.quantity(parameter)
        is_shape = quantity.null is None
        null = quantity.null or 0.0
        value = float(parameter.value(z[slot]))
        usual.append(0.0 if is_shape else quantity.typical - null)
        values.append(0.0 if is_shape else value - null)
        slopes.append(parameter.sd * (value if parameter.transform == "log" else 1.0))
    size = float(np.mean([v / u for v, u in zip(values, usual, strict=True) if u]))
    along = [v / size for v in values] if size else usual
    return size, [each / slope for each, slope in zip(along, slopes, strict=True)]


def _has_one_sign(candidate: Candidate) -> bool:
    quantities = candidate.kind.card.parameters
    strong = [quantities[name] for name in amplitudes(candidate.kind)]
    return all(q.null is not None and q.null <= q.low for q in strong)


def _values(engine: Engine, z: np.ndarray, slots: Sequence[int]) -> dict[str, float]:
    values, _ = engine.values(z, 0)
    return {
        (parameter := engine.slots[slot].parameter).name: values[parameter.name]
        if np.isnan(z[slot])
        else float(parameter.value(z[slot]))
        for slot in slots
    }


def _scaled_resistance(engine: Engine, base: Sequence[int], candidate: Candidate) -> int | None:
    """Return the place of the resistance that an effect scales among the fit's parameters."""
    kind = candidate.kind
    if kind.card.family not in OF_A_RESISTANCE:
        return None
    model = engine.problem.model
    network = model.topology()
    link = placed_link(kind, network)
    if link is None:  # the surface of the machine
        link = next(ends for ends in network.links if network.boundary in ends)
    names = [parameter.name for ends, parameter in model.form.resistance if ends == link]
    for place, slot in enumerate(base):
        if engine.slots[slot].parameter.name in names:
            return place
    return None


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
        message=f"the residuals of the {fit.problem.model.words} hold more than noise (p < "
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
