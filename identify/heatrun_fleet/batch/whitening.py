"""Residuals of many machines freed of the noise's correlation: `inference.noise`, lane by lane."""

from __future__ import annotations

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from heatrun.bench.blocks import BLOCK_S
from heatrun.inference.noise import Noise, SensorRows, filter_rows

from .machines import Group
from .matrices import sweep


def filtered(
    columns: Float[Array, "block column lane"], noise: Noise, group: Group
) -> tuple[Float[Array, "lane block column"], Float[Array, " lane"]]:
    """Return columns whitened by the noise without heat, and half the log determinant.

    Args:
        columns: Of a group of tests.
        noise: Noise of each lane, shape (lane,) each.
        group: The tests.
    """
    sensor = SensorRows(
        is_observed=group.is_observed,
        count=group.count,
        known_variance=group.known_variance,
        block_s=group.block_s,
        noise_scale=jnp.ones_like(group.block_s),
    )
    return jax.vmap(filter_rows, in_axes=-1, out_axes=0)(columns, noise, sensor)


def weighted(
    columns: Float[Array, "block column lane"], noise: Noise, group: Group
) -> Float[Array, "lane block column"]:
    """Return columns whitened by the white part of the noise alone; arguments as `filtered`."""
    variance = noise.white**2 * (BLOCK_S / group.block_s) + group.known_variance
    white = jnp.where(group.is_observed[:, None], columns, 0.0) / jnp.sqrt(variance)[:, None]
    return jnp.moveaxis(white, -1, 0)


def products(white: Float[Array, "lane block column"]) -> Float[Array, "column column lane"]:
    """Return the inner products of columns."""
    return jnp.moveaxis(jnp.einsum("wbi,wbj->wij", white, white), 0, -1)


def scaled_heat(
    gram: Float[Array, "column column lane"], num_heat: int, heat: Float[Array, " lane"]
) -> Float[Array, "column column lane"]:
    """Return inner products with the columns of the heat, the first ones, scaled by its size."""
    factor = jnp.ones((gram.shape[0], heat.shape[0])).at[:num_heat].set(heat)
    return gram * factor[:, None] * factor[None]


def without_columns(
    gram: Float[Array, "column column lane"], num: int
) -> tuple[Float[Array, "column column lane"], Float[Array, " lane"]]:
    """Sweep the first columns, a standard normal for each of them, out of inner products.

    Returns:
        All that `sweep` leaves, and half the log determinant.
    """
    ones = (jnp.arange(gram.shape[0]) < num).astype(float)
    return sweep(gram + jnp.diag(ones)[:, :, None], num)
