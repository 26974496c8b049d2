"""What a model says of a test for many draws: readings, node temperatures, heat flows."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Array, Float

from lptn import Inputs, Trace

from ..io.programs import compiled
from ..record.blocks import Blocks
from ..record.observation import Observation
from .model import Model

AT_A_TIME = 50
"""Draws that are simulated side by side; there are as many, or a multiple of them."""


class Courses(NamedTuple):
    """Means over the blocks of a test, draw by draw.

    Attributes:
        reading: Of the winding, then of each fitted body, in a row [degC], shape (draw, row).
        nodes: Temperature of each node [degC], shape (draw, block) each.
        flows: Heat flow by link [W], shape (draw, block) each.
    """

    reading: Any
    nodes: dict[str, Any]
    flows: dict[tuple[str, str], Any]


def courses(
    model: Model, values: Mapping[str, Float[np.ndarray, " draw"]], test: Blocks
) -> Courses:
    """Return what a model says of a test.

    Args:
        model: Network with effects.
        values: Draws by parameter name [their units].
        test: A reduced record.
    """
    num = len(next(iter(values.values())))
    whole = {name: np.pad(draws, (0, -num % AT_A_TIME), mode="edge")
             for name, draws in values.items()}  # fmt: skip
    padded = test.observation().padded().simulated()
    found = jax.tree.map(lambda rows: np.asarray(rows)[:num], _courses(model, whole, padded))
    of_each = jax.tree.map(lambda rows: test.winding.own(rows, axis=1), found._replace(reading=()))
    return of_each._replace(reading=test.own(found.reading, axis=1))


@compiled("model")
def block_means(
    model: Model, values: Mapping[str, Float[Any, ""]], test: Observation
) -> Float[Array, " row"]:
    """Return the modelled means over the blocks of a test [degC], as `Model.block_means`."""
    return model.block_means(values, test)


@compiled("model")
def simulated(model: Model, values: Mapping[str, Float[Any, ""]], inputs: Inputs) -> Trace:
    """Return temperatures, reading, flows and losses at full detail, as `Model.simulate`."""
    return model.simulate(values, inputs)


@compiled("model")
def _courses(model: Model, values: dict[str, Float[Array, " draw"]], test: Observation) -> Courses:
    num_steps = test.weight.shape[1]

    def means(course):
        return course.reshape(-1, num_steps).mean(axis=1)

    def one(values):
        trace = model.simulate(values, test.inputs)
        return Courses(
            reading=model.block_means(values, test),
            nodes={n: means(0.5 * (T[1:] + T[:-1])) for n, T in trace.temperature.items()},
            flows={n: means(P) for n, P in trace.flow.items()},
        )

    return jax.lax.map(one, values, batch_size=AT_A_TIME)
