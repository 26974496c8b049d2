"""The same least-squares fit by scipy on a simulator, a noise model and priors written anew.

What is shared with `heatrun` is the reduced record, and noise and heat that the fit settled on. The
simulator takes classical fourth-order steps in numba, the noise is a dense covariance matrix
instead of a Kalman filter, and the search is `scipy.optimize.least_squares` with derivatives by
differences.
"""

from functools import cache

import independent
import numpy as np
from numba import njit
from scipy.linalg import cholesky, solve_triangular
from scipy.optimize import least_squares

from heatrun.fit.fit_result import Fit
from heatrun.record.blocks import Blocks

SUBSTEPS = 4
"""Fourth-order steps in one step of the record; 2 s / 4 errs below 1e-8 K at 90 s."""

NAMES = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr", "Rs0", "current_gain", "power_gain",
         "sensor_gain", "sensor_offset", "ambient_offset", "Tw_start", "Tsr_start")  # fmt: skip

CENTRE = np.array([500.0, 1e4, 0.15, 0.15, 0.0062, 0.0, 0.0, 0.0, 0.0, 0.0, np.nan, np.nan])
SD = np.array([1.0, 1.0, 1.5, 1.5, 0.01, 0.005, 0.01, 0.005, 0.5, 0.5, 2.0, 1.0])
"""Priors as the documentation states them: the first five log-normal, the rest normal; both start
temperatures around the first readings of a cold start."""


@njit(cache=False)
def _slope(Tw, Ts, k, P, T0, Cw, Cs, Rw, Rs):
    copper = k * (234.5 + Tw)
    flow = (Tw - Ts) / Rw
    return (copper - flow) / Cw, (P - copper + flow - (Ts - T0) / Rs) / Cs


@njit(cache=False)
def winding(I2, P, T0, step, p, substeps):
    Cw, Cs, Rw, Rs, R0, current, gain, _, _, shift, Tw, Ts = p
    R0 = R0 * (1.0 + current) ** 2
    h = step / substeps
    out = np.empty(I2.size + 1)
    out[0] = Tw
    for n in range(I2.size):
        k, power, sink = 3.0 * R0 * I2[n] / 259.5, (1.0 + gain) * P[n], T0[n] + shift
        for _ in range(substeps):
            a1, b1 = _slope(Tw, Ts, k, power, sink, Cw, Cs, Rw, Rs)
            a2, b2 = _slope(Tw + h / 2 * a1, Ts + h / 2 * b1, k, power, sink, Cw, Cs, Rw, Rs)
            a3, b3 = _slope(Tw + h / 2 * a2, Ts + h / 2 * b2, k, power, sink, Cw, Cs, Rw, Rs)
            a4, b4 = _slope(Tw + h * a3, Ts + h * b3, k, power, sink, Cw, Cs, Rw, Rs)
            Tw += h / 6.0 * (a1 + 2 * a2 + 2 * a3 + a4)
            Ts += h / 6.0 * (b1 + 2 * b2 + 2 * b3 + b4)
        out[n + 1] = Tw
    return out


def covariance(blocks: Blocks, sd: float, time: float, white: float) -> np.ndarray:
    """Return the covariance of the block means [K^2]: slow drift, white part, rounding."""
    counts = np.maximum(blocks.count.astype(int), 1)

    @cache
    def slow(before: int, after: int, lag: int) -> float:
        first = (np.arange(before) + 0.5) / before
        second = lag + (np.arange(after) + 0.5) / after
        apart = blocks.block_s * np.abs(np.subtract.outer(first, second))
        return sd**2 * float(np.mean(np.exp(-apart / time)))

    pairs = [[slow(*sorted((m, n)), abs(i - j)) for j, n in enumerate(counts)]
             for i, m in enumerate(counts)]  # fmt: skip
    diagonal = white**2 * 20.0 / blocks.block_s + blocks.rounding_K**2 / 12.0 / counts
    return np.array(pairs) + np.diag(diagonal)


def heat_of(found: Fit) -> np.ndarray:
    """Return what unmodelled heat adds to the block means, as columns [K]."""
    assert found.problem.heat is not None
    return float(found.noise.heat) * found.problem.heat[0]


def residual_function(blocks: Blocks, noise: tuple[float, float, float], heat: np.ndarray):
    """Return the function from scores to whitened residuals and scores in a row."""
    centre = CENTRE.copy()
    centre[-2:] = blocks.start_degC
    I2, P, T0 = (
        np.asarray(v)
        for v in (blocks.inputs.current_squared, blocks.inputs.losses, blocks.inputs.ambient)
    )
    factor = cholesky(covariance(blocks, *noise) + heat @ heat.T, lower=True)
    edge_T0 = np.concatenate([T0[:1], 0.5 * (T0[1:] + T0[:-1]), T0[-1:]])

    def values(scores):
        shifted = centre + SD * scores
        return np.where(np.arange(len(NAMES)) < 5, centre * np.exp(SD * scores), shifted)

    def residual(scores):
        p = values(scores)
        T = winding(I2, P, T0, float(blocks.inputs.step), p, SUBSTEPS)
        sensor_gain, sensor_offset, shift = p[7:10]
        read = T + sensor_gain * (T - edge_T0 - shift) + sensor_offset
        before, after = (x.reshape(blocks.weight.shape) for x in (read[:-1], read[1:]))
        means = np.sum(blocks.weight * (before + blocks.position * (after - before)), axis=1)
        whitened = solve_triangular(factor, blocks.measured - means, lower=True)
        return np.concatenate([whitened, scores])

    return residual, values


def by_scipy(found: Fit):
    """Return scipy's optimum as scores, its sum of squares, ours by the same function, evaluations.

    The start is off by a factor of two in each of the four network parameters.
    """
    blocks = found.problem.tests[0]
    noise = found.noise
    residual, _ = residual_function(
        blocks, (float(noise.sd), float(noise.time), float(noise.white)), heat_of(found)
    )
    start = np.zeros(len(NAMES))
    truth = np.array(list(independent.SECOND.values()))
    start[:4] = np.log(np.array([2.0, 0.5, 2.0, 0.5]) * truth / CENTRE[:4]) / SD[:4]
    solution = least_squares(
        residual, start, jac="3-point", method="trf", xtol=1e-12, ftol=1e-12, gtol=1e-12
    )
    return solution.x, 2 * solution.cost, float(np.sum(residual(found.z) ** 2)), solution.nfev


def agreement(found: Fit) -> dict:
    assert tuple(slot.parameter.name for slot in found.slots) == NAMES
    theirs, squares, ours, evaluations = by_scipy(found)
    sd = np.sqrt(np.diag(found.covariance)[: len(NAMES)])
    gap = dict(zip(NAMES, (theirs - found.z) / sd, strict=True))
    return {
        "gap_in_sd": {name: float(value) for name, value in gap.items()},
        "sum_of_squares_scipy": float(squares),
        "sum_of_squares_heatrun": ours,
        "evaluations_scipy": int(evaluations),
    }
