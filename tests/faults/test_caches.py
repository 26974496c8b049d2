"""The caches: bounded, repaired, and not needed; one process at a time in a folder."""

import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from heatrun.errors import InputError
from heatrun.io import caches as folder_lock
from heatrun.io.caches import IN_PLACE, PROGRAM, FolderLock, keep_below

COMPILE = """
import sys
from heatrun.io.caches import use_caches
use_caches(lambda sentence: print("said:", sentence))
import numpy as np
from heatrun.io import programs
import heatrun.model.noise as noise

print("value:", noise.Noise(*np.array([0.2, 40.0, 0.05, 0.0])).total())
print(dict(programs.COUNTS), programs.UNKEPT)
"""


def said_by(program: str, home: Path, *options: str, **more: str) -> tuple[str, str]:
    """Return what a process says with its caches under a folder."""
    environment = {k: v for k, v in os.environ.items() if k != "JAX_COMPILATION_CACHE_DIR"}
    words = [sys.executable, *options, "-c", program]
    env = {**environment, "XDG_CACHE_HOME": str(home), **more}
    done = subprocess.run(words, capture_output=True, text=True, check=False, env=env)
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


def compiled(home: Path, **more: str) -> tuple[str, str]:
    """Return what a process says that compiles a function."""
    return said_by(COMPILE, home, **more)


def entries(home: Path) -> list[Path]:
    return list((home / "heatrun" / "programs").glob(f"*{PROGRAM}"))


@pytest.fixture(scope="module")
def filled(tmp_path_factory) -> Path:
    """Return a home in which one program is kept."""
    home = tmp_path_factory.mktemp("home")
    out, _ = compiled(home)
    assert "value: 0.19" in out
    assert "{'compiled': 1}" in out
    return home


def test_a_program_that_was_kept_is_not_compiled_again(filled):
    out, err = compiled(filled)
    assert "value: 0.19" in out
    assert "{'loaded': 1}" in out
    assert not err


@pytest.mark.parametrize(
    "damage",
    [lambda old: old[: len(old) // 2], lambda old: b"", lambda old: old[:99] + b"x" + old[100:]],
    ids=["cut", "empty", "changed"],
)
def test_a_damaged_program_is_replaced_without_a_word(damage, filled):
    (path,) = entries(filled)
    whole = path.read_bytes()
    damaged = damage(whole)
    path.write_bytes(damaged)
    out, err = compiled(filled)
    assert "{'compiled': 1}" in out
    assert not err
    assert "said" not in out
    assert len(path.read_bytes()) > len(whole) // 2
    assert path.read_bytes() != damaged


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="no owners of files")
def test_a_program_that_others_may_write_is_not_run(filled):
    (path,) = entries(filled)
    assert path.stat().st_mode & 0o077 == 0
    path.chmod(0o666)
    out, _ = compiled(filled)
    assert "{'compiled': 1}" in out
    assert path.stat().st_mode & 0o077 == 0  # the new one


def test_another_processor_or_flag_has_its_own_programs(filled):
    before = set(entries(filled))
    out, _ = compiled(filled, JAX_NUM_CPU_DEVICES="2")
    assert "{'compiled': 1}" in out
    for path in set(entries(filled)) - before:
        path.unlink()


def test_programs_that_cannot_be_written_are_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    out, err = compiled(tmp_path, JAX_COMPILATION_CACHE_DIR=str(tmp_path / "file" / "programs"))
    assert "value: 0.19" in out
    assert "Not a directory" in out
    assert not err


def test_a_cache_folder_that_cannot_be_made_is_a_note(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "temporary").mkdir()
    left = tmp_path / "temporary" / f"of_a_killed_process{IN_PLACE}"
    left.mkdir()
    home, temporary = tmp_path / "file" / "cache", {"TMPDIR": str(tmp_path / "temporary")}
    out, err = compiled(home, **temporary)
    assert "value: 0.19" in out
    assert "cannot be made (Not a directory): this run does without the cache" in out
    assert out.count("said") == 1
    assert err == ""
    assert not list((tmp_path / "temporary").iterdir())
    # what ArviZ makes when it is loaded once ended a calibration after its fit
    program = "from heatrun.io.caches import use_caches\nuse_caches(print)\n"
    program += "import arviz, matplotlib\nmatplotlib.get_cachedir()"
    assert said_by(program, home, "-W", "ignore", **temporary)[1] == ""
    assert not list((tmp_path / "temporary").iterdir())


def test_the_folder_of_compilations_stays_below_its_bound(tmp_path):
    for number in range(10):
        path = tmp_path / f"f-{number}{PROGRAM}"
        path.write_bytes(bytes(100))
        os.utime(path, (1000 + number, 1000 + number))
    os.utime(tmp_path / "f-0.program", (2000, 1000))  # read since
    (tmp_path / "mine").write_bytes(bytes(1000))
    keep_below(tmp_path, 350)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "f-0.program", "f-8.program", "f-9.program", "mine",
    ]  # fmt: skip
    keep_below(tmp_path / "nowhere", 350)


