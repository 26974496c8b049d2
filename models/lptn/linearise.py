"""The linear network that a network with effects is near one operating point."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float

from .constant_drive import field
from .effects.base import AbstractEffect
from .inputs import Drive
from .losses import CopperLosses
from .network import Network


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
