"""The current of a duty type at the insulation limit, by simulating the duty."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from lptn import Drive, hold

from ..inference.model import Model
from ..io.quantities import rounded
from ..results.derived import DerivedFigure
from .at_limit import NO_CLASS, NO_CURRENT, Limit
from .behind import Behind
from .duties import NUM_DRAWS, Duty, current_at_limit, parse_duty
from .figure import figure, refused
from .machine import Machine, fixed_losses
from .tested import REACH, Tested

STEPS_PER_TIME_CONSTANT = 10
"""Steps over the shortest time constant [1]: the third-order steps then err by 4e-5 of a change."""


@dataclass(frozen=True)
class Rated:
    """A machine that is to be rated.

    Attributes:
        behind: Model and values behind each draw.
        drawn: The machine of each draw.
        times: Its time constants [s], shape (draw, node), shortest first.
        seen: Range of the tests.
        limit: Limit of the insulation, None if no class is given.
        surroundings: As `heatrun.ratings.tested.Tested.surroundings`.
    """

    behind: Behind
    drawn: Machine
    times: Float[np.ndarray, "draw node"]
    seen: Tested
    limit: Limit | None
    surroundings: str


def duty_current(rated: Rated, text: str) -> DerivedFigure:
    """Return the current of a duty type at the limit; at rest it stands still without losses.

    Args:
        rated: The machine.
        text: The duty, such as `"S2-30"`.

    Raises:
        UsageError: As `heatrun.ratings.duties.parse_duty`.
    """
    duty = parse_duty(text, float(np.median(rated.times[:, -1])))
    if rated.limit is None:
        return refused(NO_CLASS)
    if not np.any(rated.drawn.copper_slope):
        return refused(NO_CURRENT)
    seen, limit = rated.seen, rated.limit
    beyond = seen.beyond_limit(limit.degC)
    if beyond:
        return refused(beyond)
    picked = np.random.default_rng(0).permutation(rated.times.shape[0])[:NUM_DRAWS]
    other = rated.drawn.other[picked]
    values = {name: draws[picked] for name, draws in rated.behind.values.items()}
    longest = float(np.min(rated.times[picked])) / STEPS_PER_TIME_CONSTANT

    def highest(current: np.ndarray, duty: Duty) -> np.ndarray:
        factor = jnp.asarray(current) ** 2 / seen.loaded.current_squared
        phases = []
        for length in (duty.on_s, duty.off_s):
            num = int(np.ceil(length / longest))
            phases.append((jnp.asarray(length / max(num, 1)), jnp.asarray(num)))
        on, off = phases
        top = _highest(rated.behind.model, values, seen.loaded, other, factor, on, off,
                       jnp.asarray(duty.num_cycles))  # fmt: skip
        return np.asarray(top)

    reach = REACH * seen.current_A
    current = current_at_limit(duty, highest, limit.degC, 2.0 * reach, picked.size)
    entry = figure(
        current,
        "A",
        f"{text}, {limit}, other losses {np.median(other):.0f} W under load, none at rest, "
        f"sink {seen.sink_degC:.0f} °C{rated.surroundings}",
    )
    if not entry.median <= reach:
        return refused(
            f"beyond {rounded(reach)} A, outside the tested range: the largest current "
            f"tested is {rounded(seen.current_A)} A"
        )
    return entry


@partial(jax.jit, static_argnames="model")
def _highest(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    other: Float[Array, " draw"],
    factor: Float[Array, " draw"],
    on: tuple[Array, Array],
    off: tuple[Array, Array],
    num_cycles: Array,
) -> Float[Array, " draw"]:
    """Return the highest copper temperature in the last cycle of each draw [degC]."""
    zero = jnp.zeros(())
    standing = None if loaded.speed is None else zero

    def one(values, other, factor):
        network, effects = model.network(values), model.built_effects(values)
        losses = fixed_losses(model.losses(values))
        under_load = replace(loaded.scale_current(factor), losses=other)
        at_rest = replace(
            loaded.scale_current(0.0), losses=zero, speed=standing, speed_rad=standing
        )
        copper = network.copper_node

        def phase(drive, start, lengths):
            step, num = lengths
            return hold(network, losses, drive, start, step=step, num_steps=num, effects=effects)

        def cycle(_, state):
            warm = phase(under_load, state[0], on)
            rest = phase(at_rest, warm.last, off)
            return rest.last, jnp.maximum(warm.highest[copper], rest.highest[copper])

        sink = dict.fromkeys(network.nodes, loaded.ambient)
        cold = hold(network, losses, at_rest, sink, step=zero, num_steps=0, effects=effects).last
        return jax.lax.fori_loop(0, num_cycles, cycle, (cold, loaded.ambient))[1]

    return jax.vmap(one)(values, other, factor)
