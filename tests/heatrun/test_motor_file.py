"""The motor file: what it may say, what it may not, and the page that explains it."""

import argparse
import hashlib
import json
import os
import re
from dataclasses import fields, replace
from pathlib import Path

import pytest

from heatrun.cli import main
from heatrun.commands.words import LARGEST_SEED, seed
from heatrun.errors import InputError
from heatrun.io import toml_text
from heatrun.model.model import Model
from heatrun.model.model_parameters import override_names, parameters
from heatrun.motor import keys as motor_page
from heatrun.motor.file import RANGES, UNITS, load_motor, parse_motor
from heatrun.motor.keys import SECTIONS
from heatrun.record.motor import Adequacy, Motor, ParameterOverride
from heatrun.runs.write import motor_text
from lptn import EFFECTS

FULL = """
[motor]
name = "IPM-SynRel 2022"
phases = 6
losses = "map"
sink = "coolant"
insulation_class = "F"
equilibrium = "IEEE 112"
rated_speed_rpm = 6000
[winding]
material = "aluminium"
phase_resistance_ohm = 0.0062
reference_temperature_degC = 20
[vehicle]
gear_ratio = 9.1
wheel_radius_m = 0.3
[columns]
winding_degC = "T_winding [degC]"
time_s = "rate 10 Hz"
[parameters.Req_sr]
fixed = 0.11625
[parameters.Ceq_w]
value = 667.0
relative_sd = 0.2
per_test = true
"""


def load(tmp_path: Path, text: str | bytes) -> Motor:
    path = tmp_path / "motor.toml"
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return load_motor(path)


def test_everything_it_may_say(tmp_path):
    path = str(tmp_path / "motor.toml")
    assert load(tmp_path, FULL) == Motor(
        name="IPM-SynRel 2022",
        phases=6,
        losses="map",
        sink="coolant",
        insulation_class="F",
        equilibrium="IEEE 112",
        rated_speed_rpm=6000.0,
        resistance_coefficient_degC=225.0,
        phase_resistance_ohm=0.0062,
        reference_temperature_degC=20.0,
        gear_ratio=9.1,
        wheel_radius_m=0.3,
        columns={"winding_degC": "T_winding [degC]", "time_s": "rate 10 Hz"},
        parameters={
            "Req_sr": ParameterOverride(fixed=0.11625),
            "Ceq_w": ParameterOverride(value=667.0, relative_sd=0.2, per_test=True),
        },
        sha256=hashlib.sha256(FULL.encode()).hexdigest(),
        path=path,
    )


def test_a_name_is_enough(tmp_path):
    motor = load(tmp_path, '[motor]\nname = "M"\n')
    assert motor == Motor("M", sha256=motor.sha256, path=motor.path)


@pytest.mark.parametrize("mark", [b"\xef\xbb\xbf", b""])
def test_a_byte_order_mark_is_no_matter(tmp_path, mark):
    assert load(tmp_path, mark + '[motor]\nname = "Prüfling"\n'.encode()).name == "Prüfling"


