"""What the live view reads off and writes: cursors, colours, time axis, windows of a motor file."""

import os
import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.record.record import Record
from heatrun_view.gate import replace_inside
from heatrun_view.linked import Plots, Told
from heatrun_view.look import DARK, LIGHT, Screen
from heatrun_view.motor_text import (
    windows_of,
    windows_text,
    with_window,
    without_window,
    write_windows,
)
from heatrun_view.store import Opened, Stamp
from heatrun_view.tabs.signals import Cutting, shifts_of
from heatrun_view.trace import Trace, colours, cursor_table, dashes, spoken, unit_of

MOTOR = b"""# bench 3\r
[motor]\r
name = "x"   # keep me\r
\r
[tests."duty 30"]  # cold start\r
mask = [[1, 2]]\r
use = [[1, 2], # not ]\r
  [3, 4]]  # tail\r
[winding]\r
material = "copper"  \r
"""


def _trace(test: str, channel: str, unit: str | None = None, num: int = 100) -> Trace:
    time_s = np.arange(float(num))
    return Trace.of(test, channel, time_s, 2.0 * time_s, unit)


def _plots(traces) -> Plots:
    told = Told(lambda update: None, lambda time_s, is_second: None, lambda start, end: None)
    return Plots(traces, [], LIGHT, 600, told)


def test_windows_are_replaced_and_nothing_else():
    after = write_windows(MOTOR, "duty 30", [(0.0, 10.5), (20.0, 30.0)], "motor.toml")
    cut = b"use = [[1, 2], # not ]\r\n  [3, 4]]"
    assert after == MOTOR.replace(cut, b"use = [[0, 10.5], [20, 30]]")
    assert windows_of(after, "duty 30", "motor.toml") == [(0.0, 10.5), (20.0, 30.0)]


def test_windows_of_a_new_test_go_to_the_end():
    for name in ("step", "a.b", 'Prüfung "1"', "#x"):
        after = write_windows(MOTOR, name, [(5.0, 6.0)], "motor.toml")
        assert after.startswith(MOTOR)
        assert b"\n" not in after.replace(b"\r\n", b"")
        assert tomllib.loads(after.decode())["tests"][name] == {"use": [[5, 6]]}
    bare = b"[motor]\nname = 'x'\n[tests.step]"
    assert write_windows(bare, "step", [(5.0, 6.0)], "m") == bare + b"\nuse = [[5, 6]]\n"


@pytest.mark.parametrize(
    "rest", ["[tests]\nstep = {use = [[1, 2]]}", "[tests]\nstep.use = [[1, 2]]",
             "[tests.step]\nuse_rows = [[1, 2]]", "[tests]\nstep = 3"]
)  # fmt: skip
def test_a_form_that_cannot_be_changed_alone_is_refused(rest):
    with pytest.raises(InputError):
        write_windows(f"[motor]\nname = 'x'\n{rest}\n".encode(), "step", [(5.0, 6.0)], "m")


def test_windows_are_read_as_the_fit_reads_them():
    def of(rest: str, name: str = "step"):
        return windows_of(f"[motor]\nname = 'x'\n{rest}\n".encode(), name, "motor.toml")

    times = "[tests.step]\nuse = [['10 min', '0.5 h'], [3600, '90 min']]"
    assert of(times) == [(600.0, 1800.0), (3600.0, 5400.0)]
    assert of("[tests.step]\nmask = [[1, 2]]") == of(times, "duty") == of("") == []
    with pytest.raises(InputError, match=r"\[tests\.step\].*use_rows"):
        of("[tests.step]\nuse_rows = [[1, 500]]")
    with pytest.raises(InputError, match="Expected a list of 1 to 200 pairs"):
        of("[tests.step]\nuse = [1, 2]")


def test_windows_join_and_are_left_out():
    assert with_window([(0.0, 10.0), (20.0, 30.0)], (8.0, 20.0)) == [(0.0, 30.0)]
    assert with_window([(20.0, 30.0)], (0.0, 10.0)) == [(0.0, 10.0), (20.0, 30.0)]
    assert without_window([(0.0, 30.0)], (10.0, 20.0)) == [(0.0, 10.0), (20.0, 30.0)]
    assert without_window([(0.0, 5.0), (6.0, 9.0)], (4.0, 20.0)) == [(0.0, 4.0)]
    assert windows_text("duty 30", [(0.0, 1.25)]) == '[tests."duty 30"]\nuse = [[0, 1.25]]\n'


