"""However a fleet is worked out, disturbed or not, its file is the same to the last bit."""

import errno
import filecmp
import json
import os
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import psutil
import pytest
from simulated_fleet import calibrated, planned

from heatrun import cli
from heatrun.errors import InputError
from heatrun.io.caches import FolderLock
from heatrun_fleet import job
from heatrun_fleet.cluster import Workers
from heatrun_fleet.machine import Done
from heatrun_fleet.rows import Parts, read_part

pytest.importorskip("distributed")

LONGEST_S = 240.0
"""Until then a process has done what the test waits for, however busy the machine is."""


def same(finished, out):
    return filecmp.cmp(finished / "out" / "machines.parquet", out / "machines.parquet", False)


def nothing_to_work_out(batch):
    raise AssertionError(f"{[e.machine for e in batch.entries]} were worked out before")


@pytest.fixture
def no_work(monkeypatch):
    monkeypatch.setattr(job, "work_out", nothing_to_work_out)


@pytest.fixture
def kept_work(finished):
    """Work that hands over the part that each batch was worked out to before."""
    parts = Parts(finished / "out" / "parts")

    def work(batch):
        timing = json.loads(parts.timing_path(batch.name).read_bytes())
        return Done(batch.name, parts.path(batch.name).read_bytes(), timing)

    return work


