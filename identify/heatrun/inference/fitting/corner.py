"""Readings that are exactly on time: a corner of the likelihood.

What is read late lies on straight lines between the edges of the steps, so its slope by the delay
jumps where the delay passes an edge. The most probable delay of some tests is that corner itself,
where no slope is zero and no search ends: the delay is held there, and the search finished for all
other parameters.
"""

from __future__ import annotations

import numpy as np
from jaxtyping import Bool, Float

from ..parameters import Form

DELAY = "load_timing"

NEAR = 0.01
"""A delay nearer to none than this may belong there [prior standard deviations]."""

SIDE = 1e-6
"""How far from the corner its two sides are looked at [prior standard deviations]."""


def delays(form: Form) -> list[int]:
    """Return the places of the delays among the scores, whose zero is a reading on time."""
    return [place for place, (name, _, _) in enumerate(form) if name == DELAY]


def near_corner(form: Form, z: Float[np.ndarray, "parameter *machine"]) -> Bool[np.ndarray, "..."]:
    """Return which scores are delays of next to nothing, in the shape of `z`."""
    near = np.zeros(z.shape, dtype=bool)
    near[delays(form)] = np.abs(z[delays(form)]) < NEAR
    return near


def is_corner(
    before: Float[np.ndarray, "parameter *machine"],
    after: Float[np.ndarray, "parameter *machine"],
    held: Bool[np.ndarray, "parameter *machine"],
) -> Bool[np.ndarray, "*machine"]:
    """Return where the held delays are most probable at the corner.

    Args:
        before: Slope of half the sum of squares by the scores, on the side of negative delays.
        after: The same on the other side.
        held: Delays at the corner.
    """
    return np.all(~held | ((before <= 0.0) & (after >= 0.0)), axis=0)
