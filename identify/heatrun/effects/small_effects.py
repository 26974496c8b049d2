"""Which small effects may a calibrated network lack, and what would they move?

What the tests ask for is in the network by now (`found`). Of the rest a machine has some, each too
small to be told, and together they move the parameters. So all effects that the network lacks stand
beside it once more, at the sizes of small ones, each with the odds that the search gives it. Around
the fit all is linear (`linear`): given the sizes, the parameters are a Gaussian shift away, and the
sizes are drawn one after the other, each given the others, zero or not (a spike and a slab). The
posterior is averaged over these draws (`averaged`).

References: E. I. George, R. E. McCulloch, Variable selection via Gibbs sampling, Journal of the
    American Statistical Association 88 (1993) 881-889. J. A. Hoeting, D. Madigan, A. E. Raftery,
    C. T. Volinsky, Bayesian model averaging: a tutorial, Statistical Science 14 (1999) 382-417. J.
    Brynjarsdottir, A. O'Hagan, Learning about physical parameters: the importance of model
    discrepancy, Inverse Problems 30 (2014) 114007.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.linalg
from jaxtyping import Bool, Float
from scipy.special import log_ndtr, ndtr, ndtri

from lptn.effects import AbstractEffect, placed_link

from ..fit.fit_result import Fit
from ..fit.restricted import estimate_noise, log_evidence
from ..model.discrepancy import no_heat
from ..model.draws import PlausibleEffect, PlausibleEffects
from ..model.noise import from_scores
from ..model.parameters import EVENT, amplitudes
from ..model.problem import Problem
from ..posterior.driven import too_stiff
from ..posterior.posterior import Posterior
from ..record.record import Finding
from .engine import Candidate, Engine, Refit, placed
from .found import with_catalogue
from .linear import Linear
from .search import ODDS, Member, Search, heated

CHANCE = 0.01
"""Bound of the share of clean records in which chance alone would raise the finding [1]."""

NAMED = 0.1
"""Effects of less than this probability are not named [1]."""

MOVED = 1.0
"""A parameter is told to move if it does by more than this many of its standard deviations [1]."""

SCALES = (0.1, 0.3, 1.0)
"""Standard deviations of a small effect's size over the usual one, equally probable [1]."""

LEAST_OF_NONE = 0.5
"""Of the network alone after them [1]. The evidence for what is left is no larger than what the
laws in the network leave open, and decides nothing."""

NUM_CHAINS, NUM_SWEEPS, NUM_KEPT = 500, 40, 8
"""Chains of the sizes, rounds over all effects until each of them is a draw, and draws of each."""

MOST = 8
"""Effects that are weighed with a noise of their own, the best by the linear evidence."""

LEAST = 0.3
"""Share of the usual size at least, at which an effect is told from none [1]."""

VISIBLE, VISIBLE_K = 3.0, 0.12
"""Standard deviations of its size, and kelvins, from which on tests could show an effect of the
usual size: fewer kelvins are within what lumping and instruments leave on any bench."""

OF_A_RESISTANCE = ("surface", "cooling", "winding path", EVENT)
"""Families of effects that scale a resistance or lie beside it, which then has no one value."""

SAME_AS_AN_INSTRUMENT = ("loss_gain", "sensor_gain", "copper_coefficient", "winding_resistance")
"""Effects whose amplitude has a prior among the parameters of every network already, or that of a
four-wire measurement."""


@dataclass(frozen=True)
class Sight:
    """What tests show of an effect that the network lacks."""

    candidate: Candidate  # The effect.
    visibility: float  # The usual size over the standard deviation that the tests leave it [1].
    # What an effect of that size leaves when all else is fitted anew, root mean square as
    # `Engine.rms_K` [K].
    visible_K: float
    # Log Bayes factor of a small one over none where no heat is unmodelled, by the linear evidence
    # [nat].
    log_bayes: float

    @property
    def is_visible(self) -> bool:
        """Whether these tests could show the effect at all."""
        return self.visibility >= VISIBLE and self.visible_K >= VISIBLE_K


