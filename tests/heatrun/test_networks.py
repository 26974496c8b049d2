"""Networks as data: their text, its errors, and the built-in ones as any other."""

from __future__ import annotations

from dataclasses import asdict
from importlib.resources import files

import jax.numpy as jnp
import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.model.model import Model
from heatrun.model.model_parameters import parameters
from heatrun.model.network_text import (
    BUILT_IN,
    network_named,
    network_of,
    network_text,
    networks_of,
    read_network,
)
from heatrun.model.problem import Problem, predictions
from heatrun.record.motor import Adequacy, Motor, ParameterOverride
from heatrun.runs.run import ModelOfRun, model_text, read_model

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


@pytest.mark.parametrize("form", [*map(network_named, BUILT_IN), four()], ids=lambda f: f.name)
def test_the_text_of_a_network_reads_back_to_the_same_value(form):
    assert asdict(network_of(network_text(form), "again")) == asdict(form)


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
