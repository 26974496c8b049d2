"""What cannot be simulated is refused, with what was expected, what came and the remedy."""

import os
import subprocess
import sys

import jax.numpy as jnp
import pytest

import lptn
from lptn import CopperLosses, Inputs, Network
from lptn.effects.sensors import SensorLag

ZEROS, ONE = jnp.zeros(3), jnp.asarray(1.0)
START = {"winding": 22.0, "stator": 20.0}


def inputs_of(step, num=10):
    ones = jnp.ones(num)
    return Inputs(step=jnp.asarray(step), current_squared=ones, losses=ones, ambient=20.0 * ones)


LOSING = Network(
    {"winding": jnp.asarray(600.0), "stator": jnp.asarray(1e4)},
    {("winding", "stator"): jnp.asarray(0.1), ("stator", "ambient"): jnp.asarray(0.1)},
    {"stator": jnp.asarray(0.9)},
)
NEEDS_SPEED = CopperLosses(Rs0=jnp.asarray(0.0062), torque_offset=jnp.asarray(0.3))
COURSE = {
    "a step of nothing": ("must increase", {"inputs": inputs_of(0.0)}),
    "a step back": ("must increase", {"inputs": inputs_of(-1.0)}),
    "a step that is no number": ("must increase", {"inputs": inputs_of(float("nan"))}),
    "one bad step among good ones": (
        r"shortest step is -0\.5 s", {"inputs": inputs_of(jnp.ones(10).at[3].set(-0.5))}),
    "shares that lose heat": (r"add up to 0\.9, expected 1", {"network": LOSING}),
}  # fmt: skip
ASKED = {
    "a missing start": (r"given for \['winding'\].*'stator'", {"start": {"winding": 20.0}}),
    "a start of no node": ("magnet", {"start": START | {"magnet": 20.0}}),
    "a start that is no number": (
        r"'stator' has shape \(1,\).*jax\.vmap", {"start": START | {"stator": jnp.ones(1)}}),
    "a sensor in no node": ("'magnet', which is none of", {"sensor": lptn.Sensor(node="magnet")}),
    "a torque offset without speed": (
        r"0\.3 N m needs the speed", {"losses": NEEDS_SPEED, "inputs": inputs_of(1.0)}),
}  # fmt: skip
"""By both, beside what the whole course alone is looked at for."""


@pytest.mark.parametrize("case", COURSE | ASKED)
def test_what_cannot_be_simulated_is_refused(case, network, losses, short):
    said, changes = (COURSE | ASKED)[case]
    asked = {"network": network, "losses": losses, "inputs": short, "start": START} | changes
    for function in (lptn.simulate, *([lptn.reading] if case in ASKED else [])):
        with pytest.raises(ValueError, match=said):
            function(**asked)


def record(**columns):
    good = {"step": ONE, "current_squared": ZEROS, "losses": ZEROS, "ambient": ZEROS}
    return lambda: Inputs(**(good | columns))


def linked(*link):
    return lambda: Network({"winding": ONE}, {link: ONE}, {})


ZERO = jnp.zeros(())
MADE = {
    **{f"{name} of another length": (
        rf"Inputs\.{name} has shape \(4,\), expected \(3,\)", record(**{name: jnp.zeros(4)}))
       for name in ("losses", "ambient", "speed", "coolant", "fan")},
    "too few steps": (r"Inputs\.step", record(step=jnp.ones(2))),
    "steps in columns": (r"Inputs\.step", record(step=jnp.ones((3, 1)))),
    "a single number": (
        "one mean per interval", record(current_squared=ZERO, losses=ZERO, ambient=ZERO)),
    "a link to nowhere": ("must join two different nodes", linked("winding", "frame")),
    "a link to itself": ("must join two different nodes", linked("winding", "winding")),
    "a link from the sink": ("must join two different nodes", linked("ambient", "winding")),
    "losses into no node": (
        "'stator', which is none of", lambda: Network({"winding": ONE}, {}, {"stator": ONE})),
    "a node of a name that is taken": (
        "choose another name", lambda: LOSING.with_node("stator", capacitance=ONE, links={})),
}  # fmt: skip


@pytest.mark.parametrize("case", MADE)
def test_what_is_no_record_and_no_network_is_refused(case):
    said, make = MADE[case]
    with pytest.raises(ValueError, match=said):
        make()


def test_a_sensor_lag_works_on_any_network(losses, short):
    one = lptn.first_order(1e4, 0.1)
    lag = SensorLag(jnp.asarray(10.0))
    assert lptn.reading(one, losses, short, {"winding": 20.0}, effects=[lag]).shape == (121,)


def test_float32_is_refused_with_the_remedy():
    program = (
        "import jax.numpy as jnp, lptn\n"
        "inputs = lptn.Inputs(jnp.asarray(1.0), jnp.zeros(3), jnp.zeros(3), jnp.zeros(3))\n"
        "lptn.simulate(lptn.first_order(1e4, 0.1), lptn.CopperLosses(0.0), inputs,"
        " {'winding': 20.0})\n"
    )
    # heatrun, once imported, leaves its setting in the environment
    bare = {name: value for name, value in os.environ.items() if name != "JAX_ENABLE_X64"}
    words = [sys.executable, "-c", program]
    run = subprocess.run(words, capture_output=True, text=True, check=False, env=bare)
    assert run.returncode != 0
    said = 'ValueError: lptn needs float64 and JAX runs in float32: call `jax.config.update("jax_'
    assert said in run.stderr