def test_a_file_is_replaced_inside_the_folder_alone(tmp_path):
    root = tmp_path / "shown"
    root.mkdir()
    motor, outside = root / "motor.toml", tmp_path / "outside.toml"
    motor.write_bytes(b"old")
    outside.write_bytes(b"old")
    motor.chmod(0o640)
    replace_inside(root, motor, b"old", b"new")
    assert motor.read_bytes() == b"new"
    assert motor.stat().st_mode & 0o777 == 0o640
    with pytest.raises(InputError, match="changed meanwhile"):
        replace_inside(root, motor, b"old", b"newer")
    (root / "link.toml").symlink_to(outside)
    for path in (root / "link.toml", outside, root / ".." / "outside.toml"):
        with pytest.raises(InputError, match="in the folder"):
            replace_inside(root, path, b"old", b"new")
    assert outside.read_bytes() == b"old"
    assert sorted(os.listdir(root)) == ["link.toml", "motor.toml"]


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_the_form_cuts_and_writes(tmp_path):
    motor = tmp_path / "motor.toml"
    motor.write_bytes(MOTOR)
    form = Cutting(SimpleNamespace(motor_path=motor, root=tmp_path))
    record = Record("step", {"time_s": np.arange(1000.0)})
    form.offer([Opened(record, tmp_path / "step.csv", Stamp(1, 1))], {})
    form.select(900.04, -5.0)
    form._leave.clicks += 1
    form.select(100.0, 200.0)
    assert form._windows == [(900.0, 999.0)]
    form._keep.clicks += 1
    assert motor.read_bytes() == MOTOR
    form._write.clicks += 1
    assert "Written into motor.toml" in form._result.object
    assert windows_of(motor.read_bytes(), "step", "m") == [(100.0, 200.0), (900.0, 999.0)]
    form.offer([Opened(record, tmp_path / "step.csv", Stamp(1, 1))], {"step": 50.0})
    form.select(150.0, 250.0)  # shown 50 s later than in its own time
    assert form._selected == (100.0, 200.0)
    sent = Cutting(SimpleNamespace(motor_path=motor, root=tmp_path / "elsewhere"))
    sent.offer([Opened(record, tmp_path / "step.csv", Stamp(1, 1))], {})
    sent.select(1.0, 2.0)
    sent._keep.clicks += 1
    written = motor.read_bytes()
    sent._write.clicks += 1
    assert "was sent to the page" in sent._result.object
    assert motor.read_bytes() == written


@pytest.mark.filterwarnings("ignore::PendingDeprecationWarning")
def test_windows_that_were_changed_elsewhere_are_not_written_over(tmp_path):
    motor = tmp_path / "motor.toml"
    motor.write_bytes(b"[motor]\nname = 'x'\n[tests.step]\nuse = [['1 min', '2 min']]\n")
    form = Cutting(SimpleNamespace(motor_path=motor, root=tmp_path))
    record = Record("step", {"time_s": np.arange(1000.0)})
    form.offer([Opened(record, tmp_path / "step.csv", Stamp(1, 1))], {})
    form.select(500.0, 600.0)
    form._keep.clicks += 1
    assert form._windows == [(60.0, 120.0), (500.0, 600.0)]
    theirs = motor.read_bytes().replace(b"'2 min'", b"'3 min'")
    motor.write_bytes(theirs)
    form._write.clicks += 1
    assert "have changed in the motor file" in form._result.object
    assert motor.read_bytes() == theirs
    assert form._windows == [(60.0, 180.0)]
    form._keep.clicks += 1
    form._write.clicks += 1
    form._leave.clicks += 1
    form._write.clicks += 1  # again, over what the form has written itself
    assert windows_of(motor.read_bytes(), "step", "m") == [(60.0, 180.0)]


def test_two_cursors_give_the_difference_of_every_signal():
    traces = [_trace("a", "winding_degC"), _trace("a", "oil [bar]", "bar")]
    html = cursor_table(traces, 10.2, 40.0, 7200.0)
    assert "0.497 min (29.80 s)" in html
    assert html.count("<td class='number'>60</td>") == 2  # 80 at 40 s less 20 at 10 s
    assert "°C" in html
    assert np.isnan(traces[0].at(500.0))
    assert cursor_table(traces, None, None, 60.0) == ""


