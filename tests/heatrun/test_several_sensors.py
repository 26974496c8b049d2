"""Several sensors of one winding: `mean(T_U, T_V, T_W)` and `hottest(…)` in `[columns]`."""

from __future__ import annotations

import numpy as np
import pandas as pd
import pytest

from heatrun.errors import InputError
from heatrun.motor.file import parse_motor
from heatrun.readers.joined import read_test

TIME_S = np.arange(0.0, 1200.0, 2.0)
RISE_K = 50.0 * (1.0 - np.exp(-TIME_S / 500.0))
U, V, W = 20.0 + RISE_K, 20.0 + 1.04 * RISE_K, 20.0 + 0.99 * RISE_K
REST = {
    "time_s": TIME_S,
    "losses_W": np.full(TIME_S.size, 300.0),
    "ambient_degC": np.full(TIME_S.size, 20.0),
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


def test_each_sensor_has_its_own_unit(tmp_path):
    columns = {"T_U [K]": U + 273.15, "T_V [degF]": 1.8 * V + 32.0, "T_W": W}
    record = read(tmp_path, columns, 'winding_degC = "mean(T_U, T_V, T_W [degC])"')
    np.testing.assert_allclose(record["winding_degC"], (U + V + W) / 3.0, rtol=1e-7)


def test_a_unit_behind_the_brackets_is_that_of_all(tmp_path):
    columns = {"T_U": U + 273.15, "T_V": V + 273.15}
    record = read(tmp_path, columns, 'winding_degC = "mean(T_U, T_V) [K]"')
    np.testing.assert_allclose(record["winding_degC"], (U + V) / 2.0, rtol=1e-7)


def test_names_with_brackets_and_commas_in_them(tmp_path):
    columns = {"Temp (slot 1)": U, "Temp (slot 2, rear)": V}
    line = "winding_degC = 'mean(Temp (slot 1) [degC], Temp (slot 2, rear) [degC])'"
    record = read(tmp_path, columns, line)
    np.testing.assert_allclose(record["winding_degC"], (U + V) / 2.0, rtol=1e-7)


def test_the_mean_current_is_that_of_the_heat(tmp_path):
    columns = {"I_U [A]": 0.0 * U + 30.0, "I_V [A]": 0.0 * U + 40.0, "I_W [A]": 0.0 * U + 50.0}
    record = read(tmp_path, columns, 'phase_current_A = "mean(I_U, I_V, I_W)"')
    np.testing.assert_allclose(record["phase_current_A"], np.sqrt(5000.0 / 3.0))


def test_a_sensor_without_a_reading_leaves_none_of_the_mean(tmp_path):
    gone = np.where((TIME_S > 500) & (TIME_S < 520), np.nan, V)
    record = read(tmp_path, {"T_U": U, "T_V": gone}, 'winding_degC = "mean(T_U, T_V) [degC]"')
    np.testing.assert_array_equal(np.isnan(record["winding_degC"]), np.isnan(gone))


def test_a_sensor_that_departs_from_the_others_is_told(tmp_path):
    columns = {"T_U": U, "T_V": V, "T_W": 20.0 + 0.5 * RISE_K}
    record = read(tmp_path, columns, 'winding_degC = "mean(T_U, T_V, T_W) [degC]"')
    (finding,) = record.findings
    assert finding.id == "sensors_differ"
    assert "column 'T_W' is" in finding.message
    expected = np.quantile(0.5 * RISE_K, 0.95)  # U is the one in the middle
    assert finding.values["apart_K"] == pytest.approx(expected, rel=1e-3)


def test_a_column_of_that_name_is_the_column(tmp_path):
    columns = {"mean(T_U, T_V)": U, "T_U": V, "T_V": W}
    record = read(tmp_path, columns, 'winding_degC = "mean(T_U, T_V)"')
    np.testing.assert_allclose(record["winding_degC"], U, rtol=1e-7)


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ('winding_degC = "mean(T_U)"', "2 to 64 columns"),
        ('winding_degC = "mean(T_U, T_X)"', "names 'T_X'"),
        ('winding_degC = "mean(T_U, T_U)"', "one column twice"),
        ('losses_W = "mean(T_U, T_V)"', "Expected one column for losses_W"),
        ('phase_current_A = "hottest(T_U, T_V)"', "Expected one column"),
    ],
)
def test_what_cannot_be_combined_is_refused(tmp_path, line, said):
    with pytest.raises(InputError, match=said):
        read(tmp_path, {"T_U": U, "T_V": V}, line)


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


CURRENT = np.where((TIME_S > 100) & (TIME_S < 900), 12.0, 0.0)


@pytest.mark.parametrize(
    ("factor", "says", "severity", "share_of_heat"),
    [(0.0, "nothing", "error", "67 %"), (0.5, "0.5 of it", "error", "75 %"),
     (-1.0, "the other sign", "warning", "")],
)  # fmt: skip
def test_a_phase_that_reads_wrongly_is_no_part_of_a_mean(
    tmp_path, factor, says, severity, share_of_heat
):
    columns = {"I_U": CURRENT, "I_V": 1.01 * CURRENT, "I_W": factor * CURRENT + 0.003}
    line = 'phase_current_A = "mean(I_U, I_V, I_W) [A]"'
    record = read(tmp_path, columns | {"T": U}, f'{line}\nwinding_degC = "T [degC]"')
    (finding,) = [one for one in record.findings if one.id == "sensors_differ"]
    assert finding.severity == severity
    assert f"'I_W' reads {says}" in finding.message
    assert share_of_heat in finding.message
    assert 'phase_current_A = "mean(I_U, I_V)"' in finding.remedy


def test_phases_that_differ_as_phases_do_are_no_finding(tmp_path):
    columns = {"I_U": CURRENT, "I_V": 1.06 * CURRENT, "I_W": 0.97 * CURRENT, "T": U}
    line = 'phase_current_A = "mean(I_U, I_V, I_W) [A]"\nwinding_degC = "T [degC]"'
    assert read(tmp_path, columns, line).findings == ()
