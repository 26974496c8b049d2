"""Where a test starts that was not fitted: from the state of the bench and its first readings.

The first readings alone mislead where the sensor lags or the clocks are apart. So the start
temperatures have the prior that a fit would give them, and the readings of the first blocks are
held against the model with everything in it: sensor, clock, effects, noise. The readings are
nearly linear in the starts, and the answer is that of linear Gaussian regression for each draw.
"""

from __future__ import annotations

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ..bench.blocks import Blocks, Observation
from .model import Model
from .model_parameters import COLD_START_K
from .noise import Noise, whiten
from .parameters import Parameter
from .steps import refuse_unstable

NUM_BLOCKS = 2
"""Blocks whose readings tell the start (40 s): short against the time constants of a winding, so
that what the network misses has no time to show; the rest of a held-out test is never read."""


SOAKED_K, UNSOAKED_K = 1.0, 5.0
"""How far [K] the measured node of a machine may be from the sink after it has soaked there, and
from the first reading where it has not."""

APART_K, APART = 0.3, 0.5
"""How far [K] the nodes of a soaked machine may be apart, and as a share of what is left of its
rise [1]."""


def start_draws(
    model: Model,
    test: Blocks,
    known: dict[str, Parameter],
    values: dict[str, np.ndarray],
    noise: Noise,
    rng: np.random.Generator | None,
) -> dict[str, np.ndarray]:
    """Return draws of the start temperatures by parameter name [degC], shape (draw,).

    Args:
        model: Network with effects.
        test: The test; the readings of its first blocks are used where it has any.
        known: The parameters of the model for this test, whose priors state the bench's state.
        values: Draws of all other parameters by name.
        noise: Of each draw.
        rng: Source of the draws; None for the most probable start.
    """
    names = [name for _, name in model.form.starts]
    free = [name for name in names if known[name].fixed is None]
    num_draws = next(iter(values.values())).size
    fixed = {n: np.full(num_draws, known[n].fixed) for n in names if n not in free}
    if not free:
        return fixed
    mean, covariance = _prior(model, test, known, free)
    first = _first_blocks(test.observation(), NUM_BLOCKS)
    normal = np.zeros((num_draws, len(free)))
    if rng is not None:
        normal = rng.standard_normal(normal.shape)
    known_values = {name: jnp.asarray(draws) for name, draws in {**values, **fixed}.items()}
    rows = np.asarray(_whitened(model, tuple(free), known_values, noise, first, jnp.asarray(mean)))
    refuse_unstable(model, values, rows, test)
    drawn = mean + _regress(rows, covariance, normal)
    return {**fixed, **{name: drawn[:, i] for i, name in enumerate(free)}}


def _prior(
    model: Model, test: Blocks, known: dict[str, Parameter], free: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean [degC] and covariance [K^2] of the starts.

    A machine whose first reading is that of the sink has soaked there; else the reading says where
    it is, roughly, since the readings themselves come later. A node without a sensor starts as far
    from the measured one as the prior of a fit has it; a measured stator is known for itself.
    """
    node_of = {name: node for node, name in model.form.starts}
    mean = np.array([known[name].centre for name in free])
    own = np.array([known[name].sd for name in free])
    measured = {model.form.measured_node}
    measured |= {node for body in test.bodies if (node := model.form.sensed(body.channel))}
    leads = np.array([node_of[name] == model.form.measured_node for name in free])
    is_unmeasured = np.array([node_of[name] not in measured for name in free])
    sink = float(test.inputs.ambient[0])
    rise = test.start_degC - sink
    is_soaked = abs(rise) < COLD_START_K
    own[leads] = SOAKED_K if is_soaked else UNSOAKED_K
    if is_soaked:
        mean = np.where(leads | is_unmeasured, mean - rise, mean)
        own[is_unmeasured] = max(APART_K, APART * abs(rise))
    mix = np.diag(own)
    if leads.any():
        column = int(np.argmax(leads))
        mix[is_unmeasured, column] = own[column]
    return mean, mix @ mix.T


def _first_blocks(test: Observation, num: int) -> Observation:
    """Return the first blocks of a test."""
    num = min(num, test.weight.shape[0])
    steps = num * test.weight.shape[1]
    size = test.inputs.num_time
    inputs = jax.tree.map(
        lambda v: v[:steps] if jnp.ndim(v) == 1 and v.shape[0] == size else v, test.inputs
    )
    return eqx.tree_at(
        lambda t: (t.inputs, t.measured, t.is_observed, t.weight, t.position, t.count,
                   t.known_variance, t.heat, t.moments),
        test,
        (inputs, test.measured[:num], test.is_observed[:num], test.weight[:num],
         test.position[:num], test.count[:num], test.known_variance[:num], test.heat[:num],
         test.moments[:num]),
    )  # fmt: skip


@partial(jax.jit, static_argnames=("model", "names"))
def _whitened(
    model: Model,
    names: tuple[str, ...],
    values: dict[str, Float[Array, " draw"]],
    noise: Noise,
    test: Observation,
    mean: Float[Array, " start"],
) -> Float[Array, "draw block column"]:
    """Return whitened errors at the mean of the starts, and their slopes, of each draw."""

    def one(x):
        values, noise = x

        def reading(starts):
            return model.block_means({**values, **dict(zip(names, starts, strict=True))}, test)

        error = test.measured - reading(mean)
        slope = jax.jacfwd(reading)(mean)
        rows = whiten(jnp.column_stack([error, slope]), noise, test)[0]
        return jnp.where(test.is_observed[:, None], rows, 0.0)

    return jax.lax.map(one, (values, noise), batch_size=50)


def _regress(rows: np.ndarray, covariance: np.ndarray, normal: np.ndarray) -> np.ndarray:
    """Return how far one draw of the starts lies from their mean, for each draw [K]."""
    error, slope = rows[:, :, :1], rows[:, :, 1:]
    turned = np.swapaxes(slope, 1, 2)
    total = np.linalg.inv(covariance) + turned @ slope
    shift = np.linalg.solve(total, turned @ error)
    spread = np.linalg.cholesky(np.linalg.inv(total))
    return (shift + spread @ normal[:, :, None])[:, :, 0]
