"""The winding at switch-off: from readings alone, and with a run as the prior of the cooling."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pandas as pd
import pytest
from dcc_structure import DCC, SI, against_practice, violations
from pypdf import PdfReader
from scipy.linalg import expm

import heatrun
from heatrun import cli
from heatrun.errors import InputError
from heatrun.io.texts import LANGUAGES, Texts
from heatrun.motor.file import load_motor, parse_motor
from heatrun.record.motor import Certificate
from heatrun.reports.figures import again
from heatrun.shutdown.cooling import Cooling, UsualModes, _lagged
from heatrun.shutdown.of_run import _modal, modes_of_run
from heatrun.shutdown.printed import drawn
from heatrun.shutdown.readings import Readings, read_readings
from heatrun.shutdown.result import _reason, _reduced, allowed_delay_s, by_hand, winding_at_shutdown
from heatrun.shutdown.sheet import content

COLD, COLD_degC, B, AIR = 0.482, 21.0, 234.5, 23.0
MOTOR = f"""[motor]
name = "M 112"
insulation_class = "F"
[winding]
measured_resistance_ohm = {COLD}
reference_temperature_degC = {COLD_degC}
[constants]
ambient_degC = {AIR}
[shutdown]
cold_resistance_sd = 0.0005
cold_temperature_sd_K = 0.05
coefficient_sd_degC = 0.1
moment_sd_s = 0.1
run_down_s = 0
"""
TIME_S = np.arange(20.0, 320.0, 15.0)
TRUE_degC = AIR + 9.0 + 5.0 + 48.0
SCATTER = np.random.default_rng(7).normal(0.0, 0.03, TIME_S.size)


def winding(time_s):
    """Two modes of the winding, one of the housing."""
    modes = ((5.0, 45.0), (9.0, 160.0), (48.0, 3600.0))
    return AIR + sum(drop * np.exp(-time_s / tau) for drop, tau in modes)


def ohm(degC):
    return COLD * (B + degC) / (B + COLD_degC)


def write(folder, time_s, values, head="time_s,R [Ohm]"):
    rows = [f"{t:.1f},{value:.6f}" for t, value in zip(time_s, values, strict=True)]
    path = folder / "readings.csv"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def motor(text=MOTOR):
    return parse_motor(text.encode(), "motor.toml")


def found(folder, values=None, *, time_s=TIME_S, text=MOTOR, seed=0):
    machine = motor(text)
    values = ohm(winding(time_s) + SCATTER) if values is None else values
    readings = read_readings(write(folder, time_s, values), machine, "")
    return winding_at_shutdown(machine, readings, seed=seed)


@pytest.fixture
def command(tmp_path):
    """Return the words for a motor file and readings, both written."""

    def of(text=MOTOR, values=None, head="time_s,R [Ohm]"):
        (tmp_path / "motor.toml").write_text(text, encoding="utf-8")
        path = write(tmp_path, TIME_S, ohm(winding(TIME_S)) if values is None else values, head)
        return ["shutdown", *map(str, (tmp_path / "motor.toml", path, "--out", tmp_path / "out"))]

    return of


def test_the_interval_holds_what_the_readings_came_too_late_for(tmp_path):
    result = found(tmp_path)
    low, high = result.winding_95_degC
    assert low < TRUE_degC < high
    assert high - low < 3.0
    assert abs(result.winding_degC - TRUE_degC) < 0.7
    # by hand the winding is colder than it was, also by the line through the first readings
    by_line = next(row.degC for row in result.by_hand if "line" in row.method)
    assert by_line < TRUE_degC - 1.0


def test_another_seed_says_the_same(tmp_path):
    first, second = found(tmp_path), found(tmp_path, seed=1)
    # some 2000 draws: a tenth of the standard uncertainty
    assert abs(first.winding_degC - second.winding_degC) < 0.15 * first.standard_uncertainty_K


def test_the_budget_adds_up_and_agrees_with_the_draws(tmp_path):
    result = found(tmp_path)
    assert sum(row.share for row in result.budget) == pytest.approx(1.0)
    total = np.sqrt(sum(row.contribution**2 for row in result.budget))
    assert total == pytest.approx(result.gum_uncertainty_K)
    # of first order; a late reading makes them part
    assert result.gum_uncertainty_K == pytest.approx(result.standard_uncertainty_K, rel=0.25)
    cold = next(row for row in result.budget if row.source == "cold resistance")
    # dT/dR1 by hand: the temperature above -B, for a relative error
    assert cold.sensitivity == pytest.approx(-(B + result.winding_degC), rel=0.01)
    assert cold.contribution == pytest.approx(0.0005 * (B + result.winding_degC), rel=0.01)


def test_the_slopes_of_the_budget_are_those_of_the_whole_answer(tmp_path):
    """What is sampled moves the answer as its row says."""
    text = MOTOR.replace("sd_s = 0.1", "sd_s = 0.5")
    rows = {row.source: row.sensitivity for row in found(tmp_path, text=text).budget}
    values = ohm(winding(TIME_S) + SCATTER)
    late, early = (
        found(tmp_path, values, time_s=TIME_S + off, text=text).winding_degC for off in (3.0, -3.0)
    )
    # the noise of 2000 draws is a tenth of the change
    assert rows["moment of switch-off"] == pytest.approx((late - early) / 6.0, rel=0.25)


def test_what_the_cold_measurement_is_uncertain_by_is_in_the_interval(tmp_path):
    sharp = found(tmp_path)
    blunt = found(tmp_path, text=MOTOR.replace("temperature_sd_K = 0.05", "temperature_sd_K = 2"))
    ratio = (B + TRUE_degC) / (B + COLD_degC)
    added = np.sqrt(blunt.standard_uncertainty_K**2 - sharp.standard_uncertainty_K**2)
    assert added == pytest.approx(2.0 * ratio, rel=0.1)


@pytest.mark.parametrize("place", [0, 6])
def test_a_reading_off_the_course_is_named_and_left_out(tmp_path, place):
    values = ohm(winding(TIME_S) + SCATTER)
    wrong = values * np.where(np.arange(TIME_S.size) == place, 0.97, 1.0)
    result = found(tmp_path, wrong)
    assert len(result.left_out) == 1
    assert f"after {TIME_S[place]:.0f} s" in result.left_out[0]
    assert "below the course of the others" in result.left_out[0]
    low, high = result.winding_95_degC
    assert low < TRUE_degC < high


def test_a_winding_without_fast_modes_is_held_too(tmp_path):
    """Two nodes and no run-down: what machines in general have besides can only add."""
    degC = AIR + 30.0 * np.exp(-TIME_S / 120.0) + 60.0 * np.exp(-TIME_S / 4000.0)
    for more in ("run_down_s = 0", ""):
        text = MOTOR.replace("run_down_s = 0", more)
        low, high = found(tmp_path, ohm(degC + SCATTER), text=text).winding_95_degC
        assert low < AIR + 90.0 < high


@pytest.mark.slow
def test_machines_that_are_drawn_from_the_prior_are_held():
    """Where they are not, draws or model are wrong, whatever machines there are."""
    machine, num, held = motor(), 60, 0
    modes = UsualModes(rise_K=80.0)
    for seed in range(num):
        random = np.random.default_rng(seed)
        time_s = np.arange(30.0, random.uniform(270.0, 630.0), random.choice([5.0, 15.0, 30.0]))
        none = np.full(time_s.size, AIR + 80.0)
        cooling = Cooling(time_s, none, AIR, machine, COLD, modes, np.ones(time_s.size))
        possible = False
        while not possible:
            z = random.standard_normal((1, len(cooling.names)))
            mean, by = modes.amplitudes(z)
            possible = np.all(mean + (by @ z[:, cooling.num_nonlinear : -1, None])[:, :, 0] > 0.0)
        values = {key: one.item() for key, one in cooling.values(z).items()}
        a_second = cooling.predicted(z, time_s + 0.5) - cooling.predicted(z, time_s - 0.5)
        scatter = np.hypot(values["noise"], values["clock"] * a_second[0])
        read = cooling.predicted(z)[0] + scatter * random.standard_normal(time_s.size)
        errors = {key: one.sd * random.standard_normal()
                  for key, one in cooling.instruments.items()}  # fmt: skip
        true = cooling.true(cooling.winding(z, np.zeros(1))[0], errors).item()
        readings = Readings("drawn", time_s, read, AIR, read, COLD, (), "")
        low, high = winding_at_shutdown(machine, readings, modes, seed=seed).winding_95_degC
        held += low < true < high
    assert held >= 52  # of 60 at 95 %: fewer once in 350 times


def test_leads_are_taken_off(tmp_path):
    text = MOTOR.replace(f"= {COLD}", f"= {COLD + 0.02}").replace(
        "reference_", "lead_resistance_ohm = 0.02\nreference_"
    )
    result = found(tmp_path, ohm(winding(TIME_S) + SCATTER) + 0.02, text=text)
    assert result.winding_degC == pytest.approx(found(tmp_path).winding_degC, abs=0.3)


def test_late_readings_are_not_determinable_and_say_when_they_should_have_come(tmp_path):
    late = np.arange(300.0, 600.0, 20.0)
    scatter = np.random.default_rng(3).normal(0.0, 0.1, late.size)
    result = found(tmp_path, ohm(winding(late) + scatter), time_s=late)
    assert not result.is_determinable
    assert "300 s after switch-off" in result.reason
    low, high = result.winding_95_degC
    assert low < TRUE_degC < high
    assert result.latest_first_reading_s is not None
    assert 20.0 < result.latest_first_reading_s < 300.0
    # to first order, from readings that know little: about what would have been enough
    sooner = late - late[0] + 0.5 * result.latest_first_reading_s
    assert found(tmp_path, ohm(winding(sooner) + scatter), time_s=sooner).is_determinable


def test_a_sensor_with_a_lag(tmp_path):
    machine = motor(
        '[motor]\nname = "S"\n[constants]\nambient_degC = 23.0\n[shutdown]\nsensor_lag_s = 9\n'
        "sensor_sd_K = 0.1\nrun_down_s = 0\n"
    )
    fine = np.arange(0.0, 400.0, 0.05)
    shown = np.empty(fine.size)
    shown[0] = TRUE_degC
    for k in range(1, fine.size):
        shown[k] = shown[k - 1] + 0.05 / 9.0 * (winding(fine[k - 1]) - shown[k - 1])
    read = np.interp(TIME_S, fine, shown) + np.random.default_rng(1).normal(0.0, 0.03, TIME_S.size)
    path = write(tmp_path, TIME_S, read, "time_s,winding_degC")
    result = winding_at_shutdown(machine, read_readings(path, machine))
    low, high = result.winding_95_degC
    assert result.quantity == "sensor"
    assert low < TRUE_degC < high
    assert high - low < 4.0


def test_the_lag_of_a_decay_is_its_differential_equation():
    time_s = np.linspace(0.0, 200.0, 20001)[None]
    for tau, lag in ((60.0, 8.0), (8.0, 60.0), (10.0, 10.0)):
        shown = _lagged(time_s, np.array([[tau]]), np.array([[lag]]))[0]
        slope = np.gradient(shown, time_s[0])
        assert shown[0] == 1.0
        # 1e-3 where the time constants agree, for the limit is taken beside it
        expected = (np.exp(-time_s[0] / tau) - shown) / lag
        np.testing.assert_allclose(slope[1:-1], expected[1:-1], atol=3e-4)


def test_true_temperatures_undo_errors_of_the_instruments():
    machine = motor()
    usual, ones = UsualModes(rise_K=60.0), np.ones(TIME_S.size)
    cooling = Cooling(TIME_S, winding(TIME_S), AIR, machine, COLD, usual, ones)
    errors = {"cold": 0.003, "cold_degC": -1.5, "B": 2.0}
    degC = np.array([80.0, 120.0])
    by_truth = COLD * 1.003 * (B + 2.0 + degC) / (B + 2.0 + COLD_degC - 1.5)
    read = by_truth / COLD * (B + COLD_degC) - B
    np.testing.assert_allclose(cooling.true(read, errors), degC, rtol=1e-12)


@pytest.mark.parametrize(
    ("time_s", "degC", "text", "problem"),
    [
        ([30.0], [90.0], MOTOR, "at least 3 readings after switch-off, got 1"),
        ([30.0, 60.0, 45.0], [90.0, 88.0, 89.0], MOTOR, "Reading 3 is 45 s .* do not ascend"),
        ([30.0, 60.0, 90.0], [12.0, 11.0, 10.0], MOTOR, "Below its coolant no winding cools"),
        ([30.0, 60.0, 90.0], [80.0, 85.0, 89.0], MOTOR, "The winding does not cool: 80.0 °C"),
        ([9e3, 9.1e3, 9.2e3], [90.0, 88.0, 87.0], MOTOR, "comes 9000 s after switch-off.*--at"),
        ([30.0, 60.0, 90.0], [90.0, 88.0, 87.0], MOTOR.replace("measured", "phase"),
         "it may be .*measured_resistance_ohm"),
        ([30.0, 60.0, 90.0], [90.0, 88.0, 87.0], MOTOR.replace("[constants]\nambient_degC = 23.0",
                                                               ""), "ambient at switch-off is not"),
    ],
)  # fmt: skip
def test_readings_that_are_none(tmp_path, time_s, degC, text, problem):
    values = ohm(np.array(degC)) * (0.9 if "phase" in text else 1.0)
    with pytest.raises(InputError, match=problem):
        found(tmp_path, values, time_s=np.array(time_s), text=text)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        (lambda R: R * 0.0 + R[0], "All 20 readings are the same, 0.5"),
        (lambda R: R * 0.8 - 0.02 * TIME_S / 300.0, "Below its coolant no winding cools"),
        (lambda R: R - 0.098, "after .* s gives 1.* below the ambient of 23.0"),
        (lambda R: R * np.where(TIME_S == 65.0, 10.0, 1.0), "after 65 s, 5.* The others fit"),
        (lambda R: R * np.where(TIME_S == 65.0, 0.0, 1.0), "after 65 s, 0 ohm, gives -234"),
    ],
)
def test_the_reading_at_fault_is_named(tmp_path, change, problem):
    with pytest.raises(InputError, match=problem):
        found(tmp_path, change(ohm(winding(TIME_S))))


@pytest.mark.parametrize(
    ("factor", "guess"),
    [
        (1e3, "times 0.001 they would fit"),
        (1e-3, "times 1000 they would fit"),
        (1.0 / 3.0, "0.333 times it would fit .connected in star, measured in delta"),
        (2.0, "2 times it would fit .of a phase"),
    ],
)
def test_a_wrong_unit_or_circuit_is_named(tmp_path, factor, guess):
    with pytest.raises(InputError, match=guess):
        found(tmp_path, factor * ohm(winding(TIME_S)))


def test_a_unit_that_the_motor_file_decides_against_the_file_is_said(command, tmp_path, capsys):
    text = MOTOR.replace("[constants]", '[columns]\nwinding_degC = "R [Ohm]"\n[constants]')
    words = command(text, head="time_s,R [mOhm]")
    assert cli.main([*words, "--language", "de"]) == 0
    said = "The name gives mOhm, [columns] says ohm; ohm is used."
    assert said in capsys.readouterr().out
    written = json.loads((tmp_path / "out" / "shutdown.json").read_text(encoding="utf-8"))
    assert [one["id"] for one in written["findings"]] == ["unit_overridden"]
    page = PdfReader(tmp_path / "out" / "shutdown.pdf").pages[0].extract_text()
    assert "Der Name nennt mOhm, [columns] sagt ohm; ohm gilt." in " ".join(page.split())


def test_the_circuit_follows_where_one_alone_fits(tmp_path):
    text = MOTOR.replace(f"measured_resistance_ohm = {COLD}", f"phase_resistance_ohm = {COLD / 2}")
    assert found(tmp_path, text=text).winding_degC == pytest.approx(
        found(tmp_path).winding_degC, abs=0.01
    )


def test_terminals_and_a_clock(tmp_path):
    """Three pairs of terminals are averaged; the moment is given as the clock has it."""
    path = tmp_path / "readings.csv"
    lines = ["time,R_UV [mOhm],R_VW [mOhm],R_WU [mOhm]"]
    for t, R in zip(TIME_S, 1e3 * ohm(winding(TIME_S)), strict=True):
        clock = f"14:{int(t // 60) + 3:02d}:{int(t % 60):02d}"
        lines.append(f"{clock},{0.99 * R:.4f},{R:.4f},{1.01 * R:.4f}")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    readings = read_readings(path, motor(), "14:03:00")
    np.testing.assert_allclose(readings.time_s, TIME_S)
    np.testing.assert_allclose(readings.degC, winding(TIME_S), atol=1e-2)


def test_pairs_of_terminals_that_are_read_in_turn(tmp_path):
    """One cell a row; the pairs differ by 2 %, 5 K, and their mean is what was measured cold."""
    parts, rows = (1.0, 1.01, 0.99), ["time_s,R_UV [mOhm],R_VW [mOhm],R_WU [mOhm]"]
    for k, t in enumerate(TIME_S):
        cells = ["", "", ""]
        cells[k % 3] = f"{1e3 * parts[k % 3] * ohm(winding(t)):.4f}"
        rows.append(f"{t:.0f},{','.join(cells)}")
    path = tmp_path / "readings.csv"
    path.write_text("\n".join(rows) + "\n", encoding="utf-8")
    readings = read_readings(path, motor())
    np.testing.assert_allclose(readings.degC, winding(TIME_S), atol=0.05)
    assert not readings.left_out


def write_clock(folder, begin, time_s, form="%Y-%m-%d %H:%M:%S"):
    clock = (pd.Timestamp(begin) + pd.to_timedelta(time_s, unit="s")).strftime(form)
    rows = (f"{t},{R:.7f}" for t, R in zip(clock, ohm(winding(time_s)), strict=True))
    path = folder / "readings.csv"
    path.write_text("\n".join(["Time,R [Ohm]", *rows]) + "\n", encoding="utf-8")
    return path


def test_a_clock_with_dates_and_one_that_passes_midnight(tmp_path):
    dated = write_clock(tmp_path, "2026-03-09 14:32:05", TIME_S)
    np.testing.assert_allclose(read_readings(dated, motor(), "14:32:05").time_s, TIME_S)
    np.testing.assert_allclose(read_readings(dated, motor(), "0s").time_s[0], 0.0)
    with pytest.raises(InputError, match=r"has dates, and does not say when .*--at 14:32:05"):
        read_readings(dated, motor())
    with pytest.raises(InputError, match=r"Expected a time such as .*got '25:99:00'"):
        read_readings(dated, motor(), "25:99:00")
    for form in ("%H:%M:%S", "%d.%m.%Y %H:%M:%S"):
        over = write_clock(tmp_path, "2026-03-09 23:58:10", TIME_S, form)
        np.testing.assert_allclose(read_readings(over, motor(), "23:58:10").time_s, TIME_S)


def test_a_logger_keeps_its_first_readings(tmp_path):
    """Means over minutes would lie on the chord of the curve, and begin too late."""
    time_s = np.arange(30.0, 3630.0, 1.0)
    read = Readings("log", time_s, winding(time_s), AIR, None, None, (), "")
    middle_s, degC, scatter = _reduced(read)
    assert middle_s.size == 60
    np.testing.assert_array_equal(middle_s[:3], [30.0, 31.0, 32.0])
    np.testing.assert_allclose(degC, winding(middle_s), atol=0.05)
    assert np.all(np.diff(middle_s) > 0.0)
    assert scatter[0] == 1.0
    assert scatter[-1] == pytest.approx(1.0 / 3.0)


def test_methods_by_hand_on_a_course_that_they_are_right_for():
    time_s = np.arange(30.0, 300.0, 30.0)
    rows = {row.method: row.degC for row in by_hand(time_s, 20 + 60 * np.exp(-time_s / 900), 20.0)}
    assert rows["logarithm of the rise, line to 0 s"] == pytest.approx(80.0)
    assert rows["one exponential with its own end, to 0 s"] == pytest.approx(80.0, abs=1e-3)
    # where the line bends, it is drawn through the first readings and never below them
    rows = {row.method: row for row in by_hand(TIME_S, winding(TIME_S), AIR)}
    assert rows["logarithm of the rise, line to 0 s"].degC > winding(TIME_S[0])
    rows = {row.method: row.degC for row in by_hand(time_s, 90 - 0.1 * time_s + 1e-4 * time_s**2,
                                                    20.0)}  # fmt: skip
    assert rows["parabola to 0 s"] == pytest.approx(90.0)


def test_the_delay_that_is_allowed():
    outputs = (None, 15, 75, 1000, 9e3)
    assert [allowed_delay_s(kW) for kW in outputs] == [None, 30.0, 90.0, 120.0, None]


def test_times_are_said_to_count_from_the_switch_off_alone(tmp_path):
    path = write(tmp_path, TIME_S, ohm(winding(TIME_S)))
    read = read_readings(path, motor())
    assert read.time_s[0] == TIME_S[0]
    assert not [note for note in read.notes if "first sample" in note]
    assert all(read.notes)


def test_the_key_of_the_figure_lies_on_no_line(tmp_path):
    result = found(tmp_path, ohm(winding(TIME_S)))
    figure = drawn(result)
    figure.draw_without_rendering()
    (axis,), (key,) = figure.axes, figure.legends
    assert axis.get_legend() is None
    assert not key.get_window_extent().overlaps(axis.get_window_extent())
    assert key.get_window_extent().width < figure.bbox.width


def test_the_command_writes_what_it_says(command, tmp_path, capsys):
    words = command(values=ohm(winding(TIME_S) + SCATTER))
    assert cli.main([*words, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said == json.loads((tmp_path / "out" / "shutdown.json").read_text(encoding="utf-8"))
    in_python = heatrun.winding_at_switch_off(*words[1:3])
    assert in_python.winding_degC == said["winding_degC"]
    permitted = next(one for one in said["limits"] if one["unit"] == "K")
    assert permitted["value"] == 105.0
    assert permitted["margin_K"] == pytest.approx(105.0 - said["rise_K"])
    assert (tmp_path / "out" / "shutdown.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "out" / "shutdown.pdf").read_bytes().startswith(b"%PDF")
    book = pd.read_excel(tmp_path / "out" / "shutdown.xlsx", sheet_name=None)
    budget, read = book["Budget"].set_index("source"), book["Readings"]
    combined = budget["contribution [K]"]["combined, first order (GUM)"]
    assert combined == pytest.approx(said["gum_uncertainty_K"], rel=1e-6)
    assert list(budget.index[: len(said["budget"])]) == [row["source"] for row in said["budget"]]
    assert read["reading [°C]"].count() == TIME_S.size
    table = np.genfromtxt(tmp_path / "out" / "readings.csv", delimiter=",", names=True)
    np.testing.assert_allclose(table["time_s"], TIME_S)
    assert cli.main([*words, "-v"]) == 0
    text = capsys.readouterr().out
    assert "cold resistance" in text
    assert "Winding at switch-off" in text
    assert cli.main([*words, "--within", "-1"]) == 2
    assert cli.main([*words, "--model", "second"]) == 2
    assert cli.main([*words, "--seed", "1"]) == 1
    assert "exists and holds another result" in capsys.readouterr().err


@pytest.mark.parametrize("language", LANGUAGES[1:])
def test_the_page_says_nothing_in_english(tmp_path, language):
    values = ohm(winding(TIME_S) + SCATTER)
    values[9] *= 1.01
    some = found(tmp_path, values, text=MOTOR.replace("[shutdown]", "[shutdown]\nlead_sd = 0.1"))
    assert some.left_out
    late = [_reason(200.0, 9.0, 5.0, latest) for latest in (None, 199.0, 60.0)]
    results = [replace(some, is_determinable=False, reason=reason) for reason in late]
    say = Texts(language)
    stated = Certificate(laboratory="Bench 3", operator="A")
    for result in (some, *results):
        said = content(result, stated, say)
        again(drawn(result), say)
        assert (said["remark"], say.unknown) == ("", {"M 112, readings"})  # the title of the figure
    assert said["identification"] == [[say("laboratory"), "Bench 3"], [say("operator"), "A"]]


def test_the_command_speaks_the_language_of_the_certificate_or_that_asked_for(command, tmp_path):
    words = command(MOTOR + '[certificate]\nlanguage = "de"\nlaboratory = "Bench 3"\n')
    for more, title in (([], "im Abschaltzeitpunkt"), (["--language", "it"], "alla disinserzione")):
        assert cli.main([*words, *more]) == 0
        page = PdfReader(tmp_path / "out" / "shutdown.pdf").pages[0].extract_text()
        assert title in page
        assert "Bench 3" in page


LABORATORY = """number = "7"
laboratory = "Bench 3"
laboratory_address = "Turin"
customer = "C"
customer_address = "Rome"
serial_number = "1"
operator = "A"
manufacturer = "M"
bench = "Bench 3"
approved_by = "B"
performed_at = "laboratory"
country = "IT"
"""


def test_the_certificate_holds_the_budget(command, tmp_path, capsys):
    out, meta = tmp_path / "out", tmp_path / "meta.toml"
    text = MOTOR.replace("run_down_s = 0", "rated_output_kW = 15")
    words = command(text, ohm(winding(TIME_S) + SCATTER))
    words += ["--json", "--dcc", "--meta", str(meta)]
    meta.write_text(LABORATORY, encoding="utf-8")
    assert cli.main(words) == 1
    assert "test_from" in capsys.readouterr().err
    assert not out.exists()
    meta.write_text(f"{LABORATORY}test_from = 2026-03-04", encoding="utf-8")
    assert cli.main(words) == 0
    assert len(PdfReader(out / "shutdown.pdf").pages) == 1
    said = json.loads(capsys.readouterr().out)
    root = ElementTree.parse(out / "dcc.xml").getroot()
    assert (violations(root), against_practice(root)) == ([], [])
    answer, budget = root.iter(f"{DCC}result")
    reals = [float(each.findtext(f"{SI}value") or "") for each in budget.iter(f"{SI}real")]
    parts = [row["contribution"] for row in said["budget"]]
    assert reals == pytest.approx([*parts, said["gum_uncertainty_K"]], rel=5e-3, abs=1e-12)
    told = [each.text or "" for each in budget.iter(f"{DCC}content")]
    cold = told[told.index("cold resistance") + 1]
    row = next(row for row in said["budget"] if row["source"] == "cold resistance")
    assert f"sensitivity {row['sensitivity']:.4g} K per 1" in cold
    first = next(answer.iter(f"{SI}real"))
    assert float(first.findtext(f"{SI}value") or "") == pytest.approx(said["winding_degC"], abs=0.1)
    write(tmp_path, TIME_S + 600.0, ohm(winding(TIME_S + 600.0)))
    assert cli.main([*words, "--force"]) == 1
    assert "not determinable" in capsys.readouterr().err
    assert cli.main([*words[:3], "--dcc"]) == 2
    assert cli.main([*words[:3], "--meta", str(meta)]) == 2


ROOM = 20.0
HOT = np.array([104.0, 68.0])  # winding and stator over the air [K]


def state_matrix(truth):
    w, s, inner, outer = (truth[name] for name in ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr"))
    return np.array([[-1 / (w * inner), 1 / (w * inner)],
                     [1 / (s * inner), -1 / (s * inner) - 1 / (s * outer)]])  # fmt: skip


def write_readings(folder, truth, first_s, within_K=0.0):
    """The reference motor's winding between two terminals, after switch-off; a part of it is hotter
    than the rest by so much, with a third of its time constant.
    """
    A, time_s = state_matrix(truth), np.arange(first_s, first_s + 300.0, 15.0)
    winding = ROOM + np.array([(expm(A * t) @ HOT)[0] for t in time_s])
    winding += within_K * np.exp(-3.0 * time_s / (truth["Ceq_w"] * truth["Req_w"]))
    scatter = np.random.default_rng(4).normal(1.0, 1e-4, time_s.size)
    ohm = 0.0124 * (234.5 + winding) / (234.5 + 25.0) * scatter
    lines = [f"{t:.0f},{1e3 * R:.6f}" for t, R in zip(time_s, ohm, strict=True)]
    (folder / "readings.csv").write_text("\n".join(["time_s,R [mOhm]", *lines]), encoding="utf-8")
    text = (folder / "motor.toml").read_text(encoding="utf-8")
    if "[shutdown]" not in text:
        text = text.replace(
            "phase_resistance_ohm", "measured_resistance_ohm = 0.0124\nphase_resistance_ohm"
        )
        text += f"[constants]\nambient_degC = {ROOM}\n[shutdown]\nrun_down_s = 0\n"
        text += (
            "cold_resistance_sd = 0.0005\ncold_temperature_sd_K = 0.1\ncoefficient_sd_degC = 0.2\n"
        )
        (folder / "motor.toml").write_text(text, encoding="utf-8")


def test_modes_of_two_nodes(truth):
    A = state_matrix(truth)[None]
    heat = np.array([[[1.0 / truth["Ceq_w"], 0.0], [0.0, 1.0 / truth["Ceq_sr"]]]])
    tau, shares, place = _modal(A, heat)
    np.testing.assert_allclose(np.sort(-1.0 / np.linalg.eigvals(A[0]).real), tau[0])
    assert place == 0
    # a second later, by the matrix exponential and by the modes
    for loss in (0, 1):
        steady = np.linalg.solve(A[0], -heat[0, loss])
        later = (expm(100.0 * A[0]) @ steady)[0] / steady[0]
        assert np.sum(shares[0, loss] * np.exp(-100.0 / tau[0])) == pytest.approx(later)


def test_a_run_brings_its_time_constants_along(day, truth, capsys):
    write_readings(day, truth, 120.0)
    words = ["shutdown", "motor.toml", "readings.csv", "--json"]
    assert cli.main([*words, "--within", "50"]) == 0
    alone = json.loads(capsys.readouterr().out)
    assert cli.main([*words, "--run", "run", "--model", "second"]) == 0
    with_run = json.loads(capsys.readouterr().out)
    low, high = with_run["winding_95_degC"]
    assert low < ROOM + HOT[0] < high
    # the readings alone leave the fast mode open; a run's may be off by a fifth
    assert with_run["extrapolation_95_K"] < 0.8 * alone["extrapolation_95_K"]
    assert "network second" in with_run["prior"]


@pytest.mark.parametrize("within_K", [0.0, 9.0])
def test_a_run_leaves_room_for_what_its_network_lumps(day, truth, capsys, within_K):
    write_readings(day, truth, 30.0, within_K)
    words = ["shutdown", "motor.toml", "readings.csv", "--json", "--run", "run"]
    assert cli.main([*words, "--model", "second"]) == 0
    low, high = json.loads(capsys.readouterr().out)["winding_95_degC"]
    assert low < ROOM + HOT[0] + within_K < high


def test_the_prior_is_that_of_the_draws(day, truth):
    write_readings(day, truth, 30.0)
    motor = load_motor(day / "motor.toml")
    modes = modes_of_run(day / "run", read_readings(day / "readings.csv", motor), "second")
    expected = np.sort(-1.0 / np.linalg.eigvals(state_matrix(truth)).real)
    # an hour of duty at 1 Hz, quickly sampled
    np.testing.assert_allclose(np.exp(modes.log_times), expected, rtol=0.1)
    z = np.random.default_rng(0).standard_normal((4000, len(modes.of_times)))
    tau = modes.times(z)
    assert np.all(np.diff(tau[:, :2], axis=1) > 0.0)
    assert np.std(np.log(tau[:, 1])) == pytest.approx(np.linalg.norm(modes.factor[0]), rel=0.1)
