from __future__ import annotations

import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402

from lptn import CopperLosses, Inputs, second_order  # noqa: E402

REFERENCE = {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625}


@pytest.fixture(scope="session")
def network():
    return second_order(**REFERENCE)


@pytest.fixture(scope="session")
def losses():
    return CopperLosses(Rs0=jnp.asarray(0.0062))


@pytest.fixture(scope="session")
def record():
    """76 minutes at 10 Hz: steps of load every few minutes, winding below 160 degC."""
    num = 45_846
    time = 0.1 * np.arange(num)
    rng = np.random.default_rng(20)
    level = np.repeat(rng.uniform(40.0, 125.0, num // 2400 + 1), 2400)[:num]
    current = level + 3.0 * np.sin(time / 7.0)
    speed = 200.0 + 150.0 * np.sin(time / 400.0)
    power = 250.0 + 0.02 * level**2 + 1.0 * speed
    return {
        "step": 0.1,
        "current_squared": current**2,
        "losses": power,
        "ambient": 20.0 + 0.5 * np.sin(time / 900.0),
        "speed": speed,
    }


def inputs_of(record, num=None, group=1, unequal=False):
    """Inputs from the record's first samples, as means over `group` of them."""
    columns = {}
    num = len(record["losses"]) if num is None else num
    num -= num % group
    for name in ("current_squared", "losses", "ambient", "speed"):
        columns[name] = jnp.asarray(record[name][:num].reshape(-1, group).mean(axis=1))
    step = record["step"] * group
    return Inputs(
        step=jnp.full(num // group, step) if unequal else jnp.asarray(step),
        rated_speed=jnp.asarray(350.0),
        rated_current=jnp.asarray(150.0),
        **columns,
    )


@pytest.fixture(scope="session")
def inputs(record):
    return inputs_of(record)


@pytest.fixture(scope="session")
def short(record):
    """The first 100 s, where gradients by finite differences are cheap."""
    return inputs_of(record, 2400, group=20)


@pytest.fixture(scope="session")
def regroup(record):
    return lambda **options: inputs_of(record, **options)


@pytest.fixture
def start():
    return {"winding": jnp.asarray(22.0), "stator": jnp.asarray(20.0)}
