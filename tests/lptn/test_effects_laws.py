"""Laws of single effects against numbers worked out apart from them."""

from __future__ import annotations

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from compiled import constant, simulate

import lptn
from lptn import CopperLosses
from lptn.effects import build
from lptn.effects.bodies import EndWindingNode, HousingNode, RotorNode
from lptn.effects.losses import (
    AcCopperLoss,
    CopperCoefficient,
    ExternalLoss,
    IronLossInWinding,
    StrayLoadLoss,
)
from lptn.effects.sensors import TimeShift
from lptn.effects.surface import NaturalConvection, Radiation
from lptn.stepping import heat_balance

HOT = {"winding": jnp.asarray(90.0), "stator": jnp.asarray(80.0)}


def terms(network, losses, short, kind=None, **values):
    """The balance at the last interval with winding at 90 and stator at 80 degC."""
    drive = short.drive()
    drive = type(drive)(**{
        f.name: None if getattr(drive, f.name) is None else getattr(drive, f.name)[-1]
        for f in dataclasses.fields(drive)
    })  # fmt: skip
    effects = [] if kind is None else [build(kind, values, network)]
    return heat_balance(network, losses, effects, HOT, drive), drive


def test_radiation_is_the_law_of_stefan_and_boltzmann(network, losses, short):
    base, drive = terms(network, losses, short)
    seen, _ = terms(network, losses, short, Radiation, eA=0.5)
    cold = float(drive.ambient) + 273.15
    expected = -0.5 * 5.670374419e-8 * (353.15**4 - cold**4)
    assert float(seen.heat["stator"] - base.heat["stator"]) == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_losses_move_under_a_balance_and_add_under_a_map(network, short, kind):
    losses = CopperLosses(Rs0=jnp.asarray(0.0062), kind=kind)
    base, drive = terms(network, losses, short)
    copper = 3 * float(drive.current_squared) * 0.0062 * (234.5 + 90.0) / (234.5 + 25.0)
    s = float(drive.speed)
    for effect, values, watts in (
        (AcCopperLoss, {"k": 0.4}, 0.4 * copper * s**2),
        (CopperCoefficient, {"dB": 10.0},
         copper * ((334.5 / 269.5) / (324.5 / 259.5) - 1.0)),
    ):  # fmt: skip
        seen, _ = terms(network, losses, short, effect, **values)
        assert float(seen.heat["winding"] - base.heat["winding"]) == pytest.approx(watts, rel=1e-9)
        taken = -watts if kind == "balance" else 0.0
        assert float(seen.heat["stator"] - base.heat["stator"]) == pytest.approx(taken, abs=1e-9)
    stray, _ = terms(network, losses, short, StrayLoadLoss, k=100.0)
    watts = 100.0 * float(drive.current_ratio_squared) * s**1.5
    node = "winding" if kind == "balance" else "stator"
    assert float(stray.heat[node] - base.heat[node]) == pytest.approx(watts, rel=1e-9)


def test_iron_loss_moves_and_external_loss_leaves(network, losses, short):
    base, drive = terms(network, losses, short)
    other = float(base.other)
    moved, _ = terms(network, losses, short, IronLossInWinding, q=0.2)
    assert float(moved.heat["winding"] - base.heat["winding"]) == pytest.approx(0.2 * other)
    assert float(sum(moved.heat.values())) == pytest.approx(float(sum(base.heat.values())))
    left, _ = terms(network, losses, short, ExternalLoss, k=0.1, m=1.0)
    lost = 0.1 * other * float(drive.speed)
    assert float(sum(base.heat.values()) - sum(left.heat.values())) == pytest.approx(lost)


