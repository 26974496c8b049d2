"""The posterior of a fit by MCMC (emcee) or, where its diagnostics allow, importance sampling.

What a fit leaves of parameters and noise: draws, enough to predict any test with.

Effects that a network may miss, none or some in each draw: what they add to the readings.

In a draw with effects the network's parameters are where these put them, and a prediction needs
their shares: the difference that each effect makes at the most probable parameters, scaled with
its size in the draw. They are small, and add up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import jax
import numpy as np
from jaxtyping import Bool, Float, Int

from lptn.effects import AbstractEffect

from ..bench.blocks import Blocks
from ..motor import Motor
from . import noise as noise_module
from .catalogue import lacking
from .courses import Courses, courses
from .fitting.fit_result import Fit
from .kernels import at_once
from .loggers import Loggers
from .model import Model
from .model_parameters import parameters
from .noise import Noise
from .parameters import ParameterSet
from .problem import NUM_NOISE
from .sampling.convergence import FULL, QUICK, Convergence, judge
from .sampling.importance import importance_sample, starting_sample
from .sampling.weighted import LEAST_EFFECTIVE, PARETO_LIMIT, Weighted, spread


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of parameters and noise with all that gives them a meaning.

    Attributes:
        model: Network with effects and nuisances.
        motor: The machine.
        parameters: What stands in which place of a vector, with priors and fixed values.
        vectors: Scores of parameters and noise, shape (draw, all).
        plausible: Effects behind the draws; None where all are of the model alone.
        loggers: Noise of each logger.
    """

    model: Model
    motor: Motor
    parameters: ParameterSet
    vectors: Float[np.ndarray, "draw all"]
    plausible: PlausibleEffects | None = None
    loggers: Loggers = field(default_factory=dict)

    def thin(self, num: int, seed: int = 0) -> Draws:
        """Return `num` of the draws, picked evenly at random without repetition."""
        picked = np.random.default_rng(seed).permutation(self.vectors.shape[0])[:num]
        plausible = None if self.plausible is None else self.plausible.pick(picked)
        return replace(self, vectors=self.vectors[picked], plausible=plausible)

    def values(self) -> dict[str, np.ndarray]:
        """Return the draws of the free parameters by slot name [their units], shape (draw,)."""
        return self.parameters.physical(self.vectors[:, : self.parameters.num_free])

    def of_test(self, test: str | None) -> dict[str, np.ndarray]:
        """Return the draws that hold for a test by bare name [their units], shape (draw,).

        Args:
            test: Name of a test that was fitted; None for any other test, which takes over
                what all tests share.
        """
        index = None if test is None else self.parameters.tests.index(test)
        size = self.vectors.shape[0]
        result = {}
        for name, parameter in self.parameters.by_test[index or 0].items():
            if parameter.fixed is not None and (index is not None or not parameter.per_test):
                result[name] = np.full(size, parameter.fixed)
        values = self.values()
        for slot in self.parameters.slots:
            if slot.test is None or slot.test == index:
                result[slot.parameter.name] = values[slot.name]
        return result

    def noise(self) -> Noise:
        """Return the noise of the first logger for each draw, shape (draw,) each."""
        return noise_module.from_scores(self.vectors[:, -NUM_NOISE:].T)


Link = tuple[str, str]


@dataclass(frozen=True)
class PlausibleEffect:
    """An effect that the network may miss.

    Attributes:
        kind: The effect.
        test: Name of the test that it happens in; None if it acts in all of them.
        probability: That it is missing [1].
        with_effect: Parameters of network and effect that all tests share, by name [their units].
        without: Those of the network alone that it is told from. A resistance that the effect acts
            on stands there for its mean over the tests, as in the draws.
    """

    kind: type[AbstractEffect]
    test: str | None
    probability: float
    with_effect: Mapping[str, float]
    without: Mapping[str, float]

    @property
    def id(self) -> str:
        """Id of the effect."""
        return self.kind.card.id


