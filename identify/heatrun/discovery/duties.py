"""Bench tests that tell effects apart, in the words of the bench: minutes, amperes, rpm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import jax.numpy as jnp
import numpy as np

from lptn import CopperLosses, Inputs

from ..bench.blocks import Blocks


@dataclass(frozen=True)
class Stretch:
    """A stretch of constant load.

    Attributes:
        share: Of the duration of the test [1].
        current: In parts of the largest current of the records [1].
        speed: In parts of their largest speed [1].
    """

    share: float
    current: float
    speed: float


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
    ambient = float(np.mean(np.asarray(like.inputs.ambient)))
    second = like.inputs.second_sink
    inputs = Inputs(
        step=like.inputs.step,
        current_squared=jnp.asarray(squared),
        losses=jnp.asarray(channel),
        ambient=jnp.full(num, ambient),
        speed=None if speed is None else jnp.asarray(speed),
        coolant=None if like.inputs.coolant is None else jnp.full(num, ambient + 10.0),
        fan=None if like.inputs.fan is None else jnp.ones(num),
        second_sink=None if second is None else jnp.full(num, float(jnp.mean(second))),
        rated_speed=like.inputs.rated_speed,
        rated_current=like.inputs.rated_current,
    )
    blocks = like.weight.shape[0]
    return replace(
        like,
        name="imagined",
        inputs=inputs,
        measured=np.zeros(blocks),
        weight=np.full(like.weight.shape, 1.0 / like.weight.shape[1]),
        position=np.full(like.position.shape, 0.5),
        count=np.full(blocks, float(np.nanmedian(like.count))),
        start_degC=ambient,
        bodies=(),
    )


def _other_losses(
    tests: Sequence[Blocks],
    losses: CopperLosses,
    squared: np.ndarray,
    speed: np.ndarray | None,
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
