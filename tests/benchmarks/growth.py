"""Growth: time against samples, walkers, tests, nodes and effects.

The figure of a row is the exponent of the growth, 1 where it is linear; the detail holds the times.
"""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import ours
from duty_record import TRUTH, around, record
from rows import Row, duration, median, seconds

import lptn
from heatrun.model.model import Model
from heatrun.model.problem import NUM_NOISE, Problem, log_posterior_batch
from heatrun.posterior.weighted import BATCH
from heatrun.record.motor import Motor
from lptn.effects import EFFECTS, AbstractEffect, build

SECTION = "Growth"
STEEP = 1.1
"""Target of the exponents: linear, with room for the cache that a larger job falls out of."""

ADDED = ("radiation", "speed_cooling", "standby_loss", "insulation_conductivity",
         "ac_copper_loss", "bearing_friction", "fan_cooling", "coolant_sink")  # fmt: skip


def _row(what: str, sizes: list[int], times: list[float], target: float | None = STEEP) -> Row:
    detail = ", ".join(f"{n:g}: {duration(t)}" for n, t in zip(sizes, times, strict=True))
    # the slope between the two largest sizes, where fixed costs count least
    slope = float(np.log(times[-1] / times[-2]) / np.log(sizes[-1] / sizes[-2]))
    return Row(SECTION, f"{what}, exponent", slope, "1", target, detail)


def with_samples(small: bool) -> list[Row]:
    """Time one likelihood and eight at once over records of growing length."""
    sizes = [1000, 4000] if small else [10_000, 100_000, 1_000_000, 10_000_000]
    rows = []
    for walkers in (1, 8):
        times, theta = [], jnp.asarray(around(walkers))
        for num in sizes:
            mine = ours.likelihood(record(num))
            times.append(median(lambda m=mine, t=theta: m(t), 3))
        rows.append(_row(f"samples, likelihood of {walkers}", sizes, times))
    return rows


def with_walkers(made: dict, small: bool) -> list[Row]:
    """Time one likelihood over growing numbers of parameter sets, in batches as they are drawn."""
    sizes = [1, 8, 64] if small else [1, 8, 64, 256, 1024]
    mine = ours.likelihood(made)

    def in_batches(num: int):
        parts = np.split(around(num), range(BATCH, num, BATCH))
        sets = [jnp.asarray(part) for part in parts]
        return lambda: [mine(part) for part in sets]

    times = [median(in_batches(num), 3) for num in sizes]
    return [_row(f"walkers, in batches of {BATCH}", sizes, times)]


def with_tests(small: bool) -> list[Row]:
    """Time the log posterior of 64 vectors over growing numbers of tests of 30 minutes."""
    sizes = [1, 2] if small else [1, 4, 16, 64]
    single = ours.problem(record(3000 if small else 18_000))
    motor = Motor("benchmark", phase_resistance_ohm=0.0062)
    times, compiling = [], []
    for num in sizes:
        tests = [dataclasses.replace(single.tests[0], name=f"test {i}") for i in range(num)]
        problem = Problem.of(Model.of("second", motor), motor, tests)
        size = (64, problem.num_parameters + NUM_NOISE)
        z = jnp.asarray(1e-2 * np.random.default_rng(3).standard_normal(size))

        def call(problem=problem, z=z):
            return log_posterior_batch(problem.structure, problem.data, z)

        compiling.append(seconds(call))
        times.append(median(call, 3))
    what = "tests, log posterior of 64"
    return [_row(what, sizes, times), _row("tests, compiling", sizes, compiling)]


def with_nodes_and_effects(made: dict) -> list[Row]:
    """Time the simulation of 16 parameter sets over networks with more nodes, and more effects."""
    inputs = ours.inputs_of(made)
    num = inputs.num_time
    inputs = dataclasses.replace(
        inputs,
        speed=jnp.full(num, 300.0),
        coolant=jnp.full(num, 30.0),
        fan=jnp.full(num, 0.5),
        rated_speed=jnp.asarray(600.0),
        rated_current=jnp.asarray(150.0),
    )
    measured = jnp.asarray(made["measured"])
    scale = jnp.asarray(around(16))

    def timed(network_of, effects: tuple[AbstractEffect, ...]) -> float:
        def one(theta):
            network, start = network_of(theta)
            return lptn.accumulate(
                network, lptn.CopperLosses(Rs0=theta[4]), inputs, start,
                update=lambda total, before, after, y: total + (y - after) ** 2,
                carry=jnp.zeros(()), data=measured, effects=effects,
            )  # fmt: skip

        compiled = jax.jit(jax.vmap(one))
        return median(lambda: compiled(scale), 3)

    def chain(num_nodes: int):
        def network_of(theta):
            network = lptn.second_order(theta[0], theta[1], theta[2], theta[3])
            for index in range(num_nodes - 2):
                network = network.with_node(
                    f"part {index}", capacitance=theta[1], links={"stator": theta[3]}
                )
            return network, dict.fromkeys(network.nodes, theta[5])

        return network_of

    sizes = [2, 4, 8]
    rows = [_row("nodes, bare network of n", sizes, [timed(chain(n), ()) for n in sizes], 2.0)]
    kinds = {kind.card.id: kind for kind in EFFECTS}
    base = lptn.second_order(*TRUTH[:4])
    effects = []
    for name in ADDED:
        card = kinds[name].card
        typical = {key: quantity.typical for key, quantity in card.parameters.items()}
        effects.append(build(kinds[name], typical, base))
    counts = [1, 2, 4, 8]
    times = [timed(chain(2), tuple(effects[:n])) for n in counts]
    rows.append(_row("effects", counts, times))
    return rows