def test_natural_convection_holds_at_forty_kelvin(network, losses, short):
    link = ("stator", "ambient")
    base, drive = terms(network, losses, short)
    seen, _ = terms(network, losses, short, NaturalConvection, f=0.6, n=0.25)
    theta = 80.0 - float(drive.ambient)
    # the rounding off below 1 K changes the law by (1 K/theta)^2/8
    expected = 1.0 - 0.6 + 0.6 * (theta / 40.0) ** 0.25
    factor = float(seen.conductance[link] / base.conductance[link])
    assert factor == pytest.approx(expected, rel=2e-4)


def test_a_housing_is_a_ladder_as_seen_from_the_winding(network, losses, short, start):
    """The equivalent form against the ladder itself, at a constant sink."""
    still = eqx.tree_at(lambda i: i.ambient, short, jnp.asarray(np.full(short.num_time, 20.0)))
    x, tau, R = 0.4, 200.0, 0.11625
    ladder = lptn.Network(
        capacitance={"winding": jnp.asarray(666.75), "stator": jnp.asarray(15060.1),
                     "housing": jnp.asarray(tau / (x * (1 - x) * R))},
        resistance={("winding", "stator"): jnp.asarray(0.14485),
                    ("stator", "housing"): jnp.asarray((1 - x) * R),
                    ("housing", "ambient"): jnp.asarray(x * R)},
        share={"stator": jnp.asarray(1.0)},
    )  # fmt: skip
    equal = {"winding": 20.0, "stator": 20.0}
    seen = simulate(network, losses, still, equal,
                         effects=[build(HousingNode, {"x": x, "tau": tau}, network)])  # fmt: skip
    expected = simulate(ladder, losses, still, {**equal, "housing": 20.0})
    # two explicit third-order marches of different nodes: (2 s/97 s)^3/24 of 15 K at most
    np.testing.assert_allclose(seen.reading, expected.reading, atol=1e-5)
    housing = 20.0 + x * (np.asarray(seen.temperature["housing"]) - 20.0)
    assert float(housing[-1]) > 20.01
    np.testing.assert_allclose(housing, expected.temperature["housing"], atol=1e-5)


def test_the_rotor_hands_on_what_it_gets(network, losses, short):
    values = {"p": 0.3, "C": 10e3, "tau": 300.0}
    equal = {"winding": 20.0, "stator": 20.0}
    trace = simulate(network, losses, short, equal,
                          effects=[build(RotorNode, values, network)])  # fmt: skip
    got = 0.3 * float(np.sum(trace.other_loss) * short.step)
    kept = 0.3 * 10e3 * float(trace.temperature["rotor"][-1] - 20.0)
    given = -float(np.sum(trace.flow["stator", "rotor"]) * short.step)
    assert got == pytest.approx(kept + given, rel=1e-9)
    assert given > 0.0


def test_overhang_and_slot_share_the_winding(network, losses, short):
    equal = {"winding": 20.0, "stator": 20.0}
    effect = build(EndWindingNode, {"f": 0.4, "tau": 25.0, "p": 1.0}, network)
    trace = simulate(network, losses, short, equal, effects=[effect])
    extended = effect.extend(network)
    assert float(extended.capacitance["winding"]) == pytest.approx(0.6 * 666.75)
    assert float(extended.capacitance["overhang"]) == pytest.approx(0.4 * 666.75)
    ahead = np.subtract(trace.temperature["overhang"], trace.temperature["winding"])
    np.testing.assert_allclose(
        np.subtract(trace.reading, trace.temperature["winding"]), ahead, atol=1e-12
    )
    assert float(ahead[-1]) > 0.0  # it is heated and only the slots cool it


def test_a_shift_of_a_ramp_is_the_ramp_later():
    inputs = constant(2.0, num=199)
    edges = 2.0 * np.arange(200)
    ramp = jnp.asarray(20.0 + 0.5 * edges)
    shifted = eqx.filter_jit(TimeShift(jnp.asarray(7.0)).observe)(ramp, {}, inputs)
    np.testing.assert_allclose(shifted, 20.0 + 0.5 * np.maximum(edges - 7.0, 0.0), atol=1e-7)
