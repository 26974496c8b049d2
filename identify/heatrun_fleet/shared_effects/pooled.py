r"""The test of an effect that all machines of a type share.

The machines' scores $v_i = (v_{e,i}, v_{a,i})$ about shared parameters $e$ and effects $a$ add up.
The shared parameters are those of network, instruments and starts by what the machines have in
common; an instrument of the bench is off by the same amount for all of them, which no number of
machines averages out, so $e \sim N(0, 1)$ stays in the test:

$$ S = \sum_i \varphi_i + A' D \hat e, \quad
   \varphi_i = (v_{a,i} - \Lambda_{ae,i} \hat e) - A'(v_{e,i} - \Lambda_{ee,i} \hat e), \quad
   A = H^{-1} \sum_i \Lambda_{ea,i}, \quad H = \sum_i \Lambda_{ee,i} + D $$

with $D$ the precision of what is known of $e$. Where the effect is absent, $\varphi_i$ of
independent machines is as likely the one sign as the other, and $D^{1/2}\hat e$ adds what the
shared errors do. So the variance is taken from the machines themselves,
$\sum \varphi_i^2 + A'DA$: differences between machines, noise that is stated too small or too
large, and misfit of single machines are in it. Flipped signs give the law of the largest statistic
of all effects.

References: D. R. Cox, D. V. Hinkley, Theoretical Statistics (1974), section 9.3 (score tests).
    P. H. Westfall, S. S. Young, Resampling-Based Multiple Testing (1993), section 2.3 (the law of
    the largest statistic).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from heatrun.effects.engine import Engine, placed
from heatrun.effects.found import with_catalogue
from heatrun.fit.fit_result import Fit
from heatrun.model.catalogue import all_effects
from heatrun.model.parameters import EVENT, amplitudes, effect_parameters, qualified
from heatrun.model.problem import Problem
from lptn.effects import AbstractEffect, Quantity

SETTINGS = (0.0, -1.0, 1.0)
"""Scores of the shape parameters that an effect is tried with, all of them alike [1]."""


@dataclass(frozen=True)
class Evidence:
    """What the tests of a machine say of shared parameters and of effects."""

    parameters: tuple[str, ...]  # Names of the free parameters; tests stand by number in brackets.
    effects: tuple[str, ...]  # Amplitudes, each with the setting of its shape behind a bar.
    # Of each effect, its amplitude at a score of one in a machine of this size.
    scale: Float[np.ndarray, " effect"]
    # Derivative of the log likelihood by the parameters' shared scores, then by the effects'
    # scores, where all are zero, shape (all,).
    score: Float[np.ndarray, " all"]
    information: Float[np.ndarray, "all all"]  # Its precision, shape (all, all).
    # Root mean square that each effect leaves beyond what a refit takes up, at a score of one [K],
    # shape (effect,).
    visible_K: Float[np.ndarray, " effect"]


def evidence_of(fit: Fit) -> Evidence:
    r"""Return what the tests of a machine say of the effects that they could show.

    With the residuals linear in the scores, $r + J z + h a$, noise and unmodelled heat whitened,
    and the machine's own scores spread as their prior around shared ones, $z \sim N(e, 1)$, the
    tests speak of $x = (e, a)$ by a score $v$ and an information $\Lambda$ alone:

    $$ v_e = \hat z, \quad v_a = -h'r + B'(J'r + \hat z), \quad
       \Lambda = \begin{pmatrix} 1 - P^{-1} & B \\ B' & h'h - h'J B \end{pmatrix}, \quad
       B = P^{-1}J'h, \quad P = J'J + 1 $$

    Those of many machines add up. What an effect is told by, less what network, instruments and
    starts could mimic, is in them; so is how far errors that all machines share would move it.
    """
    problem = fit.problem
    kinds = [kind for kind in all_effects() if kind.card.family != EVENT]
    motor, tests = problem.motor, problem.tests
    found, extended = with_catalogue(problem.model, motor, tests, kinds)
    engine = Engine(Problem.of(extended, motor, tests, searched=found.kinds))
    engine = engine.with_noise_of(problem)
    z, _ = placed(engine, fit)
    labels, scale, columns = _signatures(engine, np.nan_to_num(z))
    jacobian, residual = np.concatenate(fit.jacobian), np.concatenate(fit.residual)
    num = jacobian.shape[1]
    stacked = np.column_stack([residual, jacobian, columns])
    white = engine.whiten(fit.noise, stacked)
    r, J, h = white[:, 0], white[:, 1 : num + 1], white[:, num + 1 :]
    P = J.T @ J + np.eye(num)
    B = np.linalg.solve(P, J.T @ h)
    among = h.T @ h - (J.T @ h).T @ B
    score = np.concatenate([fit.z, -h.T @ r + B.T @ (J.T @ r + fit.z)])
    information = np.block([[np.eye(num) - np.linalg.inv(P), B], [B.T, among]])
    level = float(fit.noise.total())
    refit = np.linalg.solve(jacobian.T @ jacobian + level**2 * np.eye(num), jacobian.T @ columns)
    left = (columns - jacobian @ refit)[problem.is_observed]
    names = tuple(
        slot.parameter.name if slot.test is None else f"{slot.parameter.name}[{slot.test + 1}]"
        for slot in fit.slots
    )
    return Evidence(
        parameters=names,
        effects=tuple(labels),
        scale=np.array(scale),
        score=score,
        information=0.5 * (information + information.T),
        visible_K=np.sqrt(np.mean(left**2, axis=0)),
    )


def _signatures(engine: Engine, z: np.ndarray) -> tuple[list[str], list[float], np.ndarray]:
    """Return label, scale and derivative [K per score] of each amplitude at each setting of its
    shape, all amplitudes at their null.
    """
    by_kind = []
    for kind in engine.kinds.values():
        strong = amplitudes(kind)
        if engine.find(qualified(kind, strong[0])) is None:
            continue  # known to be there
        found = {name: engine.find(qualified(kind, name)) for name in kind.card.parameters}
        free = {name: slot for name, slot in found.items() if slot is not None}
        shape = {name: slot for name, slot in free.items() if name not in strong}
        by_kind.append((kind, {n: s for n, s in free.items() if n in strong}, shape))
    labels: list[str] = []
    scales: list[float] = []
    columns: list[np.ndarray] = []
    for number, setting in enumerate(SETTINGS):
        at = z.copy()
        tried = [each for each in by_kind if not number or each[2]]
        for _, _, shape in tried:
            at[list(shape.values())] = setting
        order = [slot for _, strong, _ in tried for slot in strong.values()]
        _, slopes = engine.linearise(at, order)
        columns += list(slopes.T)
        for kind, strong, shape in tried:
            values = {name: float(engine.slots[slot].parameter.value(at[slot]))
                      for name, slot in shape.items()}  # fmt: skip
            for name, slot in strong.items():
                labels.append(_label(qualified(kind, name), values))
                scales.append(engine.slots[slot].parameter.sd)
    return labels, scales, np.stack(columns, axis=1)


CLIP = 3.0
"""Robust standard deviations at which the share of one machine is cut off [1]: a machine that is
off in some way of its own neither makes a find nor hides one."""

NUM_FLIPS = 4999
"""Draws of signs: a p-value of 0.05 is then good to 0.003."""

CHUNK = 250
"""Draws of signs at once."""

FREE = 1e-9
"""Precision of a parameter that nothing is known of [1]."""

BEYOND = 1.5
"""Largest plausible amplitude over that of the catalogue [1]."""


@dataclass(frozen=True)
class Column:
    """An amplitude at a setting of its shape."""

    label: str  # As in `Evidence.effects`.
    kind: type[AbstractEffect]  # The effect.
    quantity: Quantity  # The amplitude's range and unit in a machine of this size.
    scale: float  # Amplitude at a score of one [its unit].

    @classmethod
    def of(cls, label: str, scale: float, catalogue: Mapping[str, type[AbstractEffect]]) -> Column:
        """Return what a label stands for, given its scale and the effects by id."""
        name = label.partition("|")[0]
        id, _, parameter = name.partition(".")
        kind = catalogue[id]
        own = next(p for p in effect_parameters([kind], 1.0, [kind]) if p.name == name)
        usual, larger = kind.card.parameters[parameter], scale / own.sd
        null = usual.null or 0.0
        low, high = (null + larger * (end - null) for end in (usual.low, usual.high))
        return cls(label, kind, usual._replace(low=low, high=high), scale)

    @property
    def id(self) -> str:
        """Id of the effect."""
        return self.kind.card.id

    @property
    def null(self) -> float:
        """The amplitude where the effect is absent."""
        return self.quantity.null or 0.0

    @property
    def is_two_sided(self) -> bool:
        """Whether the amplitude may have either sign."""
        return self.quantity.low < self.null < self.quantity.high

    def is_plausible(self, score: float) -> bool:
        """Whether the amplitude of a score is one that a machine may have."""
        low = min(self.quantity.low - self.null, 0.0)
        return BEYOND * low <= self.scale * score <= BEYOND * (self.quantity.high - self.null)


@dataclass(frozen=True)
class Pool:
    """The evidence of machines, in one order of parameters and effects."""

    parameters: tuple[str, ...]  # Shared parameters; the effects stand behind them.
    columns: tuple[Column, ...]  # The effects, each with the setting of its shape.
    # As `Evidence`, shape (machine, all); zero for what a machine does not have.
    score: Float[np.ndarray, "machine all"]
    information: Float[np.ndarray, "machine all all"]  # Likewise, shape (machine, all, all).
    # Shape (machine, effect); not a number where a machine could not show it.
    visible_K: Float[np.ndarray, "machine effect"]

    def given(
        self, accepted: Sequence[int], precision: np.ndarray | None = None
    ) -> tuple[list[int], np.ndarray]:
        """Return places and precision of the shared parameters and of accepted effects.

        Args:
            accepted: Effects, by their places.
            precision: Of what is known of each shared parameter's score [1]; 1 by default.
        """
        num = len(self.parameters)
        known = np.ones(num) if precision is None else precision
        places = [*range(num), *(num + each for each in accepted)]
        return places, np.concatenate([known, np.full(len(accepted), FREE)])

    def one_sided(self, values: Float[np.ndarray, "... effect"]) -> np.ndarray:
        """Return statistics so that large ones speak for an effect."""
        both = np.array([each.is_two_sided for each in self.columns])
        return np.where(both, np.abs(values), values)


def pool(evidence: Sequence[Evidence]) -> Pool:
    """Return the evidence of machines in one order, effects as large as in the median machine.

    What is usual of an effect goes with the size of a machine, of which the tests of each give
    another estimate. So one setting has values that differ a little from machine to machine.
    """
    parameters = tuple(dict.fromkeys(name for each in evidence for name in each.parameters))
    own = [_numbered(each.effects) for each in evidence]
    found: dict[tuple[str, int], list[tuple[str, float]]] = {}
    for each, settings in zip(evidence, own, strict=True):
        for setting, label, scale in zip(settings, each.effects, each.scale, strict=True):
            found.setdefault(setting, []).append((label, float(scale)))
    labels = [_median_label([label for label, _ in each]) for each in found.values()]
    scale = np.array([np.median([scale for _, scale in each]) for each in found.values()])
    place = {name: i for i, name in enumerate((*parameters, *found))}
    size, num = len(place), len(evidence)
    score, information = np.zeros((num, size)), np.zeros((num, size, size))
    visible = np.full((num, len(found)), np.nan)
    for row, (each, settings) in enumerate(zip(evidence, own, strict=True)):
        at = [place[name] for name in (*each.parameters, *settings)]
        of_effects = [place[name] - len(parameters) for name in settings]
        larger = scale[of_effects] / each.scale
        factor = np.concatenate([np.ones(len(each.parameters)), larger])
        score[row, at] = factor * each.score
        information[row][np.ix_(at, at)] = factor[:, None] * each.information * factor
        visible[row, of_effects] = larger * each.visible_K
    catalogue = {kind.card.id: kind for kind in all_effects()}
    columns = (Column.of(*each, catalogue) for each in zip(labels, scale.tolist(), strict=True))
    return Pool(parameters, tuple(columns), score, information, visible)


def _numbered(labels: Sequence[str]) -> list[tuple[str, int]]:
    """Return the amplitude of each label, and which of its settings it is."""
    names = [label.partition("|")[0] for label in labels]
    return [(name, names[:place].count(name)) for place, name in enumerate(names)]


def _median_label(labels: Sequence[str]) -> str:
    """Return the label whose values are the medians of those of labels of one setting."""
    shapes = [shape_of(label) for label in labels]
    values = {name: float(np.median([each[name] for each in shapes])) for name in shapes[0]}
    return _label(labels[0].partition("|")[0], values)


def _label(amplitude: str, shape: Mapping[str, float]) -> str:
    said = ",".join(f"{name}={value:.3g}" for name, value in shape.items())
    return f"{amplitude}|{said}" if said else amplitude


def shape_of(label: str) -> dict[str, float]:
    """Return the values of shape parameters in a label such as `"natural_convection.f|n=0.29"`."""
    said = [each.partition("=") for each in label.partition("|")[2].split(",") if each]
    return {name: float(value) for name, _, value in said}


@dataclass(frozen=True)
class Tested:
    """The test of each effect, given shared parameters and effects that are in already."""

    pool: Pool  # The machines.
    statistic: Float[np.ndarray, " effect"]  # Score over its standard deviation, shape (effect,).
    # What each machine adds to the score, cut off, shape (machine, effect).
    shares: Float[np.ndarray, "machine effect"]
    # What known shared errors may do: rows of D^(1/2) A, shape (given, effect).
    pull: Float[np.ndarray, "given effect"]
    scale: Float[np.ndarray, " effect"]  # Standard deviation of the score, shape (effect,).
    shared: Float[np.ndarray, " given"]  # Estimate of what is given, its scores, shape (given,).

    @property
    def strength(self) -> Float[np.ndarray, " effect"]:
        """Statistics, of one-sided effects with their sign."""
        return self.pool.one_sided(self.statistic)

    def largest_by_chance(self, seed: int) -> Float[np.ndarray, " flip"]:
        """Return the largest statistic of all effects where the machines' signs are by chance."""
        rng = np.random.default_rng([seed, 31])
        largest = []
        for first in range(0, NUM_FLIPS, CHUNK):
            num = min(CHUNK, NUM_FLIPS - first)
            signs = rng.integers(0, 2, (num, self.shares.shape[0])) * 2.0 - 1.0
            shared = rng.standard_normal((num, self.pull.shape[0]))
            values = (signs @ self.shares + shared @ self.pull) / self.scale
            largest.append(self.pool.one_sided(values).max(axis=1))
        return np.concatenate(largest)


def score_test(
    pool: Pool,
    accepted: Sequence[int] = (),
    precision: Float[np.ndarray, " parameter"] | None = None,
) -> Tested:
    """Return the test of each effect; arguments as `Pool.given`."""
    given, D = pool.given(accepted, precision)
    behind = list(range(len(pool.parameters), pool.score.shape[1]))
    L_ee = pool.information[:, given][:, :, given]
    L_ea = pool.information[:, given][:, :, behind]
    H = L_ee.sum(axis=0) + np.diag(D)
    shared = np.linalg.solve(H, pool.score[:, given].sum(axis=0))
    A = np.linalg.solve(H, L_ea.sum(axis=0))
    left = pool.score[:, given] - L_ee @ shared
    shares = pool.score[:, behind] - np.einsum("iea,e->ia", L_ea, shared) - left @ A
    limit = CLIP * 1.4826 * np.median(np.abs(shares), axis=0)
    shares = np.clip(shares, -limit, limit)
    pull = np.sqrt(D)[:, None] * A
    scale = np.sqrt(np.sum(shares**2, axis=0) + np.sum(pull**2, axis=0))
    total = shares.sum(axis=0) + A.T @ (D * shared)
    usable = scale > 1e-6
    usable[list(accepted)] = False
    scale = np.where(usable, scale, 1.0)
    statistic = np.where(usable, total / scale, 0.0)
    return Tested(pool, statistic, shares * usable, pull * usable, scale, shared)
