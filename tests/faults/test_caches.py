"""The caches: bounded, repaired, and not needed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from heatrun.io.caches import IN_PLACE, PROGRAM, keep_below

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


def compiled(home: Path, **more: str) -> tuple[str, str]:
    """Return what a process says that compiles a function with its caches under a folder."""
    environment = {k: v for k, v in os.environ.items() if k != "JAX_COMPILATION_CACHE_DIR"}
    done = subprocess.run(
        [sys.executable, "-c", COMPILE],
        capture_output=True,
        text=True,
        check=False,
        env={**environment, "XDG_CACHE_HOME": str(home), **more},
    )
    assert done.returncode == 0, done.stderr
    return done.stdout, done.stderr


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
    path.write_bytes(damage(whole))
    out, err = compiled(filled)
    assert "{'compiled': 1}" in out
    assert not err
    assert "said" not in out
    assert len(path.read_bytes()) > len(whole) // 2
    out, _ = compiled(filled)
    assert "{'loaded': 1}" in out


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
    program = (
        "from heatrun.io.caches import use_caches\nuse_caches(print)\nimport arviz, matplotlib\n"
    )
    done = subprocess.run(
        [sys.executable, "-W", "ignore", "-c", program + "matplotlib.get_cachedir()"],
        capture_output=True,
        text=True,
        check=False,
        env={**os.environ, "XDG_CACHE_HOME": str(home), **temporary},
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
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
