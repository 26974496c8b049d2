"""The tests of all effects at one stage of a search: which are seen, and how large they are."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from heatrun.model.parameters import effect_parameters
from lptn.effects import AbstractEffect, Quantity

from .pooled import CLIP, FREE, Pool, Tested, largest_by_chance, one_sided, score_test, shape_of

BEYOND = 1.5
"""Largest plausible amplitude over that of the catalogue [1]."""


@dataclass(frozen=True)
class Column:
    """An amplitude at a setting of its shape.

    Attributes:
        kind: The effect.
        parameter: Name of the amplitude.
        shape: Values of the shape parameters, by name.
        quantity: The amplitude's range and unit.
        scale: Amplitude at a score of one [its unit].
    """

    kind: type[AbstractEffect]
    parameter: str
    shape: dict[str, float]
    quantity: Quantity
    scale: float

    @classmethod
    def of(cls, label: str, scale: float, catalogue: Mapping[str, type[AbstractEffect]]) -> Column:
        """Return what a label of `Evidence.effects` stands for.

        Args:
            label: Such as `"natural_convection.f|n=0.29"`.
            scale: Amplitude at a score of one in a machine of this size [its unit].
            catalogue: Effects by id.
        """
        name = label.partition("|")[0]
        id, _, parameter = name.partition(".")
        kind = catalogue[id]
        own = next(p for p in effect_parameters([kind], 1.0, [kind]) if p.name == name)
        usual, larger = kind.card.parameters[parameter], scale / own.sd
        null = usual.null or 0.0
        low, high = (null + larger * (end - null) for end in (usual.low, usual.high))
        quantity = usual._replace(low=low, high=high)
        return cls(kind, parameter, shape_of(label), quantity, scale)

    @property
    def id(self) -> str:
        """Id of the effect."""
        return self.kind.card.id

    @property
    def is_two_sided(self) -> bool:
        """Whether the amplitude may have either sign."""
        null = self.quantity.null or 0.0
        return self.quantity.low < null < self.quantity.high

    def is_plausible(self, score: float) -> bool:
        """Whether the amplitude of a score is one that a machine may have."""
        size = self.scale * score
        null = self.quantity.null or 0.0
        low = min(self.quantity.low - null, 0.0)
        return BEYOND * low <= size <= BEYOND * (self.quantity.high - null)


@dataclass(frozen=True)
class Round:
    """The tests of all effects with some in the model.

    Attributes:
        pool: The machines.
        columns: What the effects stand for.
        is_two_sided: Of each.
        precision: Of what is known of each shared parameter, of its score [1].
        accepted: Effects in the model, by their places.
        test: Of each effect.
        chance: Largest statistics by chance.
        critical: That of them which is exceeded with the probability of the level.
        information: Precision of each effect's score, by what the fits state.
    """

    pool: Pool
    columns: list[Column]
    is_two_sided: Bool[np.ndarray, " effect"]
    precision: np.ndarray
    accepted: tuple[int, ...]
    test: Tested
    chance: np.ndarray
    critical: float
    information: Float[np.ndarray, " effect"]

    @classmethod
    def of(
        cls, pool: Pool, columns: list[Column], both: np.ndarray, precision: np.ndarray,
        accepted: Sequence[int], level: float, seed: int,
    ) -> Round:  # fmt: skip
        """Return the round; arguments as the attributes, and the level and seed of its chance."""
        test = score_test(pool, precision, accepted)
        chance = largest_by_chance(test, both, seed)
        critical = float(np.quantile(chance, 1.0 - level))
        stated = information(pool, precision, accepted)
        return cls(pool, columns, both, precision, tuple(accepted), test, chance, critical, stated)

    @property
    def strength(self) -> np.ndarray:
        """Statistics, of one-sided effects with their sign."""
        return one_sided(self.test.statistic, self.is_two_sided)

    def left_K(self) -> float:
        """Return what the largest effect beyond chance leaves, plausible or not [K]; 0 for none."""
        visible = np.abs(self.scores()) * np.nanmedian(self.pool.visible_K, axis=0)
        return float(np.max(np.where(self.strength >= self.critical, visible, 0.0)))

    def scores(self) -> np.ndarray:
        """Return the amplitudes to first order, in scores."""
        return self.test.statistic * self.test.scale / np.maximum(self.information, 1e-12)

    def gain(self) -> np.ndarray:
        """Return the drop of the sum of squares that each effect would bring."""
        return self.strength.clip(0.0) * self.test.scale * np.abs(self.scores())

    def usable(self) -> list[int]:
        """Return the effects that are seen and plausible, the one that explains most first."""
        known = {self.columns[each].id for each in self.accepted}
        score, gain = self.scores(), self.gain()
        seen = [
            place for place, column in enumerate(self.columns)
            if 0.0 < self.strength[place] >= self.critical and column.is_plausible(score[place])
            and column.id not in known
        ]  # fmt: skip
        return sorted(seen, key=lambda place: -gain[place])

    def best(self) -> int | None:
        """Return the first of them, None where there is none."""
        return next(iter(self.usable()), None)

    def p(self, place: int) -> float:
        """Return the family-wise p-value of an effect [1]."""
        return float((1 + np.sum(self.chance >= self.strength[place])) / (1 + self.chance.size))


def information(pool: Pool, precision: np.ndarray, accepted: Sequence[int]) -> np.ndarray:
    """Return the precision of each effect's score over all machines, by what the fits state."""
    num = pool.num_parameters
    given = [*range(num), *(num + each for each in accepted)]
    whole = pool.information.sum(axis=0)
    H = whole[np.ix_(given, given)] + np.diag([*precision, *([FREE] * len(accepted))])
    across = whole[given, num:]
    return np.diag(whole)[num:] - np.einsum("ea,ea->a", across, np.linalg.solve(H, across))


