"""Tests from unlike loggers, and several sensors of one winding."""

import re

import jax
import jax.numpy as jnp
import numpy as np
import pandas as pd
import pytest
from drafted import BEARING, CURRENT, HOUSING, LOSSES, ROOM, TIME_S, WINDING, named, text_of

from heatrun import cli
from heatrun.checks import check_record, mended
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.fit.restricted import estimate_loggers
from heatrun.model.model import Model
from heatrun.model.noise import Noise, draw, scale_of
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor, parse_motor
from heatrun.posterior.posterior import weighted_draws
from heatrun.posterior.predict import predict
from heatrun.readers.joined import read_test
from heatrun.record.motor import Motor
from heatrun.record.reduction import reduce
from heatrun.runs.write import motor_text

BASE = {"time_s": TIME_S, "losses_W": LOSSES, "phase_current_A": CURRENT, "ambient_degC": ROOM}
HEAD = '[motor]\nname = "M"\n'


def motor_of(text: str):
    return parse_motor(f"{HEAD}{text}".encode(), "motor.toml")


def test_the_first_counts_whose_column_a_file_has(tmp_path):
    one = named(tmp_path, BASE | {"TE_7 [degC]": WINDING, "TE_8 [degC]": HOUSING}, "one.csv")
    two = named(tmp_path, BASE | {"Kanal 3": WINDING - 1.0}, "two.csv")
    motor = motor_of('[columns]\nwinding_degC = ["TE_7 [degC]", "Kanal 3 [degC]"]\n')
    np.testing.assert_allclose(read_test(one, motor)["winding_degC"], WINDING, rtol=1e-4)
    np.testing.assert_allclose(read_test(two, motor)["winding_degC"], WINDING - 1.0, rtol=1e-4)
    np.testing.assert_allclose(
        read_test(two, parse_motor(motor_text(motor), "run"))["winding_degC"],
        WINDING - 1.0,
        rtol=1e-4,
    )


def test_a_mean_and_a_rate_may_be_choices(tmp_path):
    three = {f"Z{n} [degC]": WINDING + n for n in (1, 2, 3)}
    del (rest := dict(BASE))["time_s"]
    path = named(tmp_path, rest | three)
    motor = motor_of(
        '[columns]\ntime_s = ["tick [s]", "rate 0.1 Hz"]\n'
        'winding_degC = ["coil [degC]", "mean(Z1, Z2, Z3) [degC]"]\n'
    )
    record = read_test(path, motor)
    np.testing.assert_allclose(record["winding_degC"], WINDING + 2.0, rtol=1e-4)
    np.testing.assert_allclose(record.time_s, TIME_S)


def test_a_test_may_have_columns_of_its_own(tmp_path):
    one = named(tmp_path, BASE | {"K1 [degC]": WINDING, "K2 [degC]": HOUSING}, "one.csv")
    two = named(tmp_path, BASE | {"K1 [degC]": HOUSING, "K2 [degC]": WINDING}, "two.csv")
    motor = motor_of(
        '[columns]\nwinding_degC = "K1"\n[tests.two]\nmask = [[100, 200]]\n'
        '[tests.two.columns]\nwinding_degC = "K2"\n'
    )
    for path in (one, two):
        np.testing.assert_allclose(read_test(path, motor)["winding_degC"][0], 22.0, rtol=1e-4)
        np.testing.assert_allclose(
            read_test(path, motor)["winding_degC"][-1], WINDING[-1], rtol=1e-4
        )
    kept = parse_motor(motor_text(motor), "run")
    np.testing.assert_allclose(read_test(two, kept)["winding_degC"], WINDING, rtol=1e-4)


@pytest.mark.parametrize(
    ("line", "match"),
    [
        ("winding_degC = []", "1 to 20 columns"),
        ("winding_degC = [1]", "winding_degC"),
        ('wnding_degC = ["K1"]', "not known"),
    ],
)
@pytest.mark.parametrize("section", ["columns", "tests.two.columns"])
def test_what_is_no_list_of_columns_is_refused(section, line, match):
    with pytest.raises(InputError, match=match):
        motor_of(f"[{section}]\n{line}\n")


