"""The proposal of the weighted draws: first the noise, then the parameters given that noise.

Whether an error is slow or white a short test hardly tells, so the posterior of the noise is
skewed, and the width of the parameters depends on it: no normal or Student t distribution over
both comes near. Around an optimum, though, the parameters are close to normal once the noise is
given, and the noise alone has a density in closed form (`restricted`). So the noise is drawn from
kernels over that density, and the parameters from the linear model under the drawn noise. What is
not linear is followed by moving and reshaping those draws.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.special import gammaln, logsumexp

from .fit_result import Fit
from .problem import NUM_NOISE, Problem, linearise
from .restricted import Conditional, conditional_batch

DEGREES_OF_FREEDOM = 5.0
"""Tails of the draws: heavier than those of the posterior, so that weights stay bounded."""

NUM_FIRST = 2048
"""Draws of the noise from which the kernels are made."""

NUM_KERNELS = 256
BANDWIDTH = 0.6
"""Width of a kernel in standard deviations [1]: Silverman's rule, 0.45 for 256 points in 3
dimensions, and a third more, because too thin a tail costs more than a broad middle."""

GUARDING = 0.1
"""Share of the noises drawn from the prior [1], which no tail of their posterior outreaches."""

WIDER = 1.5
"""The first draws of the noise are this much wider than the curvature says [1]."""

FROM_PRIOR = 0.2
"""Share of the first draws of the noise that come from the prior [1]: they find other maxima."""

PARTS = ((0.8, 1.0), (0.2, 2.0))
"""Shares and widths of the draws around one optimum [1]: where the posterior is skewed, the rounds
part a narrow from a wide side."""

BATCH = 64
"""Noises that are worked out at once; a full set of draws would not fit the cache."""


@dataclass(frozen=True)
class Kernels:
    """A density of the noise's scores as a sum of equal Student t kernels.

    Attributes:
        centres: Shape (kernel, 3).
        factor: Lower Cholesky factor of the kernels' shape.
    """

    centres: Float[np.ndarray, "kernel 3"]
    factor: Float[np.ndarray, "3 3"]

    @classmethod
    def over(cls, noise_z: np.ndarray, weights: np.ndarray, rng: np.random.Generator) -> Kernels:
        """Return kernels over weighted draws."""
        shift = noise_z - weights @ noise_z
        shape = (shift * weights[:, None]).T @ shift + 1e-4 * np.eye(NUM_NOISE)
        picked = rng.choice(weights.size, size=NUM_KERNELS, p=weights)
        return cls(noise_z[picked], BANDWIDTH * np.linalg.cholesky(shape))

    def draw(self, num: int, rng: np.random.Generator) -> np.ndarray:
        """Return draws, shape (num, 3)."""
        which = rng.integers(len(self.centres), size=num)
        noise_z = self.centres[which] + _student(num, NUM_NOISE, rng) @ self.factor.T
        is_prior = rng.uniform(size=num) < GUARDING
        noise_z[is_prior] = rng.standard_normal((int(np.sum(is_prior)), NUM_NOISE))
        return noise_z

    def log_density(self, noise_z: Float[np.ndarray, "draw 3"]) -> Float[np.ndarray, " draw"]:
        """Return the log density [nat]."""
        white = np.linalg.inv(self.factor)
        gap = (noise_z @ white.T)[:, None] - (self.centres @ white.T)[None]
        parts = _log_student(np.sum(gap**2, axis=2), NUM_NOISE)
        log_det = np.sum(np.log(np.diag(self.factor)))
        near = np.asarray(logsumexp(parts, axis=1)) - np.log(len(self.centres)) - log_det
        return np.logaddexp(np.log1p(-GUARDING) + near, np.log(GUARDING) + _log_prior(noise_z))


@dataclass(frozen=True)
class Branch:
    """The linear model around one optimum, and how its draws are moved and reshaped.

    Attributes:
        z: Scores at the optimum, shape (parameter,).
        residual: Residuals there [K], shape (block,).
        jacobian: Their derivative [K per score], shape (block, parameter).
        share: Share of the draws [1].
        shift: Mean of the scaled draws, shape (parameter,).
        shape: Lower Cholesky factor of their shape.
    """

    z: Float[np.ndarray, " parameter"]
    residual: Float[np.ndarray, " block"]
    jacobian: Float[np.ndarray, "block parameter"]
    share: float
    shift: Float[np.ndarray, " parameter"]
    shape: Float[np.ndarray, "parameter parameter"]

    def given(self, problem: Problem, noise_z: Float[np.ndarray, "draw 3"]) -> Conditional:
        """Return what the linear model says for drawn noises."""
        num = noise_z.shape[0]
        padded = np.concatenate([noise_z, np.repeat(noise_z[-1:], -num % BATCH, axis=0)])
        arrays = [jnp.asarray(a) for a in (self.z, self.residual, self.jacobian)]
        parts = [
            conditional_batch(problem.data, jnp.asarray(part), *arrays)
            for part in np.split(padded, padded.shape[0] // BATCH)
        ]
        density, mean, factor = (
            np.concatenate([np.asarray(part[field]) for part in parts])[:num] for field in range(3)
        )
        return Conditional(density, mean, factor)


@dataclass(frozen=True)
class Drawn:
    """Draws with their density.

    Attributes:
        vectors: Scores of parameters and noise, shape (draw, all).
        log_density: Of the proposal [nat], shape (draw,).
        scaled: The draws as each branch sees them, centred and scaled by its linear model, shape
            (branch, draw, parameter).
        log_parts: Log density of each branch [nat], shape (branch, draw).
    """

    vectors: Float[np.ndarray, "draw all"]
    log_density: Float[np.ndarray, " draw"]
    scaled: Float[np.ndarray, "branch draw parameter"]
    log_parts: Float[np.ndarray, "branch draw"]


@dataclass(frozen=True)
class Proposal:
    """Where draws come from.

    Attributes:
        problem: What is sampled.
        kernels: Density of the noise.
        branches: Some for each optimum.
    """

    problem: Problem
    kernels: Kernels
    branches: tuple[Branch, ...]

    @classmethod
    def around(cls, fit: Fit, rng: np.random.Generator) -> Proposal:
        """Return the proposal that the linear models around the optima of a fit give."""
        problem = fit.problem
        size = problem.num_parameters
        branches = []
        for mode in fit.modes:
            residual, jacobian = linearise(problem.structure, problem.data, jnp.asarray(mode))
            numbers = np.asarray(residual), np.asarray(jacobian)
            for share, scale in PARTS:
                part = Branch(
                    mode, *numbers, share / len(fit.modes), np.zeros(size), scale * np.eye(size)
                )
                branches.append(part)
        return cls(problem, _first_kernels(fit, branches[0], rng), tuple(branches))

    def draw(self, num: int, rng: np.random.Generator) -> Drawn:
        """Return draws of noise and parameters."""
        noise_z = self.kernels.draw(num, rng)
        given = self._given(noise_z)
        shares = [branch.share for branch in self.branches]
        which = rng.choice(len(shares), size=num, p=shares)
        student = _student(num, self.branches[0].z.size, rng)
        z = np.empty_like(student)
        for index, (branch, linear) in enumerate(zip(self.branches, given, strict=True)):
            mine = which == index
            scaled = branch.shift + student[mine] @ branch.shape.T
            upper = np.swapaxes(linear.factor[mine], 1, 2)
            z[mine] = linear.mean[mine] + np.linalg.solve(upper, scaled[..., None])[..., 0]
        vectors = np.concatenate([z, noise_z], axis=1)
        return self._seen(vectors, given)

    def log_density(self, vectors: Float[np.ndarray, "draw all"]) -> Float[np.ndarray, " draw"]:
        """Return the log density of vectors from elsewhere [nat]."""
        return self._seen(vectors, self._given(vectors[:, -NUM_NOISE:])).log_density

    def _seen(self, vectors: np.ndarray, given: list[Conditional]) -> Drawn:
        """Return vectors with their density; `given` belongs to their noises."""
        z, noise_z = vectors[:, :-NUM_NOISE], vectors[:, -NUM_NOISE:]
        scaled, log_parts = [], []
        for branch, linear in zip(self.branches, given, strict=True):
            seen = np.einsum("nji,nj->ni", linear.factor, z - linear.mean)
            white = np.linalg.solve(branch.shape, (seen - branch.shift).T)
            log_det = np.sum(np.log(np.diagonal(linear.factor, axis1=1, axis2=2)), axis=1)
            log_det = log_det - np.sum(np.log(np.diag(branch.shape)))
            part = _log_student(np.sum(white**2, axis=0), z.shape[1]) + log_det
            scaled.append(seen)
            log_parts.append(part + np.log(branch.share))
        parts = np.stack(log_parts)
        log_density = np.asarray(logsumexp(parts, axis=0)) + self.kernels.log_density(noise_z)
        return Drawn(vectors, log_density, np.stack(scaled), parts)

    def _given(self, noise_z: np.ndarray) -> list[Conditional]:
        """Return what the linear model of each branch says; parts of one optimum share it."""
        seen: dict[bytes, Conditional] = {}
        for branch in self.branches:
            key = branch.z.tobytes()
            if key not in seen:
                seen[key] = branch.given(self.problem, noise_z)
        return [seen[branch.z.tobytes()] for branch in self.branches]

    def adapted(self, drawn: Drawn, weights: Float[np.ndarray, " draw"]) -> Proposal:
        """Return the proposal moved to weighted draws.

        The fewer draws carry the weight, the more of the linear model's shape is kept.

        Args:
            drawn: From this proposal.
            weights: Normalised, none of them overwhelming.
        """
        responsible = np.exp(drawn.log_parts - logsumexp(drawn.log_parts, axis=0)) * weights
        branches = []
        for branch, scaled, mine in zip(self.branches, drawn.scaled, responsible, strict=True):
            total = float(np.sum(mine))
            share = (total + 0.05 / len(self.branches)) / 1.05  # none dies out for good
            effective = total**2 / float(np.sum(mine**2)) if total > 0.0 else 0.0
            trust = effective / (effective + 5.0 * scaled.shape[1])
            mean = mine @ scaled / max(total, 1e-300)
            gap = scaled - mean
            shape = (gap * mine[:, None]).T @ gap / max(total, 1e-300)
            shape = trust * shape + (1.0 - trust) * (branch.shape @ branch.shape.T)
            shift = trust * mean + (1.0 - trust) * branch.shift
            branches.append(
                replace(branch, share=share, shift=shift, shape=np.linalg.cholesky(shape))
            )
        return replace(self, branches=tuple(branches))


def _first_kernels(fit: Fit, branch: Branch, rng: np.random.Generator) -> Kernels:
    """Return kernels over the restricted density, from draws around its maximum and the prior."""
    size = fit.problem.num_parameters
    factor = WIDER * np.linalg.cholesky(fit.covariance[size:, size:] + 1e-9 * np.eye(NUM_NOISE))
    noise_z = fit.noise_z + _student(NUM_FIRST, NUM_NOISE, rng) @ factor.T
    is_prior = rng.uniform(size=NUM_FIRST) < FROM_PRIOR
    noise_z[is_prior] = rng.standard_normal((int(np.sum(is_prior)), NUM_NOISE))
    white = np.linalg.solve(factor, (noise_z - fit.noise_z).T)
    near = _log_student(np.sum(white**2, axis=0), NUM_NOISE) - np.sum(np.log(np.diag(factor)))
    drawn_from = np.logaddexp(
        np.log(1.0 - FROM_PRIOR) + near, np.log(FROM_PRIOR) + _log_prior(noise_z)
    )
    log_weight = np.asarray(branch.given(fit.problem, noise_z).log_density) - drawn_from
    log_weight = np.where(np.isfinite(log_weight), log_weight, -np.inf)
    return Kernels.over(noise_z, np.exp(log_weight - logsumexp(log_weight)), rng)


def _log_prior(noise_z: np.ndarray) -> np.ndarray:
    return -0.5 * np.sum(noise_z**2, axis=1) - 0.5 * NUM_NOISE * np.log(2.0 * np.pi)


def _student(num: int, size: int, rng: np.random.Generator) -> np.ndarray:
    """Return draws of a standard Student t distribution, shape (num, size)."""
    scale = np.sqrt(DEGREES_OF_FREEDOM / rng.chisquare(DEGREES_OF_FREEDOM, num))
    return rng.standard_normal((num, size)) * scale[:, None]


def _log_student(square: np.ndarray, size: int) -> np.ndarray:
    """Return its log density [nat] for squared distances from its centre."""
    nu = DEGREES_OF_FREEDOM
    constant = gammaln((nu + size) / 2) - gammaln(nu / 2) - 0.5 * size * np.log(nu * np.pi)
    return constant - 0.5 * (nu + size) * np.log1p(square / nu)
