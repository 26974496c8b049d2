"""Networks of a user's own: nodes, losses by speed, and what is refused."""

import json
from dataclasses import asdict, replace
from importlib.resources import files
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
import two_sinks
from recovered import holds, log_sd
from turning import NETWORK, T0, TRUTH, course, friction, iron, record, rpm
from two_sinks import RS0, amperes, copper

import heatrun
from heatrun import cli
from heatrun.effects.engine import library
from heatrun.errors import InputError, UsageError
from heatrun.fit.fit import fit
from heatrun.model.catalogue import effects_named
from heatrun.model.model import Model
from heatrun.model.model_parameters import override_names, parameters
from heatrun.model.network_text import (
    SHIPPED,
    network_named,
    network_of,
    network_text,
    networks_of,
    pair_of,
    read_network,
)
from heatrun.model.problem import Problem, predictions
from heatrun.model.scale import Masses, scale_of_tests, scaled
from heatrun.record.motor import Adequacy, Motor, ParameterOverride
from heatrun.record.reduction import reduce
from heatrun.runs.run import ModelOfRun, model_text, read_model
from lptn import EFFECTS, CopperLosses, Drive, Inputs, SpeedLoss, heat_input, simulate

FOUR = """
[network]
name = "four"
nodes = ["winding", "tooth", "yoke", "rotor"]
sinks = ["coolant"]
links = [["winding", "tooth"], ["tooth", "yoke"], ["tooth", "rotor"], ["yoke", "coolant"]]
losses = { copper = "winding", iron = ["tooth", "yoke"], mechanical = "rotor" }
sensors = { winding_degC = "winding", stator_degC = "yoke" }
effects = ["speed_cooling"]

[parameters.Ceq_rotor]
capacitance = "rotor"
value = 4000.0
relative_sd = 0.5
"""


def four():
    return read_network(FOUR.encode(), "four.toml")


def test_a_network_has_a_parameter_for_every_part():
    form = four()
    assert form.names == (
        "Ceq_winding", "Ceq_tooth", "Ceq_yoke", "Ceq_rotor",
        "Req_winding_tooth", "Req_tooth_yoke", "Req_tooth_rotor", "Req_yoke_coolant",
        "share_yoke", "share_rotor",
        "Tw_start", "T_tooth_start", "T_yoke_start", "T_rotor_start",
    )  # fmt: skip
    rotor = dict(form.capacitance)["rotor"]
    assert (rotor.centre, rotor.sd) == (4000.0, np.log1p(0.5))
    assert form.body == ("Ceq_yoke", "Req_yoke_coolant")
    values = {p.name: jnp.asarray(2.0) for p in form.parameters}
    network = form.build(
        {**values, "share_yoke": jnp.asarray(0.3), "share_rotor": jnp.asarray(0.1)}
    )
    assert {n: round(float(s), 12) for n, s in network.share.items()} == {
        "tooth": 0.6, "yoke": 0.3, "rotor": 0.1,
    }  # fmt: skip
    assert network.boundary == "coolant"


def test_a_model_with_effects_and_fixed_values_reads_back_to_the_same_value(blocks):
    motor = Motor(
        "m", phase_resistance_ohm=0.0062, sink="coolant", adequacy=Adequacy(heat_time_s=600.0),
        parameters={"Ceq_tooth": ParameterOverride(fixed=900.0),
                    "speed_cooling.g": ParameterOverride(value=0.4, sd=0.1)},
    )  # fmt: skip
    with_speed = Model.of(four(), motor)
    known = parameters(with_speed, motor, [blocks])
    found = ModelOfRun(with_speed, known)
    again = read_model(model_text(found), "model.toml")
    assert again == found
    assert again.model.effects[0].card.id == "speed_cooling"


