"""Winding temperature by resistance, and what a resistance beside a sensor says of the material."""

import re

import numpy as np
import pandas as pd
import pytest
from heat_runs import as_columns

import heatrun
from heatrun import cli
from heatrun.checks import check_record
from heatrun.errors import InputError
from heatrun.model.model import Model
from heatrun.model.model_parameters import parameters
from heatrun.motor.file import load_motor, parse_motor
from heatrun.readers.joined import read_test
from heatrun.record.by_resistance import METER_SD, REFERENCE_SD, sensor_sd
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from heatrun.runs.write import motor_text

TIME_S = np.arange(0.0, 2700.0, 3.0)
ROOM = 19.0
FLOWS = (TIME_S >= 90.0) & (TIME_S < 1800.0)
TRUE = np.where(
    TIME_S < 90.0,
    ROOM,
    np.where(
        FLOWS,
        ROOM + 55.0 * -np.expm1(-(TIME_S - 90.0) / 600.0),
        ROOM + 51.8 * np.exp(-(TIME_S - 1800.0) / 600.0),
    ),
)
AMPERES = np.where(FLOWS, 12.0, 0.0)
PHASE, T_REF = 0.31, 20.0


def ohm(times=1.0, *, leads=0.0, B=234.5, winding=TRUE):
    return times * PHASE * (B + winding) / (B + T_REF) + leads


def files(folder, columns, lines, winding="", more=""):
    """A bench file with measured columns, and a motor file that names them."""
    table = {"t [s]": TIME_S, "I [A]": AMPERES, "room [°C]": ROOM, **columns}
    pd.DataFrame(table).to_csv(folder / "coil.csv", index=False)
    mapped = "".join(f'{channel} = "{column}"\n' for channel, column in lines.items())
    text = (
        f'[motor]\nname = "coil"\nlosses = "map"\n'
        f"[winding]\nphase_resistance_ohm = {PHASE}\nreference_temperature_degC = {T_REF}\n"
        f'{winding}\n[columns]\ntime_s = "t [s]"\nphase_current_A = "I [A_rms]"\n'
        f'ambient_degC = "room [°C]"\n{mapped}[constants]\nlosses_W = 0\n{more}'
    )
    (folder / "coil.toml").write_text(text)
    return folder / "coil.toml", folder / "coil.csv"


@pytest.mark.parametrize(
    ("columns", "lines", "winding"),
    [
        ({"R [mΩ]": 1e3 * ohm()}, {"winding_degC": "R [mΩ]"}, ""),
        ({"R [mΩ]": 1e3 * ohm()}, {"winding_resistance_ohm": "R [mΩ]"}, ""),
        ({"R": 1e3 * ohm()}, {"winding_degC": "R [mOhm]"}, ""),
        ({"R U-V (ohm)": ohm(2.0)}, {"winding_degC": "R U-V (ohm)"}, ""),
        ({"R [kΩ]": 1e-3 * ohm(2.0 / 3.0)}, {"winding_degC": "R [kΩ]"}, ""),
        ({"winding_resistance [milliohm]": 1e3 * ohm()}, {}, ""),
        ({"R [Ω]": ohm(leads=0.02)}, {"winding_degC": "R [Ω]"}, "lead_resistance_ohm = 0.02"),
        ({"R [Ω]": ohm(1.234, leads=0.02)}, {"winding_degC": "R [Ω]"},
         f"measured_resistance_ohm = {1.234 * PHASE + 0.02}\nlead_resistance_ohm = 0.02"),
        ({"R [Ω]": ohm(2.0, B=225.0)}, {"winding_degC": "R [Ω]"}, 'material = "aluminium"'),
        ({"U [mV]": 1e3 * ohm(2.0) * AMPERES}, {"winding_voltage_V": "U [mV]"}, ""),
        ({"U [V]": ohm(2.0) * AMPERES, "Idc": AMPERES},
         {"winding_voltage_V": "U [V]", "dc_current_A": "Idc"}, ""),
    ],
)  # fmt: skip
def test_the_winding_is_read_by_its_resistance(tmp_path, columns, lines, winding):
    files_of = files(tmp_path, columns, lines, winding)
    motor = load_motor(files_of[0])
    record = read_test(files_of[1], motor)
    known = np.isfinite(record["winding_degC"])
    assert np.array_equal(known, FLOWS if "U [" in str(columns) else np.full(FLOWS.size, True))
    # six digits of a CSV of doubles: rounding alone
    np.testing.assert_allclose(record["winding_degC"][known], TRUE[known], atol=1e-6)
    assert not [f for f in check_record(record, motor) if f.severity == "error"]
    assert reduce(record, motor).start_degC == pytest.approx(ROOM, abs=1.0)
    assert parse_motor(motor_text(motor), "again").lead_resistance_ohm == motor.lead_resistance_ohm


