"""One process at a time in a folder: its own lock, or on Windows a file that stands for it."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import pytest

from heatrun.errors import InputError
from heatrun.io import caches as folder_lock
from heatrun.io.caches import FolderLock

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