def test_the_second_order_from_a_file_is_the_built_in_to_the_last_bit(tmp_path, blocks, motor):
    text = files("heatrun.model").joinpath("networks/second.toml").read_text("utf-8")
    file = tmp_path / "mine.toml"
    file.write_text(text.replace('name = "second"', 'name = "mine"'), "utf-8")
    courses = []
    for network in ("second", str(file)):
        problem = Problem.of(Model.of(network, motor), motor, [blocks])
        z = jnp.linspace(-0.5, 0.5, problem.num_parameters)
        courses.append(np.asarray(predictions(problem.structure, problem.data, z)[0]))
    assert np.array_equal(*courses)


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('nodes = ["winding", ', 'nodes = ["winding", "winding", ', "different names"),
        ('"yoke", "coolant"]]', '"yoke", "air"]]', "two different names"),
        (', ["yoke", "coolant"]]', "]", "no path of links"),
        ('copper = "winding"', 'copper = "coil"', "names no node"),
        ('"rotor" }', '"shaft" }', "'shaft'"),
        ('iron = ["tooth", "yoke"]', "iron = { tooth = 0.5, yoke = 0.4 }", "add up to 1"),
        ('winding_degC = "winding", ', "", "winding_degC"),
        ("sinks", "drains", "'drains' is not known"),
        ('sinks = ["coolant"]', 'sinks = ["coolant", "air"]', "expected one"),
        ("[parameters.Ceq_rotor]", "[parameters.Ceq_shaft]", None),
        ("value = 4000.0", "value = -1.0", "above 0"),
        ('capacitance = "rotor"\n', "", "Did you mean"),
        ('"speed_cooling"', '"speed_coolin"', "speed_cooling"),
    ],
)
def test_a_wrong_network_says_what_was_expected(old, new, said):
    assert old in FOUR
    text = FOUR.replace(old, new)
    if said is None:  # the name of a section is free where it says whose parameter it is
        assert "Ceq_shaft" in read_network(text.encode(), "four.toml").names
        return
    if said == "Did you mean":
        text = text.replace("Ceq_rotor", "Ceq_roter")
    with pytest.raises(InputError, match=said):
        Model.of(read_network(text.encode(), "four.toml"), Motor("m", sink="coolant"))


def test_networks_by_name_and_file(tmp_path):
    (tmp_path / "four.toml").write_text(FOUR)
    assert [form.name for form in networks_of("both")] == ["first", "second"]
    assert [f.name for f in networks_of(f"second,{tmp_path / 'four.toml'}")] == ["second", "four"]
    with pytest.raises(InputError, match="no network 'third'"):
        networks_of("third")


FOUR_TEXT = Path(__file__).with_name("four.toml").read_text("utf-8")
PLAIN = """[motor]
name = "bench"
[winding]
phase_resistance_ohm = 0.0062
"""
COOLED = PLAIN + '[model]\neffects = ["speed_cooling"]\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory, bench, generator):
    """A bench folder with two short tests, one of them without a speed."""
    folder = tmp_path_factory.mktemp("own")
    (folder / "motor.toml").write_text(PLAIN)
    (folder / "cooled.toml").write_text(COOLED)
    (folder / "four.toml").write_text(FOUR_TEXT)
    (folder / "known.toml").write_text(Path(__file__).with_name("four_known.toml").read_text())
    (folder / "coolant.toml").write_text(
        FOUR_TEXT.replace("[network]\n", '[network]\nsinks = ["coolant"]\n').replace(
            '"ambient"', '"coolant"'
        )
    )
    duty = pd.DataFrame(bench(generator.duty(1800.0), seed=40).channels)
    duty.to_csv(folder / "duty.csv", index=False)
    step = pd.DataFrame(bench(generator.constant_load(900.0), seed=41).channels)
    step.to_csv(folder / "step.csv", index=False)
    duty.drop(columns="speed_rpm").to_csv(folder / "no_speed.csv", index=False)
    duty.to_csv(folder / "no_coolant.csv", index=False)
    wet = duty.assign(coolant_degC=duty.ambient_degC)
    wet.to_csv(folder / "wet.csv", index=False)
    wet.drop(columns="ambient_degC").to_csv(folder / "no_air.csv", index=False)
    (folder / "liquid.toml").write_text(PLAIN.replace("[winding]", 'sink = "coolant"\n[winding]'))
    (folder / "turning.toml").write_text(NETWORK)
    return folder


@pytest.fixture
def call(folder, capsys, monkeypatch):
    """Run a command with `--json` in the folder; return its exit code, object and messages."""
    monkeypatch.chdir(folder)

    def run(*words):
        capsys.readouterr()
        code = cli.main([*words, "--json"])
        said = capsys.readouterr()
        return code, json.loads(said.out), said.err

    return run