@dataclass(frozen=True, eq=False)
class PlausibleEffects:
    """The effects behind some draws.

    Attributes:
        effects: By probability, the most probable first.
        size: Amplitude of each effect over that of `with_effect` [1], zero where it is not there,
            shape (draw, effect).
    """

    effects: tuple[PlausibleEffect, ...]
    size: Float[np.ndarray, "draw effect"]

    @property
    def is_none(self) -> Bool[np.ndarray, " draw"]:
        """Which draws are of the network alone."""
        return ~np.any(self.size, axis=1)

    def pick(self, rows: Int[np.ndarray, " row"]) -> PlausibleEffects:
        """Return those of some draws."""
        return replace(self, size=self.size[rows])

    def with_effects(
        self, course: Courses, model: Model, motor: Motor, test: Blocks, fitted_as: str | None
    ) -> Courses:
        """Return what a test is with the effects: readings, nodes and flows.

        An event of one test adds nothing to another, nor does an effect whose channel is lacking.

        Args:
            course: What the network alone says of the draws.
            model: The network alone.
            motor: The machine.
            test: A reduced record, with the rows that `course` has.
            fitted_as: Name of the fitted test that it is, None if it was not fitted.
        """
        used = [
            index
            for index, each in enumerate(self.effects)
            if np.any(self.size[:, index])
            and each.test in (None, fitted_as)
            and not lacking(each.kind, test)
        ]
        if not used:
            return course
        shift = _differences(model, motor, test, [self.effects[index] for index in used])
        size = self.size[:, used]

        def added(draws: np.ndarray, by_effect: np.ndarray) -> np.ndarray:
            return draws + size @ by_effect

        return Courses(
            reading=added(course.reading, shift.reading),
            nodes={node: added(T, shift.nodes[node]) for node, T in course.nodes.items()},
            flows={
                link: added(P, shift.flows[_way(link, shift.flows, course.nodes)])
                for link, P in course.flows.items()
            },
        )


def of_network(
    plausible: PlausibleEffects | None, draws: Float[np.ndarray, "draw ..."]
) -> Float[np.ndarray, "picked ..."]:
    """Return the draws of the network alone, whose median is what is stated; all where there are
    none such.

    A draw with an effect beside the network has parameters that say little without it.

    Args:
        plausible: Effects behind the draws; None for none.
        draws: Anything that hangs on them, one row for each.
    """
    alone = None if plausible is None else plausible.is_none
    return draws if alone is None or not np.any(alone) else draws[alone]


def _way(link: Link, links: Collection[Link], nodes: Collection[str]) -> Link:
    """Return the link by which the heat of a link leaves its first node.

    That is the link itself, unless the body of an effect stands in it.

    Args:
        link: Of the network alone.
        links: Of the network with effects.
        nodes: Of the network alone.
    """
    if link in links:
        return link
    near, far = link

    def leads(node: str, seen: frozenset[str]) -> bool:
        ends = {b if a == node else a for a, b in links if node in (a, b)} - seen
        return far in ends or any(leads(n, seen | {n}) for n in ends if n not in nodes)

    return next(
        (near, body)
        for start, body in links
        if start == near and body not in nodes and leads(body, frozenset({near, body}))
    )


def _differences(
    model: Model, motor: Motor, test: Blocks, effects: Sequence[PlausibleEffect]
) -> Courses:
    """Return what each effect adds at the parameters that it was found with, one row for each."""
    kinds = tuple(dict.fromkeys(effect.kind for effect in effects))
    extended = replace(model, effects=(*model.effects, *kinds))
    known = parameters(extended, motor, [test], searched=kinds).by_test[0]
    rows = []
    for effect in effects:
        for values in (effect.with_effect, effect.without):
            rows.append({
                name: values.get(name, p.centre if p.fixed is None else p.fixed)
                for name, p in known.items()
            })  # fmt: skip
    stacked = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    means = courses(extended, stacked, test.observation())
    return jax.tree.map(lambda each: each[0::2] - each[1::2], means)


NUM_ENSEMBLES = 2
"""Ensembles that run apart, so that they can be held against each other."""

CHUNK = 250
"""Steps between two checkpoints, and between two looks at the convergence at first."""

