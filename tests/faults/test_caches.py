"""The caches: bounded, repaired, and not needed."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from heatrun.io.caches import IN_PLACE, keep_below

COMPILE = """
import sys
from heatrun.io.caches import damaged_are_replaced, use_caches
use_caches(lambda sentence: print("said:", sentence))
import jax, jax.numpy as jnp
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
hits = []
jax.monitoring.register_event_listener(
    lambda name, **_: hits.append(name) if name.endswith("/cache_hits") else None)

@jax.jit
def course(x):
    return jnp.sin(x) * 2.0 + 1.0

with damaged_are_replaced(lambda sentence: print("said:", sentence)):
    print("value:", float(course(0.0)))
print("hits:", len(hits))
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


def entries(home: Path) -> dict[str, bytes]:
    folder = home / "heatrun" / "jax"
    return {path.name: path.read_bytes() for path in folder.glob("jit_course-*-cache")}


@pytest.fixture(scope="module")
def kept(tmp_path_factory):
    """A home in which the function was compiled once: the keys of the cache know its place."""
    home = tmp_path_factory.mktemp("kept")
    compiled(home)
    return home


@pytest.mark.parametrize(
    "damage",
    [lambda old: old[: len(old) // 2], lambda old: b"", lambda old: old[:99] + b"x" + old[100:]],
    ids=["cut", "empty", "changed"],
)
def test_a_damaged_compilation_is_replaced_without_a_word(damage, kept):
    ((name, whole),) = entries(kept).items()
    path = kept / "heatrun" / "jax" / name
    path.write_bytes(damage(whole))
    out, err = compiled(kept)
    assert "value: 1.0" in out
    assert "Error reading" not in err
    assert "said" not in out
    assert len(path.read_bytes()) > len(whole) // 2
    replaced = path.read_bytes()
    out, _ = compiled(kept)
    assert path.read_bytes() == replaced
    assert "hits: 0" not in out


def test_compilations_that_cannot_be_written_are_one_sentence(tmp_path):
    (tmp_path / "file").write_text("")
    out, err = compiled(tmp_path, JAX_COMPILATION_CACHE_DIR=str(tmp_path / "file" / "jax"))
    assert "value: 1.0" in out
    assert "Traceback" not in err
    assert "Warning" not in err


def test_a_cache_folder_that_cannot_be_made_is_a_note(tmp_path):
    (tmp_path / "file").write_text("")
    (tmp_path / "temporary").mkdir()
    left = tmp_path / "temporary" / f"of_a_killed_process{IN_PLACE}"
    left.mkdir()
    home, temporary = tmp_path / "file" / "cache", {"TMPDIR": str(tmp_path / "temporary")}
    out, err = compiled(home, **temporary)
    assert "value: 1.0" in out
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
        path = tmp_path / f"jit_f-{number}-cache"
        path.write_bytes(bytes(100))
        os.utime(path, (1000 + number, 1000 + number))
    os.utime(tmp_path / "jit_f-0-cache", (2000, 1000))  # read since
    (tmp_path / "mine").write_bytes(bytes(1000))
    keep_below(tmp_path, 350)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "jit_f-0-cache", "jit_f-8-cache", "jit_f-9-cache", "mine",
    ]  # fmt: skip
    keep_below(tmp_path / "nowhere", 350)


def test_a_command_keeps_the_bound_at_its_start(tmp_path):
    folder = tmp_path / "heatrun" / "jax"
    folder.mkdir(parents=True)
    with (folder / "jit_old-1-cache").open("wb") as file:
        file.truncate(300_000_000)  # takes no room
    compiled(tmp_path)
    assert not (folder / "jit_old-1-cache").exists()
    assert entries(tmp_path)