@pytest.mark.parametrize(
    ("columns", "lines", "said"),
    [
        ({"R [Ohm]": ohm()}, {"winding_degC": "R [Ohm] [degC]"}, "winding_resistance_ohm"),
        ({"R [Ohm]": ohm()}, {"housing_degC": "R [Ohm]"}, "is a resistance in Ohm"),
        ({"Pt [Ohm]": 100.0 + 0.39 * TRUE}, {"winding_degC": "Pt [Ohm]"}, "Pt100 or an NTC"),
        ({"R [Ohm]": ohm(winding=TRUE + 45.0)}, {"winding_degC": "R [Ohm]"}, "no circuit of"),
        ({"R [Ohm]": ohm()}, {"phase_current_A": "R [Ohm]"}, "a unit of resistance"),
        ({"R [Ohm]": ohm() + 9.9e37}, {"winding_degC": "R [Ohm]"}, "got none"),
    ],
)
def test_a_resistance_is_never_read_as_degrees(tmp_path, columns, lines, said):
    motor_file, table = files(tmp_path, columns, {})
    text = motor_file.read_text().replace('phase_current_A = "I [A_rms]"\n', "")
    more = "".join(f'{channel} = "{column}"\n' for channel, column in lines.items())
    motor_file.write_text(text.replace("[constants]", f"{more}[constants]"))
    with pytest.raises(InputError, match=re.escape(said)):
        read_test(table, load_motor(motor_file))


def test_the_line_of_the_message_reads_the_file(tmp_path, capsys):
    motor_file, table = files(tmp_path, {"R [Ohm]": ohm(4.7)}, {"winding_degC": "R [Ohm]"})
    motor_file.write_text(motor_file.read_text().replace(f"phase_resistance_ohm = {PHASE}\n", ""))
    assert cli.main(["check", str(motor_file), str(table)]) == 1
    out = capsys.readouterr().out
    assert "missing_channel" not in out  # a consequence
    (line,) = set(re.findall(r"measured_resistance_ohm = [0-9.]+[0-9]", out))
    motor_file.write_text(motor_file.read_text().replace("[winding]\n", f"[winding]\n{line}\n"))
    winding = read_test(table, load_motor(motor_file))["winding_degC"]
    # five digits of the line are some hundredths of a kelvin
    np.testing.assert_allclose(winding, TRUE, atol=0.05)


def test_the_uncertainty_is_that_of_meter_reference_and_leads(tmp_path):
    leads = 0.03
    motor_file, table = files(
        tmp_path, {"R [Ω]": ohm(leads=leads)}, {"winding_degC": "R [Ω]"},
        f"lead_resistance_ohm = {leads}",
    )  # fmt: skip
    motor = load_motor(motor_file)
    record = read_test(table, motor)
    rng = np.random.default_rng(4)
    errors = []
    for of_meter, of_reference, of_leads in rng.standard_normal((400, 3)):
        R = ohm() * (1.0 + METER_SD * of_meter) + leads
        R0 = PHASE * (1.0 + REFERENCE_SD * of_reference)
        T = (R - leads * (1.0 + 0.2 * of_leads)) / R0 * (234.5 + T_REF) - 234.5
        errors.append(np.polyfit(TRUE - ROOM, T - TRUE, 1))
    gain, offset = np.std(errors, axis=0)
    found = sensor_sd(record, motor)
    # 400 draws know a standard deviation to 3.5 %; the offset is also that of a warm winding
    assert found == pytest.approx((offset, gain), rel=0.15)
    test = reduce(record, motor)
    own = parameters(Model.of("second", motor), motor, [test]).by_test[0]
    assert (own["sensor_offset"].sd, own["sensor_gain"].sd) == found
    assert "resistance" in own["sensor_gain"].basis


