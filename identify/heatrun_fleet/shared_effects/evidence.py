r"""What the tests of one machine say of each effect of the catalogue, around its fit.

With the residuals linear in the scores, $r + J z + h a$, noise and unmodelled heat whitened, and
the machine's own scores spread as their prior around shared ones, $z \sim N(e, 1)$, the tests speak
of $x = (e, a)$ by a score $v$ and an information $\Lambda$ alone:

$$ v_e = \hat z, \quad v_a = -h'r + B'(J'r + \hat z), \quad
   \Lambda = \begin{pmatrix} 1 - P^{-1} & B \\ B' & h'h - h'J B \end{pmatrix}, \quad
   B = P^{-1}J'h, \quad P = J'J + 1 $$

Those of many machines add up. What an effect is told by, less what network, instruments and starts
could mimic, is in them; so is how far errors that all machines share would move it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from heatrun.effects.engine import Engine, placed
from heatrun.effects.extension import with_catalogue
from heatrun.inference.catalogue import all_effects
from heatrun.inference.effect_parameters import EVENT, amplitudes, qualified
from heatrun.inference.fitting.fit_result import Fit
from heatrun.inference.problem import Problem

SETTINGS = (0.0, -1.0, 1.0)
"""Scores of the shape parameters that an effect is tried with, all of them alike [1]."""


@dataclass(frozen=True)
class Evidence:
    """What the tests of a machine say of shared parameters and of effects.

    Attributes:
        parameters: Names of the free parameters; tests stand by number in brackets.
        effects: Amplitudes, each with the setting of its shape behind a bar.
        score: Derivative of the log likelihood by the parameters' shared scores, then by the
            effects' scores, where all are zero, shape (all,).
        information: Its precision, shape (all, all).
        visible_K: Root mean square that each effect leaves beyond what a refit takes up, at a score
            of one [K], shape (effect,).
    """

    parameters: tuple[str, ...]
    effects: tuple[str, ...]
    score: Float[np.ndarray, " all"]
    information: Float[np.ndarray, "all all"]
    visible_K: Float[np.ndarray, " effect"]


def evidence_of(fit: Fit) -> Evidence:
    """Return what the tests of a machine say of the effects that they could show.

    Args:
        fit: Of the network alone.
    """
    problem = fit.problem
    kinds = [kind for kind in all_effects() if kind.card.family != EVENT]
    motor, tests = problem.motor, problem.tests
    found, extended = with_catalogue(problem.model, motor, tests, kinds)
    engine = Engine(Problem.of(extended, motor, tests, searched=found.kinds))
    if problem.heat is not None:
        engine = engine.with_heat(problem.heat)
    engine = engine.with_loggers(problem.loggers)
    z, _ = placed(engine, fit)
    labels, columns = _signatures(engine, z)
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
        score=score,
        information=0.5 * (information + information.T),
        visible_K=np.sqrt(np.mean(left**2, axis=0)),
    )


def _signatures(engine: Engine, z: np.ndarray) -> tuple[list[str], np.ndarray]:
    """Return label and derivative [K per score] of each amplitude at each setting of its shape."""
    by_kind = []
    for kind in engine.kinds.values():
        if engine.find(qualified(kind, amplitudes(kind)[0])) is None:
            continue  # known to be there
        strong = amplitudes(kind)
        slots = {name: engine.find(qualified(kind, name)) for name in kind.card.parameters}
        free = {name: slot for name, slot in slots.items() if slot is not None}
        shape = {name: slot for name, slot in free.items() if name not in strong}
        by_kind.append((kind, [n for n in free if n in strong], free, shape))
    labels: list[str] = []
    columns: list[np.ndarray] = []
    for number, setting in enumerate(SETTINGS):
        at = z.copy()
        tried = [each for each in by_kind if not number or each[3]]
        for _, _, _, shape in tried:
            at[list(shape.values())] = setting
        order = [free[name] for _, strong, free, _ in tried for name in strong]
        _, slopes = engine.linearise(at, order)
        for kind, strong, free, shape in tried:
            said = _setting(engine, shape, at)
            for name in strong:
                labels.append(qualified(kind, name) + said)
                columns.append(slopes[:, order.index(free[name])])
    return labels, np.stack(columns, axis=1)


def _setting(engine: Engine, shape: dict[str, int], z: np.ndarray) -> str:
    values = [
        f"{name}={float(engine.slots[slot].parameter.value(z[slot])):.3g}"
        for name, slot in shape.items()
    ]
    return f"|{','.join(values)}" if values else ""
