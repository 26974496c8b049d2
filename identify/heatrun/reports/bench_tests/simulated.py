"""What the network of a run says of a test: winding with band, stator, heat flows."""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from ...bench.blocks import Blocks, Observation
from ...bench.record import Record
from ...bench.reduction import reduce
from ...errors import InputError
from ...inference.model import Model, Order, parameters
from ...inference.noise import variance_of_mean
from ...motor import Motor
from ...simulation import MELTING_DEGC
from .run_draws import RunDraws, read_draws

NUM_DRAWS = 400
"""As behind the bands of a calibration."""

Band = tuple[Float[np.ndarray, " block"], Float[np.ndarray, " block"]]


@dataclass(frozen=True)
class Simulated:
    """The course of a test after a run, block by block.

    Attributes:
        order: Order of the network.
        is_seen: Whether the run was calibrated on this very file.
        motor_name: The machine that the run was calibrated for.
        time_s: Mean time of each block [s], shape (block,), like all others.
        measured_degC: Mean reading; NaN where there is none.
        median_degC: Median of the simulated reading.
        parameters_95_degC: 95 % limits from the parameters alone.
        total_95_degC: 95 % limits with the noise of a block mean.
        nodes_degC: Median of each node over each block.
        nodes_95_degC: Its 95 % limits.
        flows_W: Median heat flow by link, such as `"winding", "stator"`.
        flows_95_W: Its 95 % limits.
    """

    order: Order
    is_seen: bool
    motor_name: str
    time_s: Float[np.ndarray, " block"]
    measured_degC: Float[np.ndarray, " block"]
    median_degC: Float[np.ndarray, " block"]
    parameters_95_degC: Band
    total_95_degC: Band
    nodes_degC: dict[str, Float[np.ndarray, " block"]]
    nodes_95_degC: dict[str, Band]
    flows_W: dict[tuple[str, str], Float[np.ndarray, " block"]]
    flows_95_W: dict[tuple[str, str], Band]

    @property
    def residual_K(self) -> Float[np.ndarray, " block"]:
        """Measured minus simulated [K]; NaN where nothing was read."""
        return self.measured_degC - self.median_degC

    @property
    def rmse_K(self) -> float:
        """Root mean square of the residuals [K]."""
        return float(np.sqrt(np.nanmean(self.residual_K**2)))

    @property
    def largest_K(self) -> float:
        """Largest residual by magnitude [K], with its sign."""
        return float(self.residual_K[np.nanargmax(np.abs(self.residual_K))])

    @property
    def coverage_95(self) -> float:
        """Share of block means inside the 95 % band with noise [1]."""
        seen = np.isfinite(self.measured_degC)
        low, high = self.total_95_degC
        inside = (self.measured_degC >= low) & (self.measured_degC <= high)
        return float(np.mean(inside[seen]))


