"""A header that says two things is asked about; one that says the same twice is not."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.readers.channel_map import map_columns
from heatrun.readers.mapping import unit_of
from heatrun.readers.read import read_record
from heatrun.readers.text.remarks import units_of_remarks
from heatrun.record.channels import CHANNEL
from heatrun.record.header import split_name
from heatrun.record.motor import Motor
from heatrun.record.table import Column, Table

VALUES = np.array([1.0, 2.0])


def mapped(name, channel, *, beside=(), spec=None):
    """Map one column to a channel by `[columns]`, under its label unless told otherwise."""
    label, unit = split_name(name)
    column = Column(name, label, unit, VALUES, beside=tuple(beside))
    table = Table((column,), {}, {}, (), (), "test")
    return map_columns(table, {channel: spec or label}, where="test.csv")


@pytest.mark.parametrize(
    ("name", "channel", "said"),
    [
        ("losses_MW_mean [kW]", "losses_W", ("MW", "kW")),
        ("losses | MW [W]", "losses_W", ("MW", "W")),
        ("losses/MW [W]", "losses_W", ("MW", "W")),
        ("losses MW [kilowatt]", "losses_W", ("MW", "kilowatt")),
        ("time_ms [s]", "time_s", ("ms", "s")),
        ("time:ms [h]", "time_s", ("ms", "h")),
        ("time_min [s]", "time_s", ("min", "s")),
        ("phase_current-Arms [mA]", "phase_current_A", ("Arms", "mA")),
        ("I_Apk [A]", "phase_current_A", ("Apk", "A")),
        ("iq_Arms [A]", "i_q_A", ("Arms", "A")),
        ("T_Grad [K]", "winding_degC", ("Grad", "K")),
        ("U_volt [kV]", "dc_voltage_V", ("volt", "kV")),
    ],
)
def test_two_units_in_one_header_are_asked_about(name, channel, said):
    label, unit = split_name(name)
    with pytest.raises(InputError) as asked:
        unit_of(Column(name, label, unit, VALUES), CHANNEL[channel], "test.csv")
    assert f"The name says {said[0]}, the unit behind it {said[1]}." in str(asked.value)


@pytest.mark.parametrize(
    ("name", "channel", "factor"),
    [
        ("I_rms [A]", "phase_current_A", 1.0),
        ("I_Arms [A]", "phase_current_A", 1.0),
        ("I_mA [mA_peak]", "phase_current_A", 1e-3 / np.sqrt(2.0)),
        ("I_amps [A_peak]", "phase_current_A", 1.0 / np.sqrt(2.0)),
        ("i_q_amps [A_rms]", "i_q_A", np.sqrt(2.0)),
        ("P_MW [MW]", "losses_W", 1e6),
        ("losses at 10 kW [W]", "losses_W", 1.0),
        ("T_deg [C]", "winding_degC", 1.0),
        ("n U/min [rpm]", "speed_rpm", 1.0),
        ("T_max [degC]", "winding_degC", 1.0),
    ],
)
def test_what_agrees_or_says_more_is_read(name, channel, factor):
    found = mapped(name, channel)
    np.testing.assert_allclose(found.channels[channel], factor * VALUES)


def test_a_bare_name_takes_the_unit_that_is_left_in_the_header():
    found = mapped("T_wdg K", "winding_degC", spec="T_wdg")
    np.testing.assert_allclose(found.channels["winding_degC"], VALUES - 273.15)
    assert [reading.unit for reading in found.readings] == ["K"]


@pytest.mark.parametrize("other", ["T_wdg B", "T_wdg_2"])
def test_a_bare_name_that_begins_two_headers_is_none(other):
    pair = [Column(name, name, None, VALUES) for name in ("T_wdg F", other)]
    table = Table(tuple(pair), {}, {}, (), (), "test")
    with pytest.raises(InputError, match="which the file does not have"):
        map_columns(table, {"winding_degC": "T_wdg"}, where="test.csv")


def test_columns_decides_against_a_unit_in_the_name_and_says_so():
    found = mapped("losses_MW [kW]", "losses_W", spec="losses_MW [kW] [W]")
    np.testing.assert_array_equal(found.channels["losses_W"], VALUES)
    assert "unit_overridden" in [finding.id for finding in found.findings]


@pytest.mark.parametrize(
    "name",
    ["I_hat [A]", "Ihat [A]", "î [A]", "i\N{COMBINING CIRCUMFLEX ACCENT}_U [A]", "I^ [A]",
     "I_ph_hat [A]", "Spitzenstrom [A]", "I-pk [A]", "I.amp [A]"],
)  # fmt: skip
def test_names_of_amplitudes_are_pointed_out(name):
    found = mapped(name, "phase_current_A")
    assert [finding.id for finding in found.findings] == ["current_maybe_amplitude"]


@pytest.mark.parametrize("name", ["I_ph [A]", "I_rms [A]", "I_hatch [A]"])
def test_other_names_of_currents_are_not(name):
    found = mapped(name, "phase_current_A", spec=f"{name.split(' [')[0]} [A]")
    assert "current_maybe_amplitude" not in [finding.id for finding in found.findings]


def test_a_kind_that_columns_states_ends_the_doubt():
    found = mapped("I_hat [A]", "phase_current_A", spec="I_hat [A] [A_rms]")
    assert "current_maybe_amplitude" not in [finding.id for finding in found.findings]
    found = mapped("i_d_rms [A]", "i_d_A", spec="i_d_rms [A] [A_peak]")
    assert "current_maybe_rms" not in [finding.id for finding in found.findings]


def test_rms_in_the_name_of_a_d_current_is_pointed_out():
    found = mapped("i_d_rms [A]", "i_d_A")
    (finding,) = found.findings
    assert finding.id == "current_maybe_rms"
    assert "i_d_rms [A_rms]" in finding.remedy
    assert not mapped("i_d_rms [A_rms]", "i_d_A").findings


@pytest.mark.parametrize(
    "line",
    ["# I_ph: peak value", "# I_ph is the peak value", "% I_ph = amplitude", "I_ph in peak values",
     "# currents are amplitudes", "# Strom: Scheitelwert", "# all currents given as peak"],
)  # fmt: skip
def test_a_line_that_calls_the_current_an_amplitude_is_passed_on(line):
    ((said,), beside_losses) = units_of_remarks([line], ["I_ph", "P_loss"])
    assert said.scope == "kind"
    assert len(beside_losses) <= 1
    found = mapped("I_ph [A]", "phase_current_A", beside=(said,))
    (finding,) = found.findings
    assert finding.id == "current_maybe_amplitude"
    assert "amplitude" in finding.message


@pytest.mark.parametrize("line", ["# peak load: 30 kW", "# P_loss: peak value", "# I_ph: rms"])
def test_other_lines_about_peaks_are_none_of_the_current(line):
    assert units_of_remarks([line], ["I_ph", "P_loss"])[0] == ()


def test_a_factor_in_a_name_is_asked_about_until_the_unit_is_decided(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("time_s;P_loss x0.1 [W]\n0;10\n1;20\n2;30\n")
    for text in ("P_loss x0.1 [W]", "P_loss x0.1"):
        with pytest.raises(InputError, match=r"factor 'x0\.1'"):
            read_record(path, Motor("M", columns={"losses_W": text}))
    motor = Motor("M", columns={"losses_W": "P_loss x0.1 [W] [W]"})
    assert read_record(path, motor)["losses_W"].tolist() == [10.0, 20.0, 30.0]


def test_labview_states_its_units_above_the_names(tmp_path):
    path = tmp_path / "test.lvm"
    path.write_text(
        "Y_Unit_Label\tkW\tDeg C\ntime_s\tlosses\twinding\n0\t1\t20\n1\t2\t21\n2\t2\t22\n"
    )
    record = read_record(path)
    assert record["losses_W"].tolist() == [1000.0, 2000.0, 2000.0]


def test_a_list_of_channels_above_the_names_states_their_units(tmp_path):
    path = tmp_path / "test.csv"
    path.write_text("Channel;Unit;Device\nlosses;kW;WT1806\nwinding;K;GL840\n\n"
                    "time_s;losses;winding\n0;1;300\n1;2;301\n2;2;302\n")  # fmt: skip
    record = read_record(path)
    assert record["losses_W"].tolist() == [1000.0, 2000.0, 2000.0]
    assert record["winding_degC"][0] == pytest.approx(26.85)
