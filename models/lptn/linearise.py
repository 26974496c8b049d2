"""The linear network that a network with effects is near one operating point, and if it settles.

It may not: the copper heats itself, since its resistance rises.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from .constant_drive import field
from .effects.base import AbstractEffect
from .inputs import Drive
from .losses import CopperLosses
from .network import Network
from .stepping import eliminate


class Linearised(eqx.Module):
    """A network as dT/dt = A T + q.

    Attributes:
        nodes: Names of the nodes in the order of rows and columns: sorted, those of the effects
            among them.
        A: State matrix [1/s], shape (node, node).
        offset: q [K/s] for temperatures in degC, shape (node,).
    """

    nodes: tuple[str, ...] = eqx.field(static=True)
    A: Float[Array, "*draw node node"]
    offset: Float[Array, "*draw node"]


def linearise(
    network: Network,
    losses: CopperLosses,
    drive: Drive,
    temperature: Mapping[str, Float[Array, ""] | float],
    *,
    effects: Sequence[AbstractEffect] = (),
) -> Linearised:
    """Return the network as linear equations around the given temperatures.

    The Jacobian is taken of the very balance that `simulate` integrates: it holds the feedback of
    the resistance R(T), the meaning of the loss channel, and whatever the effects do. It is exact
    at all temperatures where no effect bends with the temperature. It can be compiled and mapped.

    Args:
        network: Nodes and links.
        losses: Copper loss and the meaning of the loss channel.
        drive: Inputs that hold all the time, numbers. Effects that follow the time since the
            start of a test stand as they are at `drive.time`.
        temperature: Temperature of each node of `network` [degC]; nodes of effects may be left
            out, and then stand where the effect has them at the start of a test.
        effects: Effects, in order; those on the sensor do not enter.

    Returns:
        State matrix and offset.

    Raises:
        ValueError: If JAX runs in float32, a temperature is missing or of no node, or an input
            is missing that an effect or the torque offset needs.
    """
    at = field(network, losses, drive, temperature, effects)
    A = jax.jacfwd(at.slope)(at.start)
    return Linearised(at.nodes, A, at.slope(at.start) - A @ at.start)


def time_constants(A: Float[Array, "*draw node node"]) -> Float[np.ndarray, "*draw node"]:
    """Return the time constants of state matrices [s], shape (..., node), shortest first.

    A mode that grows or stays has none and stands as inf, at the end.

    Args:
        A: State matrices [1/s], shape (..., node, node), numbers and not placeholders: JAX has
            eigenvalues of a matrix that is not symmetric on the CPU alone, so NumPy takes them.
    """
    decay = -np.linalg.eigvals(np.asarray(A)).real
    is_decaying = decay > 0.0
    return np.sort(np.where(is_decaying, 1.0 / np.where(is_decaying, decay, 1.0), np.inf), axis=-1)


NUM_SQUARINGS = 36
"""Squarings of the step over the fastest rate: 2^36 steps, after which 10^-10 of it has faded."""


def growth_rate(network: Network, losses: CopperLosses, current_squared: float) -> float:
    r"""Return the fastest growth of a temperature rise under a constant current [1/s].

    It is the largest real part of the eigenvalues of dT/dt = A T + q. Below 0 the network
    settles, with 1/|rate| as its slowest time constant; above 0 it runs away. One node under
    `kind="map"` does so from $m I^2 R_{s0} R_{eq} = B + T_{ref}$ on.

    Args:
        network: Nodes and links, without effects; numbers, not placeholders of a trace.
        losses: Copper loss and the meaning of the loss channel.
        current_squared: Squared rms phase current [A^2].

    Valid for: constant current and sink; a drive that holds its power and not its current ends
        the growth.
    Reference: IEC 60034-1, 8.6.2 (resistance and temperature).
    """
    drive = Drive.constant(
        current_squared=current_squared, losses=0.0, ambient=0.0, speed=0.0, second_sink=0.0
    )
    at = linearise(network, losses, drive, dict.fromkeys(network.nodes, 0.0))
    return float(np.max(np.linalg.eigvals(np.asarray(at.A)).real))


def is_stable(A: Float[Array, "node node"]) -> Bool[Array, ""]:
    r"""Return whether all eigenvalues of a state matrix have a negative real part.

    They have if and only if the powers of $(I + hA)(I - hA)^{-1}$ fade. Unlike the eigenvalues of
    a matrix that is not symmetric, this can be compiled for every device.

    Args:
        A: State matrix [1/s], shape (node, node).

    Valid for: rates that are apart by less than a factor of 10^10 from the fastest one; slower
        ones count as standing still, which is not stable.
    Reference: R. A. Horn, C. R. Johnson, Topics in Matrix Analysis, 1991, section 2.1 (the
        transform of Cayley).
    """
    unit = jnp.eye(A.shape[0])
    scaled = A / jnp.max(jnp.sum(jnp.abs(A), axis=1))
    power = eliminate(unit - 0.5 * scaled, unit + 0.5 * scaled)
    for _ in range(NUM_SQUARINGS):
        power = jnp.sum(power[:, :, None] * power[None, :, :], axis=1)
    return jnp.max(jnp.abs(power)) < 0.5  # false for NaN and inf
