"""Held-out tests as a gate: no effect enters the model that predicts one of them worse.

They then take part in the selection. What is said of them afterwards is no independent proof, and
the result says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np

from ...bench.blocks import Blocks
from ...inference.problem import Problem
from ...inference.starts import start_draws
from ..screening.engine import Engine, Refit
from ..screening.known import searched_effects_of
from .acceptance import Rival
from .folds import rmse

WORSE_K, WORSE_SHARE, WORSE_NOISE = 0.05, 0.10, 0.5
"""An error that grows by less than this counts as the same: in kelvin, in parts of itself and of
the noise of a block mean [1]."""


class HeldOut:
    """Tests that are predicted by fits of the calibration tests, never fitted.

    Args:
        engine: The extended model over the calibration tests.
        tests: The held-out tests.
    """

    def __init__(self, engine: Engine, tests: Sequence[Blocks]) -> None:
        full = engine.problem
        self._fitted = engine
        searched = searched_effects_of(full)
        self._trial = Engine(Problem.of(full.model, full.motor, list(tests), searched))

    def errors(self, fit: Refit) -> tuple[float, ...]:
        """Return the root mean square error on each test [K], NaN where nothing was read.

        Args:
            fit: A fit of the calibration tests. What belongs to one test of these alone, such as
                an event, is left at its null.
        """
        trial = self._trial
        z = np.zeros(len(trial.slots))
        for position, slot in enumerate(trial.slots):
            same = self._fitted.find(slot.parameter.name) if slot.test is None else None
            if same is not None:
                z[position] = fit.z[same]
        for index in range(len(trial.tests)):
            z = self._started(z, index, fit)
        residual, _ = trial.linearise(z, [])
        parts = trial.problem.split(residual)
        return tuple(
            rmse(part[test.is_observed]) if test.is_observed.any() else np.nan
            for part, test in zip(parts, trial.tests, strict=True)
        )

    def judged(self, rival: Rival, present: Refit) -> Rival:
        """Return the rival with its errors, and rejected if it predicts one test worse.

        Args:
            rival: An effect that has passed all else.
            present: Fit of the model without it.
        """
        errors = tuple(zip(self.errors(present), self.errors(rival.refit), strict=True))
        noise = float(present.noise.total())
        reason = ""
        for without, with_it in errors:
            if np.isnan(without):
                continue
            least = max(WORSE_K, WORSE_SHARE * without, WORSE_NOISE * noise)
            if not with_it <= without + least:
                reason = (
                    f"it predicts the held-out test worse: {with_it:.2f} K with it, "
                    f"{without:.2f} K without"
                )
        return replace(rival, held_out_K=errors, reason=reason)

    def _started(self, z: np.ndarray, index: int, fit: Refit) -> np.ndarray:
        """Return the scores with a test at its most probable start, as a prediction has it."""
        trial, test = self._trial, self._trial.tests[index]
        known = dict(trial.problem.parameters.by_test[index])
        values, _ = trial.values(z, index)
        names = {name for _, name in trial.problem.model.form.starts}
        others = {n: np.full(1, value) for n, value in values.items() if n not in names}
        noise = jax.tree.map(lambda value: jnp.reshape(value, (1,)), fit.noise)
        loggers = self._fitted.problem.loggers
        starts = start_draws(trial.problem.model, test, known, others, noise, loggers, None)
        started = z.copy()
        for position, slot in enumerate(trial.slots):
            if slot.test == index and slot.parameter.name in starts:
                value = float(starts[slot.parameter.name][0])
                started[position] = float(slot.parameter.score(value))
        return started