LOOK_AGAIN = 0.1
"""Growth of the ensembles between two looks [1]: a look takes the longer the more steps it sees."""

BURN_IN = 0.2
"""Share of the steps that is dropped: the walkers start from importance samples."""

MOST_STEPS = 24_000
"""Steps of an ensemble after which it is given up, with a verdict that says so. After half of them
it is, where the autocorrelation time says that the other half would not do."""

NUM_KEPT = 4000
"""Draws kept of the posterior."""

Method = Literal["emcee", "importance", "normal"]
Progress = Callable[[str, float], None]


@dataclass(frozen=True)
class Posterior:
    """Draws from the posterior of a fit.

    Attributes:
        fit: What was sampled.
        vectors: Scores of parameters and noise, shape (chain, draw, all); a chain is one of the
            ensembles, thinned, one walker after the other.
        log_density: Unnormalised log posterior, shape (chain, draw).
        method: How they were drawn.
        weighted: The importance samples that came first; None for draws of a normal law.
        convergence: Verdict on the ensembles; None for importance sampling.
        was_to_be_quick: Whether the ensembles stand in for importance samples that could not be
            trusted.
        plausible: Effects behind the draws, where these are averaged over models with one; None
            where all draws are of the network alone.
        alone: The posterior before it was averaged; None where it was not.
    """

    fit: Fit
    vectors: Float[np.ndarray, "chain draw all"]
    log_density: Float[np.ndarray, "chain draw"]
    method: Method
    weighted: Weighted | None
    convergence: Convergence | None
    was_to_be_quick: bool = False
    plausible: PlausibleEffects | None = None
    alone: Posterior | None = None

    @property
    def flat(self) -> Float[np.ndarray, "draw all"]:
        """All draws in a row."""
        return self.vectors.reshape(-1, self.vectors.shape[-1])

    @property
    def is_sound(self) -> bool:
        """Whether the draws can be trusted."""
        if self.convergence is not None:
            return self.convergence.is_enough
        return self.weighted is not None and self.weighted.is_sound

    def sentence(self) -> str:
        """Return the verdict in words."""
        if self.weighted is None:
            return (
                "Drawn from the normal law around the fit, for sampling failed: the intervals are "
                "indicative."
            )
        figures = (
            f"Pareto k {self.weighted.pareto_k:.2f}, limit {PARETO_LIMIT:g}; effective sample size "
            f"{self.weighted.effective_size:.0f}, at least {LEAST_EFFECTIVE:g}"
        )
        if self.convergence is not None:
            why = (
                " With `--quick`, MCMC took the place of importance sampling, which is faster and "
                f"not reliable for these tests ({figures})."
            )
            return self.convergence.sentence() + (why if self.was_to_be_quick else "")
        if self.weighted.is_sound:
            return f"Importance sampling is reliable ({figures})."
        return f"Importance sampling is not reliable ({figures}): the intervals are indicative."

    @property
    def draws(self) -> Draws:
        """The draws with what gives them a meaning: enough to predict any test."""
        problem = self.fit.problem
        return Draws(
            problem.model,
            problem.motor,
            problem.parameters,
            self.flat,
            self.plausible,
            problem.loggers,
        )

    def thin(self, num: int, seed: int = 0) -> Float[np.ndarray, "draw all"]:
        """Return `num` of the draws, picked evenly at random without repetition."""
        flat = self.flat
        picked = np.random.default_rng(seed).permutation(flat.shape[0])[:num]
        return flat[picked]

    def values(self) -> dict[str, np.ndarray]:
        """Return the draws by slot name in physical units, each of shape (chain, draw)."""
        parameters = self.fit.problem.parameters
        return parameters.physical(self.vectors[..., : self.fit.problem.num_parameters])