def test_none_of_the_choices_leaves_the_channel_missing(tmp_path, capsys):
    path = named(tmp_path, BASE | {"K1 [degC]": WINDING})
    motor = tmp_path / "motor.toml"
    motor.write_text(f'{HEAD}[columns]\nwinding_degC = ["K7 [degC]", "K8 [degC]"]\n')
    assert cli.main(["check", str(motor), str(path)]) == 1
    assert "winding_degC" in capsys.readouterr().out


def test_a_draft_offers_one_line_for_several_loggers(tmp_path):
    one = named(tmp_path, BASE | {"TE_7 [degC]": WINDING, "TE_8 [degC]": BEARING}, "one.csv")
    two = named(tmp_path, BASE | {"Kanal 3 [K]": WINDING + 273.15}, "two.csv")
    assert '# winding_degC = ["TE_7 [degC]", "Kanal 3 [K]"]' in text_of(one, two)


@pytest.mark.parametrize(
    ("one", "two", "said"),
    [
        ({"K1 [degC]": WINDING, "K2 [degC]": BEARING}, {"K1 [degC]": BEARING, "K2 [degC]": WINDING},
         '[tests."two".columns]'),
        ({"winding_degC": WINDING}, {"Kanal 3 [degC]": WINDING}, ""),
        ({"TE_7 [degC]": WINDING, "TE_8 [degC]": BEARING}, {"Kanal 3 [K]": WINDING + 273.15},
         '["TE_7 [degC]", "Kanal 3 [K]"]'),
    ],
    ids=["columns called alike", "one of them is recognised", "one line for several loggers"],
)  # fmt: skip
def test_init_tells_apart_files_of_several_loggers(tmp_path, monkeypatch, one, two, said):
    monkeypatch.chdir(tmp_path)
    paths = [named(tmp_path, BASE | columns, f"{name}.csv")
             for name, columns in (("one", one), ("two", two))]  # fmt: skip
    assert cli.main(["init", "one.csv", "two.csv", "--accept"]) == 0
    motor = load_motor("motor.toml")
    assert said in (tmp_path / "motor.toml").read_text(encoding="utf-8")
    rtol = 1e-3 if "[K]" in said else 1e-4  # of six digits three stand behind those of a kelvin
    for path in paths:
        np.testing.assert_allclose(read_test(path, motor)["winding_degC"], WINDING, rtol=rtol)


SECONDS = np.arange(0.0, 1200.0, 2.0)
RISE_K = 50.0 * (1.0 - np.exp(-SECONDS / 500.0))
U, V, W = 20.0 + RISE_K, 20.0 + 1.04 * RISE_K, 20.0 + 0.99 * RISE_K
REST = {
    "time_s": SECONDS,
    "losses_W": np.full(SECONDS.size, 300.0),
    "ambient_degC": np.full(SECONDS.size, 20.0),
}


def read(tmp_path, columns, lines):
    path = tmp_path / "t.csv"
    pd.DataFrame(REST | columns).to_csv(path, index=False, float_format="%.9g")
    text = f'[motor]\nname = "M"\n[columns]\n{lines}\n'
    return read_test(path, parse_motor(text.encode(), "motor.toml"))


@pytest.mark.parametrize(
    ("how", "expected"), [("mean", (U + V + W) / 3.0), ("hottest", V)], ids=["mean", "hottest"]
)
def test_one_course_for_three_sensors(tmp_path, how, expected):
    columns = {"T_U [degC]": U, "T_V [degC]": V, "T_W [degC]": W}
    record = read(tmp_path, columns, f'winding_degC = "{how}(T_U, T_V, T_W)"')
    np.testing.assert_allclose(record["winding_degC"], expected, rtol=1e-7)
    (reading,) = [one for one in record.mapping if one.channel == "winding_degC"]
    assert reading.column == f"{how}(T_U, T_V, T_W)"
    assert (reading.unit, reading.unit_from) == ("degC", "stated")
    assert not record.unused
    assert not record.findings