@dataclass(frozen=True)
class SmallEffects:
    """What a fitted network may lack."""

    p: float  # Bound of the chance that clean tests ask as loudly for any small effect [1].
    log_bayes: tuple[float, ...]  # Log Bayes factor by effect of a small one over none [nat].
    # Small effects with their probabilities, the most probable first.
    effects: tuple[PlausibleEffect, ...]
    # Draws of their sizes, over those of `with_effect` [1]; zero where one is not there.
    size: Float[np.ndarray, "draw effect"]
    # What these sizes do to the fit's parameters: a resistance that an effect scales stands for its
    # mean over the tests [scores], shape (parameter, effect).
    turn: Float[np.ndarray, "parameter effect"]
    sights: tuple[Sight, ...] = ()  # Of all effects that the network lacks, the best first.

    @property
    def is_seen(self) -> bool:
        """Whether the tests show that something is missing."""
        return self.p < CHANCE and len(self.effects) > 0

    @property
    def probability_of_none(self) -> float:
        """Probability that the network with its unmodelled heat lacks no effect of these [1]."""
        return float(np.mean(~np.any(self.size, axis=1)))


@dataclass(frozen=True)
class _Column:
    """What an effect of the usual size does around the fit."""

    candidate: Candidate  # The effect.
    size: float  # At which it was linearised, over the usual one; zero where it has two signs [1].
    per_size: list[float]  # Its slopes by its slots: scores per usual size.
    change: Float[np.ndarray, " block"]  # Of the residuals [K].
    at: Float[np.ndarray, " slot"]  # Scores of its slots there.


def small_effects(
    fit: Fit, kinds: Sequence[type[AbstractEffect]] | None = None
) -> SmallEffects | None:
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
    engine = heated(engine, z)
    search = Search(engine, usable.candidates, tuple(order))
    rows = engine.linearise(z, order)
    alone = Member(
        frozenset(), search.base, z, fit.noise_z, problem.loggers, *rows, fit.log_evidence, 0.0
    )
    linear = Linear(engine, search.own, search.base, alone, {})
    columns = [_column(engine, search, linear, each) for each in usable.candidates]
    bare = search.without_heat(alone)
    sights = _sights(search, linear, bare, columns)
    small = [
        each for each in columns
        if each.candidate.id not in SAME_AS_AN_INSTRUMENT and np.any(each.change)
    ]  # fmt: skip
    return replace(
        _by_evidence(fit, engine, linear, small),
        sights=tuple(sorted(sights, key=lambda each: -each.log_bayes)),
    )


def _column(engine: Engine, search: Search, linear: Linear, candidate: Candidate) -> _Column:
    own = list(search.own[candidate])
    size, per_size = _size(engine, own, linear.at)
    change = linear.shifts[candidate] / size if size else linear.slopes[candidate] @ per_size
    return _Column(candidate, size, per_size, change, linear.at[own])


def _by_evidence(
    fit: Fit, engine: Engine, linear: Linear, columns: Sequence[_Column]
) -> SmallEffects:
    """Return which of the effects a network may lack, by the linear evidence around its fit."""
    alone, num = linear.centre, fit.z.size
    nothing = np.zeros((alone.residual.size, 0))  # where no effect is left to be weighed
    changes = np.column_stack([nothing, *(each.change for each in columns)])
    white = engine.whiten(fit.noise, np.column_stack([alone.jacobian, changes]))
    turn = np.zeros((num, len(columns)))
    for place, each in enumerate(columns):
        scaled = _scaled_resistance(engine, linear.base, each.candidate)
        if scaled is not None:
            by_resistance = white[:, scaled]
            turn[scaled, place] = (
                by_resistance @ white[:, num + place] / (by_resistance @ by_resistance)
            )
    # a resistance at its mean over the tests has taken up what the effect does to that
    around = _Around(
        engine, alone, changes - alone.jacobian @ turn,
        np.array([_has_one_sign(each.candidate) for each in columns], dtype=bool),
    )  # fmt: skip
    log_bayes, noise_z = around.weighed(fit.noise_z)
    size, moved = draw_sizes(around.rows(noise_z), fit.z, around.one_sign, seed=0)
    probability = np.mean(size != 0.0, axis=0)
    unit = np.array([each.size or LEAST for each in columns])
    together = float(np.logaddexp.reduce(log_bayes)) - math.log(max(1, log_bayes.size))
    kept = [int(place) for place in np.argsort(-probability) if probability[place] > 0.0]
    return SmallEffects(
        p=min(1.0, math.exp(-max(together, 0.0))),
        log_bayes=tuple(log_bayes[kept].tolist()),
        effects=tuple(
            _described(engine, linear, columns[place], turn[:, place], probability[place])
            for place in kept
        ),
        size=(size / unit)[:, kept],
        turn=(moved * unit)[:, kept],
    )


