"""Tests without current or without other losses, and heat to two sinks."""

import json
from dataclasses import replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from heated_bodies import BLOCK, COIL, LEADS_SHARE, coil, heater
from recovered import holds, log_sd
from two_sinks import RS0, TRUTH, air, amperes, coolant, course, iron, record

import heatrun
from heatrun import cli
from heatrun.checks import check_record
from heatrun.checks.excitation import single_step
from heatrun.checks.quick_fit import quick_fit
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.network_text import network_named, network_of, network_text
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun.posterior.posterior import normal_draws
from heatrun.posterior.predict import predict
from heatrun.readers.joined import read_test
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from heatrun_reports import build_report
from heatrun_reports.report import flow_words
from lptn import CopperLosses, Drive, Inputs, Network, simulate, steady_state
from lptn.effects import CoolantSink, SpeedCooling, applies, build


def problem(files, network):
    motor = load_motor(files[0])
    test = reduce(read_test(files[1], motor), motor)
    model = Model.of(network, motor).scaled(motor, [test])
    return Problem.of(model, motor, [test])


@pytest.fixture(scope="module")
def direct(tmp_path_factory):
    """Files of a coil under direct current, and the second order's fit to them."""
    files = coil(tmp_path_factory.mktemp("coil"), has_power=False)
    return files, fit(problem(files, "second"), num_starts=4)


def test_a_block_with_a_heater_needs_no_current_and_no_resistance(tmp_path):
    files = heater(tmp_path)
    assert not [f for f in heatrun.check(*files) if f.severity != "note"]
    found = fit(problem(files, "first"), num_starts=4)
    holds(found, BLOCK)
    assert "current_gain" not in found.problem.parameters.names
    assert quick_fit(read_test(files[1], load_motor(files[0])), load_motor(files[0])) is not None
    with pytest.raises(InputError, match="phase_current_A is missing"):
        problem(files, "second")
    files = heater(tmp_path, "phase_current_A = 0")
    assert not [f for f in heatrun.check(*files) if f.severity != "note"]
    assert "Rs0" not in problem(files, "second").parameters.names


@pytest.mark.parametrize("losses", ["map", "balance"])
def test_a_current_is_asked_for_where_it_heats(tmp_path, losses):
    motor_file, table = heater(tmp_path)
    motor = replace(load_motor(motor_file), losses=losses, phase_resistance_ohm=0.3)
    found = [f.id for f in check_record(read_test(table, motor), motor) if f.severity == "error"]
    assert found == (["missing_channel"] if losses == "map" else [])


STEPS, LEVEL = (30.0, 12.0, 45.0), (30.0, 30.0, 30.0)