GONE = np.where((SECONDS > 500) & (SECONDS < 520), np.nan, V)
THREE = {"I_U [A]": 0.0 * U + 30.0, "I_V [A]": 0.0 * U + 40.0, "I_W [A]": 0.0 * U + 50.0}
COMBINED = {
    "each sensor has its own unit": (
        {"T_U [K]": U + 273.15, "T_V [degF]": 1.8 * V + 32.0, "T_W": W},
        "winding_degC = 'mean(T_U, T_V, T_W [degC])'", (U + V + W) / 3.0),
    "a unit behind the brackets is that of all": (
        {"T_U": U + 273.15, "T_V": V + 273.15}, "winding_degC = 'mean(T_U, T_V) [K]'",
        (U + V) / 2.0),
    "names with brackets and commas in them": (
        {"Temp (slot 1)": U, "Temp (slot 2, rear)": V},
        "winding_degC = 'mean(Temp (slot 1) [degC], Temp (slot 2, rear) [degC])'", (U + V) / 2.0),
    "the mean current is that of the heat": (
        THREE, "phase_current_A = 'mean(I_U, I_V, I_W)'",
        np.full(SECONDS.size, np.sqrt(5000.0 / 3.0))),
    "three wattmeters make one power": (
        {"P1 [W]": 100.0 * U, "P2 [kW]": 0.1 * V, "P3 [W]": 100.0 * W},
        "electrical_power_W = 'sum(P1, P2, P3)'", 100.0 * (U + V + W)),
    "a sensor without a reading leaves none of the mean": (
        {"T_U": U, "T_V": GONE}, "winding_degC = 'mean(T_U, T_V) [degC]'", (U + GONE) / 2.0),
    "a column of that name is the column": (
        {"mean(T_U, T_V)": U, "T_U": V, "T_V": W}, "winding_degC = 'mean(T_U, T_V)'", U),
}  # fmt: skip


@pytest.mark.parametrize("case", COMBINED)
def test_what_a_combination_reads(tmp_path, case):
    columns, line, expected = COMBINED[case]
    record = read(tmp_path, columns, line)
    np.testing.assert_allclose(record[line.partition(" ")[0]], expected, rtol=1e-7)


def test_a_sensor_that_departs_from_the_others_is_told(tmp_path):
    columns = {"T_U": U, "T_V": V, "T_W": 20.0 + 0.5 * RISE_K}
    record = read(tmp_path, columns, 'winding_degC = "mean(T_U, T_V, T_W) [degC]"')
    (finding,) = record.findings
    assert finding.id == "sensors_differ"
    assert "column 'T_W' is" in finding.message
    expected = np.quantile(0.5 * RISE_K, 0.95)  # U is the one in the middle
    assert finding.values["apart_K"] == pytest.approx(expected, rel=1e-3)
    assert 'winding_degC = "mean(T_U, T_V)" under [columns]' in finding.remedy