@dataclass(frozen=True)
class _Around:
    """The linear model around a fit: the network's parameters, and small effects beside it."""

    engine: Engine  # The tests.
    alone: Member  # The fit.
    changes: Float[np.ndarray, "block effect"]  # By the effects, per usual size [K].
    one_sign: Bool[np.ndarray, " effect"]  # Whether an effect cannot fall below zero.

    @property
    def z(self) -> Float[np.ndarray, " parameter"]:
        """Scores of the fit."""
        return self.alone.z[list(self.alone.free)]

    def rows(
        self, noise_z: np.ndarray, places: Sequence[int] | slice = slice(None)
    ) -> Float[np.ndarray, "row column"]:
        """Return residual, parameters and effects, by default all, whitened under a noise."""
        alone = self.alone
        joined = np.column_stack([alone.residual, alone.jacobian, self.changes[:, places]])
        return self.engine.whiten(from_scores(noise_z), joined)

    def weighed(self, noise_z: np.ndarray) -> tuple[Float[np.ndarray, " effect"], np.ndarray]:
        """Return the log Bayes factor of each small effect over none [nat], and the noise of the
        most probable of these networks.

        What an effect does is unmodelled heat to the network alone. So the best of them are
        weighed with a noise of their own.

        Args:
            noise_z: Noise of the network alone.
        """
        log_bayes = _log_bayes(self.rows(noise_z), self.z, self.one_sign)
        of_none = self._of_none(noise_z)
        best, of_best = -math.log(ODDS), noise_z
        for place in np.argsort(-log_bayes)[:MOST]:
            own = self._own_noise(place, noise_z)
            under_own = _log_bayes(self.rows(own, [place]), self.z, self.one_sign[[place]])
            gained = self._of_none(own) - of_none
            log_bayes[place] = max(log_bayes[place], gained + float(under_own[0]))
            if log_bayes[place] > best:
                best, of_best = log_bayes[place], own
        return log_bayes, of_best

    def _own_noise(self, place: int, start: np.ndarray) -> np.ndarray:
        usual = SCALES[1] * self.changes[:, place]
        columns = np.column_stack([self.alone.jacobian, usual])
        scores = np.append(self.z, 0.0)
        return estimate_noise(
            self.engine.problem, scores, self.alone.residual, columns, start=start
        )

    def _of_none(self, noise_z: np.ndarray) -> float:
        return log_evidence(
            self.engine.problem, noise_z, self.z, self.alone.residual, self.alone.jacobian
        )


def _parts(
    rows: Float[np.ndarray, "row column"],
    scores: Float[np.ndarray, " parameter"],
) -> tuple[
    Float[np.ndarray, "effect effect"],
    Float[np.ndarray, " effect"],
    Float[np.ndarray, "parameter effect"],
]:
    """Integrate the parameters out of a linear model with small effects.

    By a projection: of a large effect that the parameters can mimic, products would leave nothing
    but rounding.

    Returns:
        G, h and B: up to a constant the log density of the residuals given sizes a is h'a - a'Ga/2,
        and the mean of the parameters' scores given them lies B a from that without them.
    """
    num = scores.size
    basis, factor = np.linalg.qr(np.concatenate([rows[:, 1 : 1 + num], np.eye(num)]))
    beside = np.zeros((num, rows.shape[1] - num))
    beside[:, 0] = scores
    others = np.concatenate([rows[:, [0, *range(1 + num, rows.shape[1])]], beside])
    across = basis.T @ others
    left = others - basis @ across
    effects = left[:, 1:]
    moved = -scipy.linalg.solve_triangular(factor, across[:, 1:])
    return effects.T @ effects, -effects.T @ left[:, 0], moved


