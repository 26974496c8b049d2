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
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy.fft import next_fast_len
from scipy.linalg import expm

from lptn import Network

from ..io.programs import compiled
from ..record.blocks import Blocks, strongest
from . import noise as noise_module
from .draws import NUM_NOISE, Draws
from .kernels import in_batches
from .model import Model
from .noise import HEAT
from .problem import Data, Problem, Structure, residuals

NUM_WINDOWS = 24
"""Windows of all tests together, of 4 min for a test of 90 min: enough for a standard error over
them, and long against the time in which the noise of a bench is forgotten."""

BATCH = 2
"""Draws that are worked out at once, each with all its windows: more of them fall out of the
cache."""


@dataclass(frozen=True)
class Windows:
    """Stretches of the tests."""

    test: Int[np.ndarray, " window"]  # Index of the test of each window.
    from_s: Float[np.ndarray, " window"]  # Mean time of its first block [s].
    to_s: Float[np.ndarray, " window"]  # Mean time of its last block [s].
    # By test: the blocks that are read where a window is left out, shape (window of the test,
    # block).
    without: tuple[Bool[np.ndarray, "window block"], ...]


def windows(problem: Problem, num: int = NUM_WINDOWS) -> Windows:
    """Cut the readings of all tests into windows of about as many blocks each.

    Args:
        problem: With the tests.
        num: Of windows, about; every test with a reading has one at least.
    """
    total = int(np.sum(problem.is_observed))
    owner, ends, without = [], [], []
    for index, test in enumerate(problem.tests):
        read = np.flatnonzero(test.is_observed)
        share = min(read.size, max(1, round(num * read.size / total)))
        parts = np.array_split(read, share) if read.size else []
        masks = np.tile(test.is_observed, (len(parts), 1))
        for mask, part in zip(masks, parts, strict=True):
            mask[part] = False
            owner.append(index)
            ends.append((test.time[part[0]], test.time[part[-1]]))
        without.append(masks)
    from_s, to_s = np.array(ends, dtype=float).reshape(-1, 2).T
    return Windows(np.array(owner, dtype=int), from_s, to_s, tuple(without))


def left_out(
    problem: Problem, cut: Windows, vectors: Float[np.ndarray, "draw all"]
) -> Float[np.ndarray, "draw window"]:
    r"""Return the log density of each window given all other readings.

    Block means share their noise, so the density of the readings is no product over them, and what
    one block would be worth if it were left out is hardly more than an interpolation of its
    neighbours' noise. Left out here are windows of some minutes. For the readings y of a test and a
    draw theta,

    $$ p(y_W \mid y_{-W}, \theta) = \frac{p(y \mid \theta)}{p(y_{-W} \mid \theta)} $$

    where the denominator is the density of the test with the blocks of the window taken as not
    read: exact for any noise that can be filtered with gaps.
    """
    pairs = zip(cut.without, problem.tests, strict=True)
    without = tuple(test.lengthened(masks.T).T for masks, test in pairs)
    function = partial(_left_out, problem.structure, problem.data, without)
    return in_batches(function, vectors, BATCH)


@compiled("structure")
def _left_out(
    structure: Structure,
    data: Data,
    without: tuple[Bool[Array, "window block"], ...],
    vectors: Float[Array, "draw all"],
) -> Float[Array, "draw window"]:
    def one(vector):
        z, noise_z = vector[: structure.num_parameters], vector[structure.num_parameters :]
        noise = noise_module.from_scores(noise_z)
        parts = []
        for residual, test, masks in zip(
            residuals(structure, data, z), data.tests, without, strict=True
        ):

            def density(is_read, residual=residual, test=test):
                seen = eqx.tree_at(lambda test: test.is_observed, test, is_read)
                return noise_module.log_density(residual, noise, seen)

            parts.append(density(test.is_observed) - jax.vmap(density)(masks))
        return jnp.concatenate(parts)

    return jax.vmap(one)(vectors)


