"""Where a test starts that was not fitted: from the state of the bench and its first readings.

The first readings alone mislead where the sensor lags or the clocks are apart. So the start
temperatures have the prior that a fit would give them, and the readings of the first blocks, of the
winding and of bodies whose sensors were fitted, are held against the model with everything in it:
sensor, clock, effects, noise. The readings are nearly linear in the starts, and the answer is that
of linear Gaussian regression for each draw.

`too_stiff` tells whether the steps of a test are short enough for the fastest node of every draw.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from lptn import longest_step

from ..errors import InputError
from ..io.programs import compiled
from ..model.bodies import told_bodies
from ..model.model import Model
from ..model.model_parameters import COLD_START_K
from ..model.noise import Loggers, Noise, scales_of, whiten
from ..model.parameters import Parameter
from ..record.blocks import Blocks
from ..record.observation import Observation

STABLE = 2.5
"""Longest step over `lptn.longest_step` at which the march is stable [1]; beyond it the likelihood
of a network is nothing."""

ABSURD = 1e9
"""No reading and no error over its noise is larger [K or 1]: the march has left the numbers."""


def too_stiff(model: Model, values: Mapping[str, Any], step_s: float) -> Bool[np.ndarray, " draw"]:
    """Return which draws have a node that is too fast for a step.

    Args:
        model: The network.
        values: Its parameters by name, shape (draw,); others are left aside.
        step_s: Length of the step [s].
    """
    names = [parameter.name for parameter in model.form.parameters]
    longest = _longest_steps(model, {name: np.asarray(values[name], float) for name in names})
    return step_s > STABLE * np.asarray(longest)


@compiled("model", is_seldom=True)
def _longest_steps(model: Model, values: Mapping[str, Any]) -> Float[Array, " draw"]:
    return jax.vmap(lambda one: longest_step(model.network(one)))(values)


def refuse_unstable(
    model: Model, values: Mapping[str, Any], courses: Float[np.ndarray, "draw ..."], test: Blocks
) -> None:
    """Refuse a test whose steps are too long for some of the draws.

    A machine that runs away leaves the numbers too: that is told elsewhere.

    Args:
        model: The network.
        values: Its parameters by name, shape (draw,).
        courses: What the model says of the test, draw by draw.
        test: A reduced record.

    Raises:
        InputError: With their share.
    """
    is_lost = ~np.all(np.abs(courses.reshape(courses.shape[0], -1)) < ABSURD, axis=1)  # NaN too
    if not is_lost.any():
        return
    step = float(np.max(np.asarray(test.inputs.step)))
    is_stiff = is_lost & too_stiff(model, values, step)
    if is_stiff.any():
        raise InputError(
            f"the network has a node that is too fast for the steps of this test, {step:.3g} s, "
            f"in {100.0 * np.mean(is_stiff):.2g} % of the draws.",
            where=test.name,
            remedy="A network with fewer nodes will do (--model first), or record at a shorter "
            "interval.",
        )


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
    loggers: Loggers,
    rng: np.random.Generator | None,
) -> dict[str, np.ndarray]:
    """Return draws of the start temperatures by parameter name [degC], shape (draw,).

    Args:
        model: Network with effects.
        test: The test; the readings of its first blocks are used where it has any.
        known: The parameters of the model for this test, whose priors state the bench's state.
        values: Draws of all other parameters by name.
        noise: Of the first logger, of each draw.
        loggers: Noise of the other loggers over that of the first one.
        rng: Source of the draws; None for the most probable start.
    """
    names = [name for _, name in model.form.starts]
    free = [name for name in names if known[name].fixed is None]
    num_draws = next(iter(values.values())).size
    fixed = {n: np.full(num_draws, known[n].fixed) for n in names if n not in free}
    if not free:
        return fixed
    mean, covariance = _prior(model, test, known, free)
    rows = test.winding.with_bodies(told_bodies(values, test))
    first = _first_blocks(rows.observation(noise_scale=scales_of(loggers, rows)), NUM_BLOCKS)
    normal = np.zeros((num_draws, len(free)))
    if rng is not None:
        normal = rng.standard_normal(normal.shape)
    known_values = {name: np.asarray(draws) for name, draws in {**values, **fixed}.items()}
    white = np.asarray(_whitened(model, tuple(free), known_values, noise, first, np.asarray(mean)))
    refuse_unstable(model, values, white, test)
    drawn = mean + _regress(white, covariance, normal)
    return {**fixed, **{name: drawn[:, i] for i, name in enumerate(free)}}


def _prior(
    model: Model, test: Blocks, known: dict[str, Parameter], free: list[str]
) -> tuple[np.ndarray, np.ndarray]:
    """Return mean [degC] and covariance [K^2] of the starts.

    A machine whose first readings are that of the sink has soaked there; else they say where it is,
    roughly, since the readings themselves come later. A node without a sensor starts as far from
    the measured one as the prior of a fit has it; in a machine that has not soaked, a measured
    stator is known for itself.
    """
    node_of = {name: node for node, name in model.form.starts}
    mean = np.array([known[name].centre for name in free])
    own = np.array([known[name].sd for name in free])
    first = {node: b.start_degC for b in test.bodies if (node := model.form.sensed(b.channel))}
    leads = np.array([node_of[name] == model.form.measured_node for name in free])
    sink = float(test.inputs.ambient[0])
    rises = [reading - sink for reading in (test.start_degC, *first.values())]
    is_soaked = max(map(abs, rises)) < COLD_START_K
    follows = ~leads & np.array([is_soaked or node_of[name] not in first for name in free])
    own[leads] = SOAKED_K if is_soaked else UNSOAKED_K
    if is_soaked:
        mean[:] = sink
        own[follows] = max(APART_K, APART * abs(rises[0]))
    mix = np.diag(own)
    if leads.any():
        column = int(np.argmax(leads))
        mix[follows, column] = own[column]
    return mean, mix @ mix.T


def _first_blocks(test: Observation, num: int) -> Observation:
    """Return the first blocks of each sensor of a test."""
    of_each = test.weight.shape[0] // test.num_sensors
    num = min(num, of_each)
    steps = num * test.weight.shape[1]
    size = test.inputs.num_time
    inputs = jax.tree.map(
        lambda v: v[:steps] if jnp.ndim(v) == 1 and v.shape[0] == size else v, test.inputs
    )
    rows = (of_each * np.arange(test.num_sensors)[:, None] + np.arange(num)).ravel()
    return eqx.tree_at(
        lambda t: (t.inputs, t.measured, t.is_observed, t.weight, t.position, t.count,
                   t.known_variance, t.heat, t.moments),
        test,
        (inputs, *(each[rows] for each in (test.measured, test.is_observed, test.weight,
         test.position, test.count, test.known_variance, test.heat, test.moments))),
    )  # fmt: skip


@compiled("model", "names", is_seldom=True)
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