def test_check_takes_a_network_and_known_effects(call):
    code, found, _ = call(
        "check", "motor.toml", "duty.csv", "--model", "four.toml", "--with", "speed_cooling"
    )
    assert code == 0
    assert "error" not in {finding["severity"] for finding in found["findings"]}


@pytest.mark.parametrize(
    ("words", "said", "remedy"),
    [
        (["cooled.toml", "no_speed.csv"], "speed_cooling needs the channel speed_rpm", ""),
        (["motor.toml", "no_speed.csv", "--with", "speed_cooling"], "the channel speed_rpm", ""),
        (["motor.toml", "duty.csv", "--model", "four.toml", "--with", "winding_node"],
         "winding_node cannot be added to a network", ""),
        (["motor.toml", "no_speed.csv", "--model", "turning.toml"],
         "the mechanical loss follows the speed", "[columns] speed_rpm"),
        (["motor.toml", "duty.csv", "--model", "cooled"],
         "the winding and stator between coolant and air loses heat to the coolant too",
         "[columns] coolant_degC"),
        (["liquid.toml", "no_air.csv", "--model", "cooled"], "loses heat to the ambient too",
         "[columns] ambient_degC"),
    ],
)  # fmt: skip
def test_check_says_what_the_model_lacks(call, words, said, remedy):
    code, found, _ = call("check", *words)
    assert code == 1
    (refusal,) = [f for f in found["findings"] if f["severity"] == "error"]
    assert refusal["id"] == "model_refused"
    assert said in refusal["message"]
    assert refusal["remedy"]
    assert remedy in refusal["remedy"]


@pytest.mark.parametrize(
    ("network", "test", "channel"),
    [("turning.toml", "no_speed.csv", "speed_rpm"), ("cooled", "no_coolant.csv", "coolant_degC")],
)
def test_a_network_without_its_channel_is_refused(
    network, test, channel, folder, capsys, monkeypatch
):
    monkeypatch.chdir(folder)
    words = ["motor.toml", "wet.csv", "--holdout", test, "--model", network, "--out", "refused"]
    assert cli.main(["calibrate", *words]) == 1
    assert f"this test has no {channel}" in capsys.readouterr().err
    assert not (folder / "refused").exists()
    names = TRUTH if network == "turning.toml" else two_sinks.TRUTH
    (folder / "values.toml").write_text("".join(f"{n} = {v}\n" for n, v in names.items()))
    assert cli.main(["simulate", "motor.toml", "values.toml", test, "--model", network]) == 1
    assert f"this test has no {channel}" in capsys.readouterr().err


def test_check_names_a_network_file_that_is_not_there(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    assert cli.main(["check", "motor.toml", "duty.csv", "--model", "five.toml"]) == 1
    assert "five.toml" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["calibrate", "compare", "discover"])
def test_an_effect_without_its_channel_is_refused_before_a_fit(
    command, folder, capsys, monkeypatch
):
    monkeypatch.chdir(folder)
    words = [command, "cooled.toml", "duty.csv", "--holdout", "no_speed.csv", "--out", "refused"]
    assert cli.main(words) == 1
    said = capsys.readouterr().err
    assert "no_speed: the effect speed_cooling needs the channel speed_rpm" in said
    assert not (folder / "refused").exists()


