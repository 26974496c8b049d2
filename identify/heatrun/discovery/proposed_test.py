"""The bench test that would tell tied effects apart, and how clearly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np

from ..effects.engine import Engine, Refit
from ..inference.problem import Problem
from .duties import DUTIES, Stretch, imagined

MARGIN_K = 20.0
"""An imagined test may be this much hotter than the records [K]."""


@dataclass(frozen=True)
class NextTest:
    """A test to be run.

    Attributes:
        separates: Ids of the tied effects.
        what: What is done, in a sentence.
        profile: Minutes, amperes and rpm of each stretch.
        start: How the machine is at the start.
        expected_log_bayes_factor: Between the two that are hardest to tell apart [nat].
    """

    separates: tuple[str, ...]
    what: str
    profile: list[dict[str, float]]
    start: str
    expected_log_bayes_factor: float


def next_test(engine: Engine, names: tuple[str, ...], fits: Sequence[Refit]) -> NextTest | None:
    """Return the duty that best separates tied effects.

    It is judged by what the winding's sensor shows, whatever else the records hold. Each effect is
    fitted to the records already; on an imagined duty their predictions differ, and what a refit of
    the rival could make up for is taken off. The expected log Bayes factor is half of what is left,
    squared and whitened.

    Args:
        engine: The tests.
        names: Ids of the effects.
        fits: The model with each of them.
    """
    final = fits[0]
    like = max(engine.tests, key=lambda test: test.num_blocks)
    best: NextTest | None = None
    for what, duty in DUTIES.items():
        scaled = _bearable(engine, final, duty, like)
        trial = _engine(engine, final, scaled, like)
        worst = min(
            _expected(engine, trial, one, other)
            for i, one in enumerate(fits)
            for other in fits[i + 1 :]
        )
        if best is None or worst > best.expected_log_bayes_factor:
            profile = _profile(engine, scaled, like)
            best = NextTest(names, what, profile, "cold: at the temperature of the room", worst)
    return best


def _bearable(engine: Engine, final: Refit, duty: Sequence[Stretch], like) -> tuple[Stretch, ...]:
    """Return the duty with less current, if it would run hotter than the machine has been."""
    hottest = max(float(np.nanmax(test.winding.measured)) for test in engine.tests) + MARGIN_K
    scaled = tuple(duty)
    for _ in range(8):
        trial = _engine(engine, final, scaled, like)
        reading, _ = trial.linearise(_scores(engine, trial, final), ())
        if float(np.max(-reading)) < hottest:
            break
        scaled = tuple(replace(s, current=0.85 * s.current) for s in scaled)
    return scaled


def _engine(engine: Engine, final: Refit, duty: Sequence[Stretch], like) -> Engine:
    values, _ = engine.values(final.z, 0)
    model = engine.problem.model
    losses = model.losses({name: jnp.asarray(value) for name, value in values.items()})
    test = imagined(duty, like, engine.tests, losses)
    return Engine(Problem.of(model, engine.problem.motor, [test]))


def _scores(engine: Engine, trial: Engine, fit: Refit) -> np.ndarray:
    """Return the scores of a fit over the slots of another set of tests; starts at their prior."""
    z = np.zeros(len(trial.slots))
    for position, slot in enumerate(trial.slots):
        if slot.test is None:
            at = engine.find(slot.parameter.name)
            if at is not None:
                z[position] = fit.z[at]
        elif slot.parameter.role == "known":  # no event in an imagined test
            z[position] = np.nan
    return z


def _expected(engine: Engine, trial: Engine, truth: Refit, rival: Refit) -> float:
    """Return the expected log Bayes factor of one fit over another on an imagined test [nat]."""
    seen, _ = trial.linearise(_scores(engine, trial, truth), ())
    z = _scores(engine, trial, rival)
    columns = {}  # in the trial, by slot; errors of a body's sensor are none of the winding's
    for slot in rival.free:
        column = trial.find(engine.slots[slot].parameter.name)
        if engine.slots[slot].test is None and column is not None:
            columns[slot] = column
    starts = [
        i
        for i, slot in enumerate(trial.slots)
        if slot.test is not None and slot.parameter.role != "known"
    ]
    known = [*columns.values(), *starts]
    predicted, jacobian = trial.linearise(z, known)
    rows = trial.whiten(rival.noise, predicted - seen)
    J = trial.whiten(rival.noise, jacobian)
    old = engine.whiten(rival.noise, rival.jacobian)
    covariance = np.linalg.inv(old.T @ old + np.eye(old.shape[1]))
    place = [rival.free.index(slot) for slot in columns]
    precision = np.eye(len(known))
    size = len(columns)
    precision[:size, :size] = np.linalg.inv(covariance[np.ix_(place, place)])
    step = -np.linalg.solve(J.T @ J + precision, J.T @ rows)
    left = rows + J @ step
    return 0.5 * float(left @ left + step @ precision @ step)


def _profile(engine: Engine, duty: Sequence[Stretch], like) -> list[dict[str, float]]:
    largest = max(float(np.max(t.inputs.current_squared)) for t in engine.tests) ** 0.5
    fastest = 0.0
    if all(test.inputs.speed is not None for test in engine.tests):
        fastest = max(float(np.max(np.abs(np.asarray(t.inputs.speed)))) for t in engine.tests)
    total = sum(stretch.share for stretch in duty)
    return [
        {
            "minutes": like.duration_s * stretch.share / total / 60.0,
            "current_A": largest * stretch.current,
            "speed_rpm": fastest * stretch.speed * 60.0 / (2.0 * np.pi),
        }
        for stretch in duty
    ]