def test_one_sensor_of_three_that_comes_off_is_told_and_nothing_beside(tmp_path):
    off = np.where(np.arange(RISE_K.size) > RISE_K.size // 2, 20.0, U)
    record = read(tmp_path, {"T_U": U, "T_V": V, "T_W": off},
                  'winding_degC = "mean(T_U, T_V, T_W) [degC]"')  # fmt: skip
    found = [one for one in check_record(record, Motor("M")) if one.severity != "note"]
    told = [one for one in found if "winding_degC" in one.where]
    assert [(one.id, one.severity) for one in told] == [("sensors_differ", "error")]


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('winding_degC = "mean(T_U)"', "2 to 64 columns"),
        ('winding_degC = "mean(T_U, T_X)"', "names 'T_X'"),
        ('winding_degC = "mean(T_U, T_U)"', "one column twice"),
        ('losses_W = "mean(T_U, T_V)"', "Expected one column for losses_W"),
        ('phase_current_A = "hottest(T_U, T_V)"', "Expected one column"),
        ('winding_degC = "sum(T_U, T_V)"', "Expected one column"),
    ],
)
def test_what_cannot_be_combined_is_refused(tmp_path, line, said):
    with pytest.raises(InputError, match=said):
        read(tmp_path, {"T_U": U, "T_V": V}, line)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('time_s = "rate 10"', '"rate 10 Hz"'),
        ('time_s = "rate 30 /min"', '"rate 0.5 Hz"'),
        ('winding_degC = "max(T_U, T_V)"', r"hottest\(…\), of temperatures"),
        ('losses_W = "P_el - P_mech"', "name both powers, electrical_power_W"),
        ('phase_current_A = "I * 0.5"', 'phase_current_A = "COLUMN \\[UNIT\\]"'),
        ('winding_degC = "T_Q"', "not have. Did you mean|does not have"),
    ],
)
def test_what_a_line_cannot_compute_is_told_how_to_write_it(tmp_path, line, said):
    with pytest.raises(InputError, match="which the file does not have") as caught:
        read(tmp_path, {"T_U": U, "T_V": V, "P_el": U, "P_mech": V, "I": U}, line)
    assert re.search(said, str(caught.value))
    assert ("computes nothing" in str(caught.value)) == (" - " in line or "*" in line)


def of_measurement_file(tmp_path, fast):
    mdf = pytest.importorskip("mdf_files")
    time_V = mdf.FAST if fast else mdf.SLOW
    rig = [mdf.signal("T_U", mdf.SLOW + 20.0, unit="degC"), mdf.signal("T", mdf.SLOW)]
    if not fast:
        rig.append(mdf.signal("T_V", mdf.SLOW + 24.0, time_V, "degC"))
    drive = [mdf.signal("losses_W", mdf.FAST * 100.0, mdf.FAST, "W")]
    if fast:
        drive.append(mdf.signal("T_V", time_V + 24.0, time_V, "degC"))
    path = mdf.written(tmp_path / "t.mf4", ("Rig", rig), ("Drive", drive))
    line = 'winding_degC = "mean(Rig/T_U, T_V)"'
    motor = parse_motor(f'[motor]\nname = "M"\n[columns]\n{line}\n'.encode(), "motor.toml")
    return read_test(path, motor), mdf.SLOW


def test_channels_of_a_measurement_file(tmp_path):
    record, slow = of_measurement_file(tmp_path, fast=False)
    np.testing.assert_allclose(record["winding_degC"], slow + 22.0)
    assert record.time_s.size == slow.size


def test_channels_of_different_rates_are_not_combined(tmp_path):
    with pytest.raises(InputError, match="have different times"):
        of_measurement_file(tmp_path, fast=True)


AMPERES = np.where((SECONDS > 100) & (SECONDS < 900), 12.0, 0.0)


@pytest.mark.parametrize(
    ("factor", "says", "severity", "share_of_heat"),
    [(0.0, "nothing", "error", "67 %"), (0.5, "0.5 of it", "error", "75 %"),
     (-1.0, "the other sign", "warning", "")],
)  # fmt: skip
def test_a_phase_that_reads_wrongly_is_no_part_of_a_mean(
    tmp_path, factor, says, severity, share_of_heat
):
    columns = {"I_U": AMPERES, "I_V": 1.01 * AMPERES, "I_W": factor * AMPERES + 0.003}
    line = 'phase_current_A = "mean(I_U, I_V, I_W) [A]"'
    record = read(tmp_path, columns | {"T": U}, f'{line}\nwinding_degC = "T [degC]"')
    (finding,) = [one for one in record.findings if one.id == "sensors_differ"]
    assert finding.severity == severity
    assert f"'I_W' reads {says}" in finding.message
    assert share_of_heat in finding.message
    assert 'phase_current_A = "mean(I_U, I_V)"' in finding.remedy


