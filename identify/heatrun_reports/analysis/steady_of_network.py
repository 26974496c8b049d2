"""Where the network of a run comes to rest under the load that a test was stopped at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np

from heatrun.posterior.predict import Prediction
from heatrun.runs.equilibrium import Stretch
from heatrun.runs.machine import fixed_losses, other_losses
from lptn import Drive, steady_state

NUM_DRAWS = 200
"""Draws behind the limits: they are good to an eighth of a standard deviation."""


@dataclass(frozen=True)
class SteadyNetwork:
    """The steady state of a network under the mean load of the last part of a stretch.

    Attributes:
        median_degC: Temperature by node [degC].
        limits_degC: Its 95 % limits by node [degC].
        from_s: First moment of the load that it is told for [s].
        to_s: Last one [s].
    """

    median_degC: Mapping[str, float]
    limits_degC: Mapping[str, tuple[float, float]]
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
    drive = found.test.inputs.drive()
    clock = np.asarray(drive.time) + found.test.first_s
    late = (clock >= from_s) & (clock <= stretch.to_s)
    read = found.test.is_observed & (found.time_s >= from_s) & (found.time_s <= stretch.to_s)
    if not late.any() or not read.any():
        return None
    held = jax.tree.map(lambda values: jnp.mean(jnp.asarray(values)[late]), drive)
    winding = jnp.asarray(float(np.mean(found.test.measured[read])))
    values = {n: jnp.asarray(draws[:NUM_DRAWS]) for n, draws in found.values.items()}
    model = found.model

    def rest(one: dict[str, jax.Array]) -> dict[str, jax.Array]:
        network, losses, effects = model.network(one), model.losses(one), model.built_effects(one)
        other = other_losses(network, losses, held, winding, effects)
        load = Drive(**{**_fields(held), "losses": other})
        return steady_state(network, fixed_losses(losses), load, effects=effects)

    nodes = {n: np.asarray(v) for n, v in jax.jit(jax.vmap(rest))(values).items()}
    if not all(np.isfinite(draws).all() for draws in nodes.values()):
        return None
    limits = {n: np.quantile(draws, (0.025, 0.975)) for n, draws in nodes.items()}
    return SteadyNetwork(
        {n: float(np.median(draws)) for n, draws in nodes.items()},
        {n: (float(low), float(high)) for n, (low, high) in limits.items()},
        from_s,
        stretch.to_s,
    )


def _fields(drive: Drive) -> dict[str, jax.Array | None]:
    return {name: getattr(drive, name) for name in drive.__dataclass_fields__}