@pytest.mark.parametrize(
    ("winding", "coefficient"),
    [
        ("", 234.5),
        ('material = "copper"', 234.5),
        ('material = "aluminium"', 225.0),
        ("resistance_coefficient_degC = 235", 235.0),
    ],
)
def test_material(tmp_path, winding, coefficient):
    motor = load(tmp_path, f'[motor]\nname = "M"\n[winding]\n{winding}\n')
    assert motor.resistance_coefficient_degC == coefficient


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("[motr]\nname = 'M'", "section 'motr' is not known. Did you mean 'motor'"),
        ("[motor]\nnam = 'M'", "key 'nam' is not known. Did you mean 'name'"),
        ("[motor]\nphases = 3", "name of the motor"),
        ("", "name of the motor"),
        ("[motor]\nname = 3", "text for name, got the number 3"),
        ("[motor]\nname = ' '", "text for name"),
        ("motor = 3", "Expected a section"),
        ("[motor]\nname = 'M'\nphases = 0", "phases from 1 to 99, got the number 0"),
        ("[motor]\nname = 'M'\nphases = 3.0", "whole number"),
        ("[motor]\nname = 'M'\nphases = true", "whole number"),
        ("[motor]\nname = 'M'\nlosses = 'balanced'", "balance, map.*Did you mean 'balance'"),
        ("[motor]\nname = 'M'\nlosses = ['map']", "balance, map"),
        ("[motor]\nname = 'M'\nsink = 'air'", "ambient, coolant"),
        ("[motor]\nname = 'M'\ninsulation_class = 'X'", "A, E, B, F, H, N, R"),
        ("[motor]\nname = 'M'\nequilibrium = 'IEEE'", "Did you mean 'IEEE 112'"),
        ("[motor]\nname = 'M'\nrated_speed_rpm = -1", "above 0, got -1"),
        ("[motor]\nname = 'M'\nrated_speed_rpm = '6000 rpm'", "number for rated_speed_rpm"),
        ("[motor]\nname = 'M'\nrated_speed_rpm = nan", "above 0, got nan"),
        ("[motor]\nname = 'M'\nrated_speed_rpm = inf", "above 0, got inf"),
        ("[motor]\nname = 'M'\n[winding]\nphase_resistance_ohm = -0.006", "above 0"),
        ("[motor]\nname = 'M'\n[winding]\nphase_resistance_Ohm = 1", "'phase_resistance_ohm'"),
        ("[motor]\nname = 'M'\n[winding]\nmaterial = 'gold'", "copper, aluminium"),
        ("[motor]\nname = 'M'\n[winding]\nresistance_coefficient_degC = 3.9e-3", "100 and 400"),
        ("[motor]\nname = 'M'\n[winding]\nreference_temperature_degC = 298.15", "-60 and 250"),
        (
            "[motor]\nname='M'\n[winding]\nmaterial='copper'\nresistance_coefficient_degC=235",
            "Both material",
        ),
        ("[motor]\nname = 'M'\n[vehicle]\ngear_ratio = 0", "above 0"),
        ("[motor]\nname = 'M'\n[columns]\nwinding = 'T'", "'winding', which is not known"),
        ("[motor]\nname = 'M'\n[columns]\nwinding_degC = 3", "text for winding_degC"),
        ("[motor]\nname = 'M'\n[columns]\ntime_s = 'rate 0 Hz'", "above 0 Hz"),
        ("[motor]\nname = 'M'\n[columns]\ntime_s = 'rate 1.2.3 Hz'", "rate such as"),
        ("[motor]\nname = 'M'\n[parameters]\nReq_sr = 0.1", "Expected a section"),
        ("[motor]\nname = 'M'\n[parameters.Req_sr]\n", "Expected a section with one of"),
        ("[motor]\nname = 'M'\n[parameters.Req_sr]\nfix = 1", "Did you mean 'fixed'"),
        ("[motor]\nname = 'M'\n[parameters.R]\nfixed = 1\nsd = 1", "no sd"),
        ("[motor]\nname = 'M'\n[parameters.R]\nfixed = 1\nper_test = true", "no per_test"),
        ("[motor]\nname = 'M'\n[parameters.R]\nsd = 1\nrelative_sd = 1", "Both sd"),
        ("[motor]\nname = 'M'\n[parameters.R]\nsd = 0", "above 0"),
        ("[motor]\nname = 'M'\n[parameters.R]\nfixed = inf", "finite"),
        ("[motor]\nname = 'M'\n[parameters.R]\nper_test = 1", "true or false"),
        ("[motor\nname = 'M'", "no valid TOML"),
        (b"[motor]\nname = '\xff'", "UTF-8"),
        ("[motor]\nname = " + "[" * 12, "no valid TOML"),
    ],
)
def test_what_it_may_not_say(tmp_path, text, problem):
    with pytest.raises(InputError, match=problem) as caught:
        load(tmp_path, text)
    assert str(tmp_path / "motor.toml") in caught.value.where


def test_no_file(tmp_path):
    with pytest.raises(InputError, match="cannot be opened"):
        load_motor(tmp_path / "none.toml")
    with pytest.raises(InputError, match="got a directory"):
        load_motor(tmp_path)


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("a = " + "[" * 20_000, "nested more than 16 deep in line 1"),
        ("[motor]\nname = 'M'\na = " + "{a=" * 20_000, "nested more than 16 deep in line 3"),
        ("x" + ".x" * 50_000 + " = 1", "more than 16 dots"),
        ("[x" + " . x" * 50_000 + "]", "more than 16 dots"),
        ("'x'" + ".'x'" * 50_000 + " = 1", "more than 16 dots"),
        ("[motor]\nname = '" + "M" * 501 + "'", "at most 500 letters"),
        ("[motor]\nname = 'M'\n[columns]\ntime_s = '" + "(" * 501 + "'", "at most 500 letters"),
        ("[motor]\n" + "x" * 10_000 + " = 1", "key 'x{60}' is not known"),
        ("#" * (2**20 + 1), "at most 1 MB"),
    ],
    ids=["array", "table", "key", "header", "quoted", "name", "column", "long", "large"],
)
def test_a_file_that_is_meant_to_exhaust_is_refused_before_it_is_parsed(
    tmp_path, text, problem, monkeypatch
):
    def parse(_text):
        pytest.fail("the parser was called")

    if "nested" in problem or "dots" in problem or "MB" in problem:
        monkeypatch.setattr(toml_text.tomllib, "loads", parse)
    with pytest.raises(InputError, match=problem):
        load(tmp_path, text)


