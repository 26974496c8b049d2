"""Predictions with bands: what the parameters leave open, and what the noise adds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.stats import norm

from ..bench.blocks import Blocks
from . import noise as noise_module
from .posterior import Posterior
from .problem import NUM_NOISE, Data, Problem, Structure

NUM_DRAWS = 400
"""Draws behind a band: its 95 % limits are then good to about a tenth of a standard deviation."""

LEVELS = {"50": (0.25, 0.75), "95": (0.025, 0.975)}


@dataclass(frozen=True)
class Prediction:
    """What a posterior says of one test, block by block.

    Attributes:
        test: The test.
        is_held_out: Whether the posterior has not seen it; its start is then taken from its
            first readings.
        median: Reading at the median of the draws [degC], shape (block,).
        parameters: Limits by level ("50", "95") from the parameters alone [degC].
        total: Limits by level with the noise of a block mean [degC].
        sd: Standard deviation with noise [K], shape (block,).
        nodes: Median of the mean temperature of each node over each block [degC].
        nodes_95: Its 95 % limits [degC].
        flows: Median heat flow by link over each block [W].
        draws: The readings themselves, without noise [degC], shape (draw, block).
    """

    test: Blocks
    is_held_out: bool
    median: Float[np.ndarray, " block"]
    parameters: Mapping[str, tuple[np.ndarray, np.ndarray]]
    total: Mapping[str, tuple[np.ndarray, np.ndarray]]
    sd: Float[np.ndarray, " block"]
    nodes: Mapping[str, np.ndarray]
    nodes_95: Mapping[str, tuple[np.ndarray, np.ndarray]]
    flows: Mapping[tuple[str, str], np.ndarray]
    draws: Float[np.ndarray, "draw block"]

    @property
    def residual(self) -> np.ndarray:
        """Measured minus median [K], shape (block,); NaN where nothing was read."""
        return self.test.measured - self.median

    def coverage_95(self) -> float:
        """Return the share of block means inside the 95 % band with noise [1]."""
        low, high = self.total["95"]
        seen = self.test.is_observed
        inside = (self.test.measured >= low) & (self.test.measured <= high)
        return float(np.mean(inside[seen]))

    def log_score(self) -> float:
        """Return the mean log density of a block mean under its predicted normal [nat]."""
        seen = self.test.is_observed
        return float(np.mean(norm.logpdf(self.residual[seen], scale=self.sd[seen])))


def predict(
    posterior: Posterior,
    test: Blocks,
    *,
    num_draws: int = NUM_DRAWS,
    seed: int = 0,
) -> Prediction:
    """Predict a test, one that the posterior has seen or any other.

    Args:
        posterior: Draws.
        test: A reduced record; its readings are used for the start alone.
        num_draws: Number of draws.
        seed: Of the noise and of the start.
    """
    fitted = posterior.fit.problem
    vectors = posterior.thin(num_draws, seed)
    names = [each.name for each in fitted.tests]
    is_held_out = test not in fitted.tests
    problem = Problem.of(fitted.model, fitted.motor, [test])
    z = np.zeros((vectors.shape[0], problem.num_parameters))
    rng = np.random.default_rng([seed, 3])
    owner = "" if is_held_out else names[[t is test for t in fitted.tests].index(True)]
    for position, slot in enumerate(problem.parameters.slots):
        name = slot.name if slot.test is None else f"{slot.parameter.name}[{owner}]"
        if name in fitted.parameters.names:
            z[:, position] = vectors[:, fitted.parameters.index(name)]
        elif slot.parameter.role != "effect":  # an event of another test stays at its null
            z[:, position] = rng.standard_normal(vectors.shape[0])
    if is_held_out:
        _start_from_readings(problem, z, posterior, vectors, rng)

    course = _courses(problem.structure, problem.data, jnp.asarray(z))
    readings = np.asarray(course["reading"])
    noise_z = jnp.asarray(vectors[:, -NUM_NOISE:])
    keys = jax.random.split(jax.random.key(seed), vectors.shape[0])
    errors = _errors(noise_z, fitted.data.slow_noise, keys, problem.data.tests[0])
    noisy = readings + np.asarray(errors)
    return Prediction(
        test=test,
        is_held_out=is_held_out,
        median=np.median(readings, axis=0),
        parameters=_limits(readings),
        total=_limits(noisy),
        sd=np.std(noisy, axis=0),
        nodes={n: np.median(np.asarray(v), axis=0) for n, v in course["nodes"].items()},
        nodes_95={n: _limits(np.asarray(v))["95"] for n, v in course["nodes"].items()},
        flows={n: np.median(np.asarray(v), axis=0) for n, v in course["flows"].items()},
        draws=readings,
    )


def _start_from_readings(
    problem: Problem,
    z: np.ndarray,
    posterior: Posterior,
    vectors: np.ndarray,
    rng: np.random.Generator,
) -> None:
    """Set the start of a test that was not fitted: its first reading less offset and noise."""
    slots = problem.parameters.slots
    names = problem.parameters.names
    test = problem.tests[0]
    offset = np.zeros(z.shape[0])
    if "sensor_offset" in names:
        position = names.index("sensor_offset")
        offset = slots[position].parameter.value(z[:, position])
    noise = posterior.fit.problem.noise(vectors[:, -NUM_NOISE:].T)
    sd = np.minimum(np.asarray(noise.total()), 2.0)
    winding = test.start_degC - offset + sd * rng.standard_normal(z.shape[0])
    for position, slot in enumerate(slots):
        if slot.parameter.name == "Tw_start":
            z[:, position] = slot.parameter.score(winding)
        elif slot.parameter.name == "Tsr_start":
            below = slot.parameter.centre - test.start_degC + slot.parameter.sd * z[:, position]
            z[:, position] = slot.parameter.score(winding + below)


@partial(jax.jit, static_argnames="structure")
def _courses(structure: Structure, data: Data, z: Float[Array, "draw parameter"]):
    """Return readings, node temperatures and flows, all as means over blocks, over draws."""
    test = data.tests[0]
    num_steps = test.weight.shape[1]

    def means(course):
        return course.reshape(-1, num_steps).mean(axis=1)

    def one(z):
        values = data.priors.values(structure.form, z, 0)
        trace = structure.model.simulate(values, test.inputs)
        return {
            "reading": structure.model.block_means(values, test),
            "nodes": {n: means(0.5 * (T[1:] + T[:-1])) for n, T in trace.temperature.items()},
            "flows": {n: means(P) for n, P in trace.flow.items()},
        }

    return jax.lax.map(one, z, batch_size=50)


@jax.jit
def _errors(noise_z, slow, keys, test):
    def one(z, key):
        return noise_module.draw(key, noise_module.from_scores(z, slow), test)

    return jax.vmap(one)(noise_z, keys)


def _limits(draws: np.ndarray) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    return {
        name: (np.quantile(draws, low, axis=0), np.quantile(draws, high, axis=0))
        for name, (low, high) in LEVELS.items()
    }
