"""A test that was not fitted, driven through a model: where it starts, and what its course is.

The first readings alone mislead where the sensor lags or the clocks are apart. So the start
temperatures have the prior that a fit would give them, and the readings of the first blocks, of the
winding and of bodies whose sensors were fitted, are held against the model with everything in it:
sensor, clock, effects, noise. The readings are nearly linear in the starts, and the answer is that
of linear Gaussian regression for each draw. A test whose winding was not read starts soaked.

`too_stiff` tells whether the steps of a test are short enough for the fastest node of every draw;
`virtual_record` is the record of a virtual prototype: what draws of a model say of the load.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
from jaxtyping import Array, Bool, Float

from lptn import growth_rate

from ..errors import InputError
from ..io.programs import compiled
from ..model.bodies import told_bodies
from ..model.draws import ABSURD, simulated
from ..model.model import Model, change_name
from ..model.model_parameters import COLD_START_K
from ..model.noise import Loggers, Noise, scales_of, whiten
from ..model.parameters import Parameter
from ..record.blocks import Blocks
from ..record.motor import Motor
from ..record.observation import Observation
from ..record.record import Record
from ..record.reduction import reduce

if TYPE_CHECKING:
    from .predict import Prediction

STABLE = 2.5
"""Longest step over `lptn.longest_step` at which the march is stable [1]; beyond it the likelihood
of a network is nothing."""


def too_stiff(
    model: Model, values: Mapping[str, Any], step_s: float | Float[np.ndarray, " draw"]
) -> Bool[np.ndarray, " draw"]:
    """Return which draws have a node that is too fast for a step.

    Args:
        model: The network.
        values: Its parameters, those of its effects and changes by name, shape (draw,) or one for
            all; others are left aside.
        step_s: Length of the step [s], of all draws or of each.
    """
    names = list(model.network_names)
    names += [change for name in names if (change := change_name(name)) in values]
    of_each = np.broadcast_arrays(*(np.asarray(values[name], float) for name in names))
    longest = _longest_steps(model, dict(zip(names, of_each, strict=True)))
    return step_s > STABLE * np.asarray(longest)


@compiled("model", is_seldom=True)
def _longest_steps(model: Model, values: Mapping[str, Any]) -> Float[Array, " draw"]:
    return jax.vmap(model.longest_step)(values)


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


MELTING_DEGC = 1085.0
"""Melting point of copper [degC]: a simulation that passes it says nothing about a machine."""


def reduce_driven(record: Record, motor: Motor) -> Blocks:
    """Return a reduced record, whether its winding was measured or not.

    Where it was not, the machine is taken to start soaked at the temperature of the sink, and no
    block counts as read.

    Args:
        record: With currents, losses and sink.
        motor: The machine.

    Raises:
        InputError: If a channel is missing.
    """
    if "winding_degC" in record and np.any(np.isfinite(record["winding_degC"])):
        return reduce(record, motor)
    sink = record[f"{motor.sink}_degC"]
    blocks = reduce(record.having({"winding_degC": sink}), motor)
    nothing = np.zeros_like(blocks.count)
    return replace(blocks, measured=np.full_like(blocks.measured, np.nan), count=nothing)


def virtual_record(found: Prediction, record: Record, motor: Motor) -> pd.DataFrame:
    """Return the virtual record: inputs, temperatures, losses and heat flows by step.

    Every figure of a row is the mean over one step, and `time_s` its middle.

    Returns:
        A table with a row for each step inside the record. Temperatures are medians over the
        draws; columns such as `winding_95_low_degC` hold the 95 % limits, with the noise of a
        block mean for the node that is measured, where there is more than one draw.
    """
    blocks, model = found.test, found.model
    values = {name: jnp.asarray(value) for name, value in found.middle.items()}
    trace = simulated(model, values, blocks.inputs)
    step = float(blocks.inputs.step)
    middle = np.asarray(trace.time[1:]) - 0.5 * step
    columns: dict[str, Any] = {"time_s": middle + blocks.first_s}
    if blocks.has_current:
        columns["phase_current_A"] = np.sqrt(np.asarray(blocks.inputs.current_squared))
    columns["losses_W"] = np.asarray(blocks.inputs.losses)
    columns[f"{motor.sink}_degC"] = np.asarray(blocks.inputs.ambient)
    if model.form.second_sink and blocks.inputs.second_sink is not None:
        columns[f"{model.form.second_sink}_degC"] = np.asarray(blocks.inputs.second_sink)
    if blocks.inputs.speed is not None:
        columns["speed_rpm"] = np.asarray(blocks.inputs.speed) * 30.0 / np.pi
    rows = blocks.weight.shape
    block_middle = middle.reshape(rows).mean(axis=1)

    def carried(by_block: np.ndarray) -> np.ndarray:
        return np.interp(middle, block_middle, by_block)

    def moved(course: np.ndarray, by_block: np.ndarray) -> np.ndarray:
        # the median over draws, which is not the course of the median parameters
        return course + carried(by_block - course.reshape(rows).mean(axis=1))

    network, losses = model.network(values), model.losses(values)
    warmer = np.zeros_like(middle)
    for node, T in trace.temperature.items():
        course = 0.5 * (np.asarray(T[1:]) + np.asarray(T[:-1]))
        columns[f"{node}_degC"] = moved(course, found.nodes[node])
        if node == network.copper_node:
            warmer = columns[f"{node}_degC"] - course
    more = np.asarray(losses.slope(blocks.inputs.current_squared)) * warmer
    columns["copper_loss_W"] = np.asarray(trace.copper_loss) + more
    # under a balance the sum is measured
    less = more if losses.kind == "balance" else 0.0
    columns["other_loss_W"] = np.asarray(trace.other_loss) - less
    for (start, end), flow in trace.flow.items():
        columns[f"flow_{start}_{end}_W"] = moved(np.asarray(flow), found.flows[start, end])
    if found.draws.shape[0] > 1:
        for node in trace.temperature:
            limits, centre = found.nodes_95[node], found.nodes[node]
            if node == model.form.measured_node:
                limits, centre = found.total["95"], found.median
            for side, limit in zip(("low", "high"), limits, strict=True):
                name = f"{node}_95_{side}_degC"
                columns[name] = columns[f"{node}_degC"] + carried(limit - centre)
    inside = np.asarray(trace.time[1:]) <= record.duration_s + 1e-9
    return pd.DataFrame(columns)[inside].reset_index(drop=True)


def refuse_coarse_steps(model: Model, values: Mapping[str, float], blocks: Blocks) -> None:
    """Refuse a record whose steps are longer than the fastest node allows.

    Raises:
        InputError: With both lengths.
    """
    longest = float(model.longest_step({name: jnp.asarray(v) for name, v in values.items()}))
    step = float(np.max(np.asarray(blocks.inputs.step)))
    if step > longest:
        raise InputError(
            f"the step of {step:.3g} s is longer than the fastest node allows ({longest:.3g} s).",
            where=blocks.name,
            remedy="Give a record at a higher rate, or look whether the units of the parameters "
            "are J/K and K/W.",
        )


def refuse_runaway(found: Prediction, where: str) -> None:
    """Refuse a prediction that leaves the temperatures at which there is a machine.

    Raises:
        InputError: With the time, and whether the copper feeds itself.
    """
    highest = np.max(np.stack([high for _, high in found.nodes_95.values()]), axis=0)
    is_beyond = ~(highest < MELTING_DEGC)  # NaN too
    if not is_beyond.any():
        return
    first = float(found.time_s[int(np.argmax(is_beyond))])
    values = {name: jnp.asarray(value) for name, value in found.middle.items()}
    squared = float(np.max(np.asarray(found.test.inputs.current_squared)))
    growth = growth_rate(found.model.network(values), found.model.losses(values), squared)
    reason = (
        f"At {np.sqrt(squared):.0f} A it runs away: the copper loss rises faster with the "
        "temperature than the heat that leaves."
        if growth > 0.0
        else "The losses are too large for these resistances."
    )
    raise InputError(
        f"the model passes {MELTING_DEGC:.0f} °C, where copper melts, after about {first:.0f} s "
        f"of this test. {reason}",
        where=where,
        remedy="Is the run of this motor? Check the units of current (rms), losses (W) and "
        "parameters (J/K, K/W).",
    )
