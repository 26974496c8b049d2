"""The record of a virtual prototype: what draws of a model say of the load of a test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np
import pandas as pd

from lptn import growth_rate, longest_step

from ..errors import InputError
from ..model.draws import simulated
from ..model.model import Model
from ..record.blocks import Blocks
from ..record.motor import Motor
from ..record.record import Record
from ..record.reduction import reduce
from .predict import Prediction

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
    blocks = reduce(replace(record, channels={**record.channels, "winding_degC": sink}), motor)
    nothing = np.zeros_like(blocks.count)
    return replace(blocks, measured=np.full_like(blocks.measured, np.nan), count=nothing)


def virtual_record(found: Prediction, record: Record, motor: Motor) -> pd.DataFrame:
    """Return the virtual record: inputs, temperatures, losses and heat flows by step.

    Every figure of a row is the mean over one step, and `time_s` its middle.

    Args:
        found: The prediction of the test.
        record: The test.
        motor: The machine.

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

    Args:
        model: Network with effects.
        values: Parameters of the network by name.
        blocks: The reduced record.

    Raises:
        InputError: With both lengths.
    """
    network = model.network({name: jnp.asarray(value) for name, value in values.items()})
    longest, step = float(longest_step(network)), float(np.max(np.asarray(blocks.inputs.step)))
    if step > longest:
        raise InputError(
            f"the step of {step:.3g} s is longer than the fastest node allows ({longest:.3g} s).",
            where=blocks.name,
            remedy="Give a record at a higher rate, or look whether the units of the parameters "
            "are J/K and K/W.",
        )


def refuse_runaway(found: Prediction, where: str) -> None:
    """Refuse a prediction that leaves the temperatures at which there is a machine.

    Args:
        found: The prediction.
        where: What it was made of, for the message.

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