def sample(
    fit: Fit,
    *,
    method: Literal["emcee", "quick"] = "emcee",
    seed: int = 0,
    folder: Path | None = None,
    progress: Progress | None = None,
    most_steps: int = MOST_STEPS,
) -> Posterior:
    """Sample the posterior around a fit.

    Args:
        fit: The fit.
        method: `"emcee"`: MCMC; `"quick"`: importance sampling if it is sound, else MCMC of half
            the effective sample size.
        seed: Random seed.
        folder: Where checkpoints are written and taken up again; None for none.
        progress: Called with a sentence and the share done.
        most_steps: Steps of an ensemble after which it is given up; after half of them where all
            would not do.
    """
    is_quick = method == "quick"
    weighted = (importance_sample if is_quick else starting_sample)(fit, seed=seed)
    if is_quick and weighted.is_sound:
        return _of_weighted(fit, weighted, seed)
    wanted = QUICK if is_quick else FULL
    instead = "importance sampling is not reliable here, MCMC instead: " if is_quick else ""

    from .sampling.ensemble import Ensemble

    size = fit.vector.size
    num_walkers = max(64, 2 * (2 * size // 2 + 1))
    ensembles = [
        Ensemble.begin(fit, weighted, num_walkers, index, seed, folder)
        for index in range(NUM_ENSEMBLES)
    ]
    num_steps = 0
    while True:
        chunks = max(1, int(LOOK_AGAIN * num_steps / CHUNK))
        at_once(lambda ensemble, num=chunks: ensemble.advance(CHUNK, num), ensembles)
        num_steps = ensembles[0].num_steps
        drop = int(BURN_IN * num_steps)
        chains = np.stack([ensemble.chain()[drop:] for ensemble in ensembles])
        convergence = judge(chains, wanted)
        if (convergence.is_enough and num_steps >= 2 * CHUNK) or num_steps >= most_steps:
            break
        if progress is not None:
            # until it is enough there is one look more at least, whatever lacks
            times = max(convergence.times_as_long, 1.0 + LOOK_AGAIN)
            steps = max(times * num_steps, 2 * CHUNK)
            steps = CHUNK * math.ceil(steps / CHUNK) if steps < most_steps else most_steps
            progress(f"{instead}{num_steps} of about {steps} steps", num_steps / steps)
        least_steps = wanted.times * convergence.autocorrelation / (1.0 - BURN_IN)
        if num_steps >= most_steps // 2 and least_steps > most_steps:
            break
    density = np.stack([ensemble.density()[drop:] for ensemble in ensembles])
    return Posterior(fit, keep(chains), keep(density), "emcee", weighted, convergence, is_quick)


def keep(draws: Float[np.ndarray, "ensemble step walker ..."]) -> np.ndarray:
    """Return about `NUM_KEPT` draws, shape (ensemble, draw, ...): whole steps, walker by walker.

    Every n-th of all draws in a row would be the same few walkers wherever n and their number
    share a divisor. One walker after the other, so that whoever looks for the autocorrelation of
    the rows finds it.
    """
    every = max(1, draws.shape[0] * draws.shape[1] * draws.shape[2] // NUM_KEPT)
    by_walker = np.swapaxes(draws[:, ::every], 1, 2)
    return by_walker.reshape(draws.shape[0], -1, *draws.shape[3:])


def normal_draws(fit: Fit, *, seed: int = 0) -> Posterior:
    """Return draws of the normal law around a fit, for where nothing better could be had.

    They are not held against the posterior: `Posterior.is_sound` is false.
    """
    rng = np.random.default_rng([seed, 2])
    values, axes = np.linalg.eigh(0.5 * (fit.covariance + fit.covariance.T))
    spread = axes * np.sqrt(np.maximum(values, 0.0))
    vectors = fit.vector + rng.standard_normal((NUM_KEPT, fit.vector.size)) @ spread.T
    return Posterior(fit, vectors[None], np.full((1, NUM_KEPT), np.nan), "normal", None, None)


def weighted_draws(fit: Fit, *, seed: int = 0) -> Posterior:
    """Return importance samples of a fit, reliable or not; `Posterior.is_sound` tells."""
    return _of_weighted(fit, importance_sample(fit, seed=seed), seed)


def _of_weighted(fit: Fit, weighted: Weighted, seed: int) -> Posterior:
    vectors, density = spread(fit, weighted, NUM_KEPT, np.random.default_rng([seed, 1]))
    return Posterior(fit, vectors[None], density[None], "importance", weighted, None)
