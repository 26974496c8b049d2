"""Held-out tests as a gate: no effect enters the model that predicts one of them worse.

They then take part in the selection. What is said of them afterwards is no independent proof, and
the result says so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..bench.blocks import Blocks
from ..inference.problem import Problem
from .acceptance import Rival
from .engine import Engine, Refit
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
        self._trial = Engine(Problem.of(full.model, full.motor, list(tests)))

    def errors(self, fit: Refit) -> tuple[float, ...]:
        """Return the root mean square error on each test [K].

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
        residual, _ = trial.linearise(self._started(z), [])
        parts = trial.problem.split(residual)
        return tuple(
            rmse(part[test.is_observed]) for part, test in zip(parts, trial.tests, strict=True)
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
            least = max(WORSE_K, WORSE_SHARE * without, WORSE_NOISE * noise)
            if not with_it <= without + least:
                reason = (
                    f"it predicts the held-out test worse: {with_it:.2f} K with it, "
                    f"{without:.2f} K without"
                )
        return replace(rival, held_out_K=errors, reason=reason)

    def _started(self, z: np.ndarray) -> np.ndarray:
        """Return the scores with each test started from its first readings, as in a prediction."""
        trial = self._trial
        values = {slot.name: slot.parameter.value(z[i]) for i, slot in enumerate(trial.slots)}
        offset = float(values.get("sensor_offset", 0.0))
        started = z.copy()
        for position, slot in enumerate(trial.slots):
            if slot.parameter.role == "start":
                started[position] = float(slot.parameter.score(slot.parameter.centre - offset))
        return started
