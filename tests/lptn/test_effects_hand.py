"""Each of the plain laws at one instant, in numbers worked out by hand."""

from __future__ import annotations

import math

import jax.numpy as jnp
import numpy as np
import pytest

import lptn
from lptn import CopperLosses
from lptn.effects import build
from lptn.effects.cooling import CoolingStep, FanCooling
from lptn.effects.losses import BearingFriction, LossGain, StandbyLoss, WindingResistance
from lptn.effects.sensors import SensorContact, SensorGain
from lptn.effects.sinks import AmbientDrift, AmbientRecirculation, CoolantSink
from lptn.effects.winding_path import ContactDrift, InsulationConductivity
from lptn.stepping import heat_balance

TEMPERATURE = {"winding": jnp.asarray(90.0), "stator": jnp.asarray(80.0)}
MOMENT = lptn.Drive(
    time=jnp.asarray(1800.0),
    current_squared=jnp.asarray(100.0**2),
    losses=jnp.asarray(700.0),
    ambient=jnp.asarray(20.0),
    speed=jnp.asarray(-0.5),  # the direction of rotation changes nothing
    speed_rad=jnp.asarray(-200.0),
    coolant=jnp.asarray(35.0),
    fan=jnp.asarray(0.6),
    current_ratio_squared=jnp.asarray(0.25),
)
COPPER_W = 3 * 100.0**2 * 0.0062 * (234.5 + 90.0) / (234.5 + 25.0)
WINDING_PATH = ("winding", "stator")
SINK_PATH = ("stator", "ambient")


@pytest.fixture(params=["balance", "map"])
def moment(request, network):
    """The balance of the moment under some effect, for either meaning of the loss channel."""
    losses = CopperLosses(Rs0=jnp.asarray(0.0062), kind=request.param)

    def terms(kind=None, **values):
        effects = [] if kind is None else [build(kind, values, network)]
        return heat_balance(network, losses, effects, TEMPERATURE, MOMENT)

    return terms


@pytest.mark.parametrize(
    ("kind", "values", "link", "factor"),
    [
        (FanCooling, {"g": 0.5}, SINK_PATH, 1.0 + 0.5 * 0.6),
        (CoolingStep, {"k": 2.0, "t_star": 600.0}, SINK_PATH, 2.0),
        (CoolingStep, {"k": 2.0, "t_star": 3000.0}, SINK_PATH, 1.0),
        (CoolingStep, {"k": 2.0, "t_star": 1800.0}, SINK_PATH, 1.5),
        (InsulationConductivity, {"b": 0.004}, WINDING_PATH, 1.0 + 0.004 * 30.0),
        (ContactDrift, {"d": 0.1}, WINDING_PATH, 1.0 / 1.05),
    ],
)
def test_a_path_conducts_by_the_law(kind, values, link, factor, moment):
    base, seen = moment(), moment(kind, **values)
    for path, conductance in base.conductance.items():
        expected = factor if path == link else 1.0
        # 1200 s are 80 widths of the logistic course: nothing is left of its tails
        assert float(seen.conductance[path] / conductance) == pytest.approx(expected, rel=1e-12)
    assert seen.heat == base.heat
    assert seen.sink == base.sink


@pytest.mark.parametrize(
    ("kind", "values", "rise"),
    [
        (CoolantSink, {"a": 0.4}, 0.4 * 15.0),
        (AmbientDrift, {"d": -3.0}, -1.5),
    ],
)
def test_the_sink_sits_where_the_law_puts_it(kind, values, rise, moment):
    base, seen = moment(), moment(kind, **values)
    assert float(seen.sink) == pytest.approx(20.0 + rise, rel=1e-12)
    assert seen.heat == base.heat
    assert seen.conductance == base.conductance


def test_recirculation_goes_with_all_losses(moment):
    total = 700.0 if moment().losses.kind == "balance" else 700.0 + COPPER_W
    seen = moment(AmbientRecirculation, r=0.01)
    assert float(seen.sink) == pytest.approx(20.0 + 0.01 * total, rel=1e-12)


def test_a_wrong_resistance_moves_heat_under_a_balance_and_adds_under_a_map(moment):
    base, seen = moment(), moment(WindingResistance, g=0.1)
    taken = 0.1 * COPPER_W if base.losses.kind == "balance" else 0.0
    assert float(seen.heat["winding"] - base.heat["winding"]) == pytest.approx(0.1 * COPPER_W)
    assert float(base.heat["stator"] - seen.heat["stator"]) == pytest.approx(taken, abs=1e-9)


@pytest.mark.parametrize(
    ("kind", "values", "watts"),
    [
        (StandbyLoss, {"P0": 20.0}, 20.0),
        (BearingFriction, {"T_f": 0.1, "kappa": 0.03}, 0.1 * 200.0 * math.exp(-0.03 * 60.0)),
        (LossGain, {"g": 0.05}, 0.05 * 700.0),
    ],
)
def test_losses_that_change_the_total_heat_the_stator(kind, values, watts, moment):
    """The loss channel is 700 W under a balance (all losses) and under a map (without copper)."""
    base, seen = moment(), moment(kind, **values)
    assert float(seen.heat["stator"] - base.heat["stator"]) == pytest.approx(watts, rel=1e-9)
    assert float(seen.heat["winding"]) == float(base.heat["winding"])


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        (SensorContact, {"k": 0.25}, [57.5, 77.5]),
        (SensorContact, {"k": -0.1}, [61.0, 95.0]),
        (SensorGain, {"g": 0.02}, [60.0 + 0.02 * 40.0, 90.0 + 0.02 * 70.0]),
    ],
)
def test_the_sensor_reads_by_the_law(kind, values, expected, network):
    nothing = jnp.zeros(1)
    inputs = lptn.Inputs(jnp.asarray(2.0), nothing, nothing, jnp.full(1, 20.0))
    winding = jnp.asarray([60.0, 90.0])
    temperature = {"winding": winding, "stator": jnp.asarray([50.0, 40.0])}
    seen = build(kind, values, network).observe(winding, temperature, inputs)
    np.testing.assert_allclose(seen, expected, rtol=1e-12)