@pytest.mark.parametrize(
    ("watts", "held", "is_single"),
    [
        (STEPS, {}, False),
        (STEPS, {"phase_current_A": 0.0}, False),
        (STEPS, {"phase_current_A": 0.0, "speed_rpm": 1500.0}, False),
        (LEVEL, {}, True),
        (LEVEL, {"phase_current_A": 0.0, "speed_rpm": 1500.0}, True),
        (LEVEL, {"phase_current_A": 7.0}, True),
    ],
)
def test_load_steps_are_counted_on_what_heats(watts, held, is_single):
    time_s = np.arange(0.0, 3600.0, 5.0)
    channels = {"time_s": time_s, "losses_W": np.repeat(watts, time_s.size // 3)}
    channels |= {name: np.full(time_s.size, value) for name, value in held.items()}
    found = list(single_step(Record("block", channels), Motor("block")))
    assert [f.id for f in found] == ["single_step"] * is_single
    heats = "phase_current_A" if held.get("phase_current_A") else "losses_W"
    assert all(heats in f.where for f in found)


def test_a_coil_under_direct_current_needs_no_losses_and_no_room_sensor(direct):
    files, found = direct
    assert not [f for f in heatrun.check(*files) if f.severity != "note"]
    holds(found, COIL)


def test_leads_are_named_where_the_meter_sees_more_than_the_copper(tmp_path):
    found = heatrun.check(*coil(tmp_path, has_power=True))
    (finding,) = [f for f in found if f.id == "standstill_losses"]
    assert finding.severity == "warning"
    assert "Leads" in finding.remedy
    # the leads stay cold while the winding warms: their share lies below that of 25 degC
    assert 0.2 < 1.0 - 1.0 / finding.values["ratio"] < LEADS_SHARE / (1.0 + LEADS_SHARE)


def test_a_constant_is_told_and_does_not_replace_a_column(tmp_path):
    motor_file, test = heater(tmp_path, "phase_current_A = 0")
    motor_file.write_text(motor_file.read_text() + "ambient_degC = 99\n")
    record = read_test(test, load_motor(motor_file))
    assert np.max(record["ambient_degC"]) < 22.0
    assert np.all(record["phase_current_A"] == 0.0)
    assert any("phase_current_A = 0 throughout" in note for note in record.notes)


@pytest.mark.parametrize("line", ["winding_degC = 20", "torque = 3", 'ambient_degC = "warm"'])
def test_constants_that_are_none_are_refused(tmp_path, line):
    (tmp_path / "motor.toml").write_text(f'[motor]\nname = "x"\n[constants]\n{line}\n')
    with pytest.raises(InputError, match="constants"):
        load_motor(tmp_path / "motor.toml")


def test_steps_too_long_for_a_draw_are_told(direct):
    _, found = direct
    draws = normal_draws(found).draws
    place = found.problem.parameters.index("Req_w")
    draws.vectors[:, place] = found.slots[place].parameter.score(1e-6)
    with pytest.raises(InputError, match="too fast for the steps"):
        predict(draws, found.problem.tests[0])


MOTOR = Motor("bench", phase_resistance_ohm=RS0)
MOTOR_TEXT = '[motor]\nname = "bench"\n{more}[winding]\nphase_resistance_ohm = 0.0062\n'


TIME = np.arange(0.0, 5400.0, 2.0)
START = {"winding": 36.0, "stator": 36.0}
LOSSES = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")


def inputs(**other):
    """The drive of the record at the middle of its intervals."""
    middle = 0.5 * (TIME[1:] + TIME[:-1])
    found = Inputs(
        step=2.0,
        current_squared=jnp.asarray(amperes(middle) ** 2),
        losses=jnp.asarray(iron(middle)),
        ambient=jnp.asarray(air(middle)),
        second_sink=jnp.asarray(coolant(middle)),
    )
    return replace(found, **other)


def machine(main="ambient", second="coolant"):
    form = network_named("cooled").with_main_sink(main)
    assert form.sinks == (main, second)
    return form.build(TRUTH)


@pytest.mark.parametrize("form", ["affine", "general"])
def test_simulation_meets_an_independent_integrator(form):
    drive = inputs() if form == "affine" else inputs(step=np.full(TIME.size - 1, 2.0))

    @jax.jit
    def simulated():
        trace = simulate(machine(), LOSSES, drive, START)
        heat = trace.heat["winding"] + trace.heat["stator"]
        out = trace.flow["stator", "ambient"] + trace.flow["stator", "coolant"]
        return trace.temperature, heat - out

    temperature, kept = simulated()
    for node, true in zip(("winding", "stator"), course(TIME), strict=True):
        np.testing.assert_allclose(temperature[node], true, atol=1e-3)
    stored = sum(
        TRUTH[name] * float(temperature[node][-1] - temperature[node][0])
        for name, node in (("Ceq_w", "winding"), ("Ceq_sr", "stator"))
    )
    assert 2.0 * np.sum(np.asarray(kept)) == pytest.approx(float(stored), rel=1e-6)


def test_which_sink_rises_count_from_changes_no_temperature():
    losses = replace(LOSSES, ambient_offset=0.4, second_sink_offset=-0.3)
    swapped = replace(LOSSES, ambient_offset=-0.3, second_sink_offset=0.4)
    turned = inputs(ambient=inputs().second_sink, second_sink=inputs().ambient)

    @jax.jit
    def simulated():
        runs = (
            (machine(), losses, inputs()),
            (machine("coolant", "ambient"), swapped, turned),
            (machine(), LOSSES, inputs()),
        )
        return [simulate(*each, START).temperature for each in runs]

    one, other, plain = simulated()
    for node in START:
        np.testing.assert_allclose(one[node], other[node], atol=1e-9)
    # 1/0.05 and 1/0.11 W/K towards the two
    shift = (0.4 / TRUTH["Req_ambient"] - 0.3 / TRUTH["Req_coolant"]) / (
        1.0 / TRUTH["Req_ambient"] + 1.0 / TRUTH["Req_coolant"]
    )
    assert float(one["stator"][-1] - plain["stator"][-1]) == pytest.approx(shift, abs=0.01)


def test_rest_lies_between_the_sinks():
    drive = Drive.constant(current_squared=0.0, losses=110.0, ambient=20.0, second_sink=60.0)
    rest = jax.jit(lambda: steady_state(machine(), LOSSES, drive))()
    into_air, into_liquid = 1.0 / TRUTH["Req_ambient"], 1.0 / TRUTH["Req_coolant"]
    by_hand = (20.0 * into_air + 60.0 * into_liquid + 110.0) / (into_air + into_liquid)
    assert float(rest["stator"]) == pytest.approx(by_hand, abs=1e-8)
    with pytest.raises(ValueError, match="also loses heat to 'coolant'"):
        steady_state(machine(), LOSSES, replace(drive, second_sink=None))


def test_effects_find_their_place():
    network = machine()
    assert not applies(CoolantSink, network)  # one path that both share
    cooling = build(SpeedCooling, {"g": 1.0, "m": 0.8}, network)
    assert cooling.link == ("stator", "ambient")
    with pytest.raises(ValueError, match="the boundary last"):
        Network(
            capacitance={"winding": jnp.asarray(1.0)},
            resistance={("coolant", "winding"): jnp.asarray(1.0)},
            share={"winding": jnp.asarray(1.0)},
            second_boundary="coolant",
        )


def test_the_two_resistances_are_recovered():
    test = reduce(record(), MOTOR)
    model = Model.of("cooled", MOTOR).scaled(MOTOR, [test])
    found = fit(Problem.of(model, MOTOR, [model.with_bodies(test)]), num_starts=4)
    holds(found, TRUTH)
    assert max(log_sd(found, name) for name in TRUTH) < 0.02  # the prior has 1.3 and more


@pytest.mark.parametrize(
    ("sinks", "link", "said"),
    [
        (["coolant", "air"], "coolant", "2 sinks, coolant, air; expected one, or ambient and"),
        (["coolant", "ambient"], "coolant", "no link leads to the sink ambient"),
        (["coolant", "ambient"], ["coolant", "ambient"], "one of them a node"),
    ],
)
def test_a_network_of_other_sinks_is_refused(sinks, link, said):
    content = network_text(network_named("cooled"))
    del content["parameters"]
    last = link if isinstance(link, list) else ["stator", link]
    content["network"] |= {"sinks": sinks, "links": [["winding", "stator"], last]}
    with pytest.raises(InputError, match=said):
        network_of(content, "mine.toml")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A bench folder: the test, one without a coolant, and motor files."""
    folder = tmp_path_factory.mktemp("sinks")
    table = pd.DataFrame(record().channels)
    table.to_csv(folder / "duty.csv", index=False)
    table.drop(columns="coolant_degC").to_csv(folder / "no_coolant.csv", index=False)
    table.drop(columns="ambient_degC").to_csv(folder / "no_air.csv", index=False)
    (folder / "motor.toml").write_text(MOTOR_TEXT.format(more=""))
    (folder / "constant.toml").write_text(
        MOTOR_TEXT.format(more='sink = "coolant"\n') + "[constants]\nambient_degC = 22.0\n"
    )
    return folder


def test_a_constant_of_the_motor_file_takes_the_place_of_a_channel(folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    assert cli.main(["check", "constant.toml", "no_air.csv", "--model", "cooled", "--json"]) == 0
    assert "model_refused" not in capsys.readouterr().out


@pytest.mark.parametrize(("main", "second"), [("ambient", "coolant"), ("coolant", "ambient")])
def test_a_heat_flow_is_called_after_the_sink_it_goes_to(main, second):
    words = flow_words(network_named("cooled").with_main_sink(main))
    assert words == {
        ("winding", "stator"): ("P_ws", "winding to stator"),
        ("stator", main): ("P_se", f"stator to the {main}"),
        ("stator", second): (f"stator to {second}", "heat flow"),
    }
    assert flow_words(network_named("second"))["stator", "ambient"] == (
        "P_se", "stator to the sink"
    )  # fmt: skip
    assert flow_words(network_named("first")) == {
        ("winding", "ambient"): ("P_se", "machine to the sink")
    }


@pytest.fixture(scope="module")
def run(folder):
    motor, test = folder / "motor.toml", folder / "duty.csv"
    return heatrun.calibrate(motor, test, model="cooled", method="quick", out=folder / "run")


@pytest.mark.slow
def test_a_run_tells_the_two_resistances(run):
    model = run.result.models["cooled"]
    assert model.sinks == ("ambient", "coolant")
    for name, true in TRUTH.items():
        low, high = model.parameters[name].interval_95
        assert low < true < high, name
    assert model.nuisances["second_sink_offset"].unit == "K"
    assert model.residuals[0].rmse_K < 0.15


@pytest.mark.slow
def test_ratings_say_how_warm_the_other_sink_was(run):
    figures = run.result.models["cooled"].derived
    mean = float(np.mean(record()["coolant_degC"]))
    assert f"coolant {mean:.0f} °C" in figures["steady_rise_K"].condition


@pytest.mark.slow
def test_the_run_reads_back_predicts_and_is_exported(run, folder, capsys, monkeypatch):
    monkeypatch.chdir(folder)
    again = heatrun.open_run(run.path)
    assert again.model("cooled").model.form.sinks == ("ambient", "coolant")
    assert again.predict(folder / "duty.csv").rmse_K == pytest.approx(
        run.result.models["cooled"].residuals[0].rmse_K, rel=1e-6
    )
    table = again.courses()[0]
    assert table["second_sink_degC"].iloc[-1] == pytest.approx(60.0)
    with pytest.raises(InputError, match="this test has no coolant_degC"):
        again.predict(folder / "no_coolant.csv")
    assert cli.main(["export", "run", "--to", "mat", "--corrected", "--out", "mat", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["variables"]["second_sink"]["value"] == "coolant"
    # 0.10 K of noise and rounding; the file's load takes 2 s for a step, 0.43 K uncorrected
    assert said["rmse_reading_K"] < 0.2
    assert cli.main(["simulate", "motor.toml", "run", "duty.csv", "--out", "virtual"]) == 0
    virtual = pd.read_csv(folder / "virtual" / "duty_virtual.csv")
    assert {"coolant_degC", "flow_stator_coolant_W", "flow_stator_ambient_W"} <= set(virtual)


@pytest.mark.slow
def test_a_thermal_report_names_both_sinks(run, folder):
    motor = load_motor(folder / "motor.toml")
    report = build_report(
        "thermal", motor, read_test(folder / "duty.csv", motor), run=Path(run.path)
    )
    labels = {row.name: row.label for row in report.rows}
    assert labels["P_se_end_W"] == "P_se, stator to the ambient, at the end"
    assert labels["stator to coolant_end_W"] == "stator to coolant, heat flow, at the end"
    said = dict(report.definitions)
    assert "from stator to the ambient" in said["P_ws, P_se"]


@pytest.mark.slow
def test_the_sheet_names_both_sinks(run):
    from heatrun.reports.content import sheet_content

    definitions = dict(sheet_content(run.result)["definitions"])
    assert "measured: ambient" in definitions["T0"]
    assert "named after coolant lead to it" in definitions["T coolant"]
