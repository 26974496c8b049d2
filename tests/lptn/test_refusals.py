"""What cannot be simulated is refused, with what was expected, what came and the remedy."""

from __future__ import annotations

import os
import subprocess
import sys

import equinox as eqx
import jax.numpy as jnp
import pytest

import lptn
from lptn import CopperLosses, Inputs, Network
from lptn.effects.sensors import SensorLag


def inputs_of(step, num=10):
    ones = jnp.ones(num)
    return Inputs(step=jnp.asarray(step), current_squared=ones, losses=ones, ambient=20.0 * ones)


@pytest.mark.parametrize("step", [0.0, -1.0, float("nan")])
def test_a_step_of_no_length_is_refused(step, network, losses, start):
    with pytest.raises(ValueError, match="must increase"):
        lptn.simulate(network, losses, inputs_of(step), start)


def test_one_bad_step_among_good_ones_is_refused(network, losses, start):
    steps = jnp.ones(10).at[3].set(-0.5)
    with pytest.raises(ValueError, match=r"shortest step is -0\.5 s"):
        lptn.simulate(network, losses, inputs_of(steps), start)


def test_a_missing_start_temperature_is_named(network, losses, short):
    with pytest.raises(ValueError, match=r"given for \['winding'\].*'stator'"):
        lptn.simulate(network, losses, short, {"winding": 20.0})


def test_a_start_temperature_of_no_node_is_named(network, losses, short, start):
    with pytest.raises(ValueError, match="magnet"):
        lptn.reading(network, losses, short, start | {"magnet": 20.0})


def test_a_start_that_is_no_number_is_refused(network, losses, short, start):
    with pytest.raises(ValueError, match=r"'stator' has shape \(1,\).*jax\.vmap"):
        lptn.reading(network, losses, short, start | {"stator": jnp.asarray([20.0])})


def test_a_sensor_in_no_node_is_refused(network, losses, short, start):
    with pytest.raises(ValueError, match="'magnet', which is none of"):
        lptn.reading(network, losses, short, start, sensor=lptn.Sensor(node="magnet"))


def test_a_torque_offset_without_speed_is_refused(network, short, start):
    losses = CopperLosses(Rs0=jnp.asarray(0.0062), torque_offset=jnp.asarray(0.3))
    silent = eqx.tree_at(lambda inputs: inputs.speed, short, None)
    with pytest.raises(ValueError, match=r"0\.3 N m needs the speed"):
        lptn.reading(network, losses, silent, start)


def test_shares_that_lose_heat_are_refused(losses, short):
    network = Network(
        {"winding": jnp.asarray(600.0), "stator": jnp.asarray(1e4)},
        {("winding", "stator"): jnp.asarray(0.1), ("stator", "ambient"): jnp.asarray(0.1)},
        {"stator": jnp.asarray(0.9)},
    )
    with pytest.raises(ValueError, match=r"add up to 0\.9, expected 1"):
        lptn.simulate(network, losses, short, {"winding": 20.0, "stator": 20.0})


@pytest.mark.parametrize("name", ["losses", "ambient", "speed", "coolant", "fan"])
def test_shapes_that_differ_are_refused(name):
    good = {"current_squared": jnp.zeros(3), "losses": jnp.zeros(3), "ambient": jnp.zeros(3)}
    with pytest.raises(ValueError, match=rf"Inputs\.{name} has shape \(4,\), expected \(3,\)"):
        Inputs(step=jnp.asarray(1.0), **(good | {name: jnp.zeros(4)}))


@pytest.mark.parametrize("shape", [(2,), (3, 1)])
def test_steps_of_another_shape_are_refused(shape):
    zeros = jnp.zeros(3)
    with pytest.raises(ValueError, match=r"Inputs\.step"):
        Inputs(step=jnp.ones(shape), current_squared=zeros, losses=zeros, ambient=zeros)


def test_a_single_number_is_no_record():
    zero = jnp.zeros(())
    with pytest.raises(ValueError, match="one mean per interval"):
        Inputs(step=jnp.asarray(1.0), current_squared=zero, losses=zero, ambient=zero)


@pytest.mark.parametrize(
    "link", [("winding", "frame"), ("winding", "winding"), ("ambient", "winding")]
)
def test_a_link_to_nowhere_is_refused(link):
    with pytest.raises(ValueError, match="must join two different nodes"):
        Network({"winding": jnp.asarray(1.0)}, {link: jnp.asarray(1.0)}, {})


def test_losses_into_no_node_are_refused():
    with pytest.raises(ValueError, match="'stator', which is none of"):
        Network({"winding": jnp.asarray(1.0)}, {}, {"stator": jnp.asarray(1.0)})


def test_a_node_is_added_under_a_free_name(network):
    with pytest.raises(ValueError, match="choose another name"):
        network.with_node("stator", capacitance=jnp.asarray(1.0), links={})


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
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False, env=bare
    )
    assert run.returncode != 0
    assert (
        'ValueError: lptn needs float64 and JAX runs in float32: call `jax.config.update("jax_'
        in run.stderr
    )
