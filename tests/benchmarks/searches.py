"""Fits: one search on all samples beside scipy's, and the whole fit of heatrun."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np
import optimistix as optx
import ours
import rivals
import solvers
from duty_record import TRUTH
from rows import Row, duration, median, ratio_row, seconds
from scipy.optimize import least_squares

from heatrun.fit.fit import fit

SECTION = "Fit"
OFF = np.log([2.0, 0.5, 2.0, 0.5])
"""Start: off by a factor of two in each of the four network parameters, as logarithms."""


def one_search(made: dict, repeats: int) -> list[Row]:
    """Compare one search over the four network parameters on all samples at 10 Hz."""
    mine = _ours(made)
    numba_reading = rivals.numba_reading(made)
    found = np.asarray(mine())
    taken = median(mine, repeats)
    rows = [Row(SECTION, "one search at 10 Hz, heatrun's simulator and optimistix", taken, "s")]
    if numba_reading is not None:
        residual, search, counted = _by_scipy(made, numba_reading)
        # the same optimum: chi squared within a thousandth, a thirtieth of a sd at most
        squares = [np.sum(residual(logs) ** 2) / 0.3**2 for logs in (search(), found)]
        np.testing.assert_allclose(*squares, atol=1e-3, rtol=0.0)
        what = "one search at 10 Hz / scipy on numba"
        rows.append(ratio_row(SECTION, what, mine, search, repeats))
        evaluations, slow = counted(), solvers.scipy_solver(made)
        each = median(lambda: slow(TRUTH), 2)
        what = "one search at 10 Hz, scipy on solve_ivp (extrapolated)"
        detail = f"{evaluations} evaluations of {duration(each)}"
        rows.append(Row(SECTION, what, evaluations * each, "s", None, detail))
    return rows


def whole(made: dict) -> list[Row]:
    """Time the fit that `calibrate` does, compiling and warm."""
    problem = ours.problem(made)
    first = seconds(lambda: fit(problem).z)
    warm = [seconds(lambda: fit(ours.problem(made)).z) for _ in range(5)]
    found = fit(problem)
    detail = (
        f"{found.stats['num_starts']:.0f} starts, noise and covariance, {made['measured'].size} "
        f"samples reduced to 2 s; Ceq_w {found.values()['Ceq_w']:.1f} J/K"
    )
    return [
        Row(SECTION, "complete fit, warm", float(np.median(warm)), "s", 0.1, detail),
        Row(SECTION, "complete fit, fastest of five", min(warm), "s", 0.1),
        Row(SECTION, "complete fit, compiling", first, "s", 3.0),
    ]


def _ours(made: dict) -> Callable:
    inputs, measured = ours.inputs_of(made), jnp.asarray(made["measured"])
    rest = jnp.asarray(TRUTH[4:])

    def residual(logs, _):
        network, losses, start = ours.build(jnp.concatenate([TRUTH[:4] * jnp.exp(logs), rest]))
        return measured - ours.lptn.reading(network, losses, inputs, start)[1:]

    @jax.jit
    def search(start):
        solver = optx.LevenbergMarquardt(rtol=1e-8, atol=1e-8)
        options = {"jac": "fwd"}
        return optx.least_squares(residual, solver, start, options=options, max_steps=100).value

    return lambda: search(jnp.asarray(OFF))


def _by_scipy(made: dict, reading: Callable) -> tuple[Callable, Callable, Callable]:
    """Return the residual, the search, and a function that counts its evaluations."""

    def residual(logs):
        return made["measured"] - reading(np.concatenate([TRUTH[:4] * np.exp(logs), TRUTH[4:]]))

    def search(function=residual):
        return least_squares(function, OFF, xtol=1e-8, ftol=1e-10).x

    def count():
        calls = []
        search(lambda logs: calls.append(1) or residual(logs))
        return len(calls)

    return residual, search, count
