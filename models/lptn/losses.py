"""Copper loss with the resistance at the present temperature, and what the loss channel means."""

from __future__ import annotations

from typing import Literal

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

COPPER_COEFFICIENT = 234.5
"""B of R(T) = R (B + T)/(B + Tref) for copper [degC]; IEEE 112 and the thesis. IEC 60034-1, 8.6.2
uses 235."""

ALUMINIUM_COEFFICIENT = 225.0
"""B for aluminium [degC]; IEC 60034-1, 8.6.2."""


class CopperLosses(eqx.Module):
    r"""How the electrical record heats the machine.

    $$ P_{js} = m\, I_s^2 R_{s0} (B + T_w)/(B + T_{ref}) $$

    Under `kind="balance"` the channel is the measured total Pd (electrical in minus mechanical
    out), so the rest is P_ol = Pd - P_js and a warmer winding moves heat from the stator to
    itself. Under `kind="map"` the channel is P_ol alone, and P_js comes on top.

    Attributes:
        Rs0: Phase resistance at `reference_temperature` [ohm].
        reference_temperature: Temperature that Rs0 holds for [degC].
        coefficient: B of the material [degC].
        phases: Number of phases m [1].
        kind: What the loss channel means.
        power_gain: Correction of the loss channel [1]; the model uses (1 + gain) Pd.
        torque_offset: Correction of the torque signal, to be added to it [N m]; the model uses
            Pd - offset * speed. It has a meaning under `kind="balance"` only.
        ambient_offset: Correction of the sink temperature, to be added to it [K].
        current_gain: Correction of the current [1]; the model uses (1 + gain) Is.
        shaft_power_gain: Correction of the mechanical power [1]; the model uses Pd - gain Pm. As
            the offset, it has a meaning under `kind="balance"` only.
        shaft_power_offset: Correction of the mechanical power, to be added to it [W].
        second_sink_offset: Correction of the second sink's temperature, to be added to it [K].
    """

    Rs0: Float[Array, ""]
    reference_temperature: Float[Array, ""] | float = 25.0
    coefficient: Float[Array, ""] | float = COPPER_COEFFICIENT
    phases: int = eqx.field(static=True, default=3)
    kind: Literal["balance", "map"] = eqx.field(static=True, default="balance")
    power_gain: Float[Array, ""] | float = 0.0
    torque_offset: Float[Array, ""] | float = 0.0
    ambient_offset: Float[Array, ""] | float = 0.0
    current_gain: Float[Array, ""] | float = 0.0
    shaft_power_gain: Float[Array, ""] | float = 0.0
    shaft_power_offset: Float[Array, ""] | float = 0.0
    second_sink_offset: Float[Array, ""] | float = 0.0

    def slope(self, current_squared: Float[Array, "..."]) -> Float[Array, "..."]:
        """Return k of P_js = k (B + Tw) [W/K], shape as `current_squared` [A^2]."""
        per_square = self.phases * self.Rs0 / (self.coefficient + self.reference_temperature)
        return per_square * (1.0 + self.current_gain) ** 2 * current_squared


def copper_loss(
    current_squared: Float[Array, "..."],
    temperature: Float[Array, "..."],
    losses: CopperLosses,
) -> Float[Array, "..."]:
    """Return the Joule loss P_js of the winding at its present temperature [W].

    Args:
        current_squared: Mean squared rms phase current [A^2].
        temperature: Mean winding temperature [degC], shape as `current_squared`.
        losses: Resistance and material.

    Raises:
        ValueError: If the shapes differ.

    Valid for: skin and proximity effects negligible or contained in Rs0.
    Reference: IEC 60034-1, 8.6.2 (resistance and temperature).

    Example:
        >>> losses = CopperLosses(Rs0=jnp.asarray(0.1), reference_temperature=20.0)
        >>> round(float(copper_loss(jnp.asarray(100.0), jnp.asarray(20.0), losses)), 9)
        30.0
    """
    if jnp.shape(current_squared) != jnp.shape(temperature):
        raise ValueError(
            f"Current has shape {jnp.shape(current_squared)}, temperature "
            f"{jnp.shape(temperature)}: expected the same."
        )
    return losses.slope(current_squared) * (losses.coefficient + temperature)