@pytest.mark.parametrize(
    "line",
    [
        "name = 'M'  # [[[[[[[[[[[[[[[[[[[[ a.b.c.d.e.f.g.h.i.j.k.l.m.n.o.p.q.r",
        'name = """M\\"""" # ' + "[" * 20,
        "name = '" + "[" * 20 + "." * 20 + "'",
        'name = "' + "[" * 20 + '\\"' + "." * 20 + '"',
        'name = """' + "[" * 20 + '"" \\"""' + "\n." * 20 + '"""',
        "name = '''" + "[" * 20 + "'' \n" + "." * 20 + "'''",
        'name = """M' + '"' * 5,
    ],
)
def test_brackets_and_dots_in_texts_and_comments_are_no_nesting(tmp_path, line):
    assert load(tmp_path, f"[motor]\n{line}\n").name


def test_a_motor_file_that_is_no_file_is_refused(tmp_path):
    pipe = tmp_path / "motor.toml"
    os.mkfifo(pipe)
    with pytest.raises(InputError, match="got a named pipe"):
        load_motor(pipe)
    with pytest.raises(InputError, match="got a device"):
        load_motor("/dev/zero")


def test_a_run_keeps_all_that_the_motor_file_says():
    """Each field that a motor file can set is another than its default, and comes back."""
    more = """
    [model]
    effects = ["radiation"]
    [sensors]
    yoke_degC = "stator"
    [constants]
    ambient_degC = 21.5
    [scales]
    current_A = 9.5
    [adequacy]
    unmodelled_heat = 0.004
    [shutdown]
    moment_sd_s = 0.2
    utilisation_class = "B"
    [certificate]
    number = "2026-1"
    """
    head = 'rated_current_A = 8.2\nmass_kg = 40.0\nraster_s = 2.0\ndecimal = ","\n[winding]\n'
    head += "conductor_mass_kg = 4.0\n"
    head += "measured_resistance_ohm = 0.02\nlead_resistance_ohm = 0.001\n"
    found = parse_motor((FULL.replace("[winding]\n", head, 1) + more).encode(), "m.toml")
    default = Motor("other")
    of_the_file = {"sha256", "path", "tests"}
    for each in fields(Motor):
        if each.name not in of_the_file:
            said = getattr(found, each.name)
            assert said != getattr(default, each.name), f"{each.name} is not set in this test"
            assert getattr(parse_motor(motor_text(found), "m.toml"), each.name) == said, each.name


def test_the_heat_that_a_network_may_miss_is_read_and_written_back():
    text = b'[motor]\nname = "m"\n[adequacy]\nunmodelled_heat = 0.004\n'
    found = parse_motor(text, "m.toml")
    assert found.adequacy == Adequacy(unmodelled_heat=0.004, heat_time_s=1200.0)
    assert parse_motor(motor_text(found), "m.toml").adequacy == found.adequacy
    with pytest.raises(InputError, match="between 60 and 86400 s"):
        parse_motor(text + b"heat_time_s = 20", "m.toml")


PAGE = Path(__file__).parents[2] / "docs" / "motor_file.md"
HEAD = '[motor]\nname = "M"\n'


def accepted(text: str) -> set[str]:
    """What the reader of motor files says that it knows, where it meets a key that it does not."""
    with pytest.raises(InputError, match="is not known") as error:
        parse_motor(text.encode(), "motor.toml")
    return set(re.sub(r"^(Known|Channels) are: |\.$", "", error.value.remedy).split(", "))


def test_the_page_is_up_to_date():
    assert PAGE.read_text(encoding="utf-8") == motor_page.page(), "run `make docs`"


@pytest.mark.parametrize("section", ["columns", "constants", "sensors"])
def test_every_channel_that_is_accepted_stands_on_the_page(section):
    text = PAGE.read_text(encoding="utf-8")
    named = {f"`{name}`" for name in accepted(f'{HEAD}[{section}]\nnonsense = "1"\n')}
    assert all(name in text for name in named)


@pytest.mark.parametrize("section", [one for one in SECTIONS if one.keys], ids=lambda one: one.name)
def test_every_example_is_accepted(section, tmp_path):
    said = {"Req_sr": {"next_median": 0.1, "next_log_sd": 0.05}}
    for folder in ("fleet", "bench"):
        (tmp_path / folder).mkdir()
    (tmp_path / "fleet" / "population.json").write_text(json.dumps({"parameters": said}))
    where = str(tmp_path / "bench" / "motor.toml")
    name = section.name.replace("NAME", "Req")
    for key in section.keys:
        head = "" if key.name == "name" else HEAD
        lines = f"[{name}]\n" if name != "motor" or not head else ""
        parse_motor(f"{head}{lines}{key.name} = {key.example}\n".encode(), where)


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