def test_a_marker_in_one_phase_is_no_phase_that_is_alone(tmp_path):
    columns = {"I_U": AMPERES.copy(), "I_V": AMPERES, "I_W": AMPERES, "T": U}
    columns["I_U"][500] = 32767.0
    line = 'phase_current_A = "mean(I_U, I_V, I_W) [A]"'
    record = read(tmp_path, columns, f'{line}\nwinding_degC = "T [degC]"')
    assert not [one for one in record.findings if one.id == "sensors_differ"]


LASTING = np.where(SECONDS > 100, 12.0, 0.0)


@pytest.mark.parametrize(
    ("factors", "says", "line", "current_A"),
    [((0.0, 0.002), "I_V and I_W read nothing where column 'I_U' carries", '"I_U"', 12.0),
     ((-1.0, 0.001), "column 'I_W' reads nothing where I_U and I_V agree", '"mean(I_U, I_V)"',
      12.0)],
)  # fmt: skip
def test_two_faults_of_three_phases_are_no_phases_that_agree(
    tmp_path, factors, says, line, current_A
):
    columns = {"I_U": AMPERES, "I_V": factors[0] * AMPERES, "I_W": factors[1] * AMPERES}
    mapped = 'phase_current_A = "mean(I_U, I_V, I_W) [A]"\nwinding_degC = "T [degC]"'
    record = read(tmp_path, columns | {"T": U}, mapped)
    (finding,) = [one for one in record.findings if one.id == "sensors_differ"]
    assert finding.severity == "error"
    assert says in finding.message
    assert f"phase_current_A = {line}" in finding.remedy
    mean = mended(record, Motor("M"), finding)[0]["phase_current_A"]
    np.testing.assert_allclose(mean[AMPERES > 0.0], current_A, rtol=1e-3)


@pytest.mark.parametrize("others", [("I_U", "I_W"), ("I_U",)])
@pytest.mark.parametrize(("from_s", "to_s"), [(450, 2000), (860, 2000), (400, 700)])
def test_the_moment_is_named_at_which_a_clamp_dies(tmp_path, others, from_s, to_s):
    dead = (from_s <= SECONDS) & (to_s >= SECONDS)
    columns = {name: LASTING for name in others} | {"I_V": np.where(dead, 0.01, LASTING)}
    line = f'phase_current_A = "mean({", ".join(columns)}) [A]"\nwinding_degC = "T [degC]"'
    record = read(tmp_path, columns | {"T": U}, line)
    (finding,) = [one for one in record.findings if one.id == "sensors_differ"]
    until = "on" if to_s > SECONDS[-1] else f"until {to_s} s"
    assert f"'I_V' reads nothing from {from_s} s {until}" in finding.message
    whole = f"mean({', '.join(others)})" if len(others) > 1 else others[0]
    assert f'phase_current_A = "{whole}"' in finding.remedy
    mean = mended(record, Motor("M"), finding)[0]["phase_current_A"]
    np.testing.assert_allclose(mean[SECONDS > 100], 12.0, rtol=1e-3)


def test_a_passing_unbalance_and_offsets_of_clamps_are_none_of_a_phase(tmp_path):
    start = np.where((SECONDS > 100) & (SECONDS < 110), 0.6, 1.0) * LASTING
    low = np.where(SECONDS > 500, 0.25, 1.0)
    columns = {"I_U": LASTING * low, "I_V": start * low, "I_W": (LASTING * low + 0.6)}
    line = 'phase_current_A = "mean(I_U, I_V, I_W) [A]"\nwinding_degC = "T [degC]"'
    assert read(tmp_path, columns | {"T": U}, line).findings == ()


