"""What a fit returns: the most probable parameters, their spread, and how it ended."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ..model.noise import Noise, from_scores
from ..model.parameters import Slot
from ..model.problem import NUM_NOISE, Problem
from ..record.record import Finding


class RESULT(enum.Enum):
    """How a fit ended; each member is a sentence."""

    converged = "The fit converged."
    not_converged = (
        "The optimisation stopped before it converged: the tests hardly inform the parameters, and "
        "their values and intervals are not reliable. Give a prior or fix a parameter in the motor "
        "file, or add a test."
    )
    no_start = (
        "No start of the optimisation led to a finite fit: the time constants may be too short for "
        "the sampling interval. Check the units, or record at a shorter interval."
    )


@dataclass(frozen=True)
class Fit:
    """The most probable parameters and the spread of the posterior around them."""

    problem: Problem  # What was fitted.
    z: Float[np.ndarray, " parameter"]  # Scores of the parameters, shape (parameter,).
    noise_z: Float[np.ndarray, " noise"]  # Scores of the noise, shape (noise,).
    # Of the scores of parameters and noise, shape (all, all).
    covariance: Float[np.ndarray, "all all"]
    # What the scatter of the readings contributes to that of the parameters, shape (parameter,
    # parameter); the rest comes from priors (type B).
    covariance_type_a: Float[np.ndarray, "parameter parameter"]
    residual: list[np.ndarray]  # Measured minus modelled block means by test [K].
    jacobian: list[np.ndarray]  # Derivative of the residuals by test [K per score].
    # Scores of all optima that share the posterior, the best first, shape (mode, parameter).
    modes: Float[np.ndarray, "mode parameter"]
    log_evidence: float  # Laplace approximation of the marginal likelihood [nat].
    result: RESULT  # How it ended.
    findings: tuple[Finding, ...] = ()  # What is to be said about it.
    # Numbers of starts, of starts at the best optimum, and of steps.
    stats: dict[str, float] = field(default_factory=dict)

    @property
    def vector(self) -> np.ndarray:
        """Scores of parameters and noise in a row."""
        return np.concatenate([self.z, self.noise_z])

    @property
    def noise(self) -> Noise:
        """The noise at the fit."""
        return from_scores(self.noise_z)

    @property
    def slots(self) -> tuple[Slot, ...]:
        """The free parameters in order."""
        return self.problem.parameters.slots

    def rmse_K(self) -> float:
        """Root of the mean squared residual of the winding's block means over all tests [K]."""
        read = [
            test.by_sensor(rows)[0][test.winding.is_observed]
            for rows, test in zip(self.residual, self.problem.tests, strict=True)
        ]
        return float(np.sqrt(np.mean(np.concatenate(read) ** 2)))

    def values(self) -> dict[str, float]:
        """Return the fitted values of the free parameters by slot name [their units]."""
        return {name: float(v) for name, v in self.problem.parameters.physical(self.z).items()}


def failed(problem: Problem) -> Fit:
    """Return the fit of a problem for which no start led anywhere: all numbers are NaN."""
    size = problem.num_parameters
    nothing = [np.full(test.measured.size, np.nan) for test in problem.tests]
    return Fit(
        problem=problem,
        z=np.full(size, np.nan),
        noise_z=np.full(NUM_NOISE, np.nan),
        covariance=np.full((size + NUM_NOISE,) * 2, np.nan),
        covariance_type_a=np.full((size, size), np.nan),
        residual=nothing,
        jacobian=[np.full((part.size, size), np.nan) for part in nothing],
        modes=np.empty((0, size)),
        log_evidence=-np.inf,
        result=RESULT.no_start,
    )