def _slab(
    linear: Float[np.ndarray, "..."], square: float, *, has_one_sign: bool
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the log Bayes factor of one small effect over none by its scale, and the laws of its
    size: means, shape (..., scale) as before, and standard deviations, shape (scale,).

    Args:
        linear: Slope of the log density of the residuals by the size.
        square: Its curvature, negative.
        has_one_sign: Whether the size cannot fall below zero; its prior is then folded.
    """
    scale = np.array(SCALES)
    precision = square + scale**-2
    mean = np.asarray(linear)[..., None] / precision
    sd = precision**-0.5
    log_bayes = 0.5 * mean**2 * precision + np.log(sd / scale)
    if has_one_sign:
        log_bayes = log_bayes + math.log(2.0) + log_ndtr(mean / sd)
    return log_bayes, mean, sd


def _log_bayes(
    rows: Float[np.ndarray, "row column"],
    scores: Float[np.ndarray, " parameter"],
    one_sign: Bool[np.ndarray, " effect"],
) -> Float[np.ndarray, " effect"]:
    """Return the log Bayes factor of each small effect over none, no other being there [nat]."""
    gram, slope, _ = _parts(rows, scores)
    by_scale = [
        _slab(slope[k], float(gram[k, k]), has_one_sign=bool(one_sign[k]))[0]
        for k in range(slope.size)
    ]
    return np.array([np.logaddexp.reduce(each) - math.log(len(SCALES)) for each in by_scale])


def draw_sizes(
    rows: Float[np.ndarray, "row column"],
    scores: Float[np.ndarray, " parameter"],
    one_sign: Bool[np.ndarray, " effect"],
    *,
    least_of_none: float = LEAST_OF_NONE,
    seed: int = 0,
) -> tuple[Float[np.ndarray, "draw effect"], Float[np.ndarray, "parameter effect"]]:
    """Draw which small effects are there and how large they are, given the tests.

    Args:
        rows: Whitened: the residual, its derivatives by scores, and those by the effects' sizes,
            in units of the usual ones.
        scores: At which these stand; their prior is standard normal.
        one_sign: Whether a size cannot fall below zero.
        least_of_none: Share of draws without any at least.
        seed: Random seed.

    Returns:
        Sizes over the usual ones, zero where an effect is not there, and the shift of the scores
        per size.
    """
    gram, slope, moved = _parts(rows, scores)
    rng = np.random.default_rng([seed, 29])
    size, kept = np.zeros((NUM_CHAINS, slope.size)), []
    rows = np.arange(NUM_CHAINS)
    log_odds = math.log(ODDS / len(SCALES))
    for sweep in range(NUM_SWEEPS + NUM_KEPT - 1):
        for k in rng.permutation(slope.size):
            others = slope[k] - size @ gram[:, k] + size[:, k] * gram[k, k]
            log_bayes, mean, sd = _slab(others, float(gram[k, k]), has_one_sign=bool(one_sign[k]))
            weight = np.concatenate([np.zeros((NUM_CHAINS, 1)), log_bayes + log_odds], axis=1)
            weight = np.exp(weight - weight.max(axis=1, keepdims=True))
            total = np.cumsum(weight, axis=1)
            chosen = np.sum(rng.random((NUM_CHAINS, 1)) * total[:, -1:] > total, axis=1)
            scale = np.maximum(chosen - 1, 0)
            at, width = mean[rows, scale], sd[scale]
            if one_sign[k]:
                below = ndtr(-at / width)
                share = below + (1.0 - below) * rng.random(NUM_CHAINS)
                drawn = np.maximum(at + width * ndtri(np.clip(share, 1e-12, 1.0 - 1e-12)), 0.0)
            else:
                drawn = at + width * rng.standard_normal(NUM_CHAINS)
            size[:, k] = np.where(chosen > 0, drawn, 0.0)
        if sweep >= NUM_SWEEPS - 1:
            kept.append(size.copy())
    size = np.concatenate(kept)
    there = np.flatnonzero(np.any(size, axis=1))
    beyond = there.size - math.floor((1.0 - least_of_none) * size.shape[0])
    size[rng.permutation(there)[: max(0, beyond)]] = 0.0
    return size, moved


def _sights(search: Search, linear: Linear, bare: Refit, columns: Sequence[_Column]) -> list[Sight]:
    """Return what tests show of effects, by the linear evidence around the network alone.

    Args:
        search: The network without effects, and the means to add one.
        linear: What effects do around it.
        bare: It fitted without unmodelled heat, which takes up what is slow.
        columns: The effects.
    """
    engine = search.engine.with_heat(no_heat(search.engine.problem))
    places, sizes = [], []
    for column in columns:
        own = list(search.own[column.candidate])
        usual = linear.centre.z.copy()
        usual[own] = 0.0
        places.append((usual, own))
        sizes.append(_size(engine, own, usual))
    scores = bare.z[list(bare.free)]
    sights = []
    for column, (size, per_size), (residual, slopes) in zip(
        columns, sizes, engine.linearise_many(places), strict=True
    ):
        at_usual = (residual - linear.centre.residual) / size if size else slopes @ per_size
        joined = np.column_stack([bare.residual, bare.jacobian, column.change, at_usual])
        rows = engine.whiten(bare.noise, joined)
        one_sign = np.array([_has_one_sign(column.candidate)])
        square, _, mimicked = _parts(np.delete(rows, -2, axis=1), scores)
        sights.append(
            Sight(
                column.candidate,
                visibility=math.sqrt(square[0, 0]),
                visible_K=engine.rms_K(at_usual + bare.jacobian @ mimicked[:, 0]),
                log_bayes=float(_log_bayes(rows[:, :-1], scores, one_sign)[0]),
            )
        )
    return sights


def _described(
    engine: Engine,
    linear: Linear,
    column: _Column,
    turn: Float[np.ndarray, " parameter"],
    probability: float,
) -> PlausibleEffect:
    """Return an effect as it stands beside the network, at the size that its column is of."""
    candidate = column.candidate
    own = [slot for slot in linear.own[candidate]]
    without, with_effect = linear.centre.z.copy(), linear.centre.z.copy()
    without[own], with_effect[own] = np.nan, column.at
    unit = column.size or LEAST
    if not column.size:
        with_effect[own] += unit * np.array(column.per_size)
    # in the draws the resistance is what it is on the mean of the tests with the effect
    with_effect[list(linear.base)] -= unit * turn
    shared = [
        slot for slot in (*linear.base, *own)
        if slot in own or engine.slots[slot].test is None
    ]  # fmt: skip
    return PlausibleEffect(
        kind=candidate.kind,
        test=candidate.test_name(engine.tests),
        probability=probability,
        with_effect=_values(engine, with_effect, shared),
        without=_values(engine, without, shared),
    )


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
    if link is None and kind.card.family == EVENT:
        return None
    if link is None:  # the surface of the machine
        link = next(ends for ends in network.links if network.boundary in ends)
    names = [parameter.name for ends, parameter in model.form.resistance if ends == link]
    for place, slot in enumerate(base):
        if engine.slots[slot].parameter.name in names:
            return place
    return None


def missing_finding(fit: Fit, found: SmallEffects) -> Finding | None:
    """Return the finding that a network may lack a small effect; None if the tests show none.

    What the tests ask for is in the network by now (`effects.found`). They do not decide whether
    what is left is there: the intervals allow for both.
    """
    if not found.is_seen:
        return None
    named = [each for each in found.effects if each.probability >= NAMED] or found.effects[:1]
    moves = _moves(fit, found)
    listed = ", ".join(_words(each) for each in named)
    return Finding(
        id="missing_effect",
        severity="note",
        message=f"the residuals of the {fit.problem.model.words} hold more than noise (p < "
        f"{found.p:.2g}, the share of clean records that would look so), too little for a name. "
        f"The 95 % intervals allow for {listed}. {_moved(moves)}",
        where=fit.problem.label,
        remedy="Where the cause is known, name it with --with.",
        values={
            "familywise_p": found.p,
            "log_bayes_factor": max(found.log_bayes),
            "probability_of_none": found.probability_of_none,
            **{f"change_of_{n}": change for n, (change, _) in moves.items()},
        },
    )


def _words(effect: PlausibleEffect) -> str:
    """Return an effect with its probability, as printed."""
    place = "" if effect.test is None else f" in {effect.test}"
    return f"{effect.id}{place} ({100.0 * effect.probability:.0f} %)"


def _moves(fit: Fit, found: SmallEffects) -> dict[str, tuple[float, float]]:
    """Return where the small effects put the network's parameters, against the network alone.

    Returns:
        By name: relative change [1], and the same in standard deviations of the fit [1].
    """
    there = found.size[np.any(found.size, axis=1)]
    moved = fit.z + found.turn @ there.mean(axis=0)
    result = {}
    for place, slot in enumerate(fit.slots):
        parameter = slot.parameter
        if parameter.role == "network":
            before, after = (float(parameter.value(np.float64(z[place]))) for z in (fit.z, moved))
            sd = float(np.sqrt(fit.covariance[place, place]))
            result[slot.name] = (after / before - 1.0, float(moved[place] - fit.z[place]) / sd)
    return result


def _moved(moves: Mapping[str, tuple[float, float]]) -> str:
    told = ", ".join(
        f"{name} {100.0 * abs(change):.2g} % {'higher' if change > 0 else 'lower'}"
        for name, (change, in_sds) in moves.items()
        if abs(in_sds) > MOVED
    )
    if not told:
        return (
            "With them, no parameter of the network would move by more than its standard deviation."
        )
    return f"With them, on the mean: {told}."


def averaged(posterior: Posterior, found: SmallEffects, *, seed: int = 0) -> Posterior:
    """Return the posterior with small effects behind a part of its draws.

    Around the fit the parameters given the sizes lie a shift away from those without, so each draw
    moves by that of the effects behind it. One that would leave a node too fast for the steps of
    the tests, or a share above one, stays as it was.

    Args:
        posterior: Of the network alone.
        found: What the network may lack.
        seed: Random seed.
    """
    rng = np.random.default_rng([seed, 29])
    vectors = posterior.flat.copy()
    size = found.size[rng.integers(found.size.shape[0], size=vectors.shape[0])]
    z = vectors[:, : found.turn.shape[0]] + size @ found.turn.T
    is_none = is_too_stiff(posterior, z) | np.any(z > posterior.fit.problem.data.priors.largest, 1)
    size = np.where(is_none[:, None], 0.0, size)
    vectors[:, : found.turn.shape[0]] += size @ found.turn.T
    effects = PlausibleEffects(found.effects, size)
    density = np.where(effects.is_none, posterior.log_density.reshape(-1), np.nan)  # another model
    return replace(
        posterior,
        vectors=vectors.reshape(posterior.vectors.shape),
        log_density=density.reshape(posterior.log_density.shape),
        plausible=effects,
        alone=posterior,
    )


def is_too_stiff(posterior: Posterior, z: np.ndarray) -> np.ndarray:
    """Return which networks have a node that is too fast for the steps of the tests."""
    problem = posterior.fit.problem
    form, priors = problem.parameters.form, problem.parameters.priors()
    of_each = [
        too_stiff(problem.model, priors.values(form, z.T, index), float(np.max(test.inputs.step)))
        for index, test in enumerate(problem.tests)
    ]
    return np.any(of_each, axis=0)
