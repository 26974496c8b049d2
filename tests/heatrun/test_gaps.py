"""Parts of tests: gaps, cuts, masks and restarts of the logger."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from heat_runs import MOTOR, at, edited, heat_run, named
from run_near_truth import run_near_truth

from heatrun.checks import check_record
from heatrun.cli import main
from heatrun.errors import InputError
from heatrun.motor.file import parse_motor
from heatrun.readers.joined import parts_of, read_test, read_tests, read_whole_test
from heatrun.record.motor import PartsOfTest
from heatrun.record.reduction import reduce
from heatrun.record.stretch import Stretch, cut, mask, split_stretch
from heatrun.runs.run import open_run
from heatrun.runs.write import motor_text

FROM_S, TO_S = 1500.0, 2220.0
NEVER_OFF = heat_run(currents=(120.0,) * 5, minutes=60.0, step_s=1.0)
STOPPED = heat_run(currents=(120.0, 120.0, 0.0, 120.0, 120.0), minutes=60.0, step_s=1.0)
OTHER_LOAD = heat_run(currents=(140.0, 140.0, 140.0, 60.0, 60.0), minutes=60.0, step_s=1.0)
COOLS = heat_run(currents=(140.0, 140.0, 0.0, 0.0, 0.0), minutes=60.0, step_s=1.0)


def restarted(record, from_s=FROM_S, to_s=TO_S):
    """The record without what lies between two times [s]."""
    return at(record, (record.time_s <= from_s) | (record.time_s >= to_s))


def saying(load):
    text = f'[motor]\nname = "M"\n[tests.run.gap]\nload = "{load}"\n'
    return replace(MOTOR, tests=parse_motor(text.encode(), "motor.toml").tests)


@pytest.mark.parametrize(
    ("record", "load", "severity", "num_parts", "level"),
    [
        (NEVER_OFF, None, "warning", 1, 1.0),  # it goes on as it was
        (COOLS, None, "warning", 1, 0.0),
        (STOPPED, None, "warning", 2, None),  # one load on both sides, a colder winding
        (OTHER_LOAD, None, "warning", 2, None),
        (STOPPED, "zero", "note", 1, 0.0),
        (OTHER_LOAD, "held", "note", 1, 1.0),
        (NEVER_OFF, "unknown", "note", 2, None),
    ],
)
def test_both_sides_of_a_gap_are_kept(record, load, severity, num_parts, level):
    whole = restarted(record)
    motor = saying(load) if load else MOTOR
    parts = parts_of(whole, motor, at_gaps=True)
    assert len(parts) == num_parts
    kept = np.concatenate([one.time_s[np.isfinite(one["winding_degC"])] for one in parts])
    assert np.array_equal(kept, whole.time_s)
    found = [f for one in parts for f in check_record(one, motor)]
    (gap,) = [f for f in found if f.id == "time_gap"]
    assert gap.severity == severity
    assert (gap.values["from_s"], gap.values["to_s"]) == (FROM_S, TO_S)
    assert {f.severity for f in found} <= {"note", "warning"}
    assert not {"nan_block", "cut_while_warm", "start_not_in_equilibrium"} & {f.id for f in found}
    if level is not None:
        before = whole.time_s[whole.time_s <= FROM_S][-60:]
        held = whole["losses_W"][np.isin(whole.time_s, before)].mean()
        test = reduce(parts[0], motor)
        middle = (np.arange(test.inputs.num_time) + 0.5) * float(test.inputs.step)
        inside = (middle > FROM_S + 4.0) & (middle < TO_S - 4.0)
        np.testing.assert_allclose(np.asarray(test.inputs.losses)[inside], level * held, atol=3.0)
        assert test.count[(test.time > FROM_S + 30.0) & (test.time < TO_S - 30.0)].sum() == 0


@pytest.mark.parametrize("record", [NEVER_OFF, STOPPED])
def test_each_line_that_is_offered_answers_the_finding(record):
    whole = restarted(record)
    for part in parts_of(whole, MOTOR, at_gaps=True):
        for finding in named(check_record(part, MOTOR), "time_gap"):
            lines = re.findall(r'\[tests\.run\.gap\] load = "(\w+)"', finding.remedy)
            assert len(lines) == 2
            for load in lines:
                motor = saying(load)
                again = [f for one in parts_of(whole, motor, at_gaps=True)
                         for f in named(check_record(one, motor), "time_gap")]  # fmt: skip
                assert [f.severity for f in again] == ["note"]


def test_a_short_gap_stays_as_it_is_unless_its_load_is_stated():
    whole = restarted(NEVER_OFF, 1500.0, 1560.0)
    (part,) = parts_of(whole, MOTOR, at_gaps=True)
    assert part is whole
    (part,) = parts_of(whole, saying("zero"), at_gaps=True)
    assert part.time_s.size == whole.time_s.size + 2


def test_one_record_is_wanted_where_a_test_is_driven():
    whole = restarted(OTHER_LOAD)
    assert parts_of(whole, MOTOR) == (whole,)
    (part,) = parts_of(whole, saying("held"))
    assert part.masks == ((FROM_S + 1.0, TO_S - 1.0),)


def test_parts_that_are_used_are_bridged_and_masked_too():
    whole = restarted(NEVER_OFF)
    use = parse_motor(
        b'[motor]\nname = "M"\n[tests.run]\nuse_rows = [[301, 2000]]\nmask = [[600, 660]]\n'
        b'gap.load = "held"\n',
        "motor.toml",
    )
    motor = replace(MOTOR, tests=use.tests)
    (part,) = parts_of(whole, motor, at_gaps=True)
    assert (part.time_s[0], part.time_s.size) == (300.0, 1702)
    assert set(part.masks) == {(FROM_S + 1.0, TO_S - 1.0), (600.0, 660.0)}
    assert not named(check_record(part, motor), "nan_block")


def test_a_clock_that_is_wrong_is_no_gap():
    back = edited(NEVER_OFF, "time_s", 2000.0, 4000.0, lambda time_s: time_s - 900.0)
    assert parts_of(back, MOTOR, at_gaps=True) == (back,)


def test_what_is_stated_of_a_gap_goes_with_the_run():
    motor = replace(MOTOR, tests={"run": PartsOfTest(gap_load="zero")})
    assert parse_motor(motor_text(motor), "again").tests == motor.tests


@pytest.mark.parametrize("line", ['gap.load = "off"', 'gap = "held"', "gap = {}", "gap.loads = 1"])
def test_what_is_no_load_of_a_gap_is_refused(line):
    text = f'[motor]\nname = "M"\n[tests.run]\n{line}\n'
    with pytest.raises(InputError, match=r'gap\.load = "held", "zero" or "unknown"'):
        parse_motor(text.encode(), "motor.toml")


HEAD = '[motor]\nname = "M"\n[winding]\nphase_resistance_ohm = 0.01\n'


def machine(text: str = ""):
    return parse_motor(f"{HEAD}{text}".encode(), "motor.toml")


@pytest.fixture
def lab(tmp_path):
    """A folder with `drive.csv`: 3601 samples at 1 s, a warm-up of 40 K in an hour."""
    time_s = np.arange(3601.0)
    table = pd.DataFrame(
        {
            "time_s": time_s,
            "phase_current_A": np.where(time_s < 300, 0.0, 80.0),
            "losses_W": np.where(time_s < 300, 0.0, 400.0),
            "ambient_degC": 22.0 + 0.001 * np.sin(time_s),
            "winding_degC": 22.0 + 40.0 * (1.0 - np.exp(-np.maximum(time_s - 300, 0) / 900.0)),
        }
    )
    table.to_csv(tmp_path / "drive.csv", index=False, float_format="%.5f")
    (tmp_path / "motor.toml").write_text(HEAD, encoding="utf-8")
    return tmp_path


def findings(record, motor, name):
    return [found for found in check_record(record, motor) if found.id == name]


@pytest.mark.parametrize(
    ("suffix", "first_s", "last_s"),
    [
        ("600s..1800s", 600, 1800),
        ("600..1800", 600, 1800),
        ("10min..0.5h", 600, 1800),
        ("..10 min", 0, 600),
        ("50 min..", 3000, 3600),
        ("row 1..row 100", 0, 99),
        ("row 3500..", 3499, 3600),
    ],
)
def test_a_stretch_behind_the_file_keeps_its_times(lab, suffix, first_s, last_s):
    record = read_test(f"{lab / 'drive.csv'}@{suffix}", machine())
    assert record.time_s[0] == first_s
    assert record.time_s[-1] == last_s
    assert record.name == "drive"
    again = read_test(f"{lab / 'drive.csv'}@{record.stretch}", machine())
    np.testing.assert_array_equal(again["winding_degC"], record["winding_degC"])


@pytest.mark.parametrize(
    ("suffix", "said"),
    [
        ("1800s..600s", "ends before it begins"),
        ("5000s..6000s", "holds no sample"),
        ("ten..60", "'ten'"),
        ("row 5..600s", "Expected a row"),
        ("-5s..60s", "'-5s'"),
    ],
)
def test_what_is_no_stretch_is_refused(lab, suffix, said):
    with pytest.raises(InputError, match=said):
        read_test(f"{lab / 'drive.csv'}@{suffix}", machine())


def test_a_file_of_that_name_is_the_file(lab):
    named = lab / "drive@1..2.csv"
    (lab / "drive.csv").rename(named)
    assert read_test(named, machine()).time_s.size == 3601


@pytest.mark.parametrize(
    ("text", "test", "stretch"),
    [
        ("drive.csv@10min..90min", "drive.csv", "10min..90min"),
        ("a.csv+b.csv@10Hz@..60", "a.csv+b.csv@10Hz", "..60"),
        ("a.csv+b.csv@10Hz", "a.csv+b.csv@10Hz", ""),
        ("rig@bench/../drive.csv", "rig@bench/../drive.csv", ""),  # a path, no stretch
    ],
)
def test_a_test_and_the_stretch_behind_it(text, test, stretch):
    assert split_stretch(text) == (test, stretch)


def test_use_of_one_stretch(lab):
    record = read_test(lab / "drive.csv", machine("[tests.drive]\nuse = [[600, 1800]]\n"))
    assert (record.name, record.time_s[0], record.time_s[-1]) == ("drive", 600, 1800)
    assert any("1201 of 600s..1800s" in note for note in record.notes)


def test_several_stretches_are_tests_of_their_own(lab):
    motor = machine('[tests.drive]\nuse = [[0, 900], ["20 min", "1 h"]]\n')
    records = read_tests(lab / "drive.csv", motor)
    assert [(r.name, r.time_s[0], r.time_s[-1]) for r in records] == [
        ("drive_1", 0, 900),
        ("drive_2", 1200, 3600),
    ]
    with pytest.raises(InputError, match="2 stretches"):
        read_test(lab / "drive.csv", motor)
    assert read_whole_test(lab / "drive.csv", motor).time_s.size == 3601
    part = read_test(f"{lab / 'drive.csv'}@{records[1].stretch}", motor)
    np.testing.assert_array_equal(part.time_s, records[1].time_s)


def test_another_test_is_left_alone(lab):
    record = read_test(lab / "drive.csv", machine("[tests.other]\nuse = [[600, 1800]]\n"))
    assert record.time_s.size == 3601


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("use = [600, 1800]", "list of 1 to 200 pairs"),
        ("use = []", "list of 1 to 200 pairs"),
        ("use = [[600, 1800, 2]]", "list of 1 to 200 pairs"),
        ("use = [[1800, 600]]", "ends before"),
        ("use = [[-1, 600]]", "seconds from 0"),
        ("use = [[true, 600]]", "seconds from 0"),
        ("use = [[nan, 600]]", "seconds from 0"),
        ("use_rows = [[0, 600]]", "whole number from 1"),
        ("use_rows = [[1.5, 600]]", "whole number from 1"),
        ("use = [[0, 600]]\nuse_rows = [[1, 600]]", "Both use and use_rows"),
        ('mask = [[0, ""]]', "seconds from 0"),
        ('mask = [["row 1", "row 600"]]', "Expected a time such as 600s"),
        ('use = [["row 1", "row 600"]]', "use_rows"),
        ('use = [["ten", 600]]', "'ten'"),
        ("uses = [[0, 600]]", "uses"),
    ],
)
def test_parts_that_make_no_sense_are_refused_in_the_motor_file(text, said):
    with pytest.raises(InputError, match=said) as error:
        machine(f"[tests.drive]\n{text}\n")
    assert "[tests.drive]" in str(error.value)


def test_masked_readings_are_not_compared_and_no_finding(lab):
    plain = read_test(lab / "drive.csv", machine())
    motor = machine("[tests.drive]\nmask = [[1000, 1599]]\n")
    record = read_test(lab / "drive.csv", motor)
    assert np.isnan(record["winding_degC"]).sum() == 600
    np.testing.assert_array_equal(record["phase_current_A"], plain["phase_current_A"])
    assert not findings(record, motor, "nan_block")
    before, after = reduce(plain, machine()), reduce(record, motor)
    inside = (before.time > 1000) & (before.time < 1599)
    is_whole = inside & (np.abs(before.time - 1000) > 20) & (np.abs(before.time - 1599) > 20)
    assert not after.is_observed[is_whole].any()
    assert after.is_observed[~inside].all()
    np.testing.assert_array_equal(after.inputs.losses, before.inputs.losses)


def test_a_mask_belongs_to_the_part_that_it_lies_in(lab):
    motor = machine("[tests.drive]\nuse = [[0, 1999], [2000, 3600]]\nmask = [[1000, 1599]]\n")
    one, two = read_tests(lab / "drive.csv", motor)
    assert one.masks == ((1000.0, 1599.0),)
    assert sum("not compared" in note for note in one.notes) == 1
    assert two.masks == ()
    assert not any("not compared" in note for note in two.notes)
    assert np.isnan(one["winding_degC"]).sum() == 600
    assert not np.isnan(two["winding_degC"]).any()
    (asked,) = read_tests(f"{lab / 'drive.csv'}@2000..3600", motor)
    assert asked.masks == ()
    both = machine("[tests.drive]\nuse = [[0, 1299], [1200, 3600]]\nmask = [[1250, 1599]]\n")
    assert [part.masks for part in read_tests(lab / "drive.csv", both)] == [
        ((1250.0, 1599.0),), ((1250.0, 1599.0),),
    ]  # fmt: skip


def test_missing_readings_outside_a_mask_are_still_told(lab):
    table = pd.read_csv(lab / "drive.csv")
    table.loc[2000:2400, "winding_degC"] = np.nan
    table.to_csv(lab / "drive.csv", index=False)
    motor = machine("[tests.drive]\nmask = [[1000, 1599]]\n")
    found = findings(read_test(lab / "drive.csv", motor), motor, "nan_block")
    assert [one.severity for one in found] == ["error"]
    assert "[tests.drive] mask = [[1000.0, 1599.0], [2000.0, 2400.0]]" in found[0].remedy


def test_lines_that_hold_a_time_alone_are_a_gap(lab):
    table = pd.read_csv(lab / "drive.csv")
    values = [name for name in table.columns if name != "time_s"]
    table.loc[[300, *range(1500, 2201)], values] = np.nan
    table.to_csv(lab / "drive.csv", index=False)
    motor = machine("[tests.drive]\nmask = [[1600, 1700]]\n")  # within it
    found = [one for part in read_tests(lab / "drive.csv", motor)
             for one in check_record(part, motor)]  # fmt: skip
    (gap,) = [one for one in found if one.id == "time_gap"]
    assert (gap.values["from_s"], gap.values["to_s"]) == (1499.0, 2201.0)
    assert {one.severity for one in found if one.id == "nan_block"} == {"note"}


@pytest.mark.parametrize(("num_missing", "severity"), [(15, "note"), (60, "error")])
def test_blanked_readings_shorter_than_a_block_are_no_error(lab, num_missing, severity):
    table = pd.read_csv(lab / "drive.csv")
    for first in range(400, 3400, 200):
        table.loc[first : first + num_missing - 1, "winding_degC"] = np.nan
    table.to_csv(lab / "drive.csv", index=False)
    found = findings(read_test(lab / "drive.csv", machine()), machine(), "nan_block")
    assert [one.severity for one in found] == [severity]


def test_a_mask_over_the_start_is_refused(lab):
    with pytest.raises(InputError, match="from which the temperatures start"):
        read_test(lab / "drive.csv", machine("[tests.drive]\nmask = [[0, 60]]\n"))
    with pytest.raises(InputError, match="holds no sample"):
        read_test(lab / "drive.csv", machine("[tests.drive]\nmask = [[5000, 6000]]\n"))


@pytest.mark.parametrize(
    ("id", "key", "change", "sizes"),
    [
        # the reading that stands still until 300 s is left out by the same line
        ("time_gap", "use", lambda t: t[(t.time_s < 1500) | (t.time_s > 2200)], [1199, 1400]),
        ("time_backwards", "use_rows",
         lambda t: t.assign(time_s=t.time_s.where(t.time_s < 2000, t.time_s - 2000)),
         [1699, 1601]),
    ],
    ids=["a gap", "a clock that was set back"],
)  # fmt: skip
def test_what_a_finding_advises_can_be_done(lab, id, key, change, sizes):
    path = lab / "my drive.csv"
    change(pd.read_csv(lab / "drive.csv")).to_csv(path, index=False)
    (found,) = findings(read_whole_test(path, machine()), machine(), id)
    assert found.severity == "error"
    advice = found.remedy[found.remedy.index("[tests") :].removesuffix(" in the motor file.")
    section, _, lines = advice.partition(f" {key} ")
    motor = machine(f"{section}\n{key} {lines}\n")
    parts = read_tests(path, motor)
    assert [part.time_s.size for part in parts] == sizes
    for part in parts:
        assert not findings(part, motor, id)


@pytest.mark.parametrize("used", ["use_rows = [[401, 3401]]", "use = [[400, 1999]]"])
def test_a_clock_that_was_set_back_within_a_part_is_split_there(lab, used):
    table = pd.read_csv(lab / "drive.csv")
    late = table.time_s >= 2000
    table.assign(time_s=table.time_s.where(~late, table.time_s - 700)).to_csv(
        lab / "drive.csv", index=False
    )
    given = machine(f"[tests.drive]\n{used}\n")
    (found,) = findings(read_test(lab / "drive.csv", given), given, "time_backwards")
    (lines,) = re.findall(r"use_rows = \[\[.*\]\]", found.remedy)
    assert ("in place of use" in found.remedy) == ("rows" not in used)
    parts = read_tests(lab / "drive.csv", machine(f"[tests.drive]\n{lines}\n"))
    assert [part.first_row for part in parts] == [401, 2001]
    assert [part.time_s[0] for part in parts] == [400.0, 1300.0]
    assert all((np.diff(part.time_s) > 0.0).all() for part in parts)


def test_from_and_until_on_the_command_line(lab, capsys):
    arguments = ["check", str(lab / "motor.toml"), str(lab / "drive.csv"), "--json"]
    main([*arguments, "--from", "5min", "--until", "3000"])
    content = json.loads(capsys.readouterr().out)
    (sampling,) = [one for one in content["findings"] if one["id"] == "sampling"]
    assert sampling["values"]["num_samples"] == 2701
    assert "@5min..3000" in content["next"]
    assert main([*arguments[:2], f"{arguments[2]}@0..60", "--from", "5min"]) == 2
    assert main([*arguments[:2], str(lab), "--from", "5min"]) == 2


def test_a_path_with_an_at_sign_names_no_part(lab, capsys):
    path = f"{lab}/rig@bench/../drive.csv"
    assert main(["check", str(lab / "motor.toml"), path, "--from", "5min"]) == 1
    assert "names its part already" not in capsys.readouterr().err


def test_loads_run_straight_over_a_bridge_and_temperatures_stay(lab):
    table = pd.read_csv(lab / "drive.csv")
    table.loc[1500:1502, "losses_W"] = 65535.0
    table.to_csv(lab / "drive.csv", index=False)
    motor = machine()
    (spike,) = findings(read_test(lab / "drive.csv", motor), motor, "load_spike")
    assert spike.values["from_s"] == 1500.0
    line = spike.remedy.partition("bridge = ")[2].partition(" in the")[0]
    assert line == "[[1500.0, 1502.0]]"
    motor = machine(f"[tests.drive]\nbridge = {line}\n")
    record = read_test(lab / "drive.csv", motor)
    assert findings(record, motor, "load_spike") == []
    np.testing.assert_array_equal(record["losses_W"][1498:1505], 400.0)
    np.testing.assert_array_equal(record["winding_degC"], table["winding_degC"])
    assert any("interpolated" in note for note in record.notes)


def test_a_load_of_another_clock_is_moved_over_what_both_cover(lab):
    table = pd.read_csv(lab / "drive.csv")
    late = table.copy()
    of_load = [name for name in ("losses_W", "phase_current_A") if name in table]
    late[of_load] = table[of_load].shift(20).bfill()
    late.to_csv(lab / "drive.csv", index=False)
    record = read_test(lab / "drive.csv", machine("[tests.drive]\nload_offset = -20.0\n"))
    assert record.time_s[-1] == late["time_s"].iloc[-1] - 20.0
    for name in of_load:
        np.testing.assert_array_equal(record[name], table[name][:-20])
    np.testing.assert_array_equal(record["winding_degC"], table["winding_degC"][:-20])
    assert any("moved by -20 s" in note for note in record.notes)
    with pytest.raises(InputError, match="no time in common"):
        read_test(lab / "drive.csv", machine("[tests.drive]\nload_offset = 1e6\n"))


def test_a_stated_offset_joins_two_loggers_in_place_of_the_estimate(lab):
    table = pd.read_csv(lab / "drive.csv")
    of_load = [name for name in ("losses_W", "phase_current_A") if name in table]
    table.drop(columns=of_load).to_csv(lab / "temps.csv", index=False)
    load = table.loc[table["time_s"] >= 7.0, ["time_s", *of_load]]  # counted from its first sample
    load.to_csv(lab / "load.csv", index=False)
    motor = machine("[tests.temps]\nload_offset = 7.0\n")
    record = read_test(f"{lab}/temps.csv+{lab}/load.csv", motor)
    assert any("7.00 s" in note and "given" in note for note in record.notes)
    same = np.interp(record.time_s, table["time_s"], table["losses_W"])
    assert np.mean(np.abs(record["losses_W"] - same) < 1.0) > 0.99


@pytest.mark.parametrize("window", ["[[9000, 9100]]", "[[0, 3600]]"])
def test_a_bridge_needs_samples_inside_and_outside(lab, window):
    with pytest.raises(InputError, match="bridge"):
        read_test(lab / "drive.csv", machine(f"[tests.drive]\nbridge = {window}\n"))


BEGIN_S = 1800.0


def test_a_record_that_is_run_through_has_a_narrower_band_than_one_that_is_cut(
    tmp_path, bench, generator
):
    run = open_run(run_near_truth(tmp_path / "run", MOTOR, bench(generator.duty(600.0), seed=20)))
    whole = bench(generator.duty(3600.0), seed=21, name="warm")
    found = {}
    for how, record in (
        ("cut", cut(whole, Stretch(BEGIN_S), "test")),
        ("mask", mask(whole, [(60.0, BEGIN_S)], "test")),
    ):
        prediction = run.predict(record, motor=MOTOR)
        later = (prediction.time_s > BEGIN_S + 60.0) & prediction.test.is_observed
        low, high = prediction.total["95"]
        inside = (prediction.test.measured >= low) & (prediction.test.measured <= high)
        found[how] = (np.mean(inside[later]), np.mean((high - low)[later]), later.sum())
    assert found["mask"][2] == found["cut"][2]
    assert found["mask"][1] < 0.6 * found["cut"][1]
    assert found["mask"][0] > 0.85  # 95 % of 87 blocks, some of them alike
    assert found["cut"][0] > 0.85


def test_the_model_has_a_course_where_nothing_was_read(tmp_path, bench, generator):
    """The winding was drawn at 0 degC in a gap."""
    run = open_run(run_near_truth(tmp_path / "run", MOTOR, bench(generator.duty(600.0), seed=20)))
    whole = bench(generator.duty(3600.0), seed=21, name="warm")
    prediction = run.predict(mask(whole, [(900.0, BEGIN_S)], "test"), motor=MOTOR)
    blank = ~prediction.test.is_observed
    assert blank.sum() > 10
    before = prediction.time_s < 900.0
    whole = run.predict(whole, motor=MOTOR)
    for masked, read in ((prediction.median, whole.median), *zip(
            prediction.total["95"], whole.total["95"], strict=True)):  # fmt: skip
        assert np.max(np.abs(masked - read)[before]) < 1.0
        assert np.max(np.abs(masked - read)[blank]) < 1.0
