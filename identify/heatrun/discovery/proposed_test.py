"""The bench test that would tell tied effects apart, in minutes, A and rpm, and how clearly."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np

from lptn import CopperLosses

from ..effects.engine import Engine, Refit
from ..model.problem import Problem
from ..record.blocks import Blocks


@dataclass(frozen=True)
class Stretch:
    """A stretch of constant load."""

    share: float  # Of the duration of the test [1].
    current: float  # In parts of the largest current of the records [1].
    speed: float  # In parts of their largest speed [1].


DUTIES: dict[str, tuple[Stretch, ...]] = {
    "cool down at standstill, heat again, cool down at full speed": (
        Stretch(0.25, 0.8, 0.5), Stretch(0.25, 0.0, 0.0),
        Stretch(0.25, 0.8, 0.5), Stretch(0.25, 0.0, 1.0),
    ),
    "one current at standstill, at half and at full speed": (
        Stretch(0.30, 0.7, 0.0), Stretch(0.30, 0.7, 0.5), Stretch(0.30, 0.7, 1.0),
        Stretch(0.10, 0.0, 0.0),
    ),
    "spin without load, stop, spin again": (
        Stretch(0.35, 0.02, 1.0), Stretch(0.20, 0.0, 0.0), Stretch(0.35, 0.02, 0.5),
        Stretch(0.10, 0.0, 0.0),
    ),
    "heat to the highest rise, then a long cool-down at standstill": (
        Stretch(0.35, 1.0, 0.3), Stretch(0.65, 0.0, 0.0),
    ),
    "a step of current at standstill, a long load, the same step again": (
        Stretch(0.15, 0.7, 0.0), Stretch(0.55, 0.8, 0.7), Stretch(0.15, 0.7, 0.0),
        Stretch(0.15, 0.0, 0.0),
    ),
    "steps of current up and down every few minutes at one speed": (
        *(Stretch(0.04, level, 0.4) for level in (0.9, 0.1) * 11), Stretch(0.12, 0.0, 0.0),
    ),
    "steps of speed at one current": (
        *(Stretch(0.11, 0.6, level) for level in (0.1, 1.0) * 4), Stretch(0.12, 0.0, 0.0),
    ),
}  # fmt: skip
"""Duties by what is done in them."""

TYPICAL_DEGC = 80.0
"""Winding temperature that the losses of an imagined test are reckoned at [degC]."""


def imagined(
    duty: Sequence[Stretch], like: Blocks, tests: Sequence[Blocks], losses: CopperLosses
) -> Blocks:
    """Return a test that was not run: inputs of a duty, from a cold start.

    The other losses follow speed and current as they did in the records (least squares).

    Args:
        duty: The loads in order.
        like: A test whose length and layout the imagined one takes.
        tests: The records.
        losses: Resistance, and what the loss channel means.
    """
    like = like.winding
    share = np.cumsum([0.0, *(stretch.share for stretch in duty)])
    num = like.inputs.num_time
    place = np.searchsorted(share / share[-1], (np.arange(num) + 0.5) / num) - 1
    largest = max(float(np.max(test.inputs.current_squared)) for test in tests)
    squared = largest * np.array([duty[i].current ** 2 for i in place])
    fastest, speed = 0.0, None
    if all(test.inputs.speed is not None for test in tests):
        fastest = max(float(np.max(np.abs(np.asarray(t.inputs.speed)))) for t in tests)
        speed = fastest * np.array([duty[i].speed for i in place])
    other = _other_losses(tests, losses, squared, speed)
    copper = np.asarray(losses.slope(jnp.asarray(squared))) * (
        float(np.asarray(losses.coefficient)) + TYPICAL_DEGC
    )
    channel = other + copper if losses.kind == "balance" else other
    ambient = float(np.mean(like.means["ambient"]))
    held = {
        "ambient": ambient,
        "coolant": ambient + 10.0,
        "fan": 1.0,
        "second_sink": np.mean(like.means.get("second_sink", 0.0)),
    }
    means = {name: like.means[name] for name in ("step", "rated_speed", "rated_current")}
    means |= {name: np.full(num, each) for name, each in held.items() if name in like.means}
    means |= {"current_squared": squared, "losses": channel}
    means |= {} if speed is None else {"speed": speed}
    blocks = like.weight.shape[0]
    return replace(
        like,
        name="imagined",
        means=means,
        measured=np.zeros(blocks),
        weight=np.full(like.weight.shape, 1.0 / like.weight.shape[1]),
        position=np.full(like.position.shape, 0.5),
        count=np.full(blocks, float(np.nanmedian(like.count))),
        start_degC=ambient,
        bodies=(),
    )


def _other_losses(
    tests: Sequence[Blocks], losses: CopperLosses, squared: np.ndarray, speed: np.ndarray | None
) -> np.ndarray:
    """Return the other losses [W] of a load, as they were in the records."""
    rows, values = [], []
    for test in tests:
        drive = test.inputs
        own = np.asarray(drive.current_squared)
        turned = None if speed is None else np.abs(np.asarray(drive.speed))
        rows.append(_features(own, turned))
        measured = np.asarray(drive.losses)
        if losses.kind == "balance":
            heated = float(np.asarray(losses.coefficient)) + TYPICAL_DEGC
            measured = measured - np.asarray(losses.slope(jnp.asarray(own))) * heated
        values.append(measured)
    features = np.concatenate(rows)
    scale = np.maximum(np.max(np.abs(features), axis=0), 1e-12)
    weights, *_ = np.linalg.lstsq(features / scale, np.concatenate(values), rcond=1e-8)
    return np.maximum(_features(squared, speed) / scale @ weights, 0.0)


def _features(squared: np.ndarray, speed: np.ndarray | None) -> np.ndarray:
    if speed is None:
        return np.stack([np.ones_like(squared), squared], axis=1)
    return np.stack([speed, speed**2, squared * speed, squared], axis=1)


MARGIN_K = 20.0
"""An imagined test may be this much hotter than the records [K]."""


@dataclass(frozen=True)
class NextTest:
    """A test to be run."""

    separates: tuple[str, ...]  # Ids of the tied effects.
    what: str  # What is done, in a sentence.
    profile: list[dict[str, float]]  # Minutes, amperes and rpm of each stretch.
    start: str  # How the machine is at the start.
    expected_log_bayes_factor: float  # Between the two that are hardest to tell apart [nat].


def next_test(engine: Engine, names: tuple[str, ...], fits: Sequence[Refit]) -> NextTest | None:
    """Return the duty that best separates tied effects.

    It is judged by what the winding's sensor shows, whatever else the records hold. Each effect is
    fitted to the records already; on an imagined duty their predictions differ, and what a refit of
    the rival could make up for is taken off. The expected log Bayes factor is half of what is left,
    squared and whitened.
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
