"""The evidence of all sets of effects around a fitted one, from one linearisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from ..model.noise import from_scores
from .engine import Candidate, Engine

if TYPE_CHECKING:
    from .search import Member, Set

SIZES = (0.3, 1.0, 3.0)
"""Sizes over the usual one at which an absent effect is tried [1]."""

NUM_MOMENTS = 6
"""Moments at which an absent event is tried."""

WORST_K = 1e5
"""Residual, or its slope, from which on an absent effect counts as one that the network cannot
take [K]."""

REACH = 2.0
"""Prior standard deviations that a linear step is followed [1]."""


class Linear:
    """The evidence of sets of effects under the noise of a fitted one.

    An effect that the fitted set has is taken out by the difference that this makes to the
    residuals; one that it lacks is put in at the size at which it explains most. Of several at
    once, the differences are added.

    Args:
        engine: The network with all effects, and the unmodelled heat of the fitted set.
        own: Slots of each effect that may be absent.
        base: Slots of the network without them.
        centre: The fitted set.
        tried: Scores by effect at which it explains most where it is absent; filled in here.

    Attributes:
        at: Scores of all slots, of absent effects those at which they are tried.
        shifts: What an effect's presence there, or its absence, changes of the residuals [K].
        slopes: Derivatives of the residuals by its scores there [K].
    """

    def __init__(
        self,
        engine: Engine,
        own: Mapping[Candidate, Sequence[int]],
        base: Sequence[int],
        centre: Member,
        tried: dict[Candidate, np.ndarray],
    ) -> None:
        self.engine, self.own, self.base, self.centre = engine, own, base, centre
        self._noise = from_scores(centre.noise_z)
        self._white = self.engine.whiten(self._noise, centre.jacobian)
        self.at = centre.z.copy()
        columns, shifts = [centre.jacobian[:, : len(base)]], []
        seen = self._seen_elsewhere(tried)
        for each, places in own.items():
            at = list(places)
            if each in centre.effects:
                ((_, residual, _),) = seen[each]
                shifts.append(residual - centre.residual)
                columns.append(centre.jacobian[:, [centre.free.index(slot) for slot in at]])
            else:
                shift, slopes, self.at[at] = self._best(at, seen[each])
                tried[each] = self.at[at]
                shifts.append(shift)
                columns.append(slopes)
        self.shifts = dict(zip(own, shifts, strict=True))
        self.slopes = dict(zip(own, columns[1:], strict=True))
        joined = [centre.residual[:, None], np.stack(shifts, axis=1), *columns]
        # what has left the model is far off all the same, and spares the products the rest
        within = np.clip(np.nan_to_num(np.concatenate(joined, axis=1)), -WORST_K, WORST_K)
        rows = self.engine.whiten(self._noise, within)
        self._products = rows.T @ rows
        ends = np.cumsum([1 + len(shifts), len(base), *map(len, own.values())])
        self._places = {
            each: list(range(start, start + len(own[each])))
            for each, start in zip(own, ends[1:], strict=False)
        }
        self._known: dict[Set, tuple[float, np.ndarray]] = {}

    def log_evidence(self, effects: Set) -> float:
        """Return the log evidence of a set, up to what all share [nat]."""
        return (
            self._solved(effects)[0]
            - self._solved(self.centre.effects)[0]
            + (self.centre.log_evidence)
        )

    def scores(self, effects: Set) -> Float[np.ndarray, " slot"]:
        """Return scores of all slots to fit a set from."""
        return np.clip(self._solved(effects)[1], self.at - REACH, self.at + REACH)

    def _solved(self, effects: Set) -> tuple[float, np.ndarray]:
        if effects not in self._known:
            changed = [
                1 + number
                for number, each in enumerate(self.own)
                if (each in effects) != (each in self.centre.effects)
            ]
            first = 1 + len(self.own)
            used, order = list(range(first, first + len(self.base))), list(self.base)
            for each, places in self.own.items():
                if each in effects:
                    used += self._places[each]
                    order += places
            turn = np.zeros((self._products.shape[0], 1 + len(used)))
            turn[[0, *changed], 0] = 1.0
            turn[used, np.arange(1, 1 + len(used))] = 1.0
            value, step = evidence(turn.T @ self._products @ turn, self.at[order])
            z = self.at.copy()
            z[order] += step
            self._known[effects] = value, z
        return self._known[effects]

    def _seen_elsewhere(
        self, tried: Mapping[Candidate, np.ndarray]
    ) -> dict[Candidate, list[tuple[np.ndarray, np.ndarray, np.ndarray]]]:
        """Return scores of each effect with residuals and their derivatives there: of one that the
        fitted set has, where it is absent; of the others, where they are tried.
        """
        scores: dict[Candidate, list[np.ndarray]] = {}
        jobs = []
        for each, places in self.own.items():
            is_there = each in self.centre.effects
            if is_there:
                scores[each] = [np.full(len(places), np.nan)]
            else:
                scores[each] = [tried[each]] if each in tried else self._starts(places)
            for at in scores[each]:
                z = self.centre.z.copy()
                z[list(places)] = at
                jobs.append((z, [] if is_there else list(places)))
        found = iter(self.engine.linearise_many(jobs))
        return {each: [(at, *next(found)) for at in of] for each, of in scores.items()}

    def _best(
        self, places: list[int], seen: Sequence[tuple[np.ndarray, np.ndarray, np.ndarray]]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return what an absent effect changes, its derivatives and its scores, where it explains
        most.
        """
        centre = self.centre
        best, value = None, -np.inf
        for at, residual, slopes in seen:
            # no comparison is true of a NaN; slopes are those of one standard deviation
            if not max(np.max(np.abs(residual)), np.max(np.abs(slopes), initial=0.0)) <= WORST_K:
                continue
            rows = self.engine.whiten(self._noise, np.column_stack([residual, slopes]))
            rows = np.concatenate([rows[:, :1], self._white, rows[:, 1:]], axis=1)
            found = evidence(rows.T @ rows, np.concatenate([centre.z[list(centre.free)], at]))[0]
            if found > value:
                best, value = (residual - centre.residual, slopes, at), found
        if best is None:
            nothing = np.zeros((centre.residual.size, len(places)))
            best = nothing[:, 0], nothing, np.zeros(len(places))
        return best

    def _starts(self, places: Sequence[int]) -> list[np.ndarray]:
        """Return scores at which an absent effect is tried."""
        result = [np.zeros(len(places))]
        for place, slot in enumerate(places):
            parameter = self.engine.slots[slot].parameter
            quantity = self.engine.quantity(parameter)
            moves = np.zeros(1)
            if quantity.null == 0.0 and parameter.transform == "log":
                moves = np.log(SIZES) / parameter.sd
            elif quantity.null is None and parameter.per_test:  # the moment of an event
                moves = np.linspace(-1.8, 1.8, NUM_MOMENTS)
            elif quantity.unit == "s" and len(places) > 1:  # the delay of a body
                moves = np.array([-1.0, 1.0])
            step = np.eye(len(places))[place]
            result = [at + move * step for at in result for move in moves]
        return result


def evidence(
    products: Float[np.ndarray, "column column"], scores: Float[np.ndarray, " parameter"]
) -> tuple[float, Float[np.ndarray, " parameter"]]:
    """Return the log evidence of a linear model [nat], and the step to its optimum.

    Args:
        products: Inner products of the whitened residual, first, and its derivatives by scores.
        scores: At which these stand; their prior is standard normal.
    """
    gradient = products[1:, 0] + scores
    try:
        factor = np.linalg.cholesky(products[1:, 1:] + np.eye(scores.size))
    except np.linalg.LinAlgError:
        # two large derivatives that are nearly one lose the prior in their products
        values, vectors = np.linalg.eigh(products[1:, 1:])
        roots = np.sqrt(np.maximum(values, 0.0) + 1.0)
        factor = np.linalg.qr((vectors * roots).T).R.T
        factor = factor * np.sign(np.diag(factor))
    half = np.linalg.solve(factor, gradient)
    squares = products[0, 0] + scores @ scores - half @ half
    log_det = np.sum(np.log(np.diag(factor)))
    return float(-0.5 * squares - log_det), -np.linalg.solve(factor.T, half)
