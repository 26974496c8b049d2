"""The rows that measure heatrun itself: likelihoods, Jacobian, noise, fit, posterior."""

import math
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np

import lptn
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce


def build(theta):
    """Network, losses and start for a row of parameters."""
    network = lptn.second_order(theta[0], theta[1], theta[2], theta[3])
    losses = lptn.CopperLosses(Rs0=theta[4])
    return network, losses, {"winding": theta[5], "stator": theta[5]}


def inputs_of(record: dict[str, np.ndarray]) -> lptn.Inputs:
    """Return the record as inputs, one interval a sample."""
    names = ("step", "current_squared", "losses", "ambient")
    return lptn.Inputs(**{name: jnp.asarray(record[name]) for name in names})


def likelihood(record):
    """Return the compiled sum of squares over rows of parameters."""
    inputs, measured = inputs_of(record), jnp.asarray(record["measured"])

    def one(theta):
        network, losses, start = build(theta)
        return lptn.accumulate(
            network, losses, inputs, start,
            update=lambda total, before, after, y: total + (y - after) ** 2,
            carry=jnp.zeros(()), data=measured,
        )  # fmt: skip

    return jax.jit(jax.vmap(one))


def reading(record) -> np.ndarray:
    """Return the reading at the samples for the truth."""
    from duty_record import TRUTH

    network, losses, start = build(TRUTH)
    return np.asarray(lptn.reading(network, losses, inputs_of(record), start))[1:]


def exact_reading(record) -> np.ndarray:
    """As `reading`, by the reference simulation."""
    from duty_record import TRUTH

    network, losses, start = build(TRUTH)
    return np.asarray(lptn.reference(network, losses, inputs_of(record), start).reading)[1:]


def jacobian(record):
    """Return residuals and their derivatives in the four network parameters, compiled."""
    inputs, measured = inputs_of(record), jnp.asarray(record["measured"])

    def residual(four, theta):
        network, losses, start = build(jnp.concatenate([four, theta[4:]]))
        return measured - lptn.reading(network, losses, inputs, start)[1:]

    @jax.jit
    def both(theta):
        value, push = jax.linearize(partial(residual, theta=theta), theta[:4])
        return value, jax.vmap(push, out_axes=-1)(jnp.eye(4))

    return both


def coloured(record, sd=0.3, time=30.0, white=0.3, exact_steps=64):
    """Return minus twice the log density under OU + white noise at the raw rate, compiled.

    The gain of the Kalman filter settles within a few steps and does not depend on the data; it
    is computed once for the noise at hand, the exact first steps included.
    """
    inputs, measured = inputs_of(record), np.asarray(record["measured"])
    phi = math.exp(-record["step"] / time)
    variance, gains, totals = sd**2, [], []
    for _ in range(exact_steps):
        total = variance + white**2
        gains.append(variance / total)
        totals.append(total)
        variance = phi**2 * variance * (1 - gains[-1]) + (1 - phi**2) * sd**2
    rest = measured.size - exact_steps
    gain = jnp.asarray(gains + [gains[-1]] * rest)
    inverse = 1.0 / jnp.asarray(totals + [totals[-1]] * rest)
    constant = float(np.sum(np.log(totals)) + rest * math.log(totals[-1]))
    data = (jnp.asarray(measured), gain, inverse)

    def one(theta):
        network, losses, start = build(theta)

        def update(carry, before, after, item):
            mean, total = carry
            y, gain, inverse = item
            innovation = y - after - mean
            return phi * (mean + gain * innovation), total + inverse * innovation**2

        carry = (jnp.zeros(()), jnp.zeros(()))
        return constant + lptn.accumulate(
            network, losses, inputs, start, update=update, carry=carry, data=data
        )[1]  # fmt: skip

    return jax.jit(jax.vmap(one))


def problem(record, **options) -> Problem:
    num = record["measured"].size
    time = record["step"] * np.arange(num + 1)

    def edges(values):
        return np.concatenate([values[:1], values])

    made = Record(
        "benchmark",
        {
            "time_s": time,
            "phase_current_A": np.sqrt(edges(record["current_squared"])),
            "losses_W": edges(record["losses"]),
            "ambient_degC": edges(record["ambient"]),
            "winding_degC": edges(record["measured"]),
        },
    )
    motor = Motor("benchmark", phase_resistance_ohm=0.0062)
    return Problem.of(Model.of("second", motor), motor, [reduce(made, motor, **options)])
