"""The numbers of machines side by side: machines (lanes) stand in the trailing axis of all arrays.

Tests of one padded shape are lanes beside each other too: a lane is a test of a machine, and those
of the first test come first.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

Lane = Float[Array, " lane"]


class Group(eqx.Module):
    """Tests of one padded shape, of each machine; a lane for each test of each machine.

    Attributes:
        tests: Indices of the tests; the lanes of the first come first.
        step: Length of a step [s], shape (lane,).
        current_squared: As `lptn.Inputs`, shape (block, step, lane).
        losses: Likewise.
        ambient: Likewise.
        second_sink: Likewise, None where the network has no use for it.
        shaft_power: Likewise.
        speed: Likewise.
        weight: As `Blocks.weight`, shape (block, step, lane); 0 in padding.
        position: As `Blocks.position`, likewise.
        sensed_ambient: Mean of the sink at the samples of each block [degC], shape (block, lane).
        measured: Mean reading of each block [degC], shape (block, lane).
        is_observed: Which blocks hold a reading, shape (block, lane).
        count: Readings of each block [1], shape (block, lane).
        known_variance: As `Observation.known_variance`, shape (block, lane).
        moments: As `Observation.moments`, shape (block, moment, lane).
        block_s: Length of a block [s], shape (lane,).
        num_blocks: Blocks without the padding [1], shape (lane,).
        num_knots: Knots of the unmodelled heat [1], shape (lane,).
        mean_losses: Mean of the loss channel [W], shape (lane,).
        mean_current_squared: Mean of the squared current [A^2], shape (lane,).
        fixed: Fixed values by name, shape (lane,) each.
    """

    tests: tuple[int, ...] = eqx.field(static=True)
    step: Lane
    current_squared: Float[Array, "block step lane"]
    losses: Float[Array, "block step lane"]
    ambient: Float[Array, "block step lane"]
    second_sink: Float[Array, "block step lane"] | None
    shaft_power: Float[Array, "block step lane"] | None
    speed: Float[Array, "block step lane"] | None
    weight: Float[Array, "block step lane"]
    position: Float[Array, "block step lane"]
    sensed_ambient: Float[Array, "block lane"]
    measured: Float[Array, "block lane"]
    is_observed: Bool[Array, "block lane"]
    count: Float[Array, "block lane"]
    known_variance: Float[Array, "block lane"]
    moments: Float[Array, "block moment lane"]
    block_s: Lane
    num_blocks: Lane
    num_knots: Lane
    mean_losses: Lane
    mean_current_squared: Lane
    fixed: dict[str, Lane]

    def by_lane(self, values: Float[Array, "*axes machine"]) -> Float[Array, "*axes lane"]:
        """Return values of the machines for the lanes of their tests."""
        return jnp.concatenate([values] * len(self.tests), axis=-1)

    def by_test(self, values: Float[Array, "*axes lane"]) -> list[Float[Array, "*axes machine"]]:
        """Return values of the lanes for each test."""
        return jnp.split(values, len(self.tests), axis=-1)


class Machines(eqx.Module):
    """The numbers of as many problems of one structure as there are machines.

    Attributes:
        centre: Centres of the priors [their units], shape (parameter, machine).
        sd: Their standard deviations, shape (parameter, machine).
        groups: The tests.
    """

    centre: Float[Array, "parameter machine"]
    sd: Float[Array, "parameter machine"]
    groups: tuple[Group, ...]
