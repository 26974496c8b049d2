r"""What the network may miss, as heat: a slow heat flow into each heated node that no term tells.

A network of a few nodes is never the whole machine. What it leaves out acts like heat that comes
and goes over minutes: on each node that losses heat, a Gauss-Markov process

$$ \mathrm{E}[q(t)\,q(t')] = (s\,\bar P)^2 \exp(-|t - t'| / \tau) $$

with the mean loss $\bar P$ of the test, $\tau$ of twenty minutes unless the motor file says
otherwise, and $s$ estimated with the noise.
Through the network it shows in the readings. The readings are linear in it, so it is integrated
out: its responses join the covariance of the noise as columns of a low rank.

References: M. C. Kennedy, A. O'Hagan, Bayesian calibration of computer models, Journal of the Royal
    Statistical Society B 63 (2001) 425-464. S. Sarkka, M. A. Alvarez, N. D. Lawrence, Gaussian
    process latent force models, IEEE Transactions on Automatic Control 64 (2019) 2953-2960.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.linalg import expm

from lptn import Network

from ..bench.blocks import Blocks
from .draws import NUM_NOISE, Draws
from .model import Model
from .noise import HEAT
from .problem import Problem

NUM_COLUMNS = 16
"""Columns that stand for the heat of one test [1]. For the reference motor they hold 99.9 % of its
variance in a test of 90 minutes, 99 % in one of four hours, 95 % in one of eight."""

SPACING_S = 240.0
"""Time between the knots of the heat, which runs straight between them [s]."""


def heat_columns(
    model: Model, values: Mapping[str, Any], test: Blocks
) -> Float[np.ndarray, "block column"]:
    """Return columns whose outer product is the covariance that unmodelled heat gives a test.

    Args:
        model: The network. Effects beyond it are left aside: the columns are a prior, and it takes
            no more than the size and the delay of the response.
        values: Its parameters by name [their units].
        test: A reduced record.

    Returns:
        Derivatives of the block means [K] by independent standard normals, for heat whose standard
        deviation is the mean loss where the prior of the heat is the usual one, and as many times
        that as the prior of the model is wider.
    """
    network = model.network(values)
    edges = test.block_s * np.arange(test.num_blocks + 1)
    num = num_knots(edges[-1])
    knots = np.linspace(0.0, edges[-1], num)
    hats = np.maximum(0.0, 1.0 - np.abs(edges[:, None] - knots) / (knots[1] - knots[0]))
    said = model.adequacy
    factor = np.linalg.cholesky(np.exp(-np.abs(knots[:, None] - knots) / said.heat_time_s))
    size = _mean_loss(model, values, test) * said.unmodelled_heat / HEAT.centre
    read = [model.form.measured_node, *map(model.form.sensed, test.fitted)]
    responses = block_responses(network, read, hats @ factor, test.block_s)
    joined = size * np.concatenate(list(responses.values()), axis=1)
    turned, strength, _ = np.linalg.svd(joined, full_matrices=False)
    columns = np.zeros((joined.shape[0], NUM_COLUMNS))
    kept = min(NUM_COLUMNS, strength.size)
    columns[:, :kept] = turned[:, :kept] * strength[:kept]
    return columns


def num_knots(duration_s: float) -> int:
    """Return the number of knots of the heat of a test of a duration [s]."""
    return max(3, round(duration_s / SPACING_S) + 1)


def no_heat(problem: Problem) -> tuple[Float[np.ndarray, "block column"], ...]:
    """Return columns of no heat, as wide as those of heat: one compilation serves both."""
    return tuple(np.zeros((test.measured.size, NUM_COLUMNS)) for test in problem.tests)


def with_heat(problem: Problem, z: np.ndarray) -> Problem:
    """Return a problem with what unmodelled heat does to its tests.

    Args:
        problem: Model and tests.
        z: Scores that the responses are taken at.
    """
    vector = np.concatenate([z, np.zeros(NUM_NOISE)])
    at = Draws(problem.model, problem.motor, problem.parameters, vector[None])
    columns = []
    for test in problem.tests:
        values = {name: float(draw[0]) for name, draw in at.of_test(test.name).items()}
        columns.append(heat_columns(problem.model, values, test))
    return replace(problem, heat=tuple(columns))


def block_responses(
    network: Network,
    measured: Sequence[str],
    heat: Float[np.ndarray, "edge column"],
    block_s: float,
) -> dict[str, Float[np.ndarray, "row column"]]:
    """Return what heat in each heated node of a network adds to the means of measured nodes.

    Args:
        network: Nodes, capacitances, resistances.
        measured: Nodes whose block means are wanted.
        heat: Courses of the heat at the edges of the blocks, straight in between [W].
        block_s: Length of a block [s].

    Returns:
        Block means by node that is heated [K], for each measured node in turn; exact for a network
        whose parameters stay as they are.
    """
    nodes = network.nodes
    size = len(nodes)
    capacity = np.array([float(network.capacitance[node]) for node in nodes])
    G = np.zeros((size, size))
    for ends, resistance in network.resistance.items():
        places = [nodes.index(node) for node in ends if node in nodes]
        for place in places:
            G[place, place] += 1.0 / float(resistance)
        if len(places) == 2:
            G[places[0], places[1]] -= 1.0 / float(resistance)
            G[places[1], places[0]] -= 1.0 / float(resistance)
    heated = [n for n in nodes if n == network.copper_node or n in network.share]
    # states: temperatures, the integrals of the measured ones, the heat and its slope
    last = size + len(measured)
    A = np.zeros((last + 2, last + 2))
    A[:size, :size] = -G / capacity[:, None]
    for number, node in enumerate(measured):
        A[size + number, nodes.index(node)] = 1.0
    A[last, last + 1] = 1.0
    result = {}
    slope = np.diff(heat, axis=0) / block_s
    for node in heated:
        place = nodes.index(node)
        driven = A.copy()
        driven[place, last] = 1.0 / capacity[place]
        step = expm(driven * block_s)
        state = np.zeros((size, heat.shape[1]))
        means = np.zeros((len(measured), heat.shape[0] - 1, heat.shape[1]))
        for index, rise in enumerate(slope):
            push = step[:last, last:] @ np.stack([heat[index], rise])
            after = step[:last, :size] @ state + push
            means[:, index], state = after[size:] / block_s, after[:size]
        result[node] = means.reshape(-1, heat.shape[1])
    return result


def _mean_loss(model: Model, values: Mapping[str, Any], test: Blocks) -> float:
    """Return the mean loss of a test [W], in which the copper loss may not be measured."""
    total = float(np.mean(np.asarray(test.inputs.losses)))
    if model.kind == "map":
        squared = float(np.mean(np.asarray(test.inputs.current_squared)))
        total += model.phases * float(values["Rs0"]) * squared
    return max(abs(total), 1e-3)