def test_phases_that_differ_as_phases_do_are_no_finding(tmp_path):
    columns = {"I_U": AMPERES, "I_V": 1.06 * AMPERES, "I_W": 0.97 * AMPERES, "T": U}
    line = 'phase_current_A = "mean(I_U, I_V, I_W) [A]"\nwinding_degC = "T [degC]"'
    assert read(tmp_path, columns, line).findings == ()


QUIET = {"drift_sd_K": 0.1, "white_sd_K": 0.05, "resolution_K": 0.1}
NOISY = {"drift_sd_K": 0.8, "white_sd_K": 0.4, "resolution_K": 0.5}


@pytest.fixture(scope="module")
def tests(bench, generator, motor):
    """A calibration test and a held-out test of each logger."""
    profiles = generator.duty(2700.0), generator.staircase(2700.0)
    made = {
        f"{kind} {index}": bench(profile, seed + index, f"{kind} {index}", **instruments)
        for kind, seed, instruments in (("quiet", 41, QUIET), ("noisy", 51, NOISY))
        for index, profile in enumerate(profiles)
    }
    return {name: reduce(record, motor) for name, record in made.items()}


def test_the_restricted_likelihood_tells_the_noise_of_loggers_apart(tests, motor):
    """Residuals drawn with noise of two levels, and no parameter that could move them."""
    fitted = [tests["quiet 0"], tests["noisy 0"]]
    problem = Problem.of(Model.of("second", motor), motor, fitted)
    noise = Noise(*map(jnp.asarray, (0.1, 30.0, 0.05, 0.0)))
    drawn = [
        draw(jax.random.key(index), noise.scaled(factor), test.observation())
        for index, (factor, test) in enumerate(zip((1.0, 4.0), fitted, strict=True))
    ]
    residual = np.concatenate(drawn)
    nothing = np.zeros((residual.size, 1))
    scales = estimate_loggers(problem, np.zeros(1), residual, nothing)
    ratio = scale_of(scales, fitted[1].loggers[0]) / scale_of(scales, fitted[0].loggers[0])
    # of some 130 block means each, correlated over one or two: 10 % of the ratio; three of these
    assert 2.8 < ratio < 5.6


@pytest.fixture(scope="module")
def together(tests, motor):
    fitted = [tests["quiet 0"], tests["noisy 0"]]
    return fit(Problem.of(Model.of("second", motor), motor, fitted))


@pytest.mark.slow
def test_noise_of_each_logger_is_told_apart(together, tests):
    ratio = scale_of(together.problem.loggers, tests["noisy 0"].loggers[0])
    ratio /= scale_of(together.problem.loggers, tests["quiet 0"].loggers[0])
    assert 5.0 < ratio < 12.0  # 8 in both parts of the noise


@pytest.mark.slow
def test_the_band_of_a_held_out_test_is_that_of_its_logger(together, tests):
    draws = weighted_draws(together)
    bands = {name: predict(draws, tests[name]) for name in ("quiet 1", "noisy 1")}
    for found in bands.values():
        assert found.coverage_95() > 0.88
    assert np.median(bands["noisy 1"].sd) > 2.0 * np.median(bands["quiet 1"].sd)


@pytest.mark.slow
def test_a_noisy_test_does_not_hide_a_quiet_one(together, tests, motor):
    alone = fit(Problem.of(Model.of("second", motor), motor, [tests["quiet 0"]]))
    assert not alone.problem.loggers
    for name in ("Ceq_sr", "Req_w"):
        place = alone.problem.parameters.index(name)
        other = together.problem.parameters.index(name)
        widths = [np.sqrt(found.covariance[at, at])
                  for found, at in ((alone, place), (together, other))]  # fmt: skip
        assert widths[1] < 1.05 * widths[0]


@pytest.mark.slow
def test_an_unknown_logger_counts_as_the_noisiest(together, tests, blocks):
    assert blocks.loggers[0] not in together.problem.loggers
    assert scale_of(together.problem.loggers, blocks.loggers[0]) == max(
        together.problem.loggers.values()
    )
    assert scale_of({}, blocks.loggers[0]) == 1.0
