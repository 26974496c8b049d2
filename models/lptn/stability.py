"""Whether a network settles at all: the copper heats itself, since its resistance rises."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from .balance import heat_balance, rates
from .inputs import Drive
from .losses import CopperLosses
from .network import Network


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
    zero = jnp.zeros(())
    drive = Drive(
        time=zero,
        current_squared=jnp.asarray(current_squared, dtype=float),
        losses=zero,
        ambient=zero,
        speed=zero,
        speed_rad=zero,
        coolant=None,
        fan=None,
        current_ratio_squared=zero,
    )

    def slope(vector):
        temperature = dict(zip(network.nodes, vector, strict=True))
        rate = rates(network, heat_balance(network, losses, (), temperature, drive), temperature)
        return jnp.stack([rate[node] for node in network.nodes])

    A = np.asarray(jax.jacfwd(slope)(jnp.zeros(len(network.nodes))))
    # NumPy: JAX has eigenvalues of a matrix that is not symmetric on the CPU alone
    return float(np.max(np.linalg.eigvals(A).real))