SEEN = 2.0
"""Standard deviations beyond what tests leave open, from which on machines differ [1]."""


def amplitude(found: Round, best: int) -> tuple[float, float, float]:
    """Return amplitude, its standard deviation, and the spread over machines, in scores.

    Args:
        found: The tests.
        best: Place of the effect.
    """
    pool = found.pool
    num = pool.num_parameters
    given = [*range(num), *(num + each for each in found.accepted)]
    D = np.array([*found.precision, *([FREE] * len(found.accepted))])
    L_ee = pool.information[:, given][:, :, given]
    L_ea = pool.information[:, given, num + best]
    H = L_ee.sum(axis=0) + np.diag(D)
    shared = np.linalg.solve(H, pool.score[:, given].sum(axis=0))
    A = np.linalg.solve(H, L_ea.sum(axis=0))
    own = pool.information[:, num + best, num + best]
    m = own - 2.0 * L_ea @ A + np.einsum("e,ief,f->i", A, L_ee, A)
    total = float(found.information[best])
    of_prior = float(np.sum(D * A**2))
    shares = pool.score[:, num + best] - L_ea @ shared - (pool.score[:, given] - L_ee @ shared) @ A
    pulled = float(A @ (D * shared))
    score = (float(np.sum(shares)) + pulled) / total
    left = shares
    for _ in range(5):
        # what a machine says of the effect once shared parameters have moved with it
        left = shares - m * score
        limit = CLIP * 1.4826 * np.median(np.abs(left - np.median(left)))
        left = np.clip(left, -limit, limit)
        score += (float(np.sum(left)) + pulled - of_prior * score) / total
    variance = float(np.sum(left**2)) * left.size / (left.size - 1) + of_prior
    beyond = float(np.sum(left**2 - m))
    is_seen = beyond > SEEN * float(np.sqrt(2.0 * np.sum(m**2)))
    answer = own - L_ea @ A  # to an amplitude of its own, shared parameters held
    spread = beyond / float(np.sum(answer**2)) if is_seen else 0.0
    return score, float(np.sqrt(variance)) / total, float(np.sqrt(spread))