def test_simulation_of_an_effect_without_its_channel_is_refused(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    (folder / "values.toml").write_text(
        "Ceq_w = 666.75\nCeq_sr = 15060.1\nReq_w = 0.14485\nReq_sr = 0.11625\n"
    )
    assert cli.main(["simulate", "cooled.toml", "values.toml", "no_speed.csv"]) == 1
    assert "needs the channel speed_rpm" in capsys.readouterr().err


def test_a_network_cooled_by_a_liquid_needs_a_motor_file_that_says_so(folder, tmp_path):
    with pytest.raises(InputError, match="the sink of the network is the coolant"):
        Model.of(str(folder / "coolant.toml"), heatrun.load_motor(folder / "motor.toml"))
    (tmp_path / "motor.toml").write_text(PLAIN.replace("[motor]\n", '[motor]\nsink = "coolant"\n'))
    motor = heatrun.load_motor(tmp_path / "motor.toml")
    assert Model.of(str(folder / "coolant.toml"), motor).form.sink == "coolant"
    assert Model.of("second", motor).name == "second"  # the built-in ones take either sink


def test_an_effect_that_would_add_a_node_again_is_not_searched(folder, blocks, motor):
    network = Model.of(str(folder / "four.toml"), motor).topology()
    found = library(EFFECTS, network, [blocks])
    assert found.unavailable["rotor_node"] == "adds a node that this network already has"
    assert "housing_node" in {kind.card.id for kind in found.kinds}
    twice = Model.of(str(folder / "four.toml"), motor, effects_named(["rotor_node"]))
    with pytest.raises(InputError, match="already has a node 'rotor'"):
        twice.refuse_unusable([blocks])


def test_which_two_networks_are_compared(folder):
    four = str(folder / "four.toml")
    assert [form.name for form in pair_of("both")] == ["first", "second"]
    assert [form.name for form in pair_of(four)] == ["second", "four"]
    assert [form.name for form in pair_of("second")] == ["first", "second"]
    assert [form.name for form in pair_of(f"{four},first")] == ["first", "four"]
    assert network_named("second") in pair_of("first")
    with pytest.raises(UsageError, match="names 3"):
        pair_of(f"first,second,{four}")
    with pytest.raises(UsageError, match="names no network"):
        pair_of(" , ")


@pytest.mark.slow
def test_compare_takes_two_networks(call, folder):
    words = ["compare", "motor.toml", "duty.csv", "--model", "known.toml,first", "--quick"]
    code, found, _ = call(*words)
    assert code == 0
    # the winding runs tens of kelvin ahead of the iron, which one node cannot follow
    assert found["verdict"]["order"] == "four"
    factor = found["verdict"]["log_bayes_factor"]
    assert factor > 100.0
    assert f"of four to first: {factor:+.0f}" in found["verdict"]["sentence"]
    errors = found["comparison"]["words"][0]
    assert errors.index("first order: RMSE") < errors.index("network four: RMSE")
    assert not list(folder.glob("results"))


@pytest.mark.slow
def test_compare_sets_a_network_against_the_second_order(call, folder):
    code, found, _ = call(
        "compare", "motor.toml", "duty.csv", "--holdout", "step.csv", "--model", "four.toml",
        "--quick",
    )  # fmt: skip
    assert code == 0
    assert "four to second" in found["verdict"]["sentence"]
    rows = [line for line in found["comparison"]["words"] if line.startswith("step (holdout)")]
    assert len(rows) == 1
    assert "second order: RMSE" in rows[0]
    assert "network four: RMSE" in rows[0]
    assert not list(folder.glob("results"))


@pytest.mark.slow
def test_discover_starts_from_a_network_of_ones_own(call, folder):
    code, found, _ = call(
        "discover", "motor.toml", "duty.csv", "--holdout", "step.csv", "--model", "known.toml",
        "--quick", "--out", "found",
    )  # fmt: skip
    assert code == 0
    assert found["verdict"] in ("adequate", "not_identifiable")  # nothing is hidden
    assert found["effects"] == []
    run = heatrun.open_run(folder / "found")
    assert run.model().model.form.nodes == ("winding", "tooth", "yoke", "rotor")
    rmse = run.predict("step.csv").rmse_K
    assert rmse == pytest.approx(found["holdout"]["rmse_after_K"], rel=1e-6)
    assert rmse < 1.0  # the sensor's noise and rounding are some tenths


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
    holds(found, TRUTH)
    assert max(log_sd(found, name) for name in TRUTH) < 0.02  # the prior has 1.3 and more


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


@pytest.mark.parametrize(
    "form",
    [*map(network_named, SHIPPED), four(), FORM,
     *(network_named("cooled").with_main_sink(sink) for sink in ("ambient", "coolant")),
     with_losses('{ copper = "winding", other = "stator", iron = ["stator", "rotor"], '
                 "mechanical = { stator = 0.1, rotor = 0.9 } }", '["mechanical", "iron"]')],
    ids=lambda form: form.name,
)  # fmt: skip
def test_the_text_of_a_network_reads_back_to_the_same_value(form):
    again = network_of(network_text(form), "again")
    assert asdict(again) == asdict(form)
    assert (again.parameters, again.sinks) == (form.parameters, form.sinks)
    if form.by_speed:
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
