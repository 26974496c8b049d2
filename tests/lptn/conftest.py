import jax

jax.config.update("jax_enable_x64", True)

import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402
import pytest  # noqa: E402
from independent import FOUR_C, FOUR_R, FOUR_SHARE  # noqa: E402

from lptn import CopperLosses, Inputs, Network, second_order  # noqa: E402

REFERENCE = {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625}


@pytest.fixture(autouse=True)
def _ranks_must_agree():
    """An array that is broadcast by accident is an error here."""
    with jax.numpy_rank_promotion("raise"):
        yield


@pytest.fixture(scope="session")
def network():
    return second_order(**REFERENCE)


@pytest.fixture(scope="session")
def four_nodes():
    """A network in the manner of the published four-node ones, in which the shares are split."""
    parts = FOUR_C, FOUR_R | {("yoke", "ambient"): 0.018}, FOUR_SHARE
    return Network(*({name: jnp.asarray(each) for name, each in part.items()} for part in parts))


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
    speed[:400] = 0.0  # laws with a power of the speed must be smooth in their parameters here
    power = 250.0 + 0.02 * level**2 + 1.0 * speed
    return {
        "step": 0.1,
        "current_squared": current**2,
        "losses": power,
        "ambient": 20.0 + 0.5 * np.sin(time / 900.0),
        "speed": speed,
        "coolant": 35.0 + 5.0 * np.sin(time / 200.0),
        "fan": np.where(time % 100.0 < 60.0, 1.0, 0.3),
    }


@pytest.fixture(scope="session")
def duty():
    """76 minutes at 10 Hz with hard steps of 50 to 220 A, winding below 160 degC.

    The lengths of the loads [s] are odd and even, so that blocks of 2 s hold jumps.
    """
    num = 45_846
    time = 0.1 * np.arange(num)
    loads = [(60, 200), (220, 41), (50, 340), (160, 150), (80, 260), (200, 61), (50, 330),
             (120, 240)] * 3  # fmt: skip
    ends = np.cumsum([length for _, length in loads])
    current = np.array([float(level) for level, _ in loads])[
        np.searchsorted(ends, time + 0.05) % len(loads)
    ]
    return {
        "step": 0.1,
        "current_squared": current**2,
        "losses": 300.0 + 1200.0 * ((current - 50.0) / 170.0) ** 2,
        "ambient": 22.0 + 3.0 * np.sin(time / 480.0),
    }


def inputs_of(record, num=None, group=1, unequal=False):
    """Inputs from the record's first samples, as means over `group` of them."""
    columns = {}
    num = len(record["losses"]) if num is None else num
    num -= num % group
    for name, values in record.items():
        if name != "step":
            columns[name] = jnp.asarray(values[:num].reshape(-1, group).mean(axis=1))
    step = record["step"] * group
    return Inputs(
        step=jnp.full(num // group, step) if unequal else jnp.asarray(step),
        rated_speed=jnp.asarray(350.0),
        rated_current=jnp.asarray(150.0),
        **columns,
    )


@pytest.fixture(scope="session")
def short(record):
    """The first 240 s as means over 2 s, where gradients by finite differences are cheap."""
    return inputs_of(record, 2400, group=20)


@pytest.fixture(scope="session")
def regroup(record):
    return lambda **options: inputs_of(record, **options)


@pytest.fixture(scope="session")
def regroup_duty(duty):
    return lambda **options: inputs_of(duty, **options)


@pytest.fixture
def start():
    return {"winding": jnp.asarray(22.0), "stator": jnp.asarray(20.0)}