def test_a_signal_has_its_colour_in_every_choice_and_of_several_tests_each_has_one():
    num = len(LIGHT.palette)
    assert len(DARK.palette) == num
    alone = colours([_trace("b", "magnet_degC")], num)
    names = ("ambient_degC", "magnet_degC", "winding_degC", "coolant_degC")
    among = colours([_trace("a", name) for name in names], num)
    assert among[1] == alone[0]
    assert len(set(among)) == 4
    both = [_trace(test, name) for name in (*names, "losses_W") for test in "ab"]
    assert colours(both, num) == [0, 1] * 5
    drawn = dict(zip([trace.channel for trace in both[::2]], dashes(both)[::2], strict=True))
    assert drawn["losses_W"] == drawn["magnet_degC"] == "solid"  # which a fast signal needs
    assert len({drawn[name] for name in names}) == 4
    assert dashes(both)[::2] == dashes(both)[1::2]
    first, _ = drawn_in = [*_plots(both)._figures.values()]
    assert len(first.legend) == 2  # of tests and of signals, over no curve
    assert all(legend in plot.above for plot in drawn_in for legend in plot.legend)
    others = [_trace("a", f"column {n}", "bar") for n in range(num)]
    assert len(set(colours(others, num))) == num
    assert colours([others[0]], num) == colours([_trace("z", "column 0", "bar")], num)


def test_time_is_in_the_unit_that_suits():
    assert [unit_of(span)[1] for span in (60.0, 600.0, 5400.0, 20_000.0)] == [
        "s",
        "min",
        "min",
        "h",
    ]
    assert spoken(750.0, 5400.0) == "12.500 min (750.00 s)"
    assert spoken(7.5, 60.0) == "7.50 s"


def test_a_window_at_the_end_goes_with_a_growing_test():
    plots = _plots([_trace("a", "winding_degC")])
    plots.grow([_trace("a", "winding_degC", num=151)])
    assert plots.window == (0.0, 150.0)
    plots.move_to(130.0, 150.0)
    plots.grow([_trace("a", "winding_degC", num=171)])
    assert plots.window == (150.0, 170.0)
    plots.move_to(20.0, 40.0)
    plots.grow([_trace("a", "winding_degC", num=201)])
    assert plots.window == (20.0, 40.0)
    assert plots.x_range.reset_end == 200.0
    assert plots.x_range.bounds[1] > 200.0


@pytest.mark.parametrize(
    "told", [None, [], [1, 2, 3], "xxxx", [1, -5, 900, 0], [1, 10**9, 900, 0], [1, 2.5, 900, 0]]
)
def test_what_no_browser_tells_is_not_taken(told):
    assert Screen.of(told) is None


def test_the_browser_tells_its_colours_and_size():
    assert Screen.of([1, 1400, 900, 0]) == Screen(DARK, 1400, 900, False)
    assert Screen.of([0, 50, 50, 1]) == Screen(LIGHT, 200, 200, True)


def test_two_prototypes_are_laid_on_one_clock():
    rng = np.random.default_rng(5)
    time_s = np.arange(0.0, 1800.0, 0.5)

    def record(name: str, start_s: float) -> Record:
        t = time_s + start_s
        speed = 3000.0 + 1500.0 * np.sign(np.sin(2 * np.pi * (t / 310.0 + (t / 900.0) ** 2)))
        noisy = speed + 20.0 * rng.standard_normal(t.size)
        return Record(name, {"time_s": time_s, "speed_rpm": noisy, "torque_Nm": noisy / 50.0})

    shifts, said = shifts_of([record("bench", 0.0), record("<road>", 42.0)])
    assert shifts["<road>"] == pytest.approx(42.0, abs=1.0)
    assert "&lt;road&gt;" in said
    still = Record("still", {"time_s": time_s, "speed_rpm": rng.standard_normal(time_s.size)})
    shifts, said = shifts_of([record("bench", 0.0), still])
    assert shifts == {}
    assert "one manoeuvre" in said
    assert "--offset" not in said  # the page has no options
