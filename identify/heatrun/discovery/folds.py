"""Each test predicted from the others: what a model is worth on data it has not seen."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float

from ..effects.engine import Engine, Refit

NUM_PARTS = 4
"""Parts that a single test is cut into; each is predicted from the others."""


def folds(engine: Engine, event: int | None = None) -> list[Bool[np.ndarray, " block"]]:
    """Return which blocks each fold leaves out.

    Args:
        engine: The tests.
        event: Index of the test of an event, which only other parts of that test can predict.
    """
    tests = engine.tests
    masks = []
    for index, test in enumerate(tests):
        if event is None and len(tests) > 1:
            parts = [(0, test.num_blocks)]
        elif event is None or index == event:
            cuts = np.linspace(0, test.num_blocks, NUM_PARTS + 1).round().astype(int)
            parts = list(pairwise(cuts))
        else:
            continue
        for begin, end in parts:
            left_out = [np.zeros(each.measured.size, dtype=bool) for each in tests]
            for sensor in test.by_sensor(left_out[index]):  # all that was read meanwhile
                sensor[begin:end] = True
            masks.append(np.concatenate(left_out) & engine.is_observed)
    return [mask for mask in masks if mask.any()]


def left_out_errors(
    engine: Engine, refit: Refit, masks: Sequence[Bool[np.ndarray, " block"]]
) -> Float[np.ndarray, " block"]:
    """Return the errors of the left-out blocks [K], predicted by a fit to the others.

    The model is taken as linear around its fit to everything. Start temperatures of a test that
    is left out as a whole are its own: they are fitted to it, the network is not.

    Args:
        engine: The tests.
        refit: A fit to all blocks.
        masks: Which blocks each fold leaves out.
    """
    noise = refit.noise
    columns, residual = engine.whiten(noise, refit.jacobian), engine.whiten(noise, refit.residual)
    prior = refit.z[list(refit.free)]
    errors = np.full(residual.size, np.nan)
    for mask in masks:
        own = _starts_of_whole_tests(engine, refit, mask)
        kept = ~mask & engine.is_observed
        # whitening mixes neighbours only; rows of kept blocks stand for the kept data
        A, r = columns[kept], residual[kept]
        precision = A.T @ A + np.eye(prior.size)
        step = -np.linalg.solve(precision, A.T @ r + prior)
        if own.any():
            B, rest = columns[mask][:, own], residual[mask] + columns[mask] @ step
            step[own] += -np.linalg.solve(B.T @ B + precision[np.ix_(own, own)], B.T @ rest)
        errors[mask] = (refit.residual + refit.jacobian @ step)[mask]
    return errors


def _starts_of_whole_tests(engine: Engine, refit: Refit, mask: np.ndarray) -> np.ndarray:
    """Return which free slots are start temperatures of a test that is left out as a whole."""
    parts = engine.problem.split(mask)
    whole = [
        index
        for index, (part, test) in enumerate(zip(parts, engine.tests, strict=True))
        if part[test.is_observed].all()
    ]
    slots = [engine.slots[slot] for slot in refit.free]
    return np.array([s.parameter.role == "start" and s.test in whole for s in slots])


def rmse(errors: np.ndarray) -> float:
    """Return the root mean square of the finite errors [K]."""
    return float(np.sqrt(np.mean(errors[np.isfinite(errors)] ** 2)))
