"""Where the network of a run comes to rest under the load that a test was stopped at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import jax
import numpy as np
from jaxtyping import Float

from lptn import Drive, steady_state
from lptn.inputs import SIGNALS

from ..io.programs import compiled
from ..model.model import Model
from ..posterior.predict import Prediction
from .equilibrium import Stretch
from .machine import fixed_losses, other_losses

NUM_DRAWS = 200
"""Draws behind the limits: they are good to an eighth of a standard deviation."""


@dataclass(frozen=True)
class SteadyNetwork:
    """The steady state of a network under the mean load of the last part of a stretch.

    Attributes:
        median_degC: Temperature by node [degC].
        limits_degC: Its 95 % limits by node [degC].
        rise_K: Rise of the measured node over the sink [K], median and 95 % limits.
        from_s: First moment of the load that it is told for [s].
        to_s: Last one [s].
    """

    median_degC: Mapping[str, float]
    limits_degC: Mapping[str, tuple[float, float]]
    rise_K: tuple[float, float, float]
    from_s: float
    to_s: float


def steady_of_network(found: Prediction, stretch: Stretch) -> SteadyNetwork | None:
    """Return the steady state of a predicted network, None where it has none.

    Current, speed, sink and the losses outside the copper are held at their means over the last
    third of the stretch; the copper loss follows its temperature.

    Args:
        found: The test, as the run predicts it.
        stretch: Of constant load, on the record's clock.
    """
    from_s = stretch.to_s - stretch.length_s / 3.0
    inputs = found.test.inputs
    ends = np.cumsum(np.broadcast_to(inputs.step, inputs.num_time))
    clock = ends - 0.5 * np.asarray(inputs.step) + found.test.first_s
    late = (clock >= from_s) & (clock <= stretch.to_s)
    read = found.test.is_observed & (found.time_s >= from_s) & (found.time_s <= stretch.to_s)
    if not late.any() or not read.any():
        return None
    means = {
        name: float(np.mean(np.asarray(values)[late]))
        for name in SIGNALS
        if (values := getattr(inputs, name)) is not None
    }
    held = Drive.constant(
        **means, time=float(np.mean(clock[late] - found.test.first_s)),
        rated_speed=inputs.rated_speed, rated_current=inputs.rated_current,
    )  # fmt: skip
    winding = np.asarray(np.mean(found.test.measured[read]))
    values = {n: np.asarray(draws[:NUM_DRAWS]) for n, draws in found.values.items()}
    draws = _rest(found.model, values, held, winding)
    nodes = {node: np.asarray(each) for node, each in draws.items()}
    if not all(np.isfinite(each).all() for each in nodes.values()):
        return None
    shares = (0.5, 0.025, 0.975)
    middle, low, high = np.quantile(nodes[found.model.form.copper] - float(held.ambient), shares)
    limits = {n: np.quantile(draws, shares[1:]) for n, draws in nodes.items()}
    return SteadyNetwork(
        {n: float(np.median(draws)) for n, draws in nodes.items()},
        {n: (float(low), float(high)) for n, (low, high) in limits.items()},
        (float(middle), float(low), float(high)),
        from_s,
        stretch.to_s,
    )


@compiled("model", is_seldom=True)
def _rest(
    model: Model, values: dict[str, Float[Any, " draw"]], held: Drive, winding: Float[Any, ""]
) -> dict[str, jax.Array]:
    """Return the steady state of each draw [degC]."""

    def rest(one: dict[str, jax.Array]) -> dict[str, jax.Array]:
        network, losses, effects = model.network(one), model.losses(one), model.built_effects(one)
        other = other_losses(network, losses, held, winding, effects)
        load = replace(held, losses=other)
        return steady_state(network, fixed_losses(losses), load, effects=effects)

    return jax.vmap(rest)(values)
