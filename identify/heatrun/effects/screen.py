"""All effects scored in one pass: what each would leave, and how much of it the residuals hold.

Around a fit the model is linear in the scores. The signature of an effect is the derivative of
the block means by its amplitude, for several settings of its shape parameters; what the fitted
parameters could mimic is projected out of it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float
from scipy.stats.qmc import Halton

from ..inference.effect_parameters import amplitudes, qualified
from .engine import Engine, Refit
from .library import Candidate

NUM_VARIANTS = 9
"""Settings of the shape parameters that are tried."""

NUM_STARTS = 3
"""Settings of its shape that an effect with a state is refitted from, the best of the screening."""

REACH = 1.5
"""Shape parameters are tried within this many prior standard deviations [1]."""

VISIBLE = 3.0
"""Norm of a whitened signature from which on an effect could be seen [1]: three standard
deviations of its amplitude."""

VISIBLE_K = 0.12
"""And what it must leave after a refit at its typical size [K]: less is within what lumping,
instruments and the loss balance leave on any bench."""


@dataclass(frozen=True)
class Signature:
    """What one candidate does to the block means at one setting of its shape.

    Attributes:
        candidate: The candidate.
        slots: Slots of its amplitudes.
        shape: Scores by slot of its shape parameters.
        columns: Derivative of the residuals by the amplitudes [K per score], (block, amplitude).
    """

    candidate: Candidate
    slots: tuple[int, ...]
    shape: dict[int, float]
    columns: Float[np.ndarray, "block amplitude"]


@dataclass(frozen=True)
class Score:
    """How a candidate fares in the screening, at the setting of its shape that suits it best.

    Attributes:
        candidate: The candidate.
        gain: Drop of the sum of squares that its amplitude would bring [1].
        log_bayes: Its approximate log Bayes factor over the model without it [nat].
        start: Scores by slot to start a refit from.
        visibility: Norm of its whitened, projected signature at the typical amplitude [1].
        visible_K: Root mean square of its projected signature at that amplitude, summed over the
            sensors as `Engine.rms_K` [K].
        direction: Its whitened, projected signature at the estimate, of length one.
        shift: By how much it would move the free scores of the present model at the estimate.
        other_starts: The next best starts, at other settings of its shape.
    """

    candidate: Candidate
    gain: float
    log_bayes: float
    start: dict[int, float]
    visibility: float
    visible_K: float
    direction: Float[np.ndarray, " block"]
    shift: Float[np.ndarray, " free"]
    other_starts: tuple[dict[int, float], ...] = ()

    @property
    def is_visible(self) -> bool:
        """Whether these tests could show the effect at all."""
        return self.visibility >= VISIBLE and self.visible_K >= VISIBLE_K


def signatures(engine: Engine, z: np.ndarray, candidates: Sequence[Candidate]) -> list[Signature]:
    """Return the signatures of candidates at several settings of their shapes.

    Args:
        engine: The extended model.
        z: Scores of the present model; the candidates' amplitudes are at their null.
        candidates: Effects that are not in the present model.
    """
    owned = [_slots(engine, candidate) for candidate in candidates]
    shapes = [s for _, shape in owned for s in shape]
    columns = sorted({slot for amplitude, _ in owned for slot in amplitude})
    draws = _settings(len(shapes))
    result = []
    for number in range(NUM_VARIANTS):
        at = z.copy()
        at[shapes] = draws[number]
        _, jacobian = engine.linearise(at, columns)
        for candidate, (amplitude, shape) in zip(candidates, owned, strict=True):
            if number and not shape:
                continue  # nothing to vary
            result.append(
                Signature(
                    candidate,
                    amplitude,
                    {slot: float(at[slot]) for slot in shape},
                    jacobian[:, [columns.index(slot) for slot in amplitude]],
                )
            )
    return result


class Screen:
    """Signatures against the present model, whitened and projected.

    Args:
        engine: The extended model.
        present: Fit of the present model; all further quantities are relative to it.
        library: Signatures of the candidates.
    """

    def __init__(self, engine: Engine, present: Refit, library: Sequence[Signature]) -> None:
        self.engine = engine
        self.present = present
        self.library = list(library)
        noise = present.noise
        base = engine.whiten(noise, present.jacobian)
        num_free = base.shape[1]
        stacked = np.concatenate([s.columns for s in library], axis=1)
        # a signature that is not finite has left the model: no amplitude of it can be estimated
        self._is_finite = np.all(np.isfinite(stacked), axis=0)
        self._raw = np.where(self._is_finite, stacked, 0.0)
        self._ends = np.cumsum([0, *(s.columns.shape[1] for s in library)])
        self._scores = np.array([typical(engine, slot) for s in library for slot in s.slots])
        # the priors are rows below the readings; by QR, since the difference of two products loses
        # the prior of a large signature that the parameters mimic
        self._basis, upper = np.linalg.qr(np.concatenate([base, np.eye(num_free)]))
        below = np.zeros((num_free, stacked.shape[1]))
        rows = np.concatenate([engine.whiten(noise, self._raw), below])
        in_base = self._basis.T @ rows
        self._mimicked = np.linalg.solve(upper, in_base)
        self._left = rows - self._basis @ in_base
        self._rows = np.concatenate([
            engine.whiten(noise, present.residual), present.z[list(present.free)]
        ])  # fmt: skip
        self._num_blocks = base.shape[0]

    @property
    def residual(self) -> Float[np.ndarray, " block"]:
        """Whitened residuals of the present model [1]."""
        return self._rows[: self._num_blocks]

    def scores(self) -> list[Score]:
        """Return each candidate's score at its best setting, the most promising first."""
        gradient = self._left.T @ self._rows
        tried: dict[Candidate, list[Score]] = {}
        for number in range(len(self.library)):
            score = self._score(number, gradient)
            tried.setdefault(score.candidate, []).append(score)
        best = [_best(scores) for scores in tried.values()]
        return sorted(best, key=lambda score: -score.log_bayes)

    def largest_gain(self, noise_rows: Float[np.ndarray, "block draw"]) -> np.ndarray:
        """Return the largest log Bayes factor of all candidates for whitened noise draws."""
        gradient = self._projected.T @ noise_rows
        largest = np.full(noise_rows.shape[1], -np.inf)
        for number in range(len(self.library)):
            span = slice(self._ends[number], self._ends[number + 1])
            if not np.all(self._is_finite[span]):
                continue
            upper, log_det = self._precision_root(span)
            half = np.linalg.solve(upper.T, gradient[span])
            largest = np.maximum(largest, 0.5 * np.sum(half**2, axis=0) - 0.5 * log_det)
        return largest

    def projected(self) -> Float[np.ndarray, "block column"]:
        """Return all whitened signatures at typical amplitude less what the model can mimic."""
        return self._projected * self._scores

    def raw_typical(self) -> Float[np.ndarray, "block column"]:
        """Return all signatures at typical amplitude [K]."""
        return self._raw * self._scores

    @property
    def _projected(self) -> Float[np.ndarray, "block column"]:
        """All whitened signatures less what the model can mimic, at a score of one."""
        return self._left[: self._num_blocks]

    def _precision_root(self, span: slice) -> tuple[np.ndarray, float]:
        """Return the upper root of the precision of amplitudes, and the log determinant of that."""
        columns = self._left[:, span]
        rows = np.concatenate([columns, np.eye(columns.shape[1])])
        upper = np.linalg.qr(rows).R
        return upper, 2.0 * float(np.sum(np.log(np.abs(np.diag(upper)))))

    def _score(self, number: int, gradient: np.ndarray) -> Score:
        signature = self.library[number]
        span = slice(self._ends[number], self._ends[number + 1])
        upper, log_det = self._precision_root(span)
        # the residual r(z) falls along minus the gradient of half its square
        estimate = -np.linalg.solve(upper, np.linalg.solve(upper.T, gradient[span]))
        estimate = self._inside(signature, estimate)
        gain = float(-2 * estimate @ gradient[span] - np.sum((upper @ estimate) ** 2))
        size = self._scores[span]
        projected, mimicked = self._projected[:, span], self._mimicked[:, span]
        direction = projected @ (estimate if np.any(estimate) else size)
        at_typical = projected @ size
        raw = (self._raw[:, span] - self.present.jacobian @ mimicked) @ size
        length = float(np.linalg.norm(direction))
        return Score(
            candidate=signature.candidate,
            gain=gain,
            log_bayes=0.5 * gain - 0.5 * log_det if np.all(self._is_finite[span]) else -np.inf,
            start=dict(zip(signature.slots, estimate, strict=True)) | signature.shape,
            visibility=float(np.linalg.norm(at_typical)),
            visible_K=self.engine.rms_K(raw),
            direction=direction / max(length, 1e-300),
            shift=-mimicked @ estimate,
        )

    def _inside(self, signature: Signature, estimate: np.ndarray) -> np.ndarray:
        """Return the estimate, zero where the data ask for the wrong sign."""
        low, high = self.engine.bounds(signature.slots)
        return np.clip(estimate, low, high)