@pytest.mark.parametrize("num", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_workers_give_the_same_bytes(finished, bench, tmp_path, num):
    calibrated(bench, tmp_path / "out", workers=Workers(num))
    assert same(finished, tmp_path / "out")


def test_table_and_fleet_file_give_the_same_parts(bench, tmp_path):
    by_file = [each.name for each in planned(bench)]
    lines = (bench / "machines.csv").read_text().splitlines()
    alone = [f"{lines[0]},motor", *(f"{line},motor.toml" for line in lines[1:])]
    (bench / "alone.csv").write_text("\n".join(alone) + "\n")
    assert [each.name for each in planned(bench, file="alone.csv")] == by_file
    assert len(set(by_file)) == 3


def test_a_part_is_named_by_all_that_it_depends_on(bench):
    def names(**settings):
        return [each.name for each in planned(bench, **settings)]

    before = names()
    assert names() == before
    others = [names(seed=1), names(model="first"), names(XLA_FLAGS="--other")]
    with (bench / "tests" / "M000.csv").open("a") as file:
        file.write("1200,0,0,22,22\n")
    changed = names()
    assert changed[0] != before[0]
    assert changed[1:] == before[1:]
    with (bench / "motor.toml").open("a") as file:
        file.write("# another motor file\n")
    others.append(names())
    assert all(not set(before) & set(other) for other in others)


def test_a_second_run_does_nothing(finished, bench, tmp_path, no_work):
    out = copied(finished, tmp_path)
    times = {path: path.stat().st_mtime_ns for path in out.rglob("*")}
    said: list[str] = []
    result = calibrated(bench, out, say=said.append)
    assert {path: path.stat().st_mtime_ns for path in out.rglob("*")} == times
    assert "nothing is left to do" in said[-1]
    assert result.manifest["machines"] == {"all": 6, "fitted": 6}


def test_a_grown_fleet_works_out_what_is_new(finished, bench, tmp_path, monkeypatch):
    out = copied(finished, tmp_path)
    with (bench / "machines.csv").open("a") as file:
        file.write("M900,A,tests/gone.csv,,\n")
    with pytest.raises(InputError, match="--force"):
        calibrated(bench, out)
    worked = counted(monkeypatch, job.work_out)
    calibrated(bench, out, is_replacing=True)
    assert worked == ["M900"]
    assert read_part(out / "machines.parquet").num_rows == 7


def counted(monkeypatch, work):
    """The list that the machines are added to which are worked out from now on."""
    worked: list[str] = []

    def counting(batch):
        worked.extend(entry.machine for entry in batch.entries)
        return work(batch)

    monkeypatch.setattr(job, "work_out", counting)
    return worked


def copied(finished, tmp_path):
    """A copy of the finished folder, with its times."""
    return Path(shutil.copytree(finished / "out", tmp_path / "copy"))


def test_a_damaged_part_is_worked_out_again(finished, bench, tmp_path):
    out = copied(finished, tmp_path)
    (out / "machines.parquet").unlink()
    part = sorted((out / "parts").glob("*.parquet"))[0]
    data = bytearray(part.read_bytes())
    data[len(data) // 3] ^= 0xFF
    part.write_bytes(data)
    calibrated(bench, out)
    assert same(finished, out)
    assert part.read_bytes() != bytes(data)


def test_a_full_disk_loses_nothing(finished, bench, tmp_path, monkeypatch, kept_work):
    monkeypatch.setattr(job, "work_out", kept_work)
    out = tmp_path / "out"
    written: list[str] = []
    real = job.Parts.write

    def until_full(self, name, *arguments, **settings):
        if written:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(self.path(name)))
        written.append(name)
        real(self, name, *arguments, **settings)

    with monkeypatch.context() as patch:
        patch.setattr(job.Parts, "write", until_full)
        with pytest.raises(OSError, match="No space left"):
            calibrated(bench, out)
    assert [path.stem for path in (out / "parts").glob("*.parquet")] == written
    assert not (out / "machines.parquet").exists()
    calibrated(bench, out)
    assert same(finished, out)


def test_a_file_that_changes_meanwhile_is_named(bench, tmp_path, monkeypatch, kept_work):
    real = job.work_out

    def changing(batch):
        if batch.entries[0].machine != "M002":
            return kept_work(batch)
        with (bench / "tests" / "M003.csv").open("a") as file:
            file.write("1200,0,0,22,22\n")
        return real(batch)

    monkeypatch.setattr(job, "work_out", changing)
    with pytest.raises(InputError, match=r"M003\.csv: The file was changed"):
        calibrated(bench, tmp_path / "out")
    assert len(list((tmp_path / "out" / "parts").glob("*.parquet"))) == 2


def test_a_machine_that_workers_died_on_is_tried_again(
    finished, bench, tmp_path, monkeypatch, kept_work
):
    out = tmp_path / "out"

    def dying(batch):
        done = kept_work(batch)
        return replace(done, lost=("M003",)) if "M003" in done.timing["machines"] else done

    with monkeypatch.context() as patch:
        patch.setattr(job, "work_out", dying)
        assert not calibrated(bench, out).manifest["is_whole"]
    assert len(list((out / "parts").glob("*.lost.parquet"))) == 1
    worked = counted(monkeypatch, kept_work)
    assert calibrated(bench, out).manifest["is_whole"]
    assert worked == ["M002", "M003"]
    assert not list((out / "parts").glob("*.lost.parquet"))
    assert same(finished, out)


def test_one_process_at_a_time_works_in_a_folder(bench, tmp_path):
    lock = FolderLock.take(tmp_path / "out" / "parts")
    with pytest.raises(InputError, match="another process"):
        calibrated(bench, tmp_path / "out")
    lock.release()


def test_a_folder_that_nobody_named_gets_a_number(bench, tmp_path):
    (bench / "machines.csv").write_text("machine,test\nM1,gone.csv\n")
    out = tmp_path / "fleets" / "line-3"
    first = calibrated(bench, out, is_named=False)
    assert calibrated(bench, out, is_named=False).path == first.path == out
    (bench / "machines.csv").write_text("machine,test\nM2,gone.csv\n")
    assert calibrated(bench, out, is_named=False).path == out.with_name("line-3-2")
    assert calibrated(bench, out, is_named=False, seed=1).path == out.with_name("line-3-3")


def test_the_rows_do_not_depend_on_where_the_fleet_lies(bench, tmp_path):
    (bench / "tests" / "M000.csv").write_text("t,Is\n0,1\n")
    (bench / "machines.csv").write_text("machine,test\nM0,tests/M000.csv\nM1,gone.csv\n")
    shutil.copytree(bench, tmp_path / "elsewhere" / "bench")
    for folder in (tmp_path, tmp_path / "elsewhere"):
        calibrated(folder / "bench", folder / "out")
    assert same(tmp_path, tmp_path / "elsewhere" / "out")


def test_other_things_are_left_alone(bench, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("mine")
    with pytest.raises(InputError, match="not the folder of a fleet"):
        calibrated(bench, tmp_path / "mine")
    assert [path.name for path in (tmp_path / "mine").iterdir()] == ["thesis.txt"]


@pytest.mark.parametrize("gone", ["pyarrow", "distributed"])
def test_what_is_not_installed_is_named(bench, tmp_path, monkeypatch, gone):
    from heatrun_fleet import rows

    rows.schema.cache_clear()
    monkeypatch.setitem(sys.modules, gone, None)
    with pytest.raises(InputError, match=r'pip install "heatrun\[fleet\]"'):
        calibrated(bench, tmp_path / "out", workers=Workers(2))
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_a_killed_command_goes_on(finished, bench, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "heatrun.cli", "fleet", str(bench / "FLEET.toml"), "--batch",
               "2", "--workers", "2", "--out", str(out)]  # fmt: skip
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                               stderr=subprocess.PIPE)  # fmt: skip
    children: list[psutil.Process] = []
    end = time.monotonic() + LONGEST_S
    try:
        while process.poll() is None and not list((out / "parts").glob("*.parquet")):
            assert time.monotonic() < end
            time.sleep(0.02)
        children = psutil.Process(process.pid).children(recursive=True)
    finally:
        process.send_signal(signal.SIGKILL)
        _, said = process.communicate()
    assert process.returncode == -signal.SIGKILL, said
    _, alive = psutil.wait_procs(children, timeout=LONGEST_S)
    assert not alive, "workers outlive the command"
    left = list((out / "parts").glob("*.parquet"))
    assert 1 <= len(left) < 3
    assert not (out / "machines.parquet").exists()
    times = {path: path.stat().st_mtime_ns for path in left}
    said_next: list[str] = []
    calibrated(bench, out, say=said_next.append)
    assert any("were worked out before" in sentence for sentence in said_next)
    assert {path: path.stat().st_mtime_ns for path in left} == times
    assert same(finished, out)


def test_the_command_prints_one_object(finished, bench, tmp_path, monkeypatch, capsys, no_work):
    monkeypatch.chdir(tmp_path)
    out = copied(finished, tmp_path)
    words = ["fleet", str(bench / "FLEET.toml"), "--workers", "0", "--batch", "2"]
    assert cli.main([*words, "--out", str(out), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["machines"] == {"all": 6, "fitted": 6}
    assert set(found["types"]["A"]) == {"Ceq_w", "Ceq_sr", "Req_w", "Req_sr"}
    assert cli.main([*words, "--out", str(out)]) == 0
    said = capsys.readouterr()
    assert "6 of 6 machines fitted" in said.out
    assert "nothing is left to do" in said.err


def test_a_fleet_of_which_nothing_can_be_fitted_ends_with_1(bench, tmp_path, capsys):
    (bench / "machines.csv").write_text("machine,test\nM1,gone.csv\n")
    words = ["fleet", str(bench / "FLEET.toml"), "--workers", "0", "--out", str(tmp_path / "out")]
    assert cli.main(words) == 1
    assert "gone.csv: The file cannot be opened" in capsys.readouterr().out


WRONG = {
    "belong together": ["--tls-ca", "ca.pem"],
    "leave it out": ["--scheduler", "tcp://a:1", "--workers", "2"],
    "from 1 on": ["--batch", "0"],
}


@pytest.mark.parametrize("sentence", WRONG)
def test_wrong_words_end_with_2(bench, capsys, sentence):
    assert cli.main(["fleet", str(bench / "FLEET.toml"), *WRONG[sentence]]) == 2
    assert sentence in capsys.readouterr().err
