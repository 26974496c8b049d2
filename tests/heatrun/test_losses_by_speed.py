"""Iron and friction losses that follow the speed, in networks of several nodes."""

from __future__ import annotations

import json
from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from turning import NETWORK, RS0, T0, TRUTH, amperes, copper, course, friction, iron, record, rpm

from heatrun import cli
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.model_parameters import override_names
from heatrun.model.network_text import network_of, network_text, read_network
from heatrun.model.problem import Problem
from heatrun.model.scale import Masses, scale_of_tests, scaled
from heatrun.record.motor import Motor
from heatrun.record.reduction import reduce
from lptn import CopperLosses, Drive, Inputs, SpeedLoss, heat_input, simulate

MOTOR = Motor("bench", phase_resistance_ohm=RS0)
FORM = read_network(NETWORK.encode(), "turning.toml")
TIME = np.arange(0.0, 6000.0, 2.0)


def with_losses(losses, by_speed):
    text = NETWORK.replace(
        'losses = { copper = "winding", iron = "stator", mechanical = "rotor" }',
        f"losses = {losses}",
    ).replace('by_speed = ["mechanical"]', f"by_speed = {by_speed}")
    return read_network(text.encode(), "turning.toml")


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_simulation_meets_an_independent_integrator(kind):
    middle = 0.5 * (TIME[1:] + TIME[:-1])
    fine = course(np.union1d(TIME, middle))
    at_edges, between = fine[:, ::2], fine[:, 1::2]
    losses = iron(middle)
    if kind == "balance":
        losses = losses + friction(middle) + copper(middle, between[0])
    inputs = Inputs(
        step=2.0,
        current_squared=jnp.asarray(amperes(middle) ** 2),
        losses=jnp.asarray(losses),
        ambient=jnp.full(middle.size, T0),
        speed=jnp.asarray(rpm(middle) * np.pi / 30.0),
    )
    (mechanical,) = FORM.by_speed
    trace = simulate(
        FORM.build(TRUTH),
        CopperLosses(Rs0=jnp.asarray(RS0), kind=kind),
        inputs,
        dict.fromkeys(FORM.nodes, T0),
        effects=mechanical.build(TRUTH),
    )
    for node, true in zip(FORM.nodes, at_edges, strict=True):
        np.testing.assert_allclose(trace.temperature[node], true, atol=2e-3, err_msg=node)
    if kind == "balance":
        total = sum(np.asarray(heat) for heat in trace.heat.values())
        np.testing.assert_allclose(total, losses, rtol=1e-12)


def test_of_a_balance_the_parts_are_taken_out_and_on_a_map_they_come_on_top():
    form = with_losses(
        '{ copper = "winding", other = "stator", iron = { stator = 0.25, rotor = 0.75 }, '
        'mechanical = "rotor" }',
        '["iron", "mechanical"]',
    )
    values = TRUTH | {"P_iron_n": 40.0, "P_iron_n2": 8.0}
    losses = CopperLosses(Rs0=jnp.asarray(0.0))
    drive = Drive.constant(
        current_squared=0.0, losses=500.0, ambient=T0, speed=-2000.0 * np.pi / 30.0
    )
    effects = [part for loss in form.by_speed for part in loss.build(values)]
    heat = heat_input(form.build(values), losses, drive, dict.fromkeys(form.nodes, T0),
                      effects=effects)  # fmt: skip
    of_iron, of_friction = 2 * 40.0 + 4 * 8.0, 2 * 30.0 + 4 * 12.0
    assert float(heat["rotor"]) == pytest.approx(0.75 * of_iron + of_friction)
    assert float(heat["stator"]) == pytest.approx(500.0 - 0.75 * of_iron - of_friction)
    on_top = heat_input(form.build(values), replace(losses, kind="map"), drive,
                        dict.fromkeys(form.nodes, T0), effects=effects)  # fmt: skip
    assert float(on_top["stator"]) == pytest.approx(500.0 + 0.25 * of_iron)
    at_rest = replace(drive, speed_rad=jnp.asarray(0.0))
    still = heat_input(form.build(values), losses, at_rest, dict.fromkeys(form.nodes, T0),
                       effects=effects)  # fmt: skip
    assert float(still["rotor"]) == 0.0
    with pytest.raises(ValueError, match="needs the channel speed_rpm"):
        heat_input(form.build(values), losses, replace(drive, speed_rad=None),
                   dict.fromkeys(form.nodes, T0), effects=[SpeedLoss(1.0, 1.0)])  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["balance", "map"])
