"""A model set against records: predictions, whitened residuals and log density in one place.

Least squares, importance sampling and emcee all read their numbers here, so they cannot
disagree about what is being estimated. What is compiled depends on the form of a problem alone;
its numbers are arguments, so a second record of the same shape compiles nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from lptn.effects import AbstractEffect

from ..io.programs import compiled
from ..record.blocks import Blocks
from ..record.motor import Motor
from ..record.observation import Observation
from . import noise as noise_module
from .model import Model
from .model_parameters import parameters
from .noise import Loggers, Noise, scales_of
from .parameters import Form, ParameterSet


class Priors(eqx.Module):
    """The numbers of a parameter set."""

    centre: Float[Any, " parameter"]  # Centre of each slot's prior [its unit], shape (parameter,).
    # Its standard deviation, of the logarithm [1] or [its unit], shape (parameter,).
    sd: Float[Any, " parameter"]
    # Largest score of each slot, shape (parameter,): a share is one at most.
    largest: Float[Any, " parameter"]
    fixed: tuple[dict[str, Float[Any, ""]], ...]  # Fixed values by name, for each test.

    def values(
        self, form: Form, z: Float[Any, " parameter ..."], test: int
    ) -> dict[str, Float[Any, "..."]]:
        """Return the values of all parameters for one test [their units].

        Args:
            form: What stands in which slot.
            z: Scores, of JAX or of NumPy.
            test: Index of the test.
        """
        exp = np.exp if isinstance(z, np.ndarray) else jnp.exp  # eager JAX would compile it
        result = dict(self.fixed[test])
        for position, (name, transform, owner) in enumerate(form):
            if owner is None or owner == test:
                shift = self.sd[position] * z[position]
                centre = self.centre[position]
                result[name] = centre * exp(shift) if transform == "log" else centre + shift
        return result

    @classmethod
    def of(cls, parameters: ParameterSet) -> Priors:
        """Return centres, standard deviations, and fixed values of a parameter set."""
        return cls(
            centre=np.asarray([slot.parameter.centre for slot in parameters.slots]),
            sd=np.asarray([slot.parameter.sd for slot in parameters.slots]),
            largest=np.asarray([slot.parameter.largest_score for slot in parameters.slots]),
            fixed=tuple(
                {
                    name: np.asarray(parameter.fixed, dtype=float)
                    for name, parameter in of_test.items()
                    if parameter.fixed is not None
                }
                for of_test in parameters.by_test
            ),
        )


NUM_NOISE = len(noise_module.NOISE)

WIDTH = 4
"""Directions are marched in full vector registers: 23 of them take longer than 24, 9 than 12."""

WORST_RESIDUAL = 1e6
"""A residual that is not finite [K], from a network too stiff for the step: out of reach of any
real one, so that a solver turns back."""


@dataclass(frozen=True)
class Structure:
    """What is compiled: the model and what stands in which slot. Hashable."""

    model: Model
    form: Form

    @property
    def num_parameters(self) -> int:
        """Number of free parameters without the noise."""
        return len(self.form)


class Data(eqx.Module):
    """The numbers of a problem: a pytree."""

    priors: Priors  # Centres, standard deviations, fixed values.
    tests: tuple[Observation, ...]  # The reduced records.


@dataclass(frozen=True, eq=False)
class Problem:
    """A model and the tests it is to explain."""

    model: Model  # Network with nuisances.
    motor: Motor  # What the motor file says.
    tests: tuple[Blocks, ...]  # The reduced records.
    parameters: ParameterSet  # The model's parameters over these tests.
    # What unmodelled heat does to each test, as `Observation.heat`; None leaves it out.
    heat: tuple[Float[np.ndarray, "block column"], ...] | None = None
    loggers: Loggers = field(default_factory=dict)  # Noise of each logger.

    @classmethod
    def of(
        cls,
        model: Model,
        motor: Motor,
        tests: Sequence[Blocks],
        searched: Sequence[type[AbstractEffect]] = (),
    ) -> Problem:
        """Return the problem of a model over tests.

        Args:
            model: Network with effects.
            motor: The machine.
            tests: The reduced records.
            searched: Effects of the model that may be absent, as `parameters`.

        Raises:
            InputError: If a parameter is needed and not given.
        """
        return cls(model, motor, tuple(tests), parameters(model, motor, tests, searched))

    @property
    def num_parameters(self) -> int:
        """Number of free parameters without the noise."""
        return self.parameters.num_free

    @cached_property
    def structure(self) -> Structure:
        """What is compiled."""
        return Structure(self.model, self.parameters.form)

    @cached_property
    def data(self) -> Data:
        """The numbers; their tests have rows beyond those of `tests`, as `lengthened`."""
        heat = self.heat or (None,) * len(self.tests)
        return Data(
            priors=self.parameters.priors(),
            tests=tuple(
                test.observation(of_test, scales_of(self.loggers, test)).padded()
                for test, of_test in zip(self.tests, heat, strict=True)
            ),
        )

    @cached_property
    def readings(self) -> tuple[Observation, ...]:
        """What the noise needs of the tests of `data`."""
        return tuple(test.compared() for test in self.data.tests)

    @property
    def is_observed(self) -> np.ndarray:
        """Which blocks hold a reading, all tests in a row."""
        return np.concatenate([test.is_observed for test in self.tests])

    def rmse_K(self, residual: Float[np.ndarray, " row"]) -> float:
        """Return the root mean square of residuals where there is a reading [K].

        Args:
            residual: Of all rows, all tests in a row [K].
        """
        return float(np.sqrt(np.mean(residual[self.is_observed] ** 2)))

    @property
    def label(self) -> str:
        """Names of the tests, for messages."""
        return ", ".join(test.name for test in self.tests)

    def lengthened(self, stacked: np.ndarray) -> np.ndarray:
        """Return rows of all tests in a row with those that `data` has beyond them, which are 0."""
        parts = zip(self.split(stacked), self.tests, strict=True)
        return np.concatenate([test.lengthened(rows) for rows, test in parts])

    def own(self, lengthened: Float[Any, "more ..."]) -> np.ndarray:
        """Return rows of all tests in a row without those that `data` has beyond them."""
        ends = np.cumsum([test.measured.size for test in self.data.tests])[:-1]
        parts = zip(np.split(np.asarray(lengthened), ends), self.tests, strict=True)
        return np.concatenate([test.own(rows) for rows, test in parts])

    def linearised(self, z: Float[np.ndarray, " parameter"]) -> tuple[np.ndarray, np.ndarray]:
        """Return the residuals of all tests in a row [K] and their Jacobian [K per score]."""
        residual, jacobian = linearise(self.structure, self.data, np.asarray(z))
        return self.own(residual), self.own(jacobian)

    def split(self, stacked: np.ndarray) -> list[np.ndarray]:
        """Split rows over all blocks into one array per test."""
        ends = np.cumsum([test.measured.size for test in self.tests])[:-1]
        return np.split(stacked, ends)


def predictions(
    structure: Structure, data: Data, z: Float[Array, " parameter"]
) -> list[Float[Array, " block"]]:
    """Return the modelled block means of each test [degC]."""
    return [_means(structure, data, z, index) for index in range(len(data.tests))]


def _means(
    structure: Structure, data: Data, z: Float[Array, " parameter"], index: int
) -> Float[Array, " block"]:
    """Return the modelled block means of one test [degC]."""
    values = data.priors.values(structure.form, z, index)
    return structure.model.block_means(values, data.tests[index])


def residuals(
    structure: Structure, data: Data, z: Float[Array, " parameter"]
) -> list[Float[Array, " block"]]:
    """Return measured minus modelled block means of each test [K], 0 where none was read."""
    return [_residual(structure, data, z, index) for index in range(len(data.tests))]


def _residual(
    structure: Structure, data: Data, z: Float[Array, " parameter"], index: int
) -> Float[Array, " block"]:
    """Return the residuals of one test [K], as `residuals`."""
    test = data.tests[index]
    predicted = _means(structure, data, z, index)
    difference = jnp.where(test.is_observed, test.measured - predicted, 0.0)
    return jnp.where(jnp.abs(difference) < WORST_RESIDUAL, difference, WORST_RESIDUAL)


def whitened(
    structure: Structure, data: Data, z: Float[Array, " parameter"], noise: Noise
) -> Float[Array, " residual"]:
    """Return whitened residuals of all tests, followed by the scores (the prior)."""
    parts = [
        noise_module.whiten(residual, noise, test)[0]
        for residual, test in zip(residuals(structure, data, z), data.tests, strict=True)
    ]
    return jnp.concatenate([*parts, z])


def log_likelihood(
    structure: Structure, data: Data, z: Float[Array, " parameter"], noise: Noise
) -> Float[Array, ""]:
    """Return the log density of all readings [nat]."""
    parts = [
        noise_module.log_density(residual, noise, test)
        for residual, test in zip(residuals(structure, data, z), data.tests, strict=True)
    ]
    return jnp.sum(jnp.stack(parts))


def log_posterior(
    structure: Structure, data: Data, vector: Float[Array, " all"]
) -> Float[Array, ""]:
    """Return log likelihood plus log prior of the scores of parameters and noise [nat]."""
    z, noise_z = vector[: structure.num_parameters], vector[structure.num_parameters :]
    prior = -0.5 * jnp.sum(vector**2) - 0.5 * vector.size * jnp.log(2 * jnp.pi)
    noise = noise_module.from_scores(noise_z)
    total = log_likelihood(structure, data, z, noise) + prior
    is_allowed = jnp.all(noise_z <= jnp.asarray(noise_module.LARGEST_SCORES))
    is_allowed &= jnp.all(z <= data.priors.largest)
    return jnp.where(is_allowed & jnp.isfinite(total), total, -jnp.inf)


@compiled("structure")
def log_posterior_batch(
    structure: Structure, data: Data, vectors: Float[Array, "draw all"]
) -> Float[Array, " draw"]:
    """As `log_posterior`, over draws; compiled."""
    return jax.vmap(partial(log_posterior, structure, data))(vectors)


def with_slopes(
    function: Callable[[Any], Float[Array, " row"]], at: Any, directions: Any
) -> tuple[Float[Array, " row"], Float[Array, "row direction"]]:
    """Return a function's value, and its derivatives along directions, stacked in front.

    All directions go through the march with the value: what `jax.linearize` stores of each step for
    them takes longer to read than to work out again.
    """
    return jax.vmap(lambda one: jax.jvp(function, (at,), (one,)), out_axes=(None, -1))(directions)


@compiled("structure")
def linearise(
    structure: Structure, data: Data, z: Float[Array, " parameter"]
) -> tuple[Float[Array, " block"], Float[Array, "block parameter"]]:
    """Return the residuals of all tests in a row [K] and their Jacobian [K per score].

    A test is marched along the parameters that it has, not along those of the other tests.
    """
    num = structure.num_parameters
    rows, slopes = [], []
    for index in range(len(data.tests)):
        own = [slot for slot, (*_, owner) in enumerate(structure.form) if owner in (None, index)]
        directions = np.zeros((-(-len(own) // WIDTH) * WIDTH, num))
        directions[np.arange(len(own)), own] = 1.0

        of_test = partial(_residual, structure, data, index=index)
        residual, slope = with_slopes(of_test, z, jnp.asarray(directions))
        rows.append(residual)
        slopes.append(
            jnp.zeros((residual.size, num)).at[:, np.array(own)].set(slope[:, : len(own)])
        )
    return jnp.concatenate(rows), jnp.concatenate(slopes)


@compiled("structure", is_seldom=True)
def information(
    structure: Structure, data: Data, z: Float[Array, " parameter"], noise: Noise
) -> Float[Array, "parameter parameter"]:
    """Return the precision of the scores, prior included, that the linear model gives."""
    directions = jnp.eye(structure.num_parameters)
    _, jacobian = with_slopes(lambda z: whitened(structure, data, z, noise), z, directions)
    return jacobian.T @ jacobian


@compiled("structure", is_seldom=True)
def predict_batch(
    structure: Structure, data: Data, z: Float[Array, "draw parameter"]
) -> list[Float[Array, "draw block"]]:
    """As `predictions`, over draws; compiled."""
    return jax.vmap(partial(predictions, structure, data))(z)
