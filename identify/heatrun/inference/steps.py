"""Are the steps of a test short enough for the fastest node of every draw?"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from lptn import longest_step

from ..bench.blocks import Blocks
from ..errors import InputError
from .model import Model

STABLE = 2.5
"""Longest step over `lptn.longest_step` at which the march is stable [1]; beyond it the likelihood
of a network is nothing."""

ABSURD = 1e9
"""No reading and no error over its noise is larger [K or 1]: the march has left the numbers."""


def too_stiff(model: Model, values: Mapping[str, Any], step_s: float) -> Bool[np.ndarray, " draw"]:
    """Return which draws have a node that is too fast for a step.

    Args:
        model: The network.
        values: Its parameters by name, shape (draw,); others are left aside.
        step_s: Length of the step [s].
    """
    names = [parameter.name for parameter in model.form.parameters]
    longest = jax.vmap(lambda one: longest_step(model.network(one)))(
        {name: jnp.asarray(values[name]) for name in names}
    )
    return step_s > STABLE * np.asarray(longest)


def refuse_unstable(
    model: Model, values: Mapping[str, Any], courses: Float[np.ndarray, "draw ..."], test: Blocks
) -> None:
    """Refuse a test whose steps are too long for some of the draws.

    A machine that runs away leaves the numbers too: that is told elsewhere.

    Args:
        model: The network.
        values: Its parameters by name, shape (draw,).
        courses: What the model says of the test, draw by draw.
        test: A reduced record.

    Raises:
        InputError: With their share.
    """
    is_lost = ~np.all(np.abs(courses.reshape(courses.shape[0], -1)) < ABSURD, axis=1)  # NaN too
    if not is_lost.any():
        return
    step = float(np.max(np.asarray(test.inputs.step)))
    is_stiff = is_lost & too_stiff(model, values, step)
    if is_stiff.any():
        raise InputError(
            f"the network has a node that is too fast for the steps of this test, {step:.3g} s, "
            f"in {100.0 * np.mean(is_stiff):.2g} % of the draws.",
            where=test.name,
            remedy="A network with fewer nodes will do (--model first), or record at a shorter "
            "interval.",
        )