def test_a_sensor_goes_before_the_resistance(tmp_path):
    columns = {"R [Ω]": ohm(), "Tw [°C]": TRUE + 1.0}
    lines = {"winding_resistance_ohm": "R [Ω]", "winding_degC": "Tw [°C]"}
    motor_file, table = files(tmp_path, columns, lines)
    motor = load_motor(motor_file)
    record = read_test(table, motor)
    np.testing.assert_allclose(record["winding_degC"], TRUE + 1.0)
    assert sensor_sd(record, motor) is None
    assert not [f for f in heatrun.check(motor_file, table) if f.severity == "error"]


def test_parts_keep_the_reference_and_the_windows_without_current(tmp_path):
    motor_file, table = files(
        tmp_path, {"U [V]": ohm() * AMPERES}, {"winding_voltage_V": "U [V]"},
        more="[tests.coil]\nuse = [[600, 2400]]\nmask = [[900, 960]]\n",
    )  # fmt: skip
    motor = load_motor(motor_file)
    record = read_test(table, motor)
    assert record.time_s[0] == 600.0
    assert not [f for f in check_record(record, motor) if f.id == "nan_block"]
    assert reduce(record, motor).sensor_sd is not None


@pytest.mark.parametrize("leads", ["-0.1", "0.5"])
def test_leads_are_a_part_of_what_is_measured(tmp_path, leads):
    motor_file, _ = files(
        tmp_path, {}, {}, f"measured_resistance_ohm = 0.4\nlead_resistance_ohm = {leads}"
    )
    with pytest.raises(InputError, match="lead_resistance_ohm"):
        load_motor(motor_file)


COPPER, ALUMINIUM = 234.5, 225.0
LONG_S = np.arange(0.0, 5400.0, 2.0)
WINDING = 24.0 + 88.0 * np.where(
    LONG_S < 3600.0,
    -np.expm1(-LONG_S / 900.0),
    -np.expm1(-4.0) * np.exp(-(np.maximum(LONG_S, 3600.0) - 3600.0) / 900.0),
)
CURRENT = np.where(LONG_S < 3600.0, 34.0, 0.0)
RNG = np.random.default_rng(12)


def ohm_of(B=COPPER, winding=WINDING):
    return 0.047 * (B + winding) / (B + 20.0)


def motor(B: float, **more) -> Motor:
    return Motor(
        "M", phase_resistance_ohm=0.047, reference_temperature_degC=20.0,
        resistance_coefficient_degC=B, **more,
    )  # fmt: skip


def locked(B=COPPER, *, extra=0.0, seen=WINDING, **columns) -> Record:
    """A locked rotor under direct current for an hour, and its cooling; `extra` beside copper."""
    losses = 3.0 * (1.0 + extra) * ohm_of(B) * CURRENT**2
    return Record(
        "locked",
        {
            "time_s": LONG_S,
            "phase_current_A": CURRENT,
            "losses_W": losses * (1.0 + 0.002 * RNG.standard_normal(LONG_S.size)),
            "ambient_degC": np.full(LONG_S.size, 24.0),
            "winding_degC": seen + 0.1 * RNG.standard_normal(LONG_S.size),
            "speed_rpm": 0.0 * LONG_S,
            **columns,
        },
    )


