"""Values of the motor file that no machine has, and seeds that no generator takes."""

from __future__ import annotations

import argparse
from dataclasses import replace

import pytest

from heatrun.cli import main
from heatrun.commands.words import LARGEST_SEED, seed
from heatrun.errors import InputError
from heatrun.model.model import Model
from heatrun.model.model_parameters import override_names, parameters
from heatrun.motor.file import RANGES, UNITS, load_motor
from heatrun.record.motor import ParameterOverride
from lptn import EFFECTS


def motor_file(tmp_path, text):
    path = tmp_path / "motor.toml"
    path.write_text(f"[motor]\nname = 'M'\n{text}\n", encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[parameters.Ceq_w]\nfixed = 1e300", r"fixed = 1e\+300 J/K is beyond.*0.001 to 1e\+10"),
        ("[parameters.Req_sr]\nfixed = 1e-300", "fixed = 1e-300 K/W is beyond"),
        ("[parameters.Req_sr]\nvalue = 1e200", r"value = 1e\+200 K/W is beyond"),
        ("[parameters.Tw_start]\nfixed = -300", "fixed = -300 degC is beyond"),
        ("[parameters.power_gain]\nfixed = -1", "fixed = -1 is beyond"),
        ("[parameters.sensor_offset]\nsd = 1e300", r"sd = 1e\+300 K is no standard deviation"),
        ("[parameters.sensor_offset]\nsd = 1e-300", "sd = 1e-300 K is no standard deviation"),
        ("[parameters.Ceq_w]\nrelative_sd = 1e300", r"relative_sd = 1e\+300 is no standard"),
        ("[parameters.Ceq_w]\nrelative_sd = 1e-300", "relative_sd = 1e-300 is no standard"),
    ],
)
def test_values_beyond_any_machine_are_refused_when_the_motor_file_is_read(tmp_path, text, message):
    with pytest.raises(InputError, match=message) as caught:
        load_motor(motor_file(tmp_path, text))
    assert caught.value.remedy.startswith("Correct it")
    assert "[parameters." in caught.value.where


@pytest.mark.parametrize("bad", [1e300, -1e300, 1e12])
def test_so_are_those_of_an_effect(bad, motor, blocks):
    kind = next(kind for kind in EFFECTS if kind.card.id == "speed_cooling")
    name = f"speed_cooling.{next(iter(kind.card.parameters))}"
    said = ParameterOverride(fixed=bad)
    evil = replace(motor, parameters={name: said})
    model = replace(Model.of("second", evil), effects=(kind,))
    with pytest.raises(InputError, match=f"is beyond what {name} is in any machine"):
        parameters(model, evil, [blocks], searched=(kind,))


def test_the_defaults_and_their_units_are_within_the_ranges(motor, blocks):
    assert set(UNITS) == {name for name in override_names() if "." not in name}
    for order in ("first", "second"):
        (known,) = parameters(Model.of(order, motor), motor, [blocks]).by_test
        for name, parameter in known.items():
            low, high = RANGES[UNITS[name]]
            assert parameter.unit == UNITS[name]
            assert low < parameter.prior_interval_95()[0]
            assert parameter.prior_interval_95()[1] < high


@pytest.mark.parametrize("text", ["-5", "99999999999999999999", "1.5", "", "²", "1" * 5000, "1_0"])
def test_a_seed_out_of_range_is_wrong_use(text, capsys):
    for command in ("calibrate", "compare", "discover", "demo"):
        inputs = [] if command == "demo" else ["motor.toml", "duty.csv"]
        with pytest.raises(SystemExit) as ended:
            main([command, *inputs, "--seed", text])
        assert ended.value.code == 2
        assert "expected a whole number from 0 to 4294967295" in capsys.readouterr().err
    with pytest.raises(SystemExit) as ended:
        main(["simulate", "motor.toml", "run", "duty.csv", "--seed", text])
    assert ended.value.code == 2


def test_seeds_in_range_are_taken():
    assert [seed("0"), seed("007"), seed(str(LARGEST_SEED))] == [0, 7, LARGEST_SEED]
    with pytest.raises(argparse.ArgumentTypeError):
        seed(str(LARGEST_SEED + 1))


def test_the_range_of_the_seed_stands_in_the_help(capsys):
    with pytest.raises(SystemExit):
        main(["simulate", "--help"])
    assert "from 0 to 4294967295" in " ".join(capsys.readouterr().out.split())
