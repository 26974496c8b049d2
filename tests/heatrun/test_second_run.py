"""A run folder that is there already, was refused, or is taken up; and the work that is told."""

import json
import time
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from heatrun import cli, jobs
from heatrun.calibration import Settings
from heatrun.commands.console import PROGRESS
from heatrun.errors import InputError
from heatrun.io.caches import PROGRAM, PROGRAMS_FOLDER
from heatrun.io.whole_files import folder_name, free_name, numbered
from heatrun.motor.file import load_motor
from heatrun.posterior.posterior import NUM_KEPT, keep
from heatrun.record.motor import Certificate, Motor
from heatrun.record.record import Record
from heatrun.runs.run_folder import RunFolder, default_folder, free_place
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

SAME, OTHER = {"seed": 1}, {"seed": 2}


def finished(path, identity, text="{}", **how):
    folder = RunFolder.begin(path, identity, **how)
    (folder.partial / "fit.json").write_text(text)
    return folder.finish({})


def test_the_name_of_a_folder_keeps_the_letters_under_their_marks():
    assert folder_name("Prüfung_01, Größe 160-both") == "prufung-01-grosse-160-both"
    assert folder_name("Échauffement n° 2") == "echauffement-n-2"
    assert folder_name("巻線") == ""
    assert len(folder_name("a" * 200)) == 80


def test_motor_and_test_of_one_name_stand_once_in_that_of_the_folder():
    test = Record("dc run", {"time_s": np.arange(3.0)})
    named = [default_folder(Motor(name=name), test, "second") for name in ("dc run", "coil")]
    assert [path.name for path in named] == ["dc-run-second", "coil-dc-run-second"]


def test_another_run_is_refused_and_the_first_stays(tmp_path):
    run = finished(tmp_path / "run", SAME, "first")
    with pytest.raises(InputError, match=r"holds another run.*pass --force to replace it"):
        RunFolder.begin(run, OTHER)
    assert (run / "fit.json").read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["run"]  # nothing begun is left
    finished(run, OTHER, "second", is_replacing=True)
    assert (run / "fit.json").read_text() == "second"


def test_the_same_run_again_takes_its_place(tmp_path):
    """As after a kill in the last moment, of which nobody knows whether it came too late."""
    run = finished(tmp_path / "run", SAME, "first")
    assert free_place(run, SAME) == run
    finished(run, SAME, "again")
    assert (run / "fit.json").read_text() == "again"


def test_a_rating_makes_another_result_and_takes_up_the_same_unfinished_run(tmp_path):
    run = finished(tmp_path / "run", SAME)
    with pytest.raises(InputError, match="holds another run"):
        RunFolder.begin(run, SAME, further=["S2-30"])
    RunFolder.begin(tmp_path / "killed", SAME, further=["S2-30"])
    assert "taking up" in RunFolder.begin(tmp_path / "killed", SAME).note


def test_an_unnamed_run_gets_the_next_number(tmp_path):
    run = tmp_path / "motor-duty-both"
    assert free_place(run, SAME) == run
    finished(run, SAME)
    assert free_place(run, OTHER) == tmp_path / "motor-duty-both-2"
    finished(tmp_path / "motor-duty-both-2", OTHER)
    assert free_place(run, OTHER) == tmp_path / "motor-duty-both-2"
    assert free_place(run, {"seed": 3}) == tmp_path / "motor-duty-both-3"
    # what is no run of heatrun is passed over too
    (tmp_path / "motor-duty-both-3").mkdir()
    assert free_place(run, {"seed": 3}) == tmp_path / "motor-duty-both-4"


def test_a_killed_run_is_taken_up_under_its_number(tmp_path):
    finished(tmp_path / "run", SAME)
    RunFolder.begin(free_place(tmp_path / "run", OTHER), OTHER)
    place = free_place(tmp_path / "run", OTHER)
    assert place == tmp_path / "run-2"
    assert "taking up the unfinished run" in RunFolder.begin(place, OTHER).note


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"identity": 3}'])
def test_a_manifest_that_says_nothing_is_another_run(tmp_path, content):
    (tmp_path / "manifest.json").write_text(content)
    with pytest.raises(InputError, match="holds another run"):
        RunFolder.begin(tmp_path, SAME)


@pytest.mark.parametrize(
    ("is_named", "is_replacing", "place"),
    [(False, False, "run-2"), (False, True, "run"), (True, True, "run"), (True, False, None)],
)
def test_a_job_asks_for_the_place_as_it_was_named(
    tmp_path, monkeypatch, is_named, is_replacing, place
):
    finished(tmp_path / "run", OTHER)
    begun = []

    class Begun(Exception):
        """So far it goes here; the rest takes minutes."""

    def begin(path, identity, **how):
        begun.append(RunFolder.begin(path, identity, **how))
        raise Begun

    monkeypatch.setattr(jobs, "RunFolder", type("Folder", (), {"begin": staticmethod(begin)}))
    asked = jobs.Place(tmp_path / "run", is_named=is_named, is_replacing=is_replacing)
    with pytest.raises(InputError if place is None else Begun):
        jobs.calibrate_into(asked, Motor("m"), [], Settings(networks=()))
    assert [folder.path.name for folder in begun] == ([] if place is None else [place])