def simulate_run(
    run: Path,
    record: Record,
    motor: Motor,
    *,
    order: Order | None = None,
    num_draws: int = NUM_DRAWS,
    seed: int = 0,
) -> Simulated:
    """Simulate a test with the draws of a run.

    The start is taken from the first readings, with their noise; where the stator was not
    measured, its start has the spread that a calibration assumes.

    Args:
        run: A folder that `heatrun calibrate` wrote.
        record: With the channels that a calibration needs.
        motor: The machine.
        order: Of the network; the higher one that the run holds if None.
        num_draws: Number of draws.
        seed: Of draws, start and noise.

    Raises:
        InputError: If the run cannot be read, the record lacks a channel, or a draw runs away.
    """
    draws = read_draws(run, order=order, num_draws=num_draws, seed=seed)
    blocks = reduce(record, motor)
    model = Model.of(draws.order, motor)
    rng = np.random.default_rng([seed, 11])
    values = {**draws.values, **_of_this_test(model, motor, blocks, draws, rng)}
    needed = set(parameters(model, motor, [blocks]).by_test[0])
    if not needed <= set(values):
        raise InputError(
            f"the run does not hold {', '.join(sorted(needed - set(values)))}.",
            where=str(run),
            remedy="Calibrate again with this motor file.",
        )
    wanted = {name: jnp.asarray(values[name]) for name in needed}
    course = jax.tree.map(np.asarray, _courses(model, wanted, blocks.observation()))
    reading = course["reading"]
    _refuse_runaway(course["nodes"], blocks, run)
    variance = variance_of_mean(draws.noise, blocks.block_s, 1)
    rounding = blocks.rounding_K**2 / 12.0 / np.maximum(blocks.count, 1.0)
    noisy = reading + np.sqrt(variance + rounding) * rng.standard_normal(reading.shape)
    return Simulated(
        order=draws.order,
        is_seen=any(source.sha256 in draws.calibration_sha256 for source in record.sources),
        motor_name=draws.motor_name,
        time_s=blocks.time + blocks.first_s,
        measured_degC=blocks.measured,
        median_degC=np.median(reading, axis=0),
        parameters_95_degC=_limits(reading),
        total_95_degC=_limits(noisy),
        nodes_degC={name: np.median(T, axis=0) for name, T in course["nodes"].items()},
        nodes_95_degC={name: _limits(T) for name, T in course["nodes"].items()},
        flows_W={link: np.median(P, axis=0) for link, P in course["flows"].items()},
        flows_95_W={link: _limits(P) for link, P in course["flows"].items()},
    )


def _refuse_runaway(nodes: dict[str, np.ndarray], blocks: Blocks, run: Path) -> None:
    """Refuse draws that leave the temperatures at which there is a machine, and NaN with them."""
    hottest = np.max(np.stack(list(nodes.values())), axis=0)
    share = float(np.mean(np.any(~(hottest < MELTING_DEGC), axis=1)))
    if share > 0.0:
        raise InputError(
            f"{share:.0%} of the run's draws pass {MELTING_DEGC:.0f} degC under this test, where "
            "copper melts.",
            where=f"{blocks.name}, {run}",
            remedy="Is the run of this motor? Check the units of current (rms) and losses (W).",
        )


def _of_this_test(
    model: Model, motor: Motor, blocks: Blocks, draws: RunDraws, rng: np.random.Generator
) -> dict[str, np.ndarray]:
    """What a run cannot know of a test: its start from the first reading, the rest as its prior."""
    offset = draws.values.get("sensor_offset", np.zeros(1))
    num_draws = next(iter(draws.values.values())).size
    sd = min(float(draws.noise.total()), 2.0)
    winding = blocks.start_degC - offset + sd * rng.standard_normal(num_draws)
    known = parameters(model, motor, [blocks]).by_test[0]
    values = {"Tw_start": winding}
    if "Tsr_start" in known:
        prior = known["Tsr_start"]
        below = prior.centre - blocks.start_degC + prior.sd * rng.standard_normal(num_draws)
        values["Tsr_start"] = winding + below
    if "load_timing" in known:
        prior = known["load_timing"]
        drawn = prior.value(rng.standard_normal(num_draws))
        values["load_timing"] = drawn if prior.fixed is None else np.full(num_draws, prior.fixed)
    return values


@partial(jax.jit, static_argnames="model")
def _courses(model: Model, values: dict[str, Float[Array, " draw"]], test: Observation):
    """Readings, node temperatures and flows as means over blocks, over draws."""
    num_steps = test.weight.shape[1]

    def means(course):
        return course.reshape(-1, num_steps).mean(axis=1)

    def one(values):
        trace = model.simulate(values, test.inputs)
        return {
            "reading": model.block_means(values, test),
            "nodes": {n: means(0.5 * (T[1:] + T[:-1])) for n, T in trace.temperature.items()},
            "flows": {n: means(P) for n, P in trace.flow.items()},
        }

    return jax.lax.map(one, values, batch_size=50)


def _limits(draws: np.ndarray) -> Band:
    return np.quantile(draws, 0.025, axis=0), np.quantile(draws, 0.975, axis=0)