def metered(B=COPPER, times=1.0, *, leads=0.0, seen=WINDING, rpm=2900.0) -> Record:
    """A record that turns, with the winding's resistance in a column of its own."""
    shown = times * ohm_of(B) * (1.0 + 0.001 * RNG.standard_normal(LONG_S.size)) + leads
    turning = dict(locked(B, extra=0.6, seen=seen, winding_resistance_ohm=shown).channels)
    turning["speed_rpm"] = np.where(CURRENT > 0.0, rpm, 0.0)
    return as_columns(Record("metered", turning))


def doubts(record: Record, machine: Motor) -> list:
    return [one for one in check_record(record, machine) if one.severity != "note"]


USUAL = 'material = "copper" or "aluminium"'


@pytest.mark.parametrize(
    ("record", "B", "true", "says"),
    [
        (locked(), 150.0, COPPER, USUAL),
        (locked(), 334.5, COPPER, USUAL),
        (locked(390.0), COPPER, 390.0, "resistance_coefficient_degC = 39"),
        (metered(), 160.0, COPPER, USUAL),
        (metered(ALUMINIUM, 2.0), 310.0, ALUMINIUM, USUAL),
    ],
    ids=["locked, low", "locked, high", "no usual material", "meter, low", "meter, high"],
)
def test_a_wrong_coefficient_is_told_once_and_first(record, B, true, says):
    (finding,) = doubts(record, motor(B))
    assert (finding.id, finding.severity) == ("resistance_coefficient", "warning")
    assert says in finding.remedy
    assert f"B = {B:g} °C" in finding.message
    assert finding.values["coefficient_degC"] == pytest.approx(true, abs=5.0)


@pytest.mark.parametrize("B", [COPPER, ALUMINIUM])
@pytest.mark.parametrize("gain", [0.95, 1.0, 1.06])
def test_what_a_sensor_may_show_beside_the_mean_accuses_nobody(B, gain):
    seen = 24.0 + gain * (WINDING - 24.0)
    for record in (locked(B, seen=seen), metered(B, seen=seen)):
        ids = {one.id for one in check_record(record, motor(B))}
        assert "resistance_coefficient" not in ids


def test_a_small_rise_tells_nothing():
    little = 24.0 + 0.05 * (WINDING - 24.0)
    record = locked(seen=little, losses_W=3.0 * ohm_of(winding=little) * CURRENT**2
                    * (1.0 + 0.01 * RNG.standard_normal(LONG_S.size)))  # fmt: skip
    assert "resistance_coefficient" not in {one.id for one in check_record(record, motor(150.0))}


def test_losses_beside_the_copper_are_no_matter_of_the_material():
    ids = {one.id for one in check_record(locked(extra=0.5), motor(COPPER))}
    assert "resistance_coefficient" not in ids


def test_leads_that_stay_cold_are_named():
    record = metered(leads=0.02)
    (finding,) = doubts(record, motor(COPPER))
    (said,) = re.findall(r"lead_resistance_ohm = ([0-9.]*[0-9])", finding.remedy)
    assert float(said) == pytest.approx(0.02, abs=0.002)
    assert doubts(record, motor(COPPER, lead_resistance_ohm=0.02)) == []


def test_the_command_names_the_line_to_write(tmp_path, capsys):
    record = locked()
    table = {"t [s]": LONG_S, "I [A]": CURRENT, "P [W]": record["losses_W"],
             "T [°C]": record["winding_degC"], "room [°C]": record["ambient_degC"]}  # fmt: skip
    pd.DataFrame(table).to_csv(tmp_path / "locked.csv", index=False)
    (tmp_path / "m.toml").write_text(
        '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.047\n'
        "reference_temperature_degC = 20\nresistance_coefficient_degC = 120\n"
        '[columns]\ntime_s = "t [s]"\nphase_current_A = "I [A_rms]"\nlosses_W = "P"\n'
        'winding_degC = "T"\nambient_degC = "room"\n[constants]\nspeed_rpm = 0\n',
        encoding="utf-8",
    )
    cli.main(["check", str(tmp_path / "m.toml"), str(tmp_path / "locked.csv")])
    printed = capsys.readouterr().out
    assert "(resistance_coefficient)" in printed
    assert "(losses_below_copper)" not in printed
    assert "(standstill_losses)" not in printed
