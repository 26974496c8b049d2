"""Progress in the units of the work: the share never goes back, 1 means done, the rest is told."""

from __future__ import annotations

import json
import time
from itertools import pairwise
from pathlib import Path

import pandas as pd
import pytest

from heatrun import cli
from heatrun.commands.console import PROGRESS
from heatrun.motor.file import load_motor
from heatrun.work import (
    MOST_BEFORE_DONE,
    SILENT,
    TICK_S,
    Work,
    in_words,
    work_of_calibration,
    work_of_discovery,
)
from heatrun_reports.job import make_report

DATA = Path(__file__).parents[2] / "data" / "synthetic"


class Clock:
    """A clock that is set by hand [s]."""

    now = 0.0

    def __call__(self):
        return self.now


def told(usual, clock):
    said = []
    return Work(usual, lambda *words: said.append(words), clock), said


def test_there_is_an_estimate_from_the_start_and_it_follows_this_machine():
    clock = Clock()
    work, said = told({"fit": 20.0, "sample": 60.0, "write": 20.0}, clock)
    work.at("fit", "least squares")
    assert said == [("least squares; usually 2 min in all", 0.0)]  # 100 s
    clock.now = 60.0  # three times as long as usual
    work.done("fit", "fitted")
    # (60 + 5)/(20 + 5) = 2.6 times as long for the 80 s that are left: 208 s
    assert work.left_s() == pytest.approx(208.0)
    assert said[-1] == ("fitted; about 3 min left", pytest.approx(60.0 / 268.0))
    clock.now = 150.0  # half of it in 90 s: 45 s more by its own pace, as much by the usual one
    work.at("sample", "500 of 1000 steps", 0.5)
    slower = (150.0 + 5.0) / (50.0 + 5.0)
    sample = 0.5 * (90.0 + 0.5 * 60.0 * slower)
    assert work.left_s() == pytest.approx(sample + 20.0 * slower)
    before = work.left_s()
    work.at("sample", "before", 0.1)
    assert work.left_s() == before  # never back


def test_what_is_left_moves_while_nobody_tells_anything():
    clock = Clock()
    work, said = told({"search": 20.0, "write": 5.0}, clock)
    work.at("search", "searching")
    lefts, shares = [], []
    for clock.now in range(10, 300, 10):
        work.at("search", "searching")
        lefts.append(work.left_s())
        shares.append(said[-1][1])
    assert all(later > earlier for earlier, later in pairwise(shares))
    assert all(later != earlier for earlier, later in pairwise(lefts))
    # fifteen times as long as usual: so will be what comes after it
    assert lefts[-1] > 5.0 * 290.0 / 20.0
    assert shares[-1] < 1.0


def test_networks_go_on_beside_each_other_and_what_comes_last_behind_them():
    clock = Clock()
    parts = {("a", "fit"): 10.0, ("a", "draw"): 10.0, ("b", "fit"): 30.0, "write": 5.0}
    work, _ = told(parts, clock)
    assert work.left_s() == pytest.approx(30.0 + 5.0)
    work.at(("a", "fit"), "fitting")
    work.at(("b", "fit"), "fitting")
    clock.now = 10.0
    work.at(("a", "draw"), "drawing")  # so the fit is done
    clock.now = 20.0
    work.done(("a", "draw"))
    work.done(("b", "fit"))
    assert work.left_s() == pytest.approx(5.0 * (40.0 + 5.0) / (50.0 + 5.0))


def test_the_time_left_is_told_by_the_clock_until_the_work_ends():
    said = []
    work = Work({"compile": 30.0}, lambda *words: said.append(words))

    def fails():
        with work:
            work.at("compile", "compiling")
            end = time.monotonic() + 120.0
            while len(said) < 2 and time.monotonic() < end:
                time.sleep(0.1 * TICK_S)
            raise KeyError

    with pytest.raises(KeyError):
        fails()
    assert len(said) >= 2
    assert len({share for _, share in said}) == len(said)
    num = len(said)
    time.sleep(1.5 * TICK_S)
    assert len(said) == num


def test_one_means_done_and_is_said_once():
    clock = Clock()
    work, said = told({"a": 1.0, "b": 1.0}, clock)
    clock.now = 2.0
    work.done("a", "a")
    clock.now = 3.0
    work.done("b", "b")
    assert said[-1][1] == MOST_BEFORE_DONE
    work.finish()
    assert said[-1] == ("done", 1.0)


def test_nobody_need_listen():
    SILENT.at("anything", "said")
    SILENT.done("anything", "said")
    SILENT.finish()


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.2, "5 s"), (12, "10 s"), (54, "50 s"), (58, "1 min"), (200, "3 min"), (9000, "2.5 h")],
)
def test_durations_as_one_says_them(seconds, words):
    assert in_words(seconds) == words


def test_a_quick_job_is_planned_shorter():
    networks = ["first", "second"]
    quick, full = (work_of_calibration(networks, 2, m, print).left_s() for m in ("quick", "emcee"))
    assert quick < full
    quick, full = (
        work_of_discovery("second", 2, method, print).left_s() for method in ("quick", "emcee")
    )
    assert quick < full


@pytest.fixture
def bench_day(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table = pd.read_csv(DATA / "step_30min.csv.gz").iloc[::10]
    (tmp_path / "tests").mkdir()
    for name in ("a", "b", "c"):
        table.to_csv(f"tests/{name}.csv", index=False)
    return load_motor(DATA / "motor.toml")


def test_the_reports_of_a_folder_are_counted(bench_day):
    said = []
    make_report("general", bench_day, [Path("tests")], Path("out"),
                progress=lambda *words: said.append(words))  # fmt: skip
    sentences = dict.fromkeys(words.partition(";")[0] for words, _ in said)
    assert list(sentences) == ["report 1 of 3", "report 2 of 3", "report 3 of 3", "done"]
    shares = [share for _, share in said]
    assert shares == sorted(shares)
    assert (shares[0], shares[-1]) == (pytest.approx(0.0, abs=0.01), 1.0)


def test_a_program_reads_lines_of_json_that_end_with_done(bench_day, monkeypatch, capsys):
    monkeypatch.setenv(PROGRESS, "json")
    words = ["report", "--type", "general", str(DATA / "motor.toml"), "tests/a.csv", "--json"]
    assert cli.main(words) == 0
    printed = capsys.readouterr()
    json.loads(printed.out)  # and nothing else
    lines = [json.loads(line) for line in printed.err.splitlines() if line.startswith("{")]
    assert lines[0]["share"] < 0.01
    assert lines[-1] == {"share": 1.0, "doing": "done"}