FEWEST_COLUMNS, MOST_COLUMNS = 8, 16
"""Columns that stand for the heat of one test: half as many as it has knots within these, in steps
of four, for programs hold for one number of them [1]. For the reference motor they hold 99 % of its
variance in tests of 90 minutes (12) and of four hours (16), 95 % in one of eight."""

SPACING_S = 240.0
"""Time between the knots of the heat, which runs straight between them [s]."""

AT_ONCE = 32
"""Columns whose spectra are held at once: a day at 10 Hz has 400."""


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
    num = num_knots(test.duration_s)  # as those of no heat
    knots = np.linspace(0.0, edges[-1], num)
    hats = np.maximum(0.0, 1.0 - np.abs(edges[:, None] - knots) / (knots[1] - knots[0]))
    said = model.adequacy
    factor = np.linalg.cholesky(np.exp(-np.abs(knots[:, None] - knots) / said.heat_time_s))
    size = _mean_loss(model, values, test) * said.unmodelled_heat / HEAT.centre
    read = [model.form.measured_node, *map(model.form.sensed, test.fitted)]
    responses = block_responses(network, read, hats @ factor, test.block_s)
    joined = size * np.concatenate(list(responses.values()), axis=1)
    wanted = int(num_columns(np.asarray(num)))
    columns = strongest(joined, wanted)
    return np.pad(columns, ((0, 0), (0, wanted - columns.shape[1])))


def num_knots(duration_s: float) -> int:
    """Return the number of knots of the heat of a test of a duration [s]."""
    return max(3, round(duration_s / SPACING_S) + 1)


def num_columns(knots: Any) -> Any:
    """Return the number of columns of heat for the knots of tests; arrays of NumPy or JAX."""
    return (4 * -(-knots // 8)).clip(FEWEST_COLUMNS, MOST_COLUMNS)


def no_heat(problem: Problem) -> tuple[Float[np.ndarray, "block column"], ...]:
    """Return columns of no heat, as wide as those of heat: one compilation serves both."""
    knots = np.array([num_knots(test.duration_s) for test in problem.tests])
    pairs = zip(problem.tests, num_columns(knots), strict=True)
    return tuple(np.zeros((test.measured.size, width)) for test, width in pairs)


def with_heat(problem: Problem, z: np.ndarray) -> Problem:
    """Return a problem with what unmodelled heat does to its tests."""
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
    # one block after the other takes as long as a fit: the response to each is the same, later
    num = heat.shape[0] - 1
    length = next_fast_len(2 * num, real=True)
    result = {}
    for node in heated:
        driven = A.copy()
        driven[nodes.index(node), last] = 1.0 / capacity[nodes.index(node)]
        step = expm(driven * block_s)
        ahead, states = step[:size, :size], step[None, :size, last:]
        while states.shape[0] < num:  # after one block, two, four, ...
            states, ahead = np.concatenate([states, ahead @ states]), ahead @ ahead
        later = step[size:last, :size] @ states[: num - 1]
        kernel = np.concatenate([step[None, size:last, last:], later]) / block_s
        spectrum = np.fft.rfft(kernel, length, axis=0)
        rows = np.empty((len(measured), num, heat.shape[1]))
        for first in range(0, heat.shape[1], AT_ONCE):
            some = heat[:, first : first + AT_ONCE]
            course = np.stack([some[:-1], np.diff(some, axis=0) / block_s])  # and slope, by block
            means = np.einsum("fmk,kfc->mfc", spectrum, np.fft.rfft(course, length, axis=1))
            rows[..., first : first + AT_ONCE] = np.fft.irfft(means, length, axis=1)[:, :num]
        result[node] = rows.reshape(-1, heat.shape[1])
    return result


def _mean_loss(model: Model, values: Mapping[str, Any], test: Blocks) -> float:
    """Return the mean loss of a test [W], in which the copper loss may not be measured."""
    total = float(np.mean(np.asarray(test.inputs.losses)))
    if model.kind == "map":
        squared = float(np.mean(np.asarray(test.inputs.current_squared)))
        total += model.phases * float(values["Rs0"]) * squared
    return max(abs(total), 1e-3)
