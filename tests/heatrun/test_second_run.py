"""A second result never replaces a first in silence: runs, and names with numbers."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from heatrun.calibration import Settings
from heatrun.errors import InputError
from heatrun.io.whole_files import free_name, numbered
from heatrun.jobs import calibrate as jobs
from heatrun.record.motor import Certificate, Motor
from heatrun.runs.run_folder import RunFolder, free_place

SAME, OTHER = {"seed": 1}, {"seed": 2}


def finished(path, identity, text="{}", **how):
    folder = RunFolder.begin(path, identity, **how)
    (folder.partial / "fit.json").write_text(text)
    return folder.finish({})


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