def test_friction_is_recovered_beside_the_network(kind):
    motor = replace(MOTOR, losses=kind)
    test = reduce(record(kind=kind), motor)
    model = Model.of(FORM, motor).scaled(motor, [test])
    found = fit(Problem.of(model, motor, [model.with_bodies(test)]))
    for name, true in TRUTH.items():
        slot = found.problem.parameters.index(name)
        parameter = found.slots[slot].parameter
        sd = float(np.sqrt(found.covariance[slot, slot]))
        assert abs(float(found.z[slot]) - parameter.score(true)) < 3.0 * sd, name
        assert sd * parameter.sd < 0.02, name  # of the logarithm; the prior has 1.3 and more


def test_priors_follow_the_losses_and_the_speed_of_the_tests():
    test = reduce(record(), MOTOR)
    scale = scale_of_tests([test])
    assert scale is not None
    assert scale.fastest == pytest.approx(6.0)
    (loss,) = scaled(FORM, scale, Masses()).by_speed
    assert loss.linear.centre * 6.0 == pytest.approx(0.1 * scale.loss)
    assert loss.square.centre * 36.0 == pytest.approx(0.1 * scale.loss)
    content = network_text(FORM)
    content["parameters"]["P_mechanical_n"] = {"value": 25.0, "relative_sd": 0.5}
    (stated,) = scaled(network_of(content, "stated"), scale, Masses()).by_speed
    assert stated.linear.centre == 25.0
    assert (loss.linear.unit, loss.square.unit) == ("W", "W")
    assert "P_mechanical_n2" in override_names(FORM)


def test_text_reads_back_to_the_same_network():
    for form in (
        FORM,
        with_losses(
            '{ copper = "winding", other = "stator", iron = ["stator", "rotor"], '
            "mechanical = { stator = 0.1, rotor = 0.9 } }",
            '["mechanical", "iron"]',
        ),
    ):
        again = network_of(network_text(form), "again")
        assert again == form
        assert again.parameters == form.parameters
        assert again != network_of(network_text(replace(form, by_speed=())), "without")


@pytest.mark.parametrize(
    ("losses", "by_speed", "said"),
    [
        ('{ copper = "winding", iron = "stator", mechanical = "rotor" }', '["copper"]',
         "expected a list with iron, mechanical or both"),
        ('{ copper = "winding", iron = "stator" }', '["mechanical"]',
         "losses do not say which node each heats"),
        ('{ copper = "winding", iron = "stator", mechanical = "rotor" }', '["iron", "mechanical"]',
         "none is left to take"),
        ('{ copper = "winding", iron = "stator", mechanical = "shaft" }', '["mechanical"]',
         "losses name 'shaft'"),
    ],
)  # fmt: skip
def test_a_wrong_network_is_refused(losses, by_speed, said):
    with pytest.raises(InputError, match=said):
        with_losses(losses, by_speed)


def test_a_test_without_a_speed_is_refused(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table = pd.DataFrame(record().channels).drop(columns="speed_rpm")
    table.to_csv("duty.csv", index=False)
    (tmp_path / "turning.toml").write_text(NETWORK)
    text = '[motor]\nname = "bench"\n[winding]\nphase_resistance_ohm = 0.0062\n'
    (tmp_path / "motor.toml").write_text(text)
    assert cli.main(["check", "motor.toml", "duty.csv", "--model", "turning.toml", "--json"]) == 1
    findings = json.loads(capsys.readouterr().out)["findings"]
    (refusal,) = [f for f in findings if f["severity"] == "error"]
    assert "the mechanical loss follows the speed" in refusal["message"]
    assert "[columns] speed_rpm" in refusal["remedy"]
    words = ["calibrate", "motor.toml", "duty.csv", "--model", "turning.toml", "--out", "refused"]
    assert cli.main(words) == 1
    assert "this test has no speed_rpm" in capsys.readouterr().err
    assert not (tmp_path / "refused").exists()
    (tmp_path / "motor.toml").write_text(text + "[constants]\nspeed_rpm = 3000\n")
    assert cli.main(["check", "motor.toml", "duty.csv", "--model", "turning.toml", "--json"]) == 0
