"""One likelihood: heatrun beside C, numba, scipy, diffrax and casadi."""

import tempfile
from collections.abc import Callable
from functools import partial
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import ours
import rivals
import solvers
from duty_record import TRUTH, around
from rows import Row, median, ratio_row

SECTION = "Likelihood"


def by_hand(made: dict, repeats: int) -> list[Row]:
    """Compare with the same arithmetic written by hand, walkers in the inner loop."""
    rows, mine = [], ours.likelihood(made)

    def ratio(what: str, first: Callable, second: Callable, target: float | None) -> None:
        rows.append(ratio_row(SECTION, what, first, second, repeats, target))

    with tempfile.TemporaryDirectory() as folder:
        in_c = rivals.c_likelihood(made, Path(folder))
        check = around(4)
        for name, rival in (("C", in_c), ("numba", rivals.numba_likelihood(made))):
            if rival is None:
                continue
            np.testing.assert_allclose(rival(check), mine(jnp.asarray(check)), rtol=1e-9)
            for walkers, target in ((1, 1.1), (32, 2.0), (64, 1.5), (128, 1.5)):
                theta = around(walkers)
                first, second = partial(mine, jnp.asarray(theta)), partial(rival, theta)
                what = f"likelihood of {walkers} / {name}"
                ratio(what, first, second, target if rival is in_c else None)
        if in_c is not None:
            both = partial(ours.jacobian(made), jnp.asarray(TRUTH))
            what = "residual and Jacobian (4) / one in C"
            ratio(what, both, partial(in_c, TRUTH[None]), 3.0)
    many = jnp.asarray(around(64))
    coloured = partial(ours.coloured(made), many)
    ratio("OU + white / white likelihood, 64", coloured, partial(mine, many), 1.2)
    return rows


def by_solvers(made: dict, repeats: int) -> list[Row]:
    """Compare with what a user would write with a general solver, one parameter set.

    The error is that of the reading against the exact one: a solver that steps over the jumps of
    the inputs is both slow and wrong.
    """
    rows = []
    mine, one = ours.likelihood(made), jnp.asarray(TRUTH[None])
    here = median(lambda: mine(one), 3 * repeats)
    exact = ours.exact_reading(made)
    error = np.max(np.abs(ours.reading(made) - exact))
    rows.append(
        Row(SECTION, "one likelihood, heatrun", here, "s", None, f"reading errs by {error:.0e} K")
    )
    for name, build in solvers.SOLVERS.items():
        reading = build(made)
        if reading is None:
            continue
        error = np.max(np.abs(np.asarray(reading(TRUTH)) - exact))
        taken = median(lambda r=reading: r(TRUTH), max(2, repeats // 5))
        detail = f"{taken / here:.0f} x heatrun's time; reading errs by {error:.0e} K"
        rows.append(Row(SECTION, f"one likelihood, {name}", taken, "s", None, detail))
    return rows