def _best(settings: list[Score]) -> Score:
    """Return a candidate's best setting, with the next best ones as starts.

    The visibility is that of the setting at which the effect could be seen best.
    """
    ranked = sorted(settings, key=lambda score: -score.log_bayes)
    seen = max(settings, key=lambda score: score.visibility)
    return replace(
        ranked[0],
        visibility=seen.visibility,
        visible_K=seen.visible_K,
        other_starts=tuple(score.start for score in ranked[1:NUM_STARTS]),
    )


def _slots(engine: Engine, candidate: Candidate) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Return the slots of a candidate's amplitudes and of its shape parameters."""
    kind = candidate.kind
    strong = amplitudes(kind)
    free = {
        name: engine.find(qualified(kind, name), candidate.test) for name in kind.card.parameters
    }
    amplitude = tuple(slot for name, slot in free.items() if name in strong and slot is not None)
    shape = tuple(slot for name, slot in free.items() if name not in strong and slot is not None)
    return amplitude, shape


def _settings(num: int) -> Float[np.ndarray, "variant shape"]:
    """Return settings of shape parameters in scores: the middle first, then spread evenly."""
    if num == 0:
        return np.zeros((NUM_VARIANTS, 0))
    spread = Halton(d=1, scramble=False).random(NUM_VARIANTS).ravel()
    rng = np.random.default_rng(0)
    # a permutation for each parameter: all values appear, and pairs are not in step
    draws = np.stack([rng.permutation(spread) for _ in range(num)], axis=1)
    draws = REACH * (2.0 * (draws + 0.5 / NUM_VARIANTS) - 1.0)
    draws[0] = 0.0
    return np.clip(draws, -REACH, REACH)


def typical(engine: Engine, slot: int) -> float:
    """Return the score of the typical amplitude of an effect [1]."""
    parameter = engine.slots[slot].parameter
    effect, name = parameter.name.split(".", 1)
    quantity = engine.kinds[effect].card.parameters[name]
    return float(parameter.score(quantity.typical))