def test_a_run_with_a_certificate_is_not_replaced_by_one_without(tmp_path, monkeypatch):
    """Only `--meta` made the difference: the digest of the motor file is the same."""
    begun = []

    def calibrate(*_, folder, **__):
        begun.append(folder)
        raise InputError("so far it goes here; the rest takes minutes")

    def begin(stated):
        machine = Motor("m", certificate=stated)
        with pytest.raises(InputError) as raised:
            jobs.calibrate_into(jobs.Place(tmp_path / "run"), machine, [], Settings(networks=()))
        return str(raised.value)

    monkeypatch.setattr(jobs, "calibrate", calibrate)
    begin(Certificate(laboratory="Bench 3"))
    (folder,) = begun
    folder.partial.mkdir()
    folder.finish({})
    assert "holds another run" in begin(Certificate())
    assert "so far it goes" in begin(Certificate(laboratory="Bench 3"))


def test_numbers_stand_before_the_ending(tmp_path):
    names = [path.name for path, _ in zip(numbered(Path("a_virtual.csv")), range(3), strict=False)]
    assert names == ["a_virtual.csv", "a_virtual-2.csv", "a_virtual-3.csv"]
    (tmp_path / "a.csv").touch()
    assert free_name(tmp_path / "a.csv").name == "a-2.csv"


def test_the_manifest_keeps_the_identity(tmp_path):
    one, two = (finished(tmp_path / name, SAME) for name in ("one", "two"))
    said = [json.loads((run / "manifest.json").read_text())["identity"] for run in (one, two)]
    assert said[0] == said[1]
    assert len(said[0]) == 64  # SHA-256 in hexadecimal digits


@pytest.mark.parametrize("num_steps", [800, 1200, 2000, 4000, 9600])
@pytest.mark.parametrize("num_walkers", [64, 66])
def test_every_walker_is_among_the_kept_draws(num_steps, num_walkers):
    """2000 steps of 64 walkers once left the draws of one walker alone."""
    walker = np.broadcast_to(np.arange(num_walkers), (2, num_steps, num_walkers))
    kept = keep(walker)
    count = np.bincount(kept.ravel(), minlength=num_walkers)
    assert np.all(count == count[0])
    assert NUM_KEPT <= kept.size <= 1.1 * NUM_KEPT


def test_rows_are_walker_by_walker_and_even_in_time():
    step = np.broadcast_to(np.arange(2000)[:, None], (2, 2000, 64))
    track = keep(step)[0, : keep(step).shape[1] // 64]
    assert np.all(np.diff(track) == np.diff(track)[0])
    assert np.diff(track)[0] > 0


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
    before, share = work.left_s(), said[-1][1]
    work.at("sample", "500 of 1000 steps")
    assert work.left_s() == before
    work.at("sample", "500 of 5000 steps", 0.1)  # more is to be done than was thought
    assert work.left_s() > 2.0 * before
    assert said[-1][1] >= share


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


def test_a_part_that_takes_another_way_is_planned_anew():
    clock = Clock()
    work, said = told({"fit": 30.0, "sample": 5.0, "write": 3.0}, clock)
    work.at("fit", "fitting")
    clock.now = 30.0
    work.done("fit", "fitted")
    for clock.now in range(31, 60):
        work.at("sample", "importance sampling")
    assert said[-1][1] > 0.85
    work.replan("sample", 60.0, "MCMC instead")
    assert said[-1][1] < 0.6
    for clock.now in range(70, 210, 10):  # the steps take five times as long as was planned
        work.at("sample", "MCMC", (clock.now - 60.0) / 300.0)
    # half of it is done: as much is left
    assert work.left_s() == pytest.approx(150.0, rel=0.2)
    assert 0.5 < said[-1][1] < 0.85


def test_where_nothing_was_compiled_before_no_time_is_promised(tmp_path, monkeypatch):
    monkeypatch.setenv(PROGRAMS_FOLDER, str(tmp_path))
    said = []
    for _ in range(2):
        work = work_of_calibration(["first"], 1, "quick", lambda *words: said.append(words[0]))
        work.at(("first", "fit"), "least squares")
        (tmp_path / f"fit{PROGRAM}").touch()
    assert (
        said[0] == "least squares; the first run compiles its programs, which takes about a minute"
    )
    assert said[1].startswith("least squares; usually")


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


def test_what_is_told_is_of_the_row_that_takes_longest():
    clock = Clock()
    work, said = told({("a", "draw"): 10.0, ("b", "draw"): 60.0, "write": 5.0}, clock)
    work.at("write", "reading")
    work.at(("b", "draw"), "b: drawing")
    work.at(("a", "draw"), "a: drawing")
    clock.now = 10.0
    work.done(("a", "draw"), "a: done")
    assert said[-1][0].startswith("b: drawing; about")
    work.done(("b", "draw"), "b: done")
    work.at("write", "writing")
    assert said[-1][0].startswith("writing;")


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
    rated = work_of_calibration(networks, 2, "quick", print, num_ratings=3)
    assert rated.left_s() > quick + 10.0
    assert list(rated.usual_s)[-3] == ("second", "ratings")  # behind the predictions
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
    assert lines[0]["share"] < 0.1  # a busy machine may take 0.1 s to get there
    assert lines[-1] == {"share": 1.0, "doing": "done"}