def test_a_command_keeps_the_bound_at_its_start(tmp_path):
    folder = tmp_path / "heatrun" / "programs"
    folder.mkdir(parents=True)
    with (folder / "old-1.program").open("wb") as file:
        file.truncate(300_000_000)  # takes no room
    compiled(tmp_path)
    assert not (folder / "old-1.program").exists()
    assert entries(tmp_path)


HOLD = """
import sys, time
from pathlib import Path
from heatrun.io import caches as folder_lock
if sys.argv[2] == "path":
    folder_lock.fcntl = None
lock = folder_lock.FolderLock.take(Path(sys.argv[1]))
print("held", flush=True)
sys.stdin.read()
"""


@pytest.fixture(params=["folder", "path"])
def way(request, monkeypatch, tmp_path) -> str:
    """The lock of POSIX systems, and the one that Windows gets, with its files in `tmp_path`."""
    if request.param == "path":
        monkeypatch.setattr(folder_lock, "fcntl", None)
        monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    elif folder_lock.fcntl is None:
        pytest.skip("folders cannot be locked here")
    return request.param


@pytest.fixture
def other(way, tmp_path):
    """Another process that holds `tmp_path / "run"` until its standard input ends."""
    process = subprocess.Popen(
        [sys.executable, "-c", HOLD, str(tmp_path / "run"), way],
        env={**os.environ, "TMPDIR": str(tmp_path), "TEMP": str(tmp_path)},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert process.stdout.readline() == "held\n"
    yield process
    process.kill()
    process.communicate()


def test_a_second_process_is_told_and_the_hold_ends_with_a_kill(other, tmp_path):
    run = tmp_path / "run"
    assert not FolderLock.is_free(run)
    with pytest.raises(InputError, match="another process is writing this run") as refused:
        FolderLock.take(run)
    assert refused.value.where == str(run)
    assert "--out" in refused.value.remedy
    other.kill()
    other.wait()
    assert FolderLock.is_free(run)
    lock = FolderLock.take(run)
    assert not FolderLock.is_free(run)
    lock.release()
    lock.release()
    assert FolderLock.is_free(run)


def test_who_waits_gets_the_folder_when_the_other_process_ends(other, tmp_path):
    taken: list[FolderLock] = []
    wait = threading.Thread(
        target=lambda: taken.append(FolderLock.take(tmp_path / "run", waits=True)), daemon=True
    )
    wait.start()
    wait.join(0.3)
    assert wait.is_alive()
    other.communicate("")
    wait.join(20)
    assert len(taken) == 1
    taken[0].release()


@pytest.mark.usefixtures("way")
def test_two_folders_are_two_locks_and_nothing_is_left_in_them(tmp_path):
    first, second = tmp_path / "a" / "run", tmp_path / "b" / "run"
    locks = [FolderLock.take(first), FolderLock.take(second)]
    with pytest.raises(InputError):
        FolderLock.take(first)
    renamed = first.replace(tmp_path / "a" / "done")  # a held folder can take another name
    for lock in locks:
        lock.release()
    assert [list(folder.iterdir()) for folder in (renamed, second)] == [[], []]
    assert not FolderLock.is_free(Path(tmp_path / "none"))


def test_a_lock_that_is_forgotten_is_let_go(way, tmp_path):
    FolderLock.take(tmp_path / "run")
    assert FolderLock.is_free(tmp_path / "run")
