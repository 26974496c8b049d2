"""Full disks and memory, taken folders, clocks and Ctrl-C: said in words, nothing lost."""

import gzip
import json
import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from heatrun import cli
from heatrun.commands.console import printable
from heatrun.errors import InputError
from heatrun.io.whole_files import write_whole
from heatrun.runs.run_folder import RunFolder, listed_anew, read_listed

DATA = Path(__file__).parents[2] / "data" / "synthetic"
IDENTITY = {"motor": "m", "seed": 1}
NOBODY = 65534
FIT = {"format": "heatrun-fit/1", "models": {}}


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Motor file and the bundled 30-minute duty at 1 Hz."""
    folder = tmp_path_factory.mktemp("inputs")
    (folder / "motor.toml").write_bytes((DATA / "motor.toml").read_bytes())
    with gzip.open(DATA / "duty_30min.csv.gz", "rt") as file:
        lines = file.read().splitlines()
    (folder / "duty.csv").write_text("\n".join([lines[0], *lines[1::10]]) + "\n")
    return folder


def words(inputs, out, *more):
    return [sys.executable, "-m", "heatrun.cli", "calibrate", str(inputs / "motor.toml"),
            str(inputs / "duty.csv"), "--model", "second", "--quick", "--out", str(out),
            *more]  # fmt: skip


def result_of(run):
    return json.loads(read_listed(run, "fit.json"))


def made(path, identity=IDENTITY):
    folder = RunFolder.begin(path, identity, is_replacing=True)
    folder.write_json("fit.json", FIT)
    return folder.finish({"format": "heatrun-run/1"})


def test_two_runs_into_one_folder_are_refused(tmp_path):
    first = RunFolder.begin(tmp_path / "run", IDENTITY)
    first.write_json("fit.json", FIT)
    for other in (IDENTITY, {"seed": 2}):
        with pytest.raises(InputError, match=r"another process is writing.*another --out"):
            RunFolder.begin(tmp_path / "run", other)
    assert result_of(first.finish({})) == FIT
    again = RunFolder.begin(tmp_path / "run", {"seed": 2}, is_replacing=True)
    assert result_of(tmp_path / "run") == FIT
    assert again.note == ""


def test_an_unfinished_run_is_taken_up_or_dropped_with_a_word(tmp_path):
    path = tmp_path / "run"
    RunFolder.begin(path, IDENTITY).write_json("fit.json", FIT)
    same = RunFolder.begin(path, IDENTITY)
    assert "taking up" in same.note
    assert (same.partial / "fit.json").is_file()
    del same
    other = RunFolder.begin(path, {"seed": 2})
    assert "its inputs, settings or versions were others" in other.note
    assert not (other.partial / "fit.json").exists()


def test_a_folder_of_that_name_that_is_not_ours_is_left_alone(tmp_path):
    mine = tmp_path / "run.partial"
    mine.mkdir()
    (mine / "precious.txt").write_text("keep me")
    with pytest.raises(InputError, match="no unfinished run"):
        RunFolder.begin(tmp_path / "run", IDENTITY)
    assert (mine / "precious.txt").read_text() == "keep me"


def test_a_changed_result_is_refused(tmp_path):
    run = made(tmp_path / "run")
    (run / "fit.json").write_text(json.dumps({**FIT, "seed": 3}))
    with pytest.raises(InputError, match="SHA-256"):
        result_of(run)
    (run / "manifest.json").write_bytes(listed_anew(run, run))
    assert result_of(run)["seed"] == 3


@pytest.mark.parametrize("name", ["fit.json", "manifest.json"])
def test_a_cut_run_is_refused(name, tmp_path):
    run = made(tmp_path / "run")
    content = (run / name).read_bytes()
    for length in range(len(content) - 1):
        (run / name).write_bytes(content[:length])
        with pytest.raises(InputError):
            result_of(run)


def ended(words, **more):
    """What came of a process."""
    return subprocess.run(words, capture_output=True, text=True, check=False, **more)


def in_process(program):
    return ended([sys.executable, "-c", program])


def test_a_file_that_does_not_fit_leaves_the_old_one_and_no_piece(tmp_path):
    path = tmp_path / "file"
    write_whole(path, b"old")
    program = (
        "import resource, pathlib\n"
        "from heatrun.io.whole_files import write_whole\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (1000, 1000))\n"
        f"write_whole(pathlib.Path({str(path)!r}), bytes(5000))\n"
    )
    done = in_process(program)
    assert "File too large" in done.stderr
    assert path.read_bytes() == b"old"
    assert [p.name for p in tmp_path.iterdir()] == ["file"]


@pytest.mark.skipif(os.getuid() != 0, reason="only root can become another user")
def test_a_read_only_folder_and_an_unreadable_file_are_said(tmp_path, inputs):
    tmp_path.chmod(0o755)
    for parent in tmp_path.parents[:3]:
        parent.chmod(0o755)
    secret = tmp_path / "secret.csv"
    secret.write_bytes((inputs / "duty.csv").read_bytes())
    secret.chmod(0o000)
    program = (
        "import pathlib\n"
        "from heatrun.readers.read import read_record\n"
        "from heatrun.errors import InputError\n"
        "from heatrun.runs.run_folder import RunFolder\n"
        "import os\n"
        f"os.setuid({NOBODY})\n"  # root may write and read everywhere
        f"for job in (lambda: RunFolder.begin(pathlib.Path({str(tmp_path / 'run')!r}), {{}}),\n"
        f"            lambda: read_record({str(secret)!r})):\n"
        "    try:\n"
        "        job()\n"
        "    except InputError as error:\n"
        "        print(error)\n"
    )
    done = in_process(program)
    assert "the run folder cannot be written: Permission denied" in done.stdout
    assert "cannot be opened (Permission denied)" in done.stdout


def test_a_disk_that_is_full_is_a_message_with_a_way_on(monkeypatch, capsys, tmp_path, inputs):
    def full(*_):
        raise OSError(28, "No space left on device", str(tmp_path / "x"))

    monkeypatch.setattr("heatrun.checks.check_record", full)
    assert cli.main(["check", str(inputs / "motor.toml"), str(inputs / "duty.csv"), "--json"]) == 1
    captured = capsys.readouterr()
    assert "No space left on device" in json.loads(captured.out)["error"]["problem"]
    assert "the same command goes on" in captured.err
    assert "Traceback" not in captured.err


def test_draws_that_do_not_fit_on_the_disk_do_not_end_the_process(tmp_path):
    """HDF5 itself, left to write to a full disk, once ended it with signal 11."""
    program = (
        "import pathlib, resource, numpy, xarray\n"
        "from heatrun.runs import netcdf as archive\n"
        "draws = xarray.Dataset({'a': ('draw', numpy.random.default_rng(1).normal(size=9000))})\n"
        "tree = xarray.DataTree.from_dict({'posterior': draws})\n"
        "archive.groups = lambda *_: tree\n"
        "resource.setrlimit(resource.RLIMIT_FSIZE, (20_000, 20_000))\n"
        f"archive.write(None, pathlib.Path({str(tmp_path / 'posterior.nc')!r}))\n"
    )
    done = in_process(program)
    assert done.returncode == 1, done.stderr
    assert done.stderr.strip().endswith("OSError: [Errno 27] File too large")
    assert list(tmp_path.iterdir()) == []


def test_output_that_cannot_be_written_is_said(inputs):
    check = [sys.executable, "-m", "heatrun.cli", "check", str(inputs / "motor.toml"),
             str(inputs / "duty.csv")]  # fmt: skip
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [*check, "--json"], stdout=full, stderr=subprocess.PIPE, text=True, check=False
        )
    assert done.returncode == 1
    assert "No space left on device" in done.stderr
    assert "Traceback" not in done.stderr
    assert "Exception ignored" not in done.stderr


def test_an_interrupt_ends_with_130_and_a_word(inputs, tmp_path):
    calibrate = words(inputs, tmp_path / "run")
    with heard():
        command = subprocess.Popen(calibrate, stderr=subprocess.PIPE, text=True)
    assert command.stderr is not None
    said = ""
    for line in command.stderr:
        said += line
        if "least squares" in line:
            break
    time.sleep(0.5)
    command.send_signal(signal.SIGINT)
    said += command.communicate()[1]
    assert command.returncode == 130
    assert "interrupted; the same command resumes" in said
    assert "Traceback" not in said
    assert [p.name for p in tmp_path.iterdir()] == ["run.partial"]


def test_an_interrupt_after_the_work_changes_nothing():
    program = (
        "import atexit, os, signal, sys\n"
        "from heatrun import cli\n"
        "atexit.register(lambda: os.kill(os.getpid(), signal.SIGINT))\n"
        "sys.argv = ['heatrun', 'check', '/nowhere.toml', 'x.csv']\n"
        "sys.exit(cli.main())\n"
    )
    with heard():
        done = in_process(program)
    assert done.returncode == 1
    assert "Traceback" not in done.stderr
    assert "KeyboardInterrupt" not in done.stderr


def test_a_clock_that_runs_backwards_changes_no_result(tmp_path, monkeypatch):
    moment = iter(range(2_000_000_000, 0, -1000))
    monkeypatch.setattr(time, "time", lambda: float(next(moment)))
    run = made(tmp_path / "run")
    os.utime(run / "fit.json", (0, 0))
    assert result_of(run) == FIT
    assert result_of(made(tmp_path / "run", {"seed": 2})) == FIT


def test_text_from_files_cannot_steer_the_terminal():
    assert printable("\x1b[2J\x07\u202etest\u2028") == r"\x1b[2J\x07\u202etest\u2028"


@contextmanager
def heard():
    """A shell in the background lets its children ignore the interrupt; here they do not.

    Not by `preexec_fn`, which forks: JAX may run in this process.
    """
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@pytest.mark.slow
def test_a_run_on_a_full_disk_stops_with_a_word_and_goes_on(inputs, tmp_path):
    command = words(inputs, tmp_path / "run")
    # the draws take 360 kB
    limited = ["bash", "-c", 'ulimit -f 195; exec "$@"', "bash", *map(str, command)]
    full = ended(limited)
    assert full.returncode == 1, full.stderr
    assert "could not be read or written" in full.stderr
    assert "Traceback" not in full.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["run.partial"]
    again = ended(command)
    assert again.returncode == 0, again.stderr
    assert "taking up the unfinished run" in again.stderr
    assert [p.name for p in tmp_path.iterdir()] == ["run"]
    assert result_of(tmp_path / "run")["models"].keys() == {"second"}


def raising(error):
    def run(options):
        raise error

    return run


CHECK = ["check", "motor.toml", "test.csv"]


def test_the_sentence_about_memory_needs_no_more_of_it(monkeypatch, capsys):
    monkeypatch.setattr("heatrun.commands.check.run", raising(MemoryError))
    # a package that is loaded at this point ends in a traceback: there is no room for it
    monkeypatch.setitem(sys.modules, "heatrun.runs.run_folder", None)
    assert cli.main([*CHECK, "--json"]) == 1
    printed = capsys.readouterr()
    assert "more memory than there is" in json.loads(printed.out)["error"]["problem"]
    assert "more memory than there is" in printed.err


def test_a_package_for_which_there_is_no_room_is_said_so(monkeypatch, capsys):
    no_room = ImportError("libjax_common.so: failed to map segment from shared object")
    monkeypatch.setattr("heatrun.commands.check.run", raising(no_room))
    assert cli.main(CHECK) == 1
    assert "more memory than there is" in capsys.readouterr().err
    not_there = ImportError("No module named 'pyarrow'")
    monkeypatch.setattr("heatrun.commands.check.run", raising(not_there))
    with pytest.raises(ImportError, match="pyarrow"):
        cli.main(CHECK)
