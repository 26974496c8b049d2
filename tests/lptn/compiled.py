"""The functions of `lptn`, each compiled as a whole, and records of one length for them.

Called as they are, they compile a program for each operation and shape, a hundred in a test. That
both ways give the same numbers is asserted in `test_simulate.py` and `test_effects.py`.
"""

from functools import wraps

import equinox as eqx
import jax.numpy as jnp
import numpy as np

import lptn

NUM = 6000
"""Intervals of a record: a shorter one is looked at up to its end."""


def constant(step, current=0.0, losses=0.0, ambient=20.0, num=NUM):
    return lptn.Inputs(
        step=jnp.asarray(step),
        current_squared=jnp.asarray(np.full(num, current**2)),
        losses=jnp.asarray(np.full(num, losses)),
        ambient=jnp.asarray(np.full(num, ambient)),
    )


def _compiled(function):
    whole = eqx.filter_jit(function)

    @wraps(function)
    def called(network, losses, inputs, start, **more):
        # numbers would be compiled in
        start = {node: jnp.asarray(T, dtype=float) for node, T in start.items()}
        return whole(network, losses, inputs, start, **more)

    return called


simulate = _compiled(lptn.simulate)
reading = _compiled(lptn.reading)
reference = _compiled(lptn.reference)


def _compiled_constant(function):
    whole = eqx.filter_jit(function)

    @wraps(function)
    def called(network, losses, drive, *temperature, **more):
        temperature = [{n: jnp.asarray(T, dtype=float) for n, T in t.items()} for t in temperature]
        if "limit" in more:
            more["limit"] = jnp.asarray(more["limit"], dtype=float)
        return whole(network, losses, drive, *temperature, **more)

    return called


steady_state = _compiled_constant(lptn.steady_state)
time_to = _compiled_constant(lptn.time_to)
linearise = _compiled_constant(lptn.linearise)
