"""Draws of parameters and noise, and what a model says of a test for many of them.

In a draw with effects that the network may miss, the network's parameters are where these put them,
and a prediction needs the effects' shares: the difference that each makes at the most probable
parameters, scaled with its size in the draw. They are small, and add up.

What it says, its courses, are readings, node temperatures and heat flows, simulated side by side.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from lptn import Inputs, Trace
from lptn.effects import AbstractEffect

from ..io.programs import compiled
from ..record.blocks import Blocks
from ..record.motor import Motor
from ..record.observation import Observation
from . import noise as noise_module
from .catalogue import lacking
from .model import Model
from .model_parameters import parameters
from .noise import Loggers, Noise
from .parameters import ParameterSet
from .problem import NUM_NOISE


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of parameters and noise with all that gives them a meaning."""

    model: Model  # Network with effects and nuisances.
    motor: Motor  # The machine.
    # What stands in which place of a vector, with priors and fixed values.
    parameters: ParameterSet
    vectors: Float[np.ndarray, "draw all"]  # Scores of parameters and noise, shape (draw, all).
    # Effects behind the draws; None where all are of the model alone.
    plausible: PlausibleEffects | None = None
    loggers: Loggers = field(default_factory=dict)  # Noise of each logger.

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
    """An effect that the network may miss."""

    kind: type[AbstractEffect]  # The effect.
    test: str | None  # Name of the test that it happens in; None if it acts in all of them.
    probability: float  # That it is missing [1].
    # Parameters of network and effect that all tests share, by name [their units].
    with_effect: Mapping[str, float]
    # Those of the network alone that it is told from. A resistance that the effect acts on stands
    # there for its mean over the tests, as in the draws.
    without: Mapping[str, float]

    @property
    def id(self) -> str:
        """Id of the effect."""
        return self.kind.card.id


@dataclass(frozen=True, eq=False)
class PlausibleEffects:
    """The effects behind some draws."""

    effects: tuple[PlausibleEffect, ...]  # By probability, the most probable first.
    # Amplitude of each effect over that of `with_effect` [1], zero where it is not there, shape
    # (draw, effect).
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
        # all that the test allows: another test takes the same program
        kinds = [each.kind for each in self.effects if not lacking(each.kind, test)]
        shift = _differences(model, motor, test, [self.effects[index] for index in used], kinds)
        # of an effect with which the machine runs away in this test, no more is known
        holds = np.all(np.abs(shift.reading) < 0.5 * ABSURD, axis=1)
        shift = jax.tree.map(lambda rows: rows[holds], shift)
        size = self.size[:, used][:, holds]

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
    """Return the draws of the network alone, whose middle is what is stated; all where there are
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
    model: Model,
    motor: Motor,
    test: Blocks,
    effects: Sequence[PlausibleEffect],
    kinds: Sequence[type[AbstractEffect]],
) -> Courses:
    """Return what each effect adds at the parameters that it was found with, one row for each.

    Args:
        model: The network alone.
        motor: The machine.
        test: A reduced record.
        effects: The effects.
        kinds: What the network is extended by: theirs, and others that do nothing here.
    """
    extended = model.extended(kinds)
    known = parameters(extended, motor, [test], searched=kinds).by_test[0]
    rows = []
    for effect in effects:
        for values in (effect.with_effect, effect.without):
            rows.append({
                name: values.get(name, p.centre if p.fixed is None else p.fixed)
                for name, p in known.items()
            })  # fmt: skip
    stacked = {name: np.array([row[name] for row in rows]) for name in rows[0]}
    means = courses(extended, stacked, test)
    return jax.tree.map(lambda each: each[0::2] - each[1::2], means)


ABSURD = 1e9
"""No reading and no error over its noise is larger [K or 1]: the march has left the numbers."""

AT_A_TIME, OF_LONG = 50, 10
"""Draws that are simulated side by side, and those of a long test; there are as many, or a multiple
of them."""

LONG = 20_000
"""Steps from which on a test is long: more lanes of it take hundreds of megabytes [1]."""


def side_by_side(tests: Iterable[Observation], usual: int, of_long: int) -> int:
    """Return how many lanes of tests are worked out side by side: few where one is long."""
    return of_long if any(test.weight.size >= LONG for test in tests) else usual


class Courses(NamedTuple):
    """Means over the blocks of a test, draw by draw."""

    reading: Any  # Of the winding, then of each fitted body, in a row [degC], shape (draw, row).
    nodes: dict[str, Any]  # Temperature of each node [degC], shape (draw, block) each.
    flows: dict[tuple[str, str], Any]  # Heat flow by link [W], shape (draw, block) each.


def courses(
    model: Model, values: Mapping[str, Float[np.ndarray, " draw"]], test: Blocks
) -> Courses:
    """Return what a model says of a test.

    Args:
        model: Network with effects.
        values: Draws by parameter name [their units].
        test: A reduced record.
    """
    num = len(next(iter(values.values())))
    whole = {name: np.pad(draws, (0, -num % AT_A_TIME), mode="edge")
             for name, draws in values.items()}  # fmt: skip
    padded = test.observation().padded(is_seldom=True).simulated()
    found = jax.tree.map(lambda rows: np.asarray(rows)[:num], _courses(model, whole, padded))
    of_each = jax.tree.map(lambda rows: test.winding.own(rows, axis=1), found._replace(reading=()))
    # beyond the numbers, how far says nothing, and its square is none
    reading = np.clip(found.reading, -ABSURD, ABSURD)
    return of_each._replace(reading=test.own(reading, axis=1))


@compiled("model")
def block_means(
    model: Model, values: Mapping[str, Float[Any, ""]], test: Observation
) -> Float[Array, " row"]:
    """Return the modelled means over the blocks of a test [degC], as `Model.block_means`."""
    return model.block_means(values, test)


@compiled("model")
def simulated(model: Model, values: Mapping[str, Float[Any, ""]], inputs: Inputs) -> Trace:
    """Return temperatures, reading, flows and losses at full detail, as `Model.simulate`."""
    return model.simulate(values, inputs)


@compiled("model")
def _courses(model: Model, values: dict[str, Float[Array, " draw"]], test: Observation) -> Courses:
    num_steps = test.weight.shape[1]

    def means(course):
        return course.reshape(-1, num_steps).mean(axis=1)

    def one(values):
        trace = model.simulate(values, test.inputs)
        return Courses(
            reading=model.block_means(values, test),
            nodes={n: means(0.5 * (T[1:] + T[:-1])) for n, T in trace.temperature.items()},
            flows={n: means(P) for n, P in trace.flow.items()},
        )

    return jax.lax.map(one, values, batch_size=side_by_side((test,), AT_A_TIME, OF_LONG))
