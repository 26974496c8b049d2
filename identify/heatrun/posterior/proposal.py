"""Draws of the linear models around the optima: first the noise, then the parameters given it.

Whether an error is slow or white a short test hardly tells, so the posterior of the noise is
skewed, and the width of the parameters depends on it: no normal or Student t distribution over
both comes near. Around an optimum, though, the parameters are close to normal once the noise is
given, and the noise alone has a density in closed form (`restricted`). So the noise is drawn from
kernels over that density, and the parameters from the linear model under the drawn noise. What is
not linear is followed by moving and reshaping those draws.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.special import logsumexp
from jaxtyping import Array, Float, Int

from ..fit.fit_result import Fit
from ..fit.restricted import conditional
from ..io.programs import compiled
from ..model.kernels import NUM_KERNELS, Kernels, in_batches, log_student, student
from ..model.noise import LARGEST_SCORES, solved_by
from ..model.problem import NUM_NOISE, Problem, linearise
from ..record.observation import Observation

NUM_FIRST = 2048
"""Draws of the noise from which the kernels are made."""

WIDER = 1.5
"""The first draws of the noise are this much wider than the curvature says [1]."""

PARTS = ((0.8, 1.0), (0.2, 2.0))
"""Shares and widths of the draws around one optimum [1]: where the posterior is skewed, the rounds
part a narrow from a wide side."""

BATCH = 16
"""Draws that are worked out at once; with many parameters, more of them fall out of the cache."""

AS_GIVEN = -1
"""Stands for a branch where a vector is given and not drawn."""


class Optima(eqx.Module):
    """The linear models around the optima."""

    z: Float[Any, "optimum parameter"]  # Scores at the optima.
    residual: Float[Any, "optimum block"]  # Residuals there [K].
    jacobian: Float[Any, "optimum block parameter"]  # Their derivative [K per score].


class Branches(eqx.Module):
    """Parts of the density, and how the draws of each are moved and reshaped."""

    optimum: Int[Any, " branch"]  # Which linear model each has.
    share: Float[Any, " branch"]  # Share of the draws [1].
    shift: Float[Any, "branch parameter"]  # Mean of the scaled draws.
    shape: Float[Any, "branch parameter parameter"]  # Lower Cholesky factor of their shape.
    whiten: Float[Any, "branch parameter parameter"]  # Its inverse.

    @classmethod
    def of(cls, optimum, share, shift, shape) -> Branches:
        """Return branches; arguments as the attributes."""
        return cls(*map(np.asarray, (optimum, share, shift, shape, np.linalg.inv(shape))))


@dataclass(frozen=True)
class Drawn:
    """Draws with their density."""

    vectors: Float[np.ndarray, "draw all"]  # Scores of parameters and noise.
    log_density: Float[np.ndarray, " draw"]  # Of the proposal [nat].
    # The draws as each branch sees them, centred and scaled by its linear model.
    scaled: Float[np.ndarray, "draw branch parameter"]
    log_parts: Float[np.ndarray, "draw branch"]  # Log density of each branch [nat].
    # Log density of the noise alone under the first linear model, up to a constant [nat].
    restricted: Float[np.ndarray, " draw"]


@dataclass(frozen=True)
class Proposal:
    """Where draws come from."""

    problem: Problem  # What is sampled.
    kernels: Kernels  # Density of the noise.
    optima: Optima  # Linear models.
    branches: Branches  # Some for each optimum.

    @classmethod
    def around(cls, fit: Fit, rng: np.random.Generator) -> Proposal:
        """Return the proposal that the linear models around the optima of a fit give."""
        problem, num = fit.problem, len(fit.modes)
        found = [linearise(problem.structure, problem.data, mode) for mode in fit.modes]
        residual, jacobian = (np.stack(parts) for parts in zip(*found, strict=True))
        optima = Optima(*map(np.asarray, (fit.modes, residual, jacobian)))
        share, scale = (np.tile(part, num) for part in zip(*PARTS, strict=True))
        size = problem.num_parameters
        branches = Branches.of(
            np.repeat(np.arange(num), len(PARTS)),
            share / num,
            np.zeros((share.size, size)),
            scale[:, None, None] * np.eye(size),
        )
        factor = WIDER * np.linalg.cholesky(fit.covariance[size:, size:] + 1e-9 * np.eye(NUM_NOISE))
        one_place = Kernels.at(np.tile(fit.noise_z, (NUM_KERNELS, 1)), factor)
        return cls(problem, one_place, optima, branches)._with_kernels(rng)

    def _with_kernels(self, rng: np.random.Generator) -> Proposal:
        """Return it with kernels over the restricted density, from draws around its maximum and
        the prior.
        """
        noise_z = self.kernels.draw(NUM_FIRST, rng)
        drawn_from = self.kernels.log_densities(noise_z)
        z = np.zeros((NUM_FIRST, self.problem.num_parameters))
        log_weight = self._seen(np.concatenate([z, noise_z], axis=1)).restricted - drawn_from
        is_allowed = np.all(noise_z <= LARGEST_SCORES, axis=1) & np.isfinite(log_weight)
        log_weight = np.where(is_allowed, log_weight, -np.inf)
        weights = np.exp(log_weight - np.max(log_weight))
        return replace(self, kernels=Kernels.over(noise_z, weights / np.sum(weights), rng))

    def draw(self, num: int, rng: np.random.Generator) -> Drawn:
        """Return draws of noise and parameters."""
        noise_z = self.kernels.draw(num, rng)
        share = np.asarray(self.branches.share)
        branch = rng.choice(share.size, size=num, p=share)
        return self._placed(noise_z, branch, student(num, self.problem.num_parameters, rng))

    def log_density(self, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
        """Return the log density of vectors from elsewhere [nat]."""
        return self._seen(vectors).log_density

    @property
    def latest(self) -> Proposal:
        """Itself: it has one density of the noise."""
        return self

    def _seen(self, vectors: Float[np.ndarray, "draw all"]) -> Drawn:
        as_given = np.full(vectors.shape[0], AS_GIVEN)
        return self._placed(vectors[:, -NUM_NOISE:], as_given, vectors[:, :-NUM_NOISE])

    def _placed(self, noise_z: np.ndarray, branch: np.ndarray, z: np.ndarray) -> Drawn:
        """Return draws; `z` holds standard draws of their branches, or scores as given."""
        known = self.problem.readings, self.kernels, self.optima, self.branches
        rows = noise_z, branch, z
        return Drawn(*in_batches(lambda part: _place(*known, *part), rows, BATCH))

    def adapted(
        self, drawn: Drawn, weights: Float[np.ndarray, " draw"], rng: np.random.Generator
    ) -> Proposal:
        """Return the proposal moved to the importance samples, in the parameters and the noise.

        The fewer draws carry the weight, the more of the linear model's shape is kept. The noise
        goes with them whole: where the fit is poor, the parameters bend as the noise grows, and
        its density under the linear model ends elsewhere.

        Args:
            drawn: From this proposal.
            weights: Normalised, none of them overwhelming.
            rng: Picks the noises on which new kernels stand.
        """
        top = np.max(drawn.log_parts, axis=1, keepdims=True)
        responsible = np.exp(drawn.log_parts - top)
        responsible *= (weights / np.sum(responsible, axis=1))[:, None]
        old = jax.tree.map(np.asarray, self.branches)
        shares, shifts, shapes = [], [], []
        for index in range(old.share.size):
            mine, scaled = responsible[:, index], drawn.scaled[:, index]
            total = float(np.sum(mine))
            effective = total**2 / float(np.sum(mine**2)) if total > 0.0 else 0.0
            trust = effective / (effective + 5.0 * scaled.shape[1])
            mean = mine @ scaled / max(total, 1e-300)
            gap = scaled - mean
            shape = (gap * mine[:, None]).T @ gap / max(total, 1e-300)
            shape = trust * shape + (1.0 - trust) * (old.shape[index] @ old.shape[index].T)
            shares.append((total + 0.05 / old.share.size) / 1.05)  # none dies out for good
            shifts.append(trust * mean + (1.0 - trust) * old.shift[index])
            shapes.append(np.linalg.cholesky(shape))
        moved = Branches.of(old.optimum, *map(np.stack, (shares, shifts, shapes)))
        kernels = Kernels.over(drawn.vectors[:, -NUM_NOISE:], weights, rng)
        return replace(self, branches=moved, kernels=kernels)


@compiled()
def _place(
    tests: Sequence[Observation],
    kernels: Kernels,
    optima: Optima,
    branches: Branches,
    noise_z: Float[Array, "draw noise"],
    branch: Int[Array, " draw"],
    z: Float[Array, "draw parameter"],
):
    """Return the fields of `Drawn`; arguments as `Proposal._placed`."""

    def one(noise_z, branch, z):
        linear = jax.vmap(partial(conditional, tests, noise_z))(
            optima.z, optima.residual, optima.jacobian
        )
        mean, factor = linear.mean[branches.optimum], linear.factor[branches.optimum]
        scaled = branches.shift[branch] + branches.shape[branch] @ z
        drawn = mean[branch] + solved_by(factor[branch], scaled, is_transposed=True)
        z = jnp.where(branch == AS_GIVEN, z, drawn)
        seen = jnp.einsum("bji,bj->bi", factor, z - mean)
        white = jnp.einsum("bij,bj->bi", branches.whiten, seen - branches.shift)
        log_det = _log_det(factor) - _log_det(branches.shape)
        log_parts = log_student(jnp.sum(white**2, axis=1), z.size) + log_det
        log_parts = log_parts + jnp.log(branches.share)
        log_density = logsumexp(log_parts) + kernels.log_density(noise_z)
        vector = jnp.concatenate([z, noise_z])
        return vector, log_density, seen, log_parts, linear.log_density[0]

    return jax.vmap(one)(noise_z, branch, z)


def _log_det(factor: Float[Array, "*batch row row"]) -> Float[Array, "*batch"]:
    return jnp.sum(jnp.log(jnp.diagonal(factor, axis1=-2, axis2=-1)), axis=-1)
