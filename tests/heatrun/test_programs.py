"""Programs that are kept: under what name, and what they are made anew for."""

import os
import subprocess
import sys
import threading
from dataclasses import dataclass, replace
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from heatrun.io import ahead, programs
from heatrun.io.caches import PROGRAM
from heatrun.io.programs import compiled
from heatrun.model.network_text import network_named


@dataclass(frozen=True)
class Law:
    """Compiled in."""

    power: int
    names: tuple[str, ...] = ("a", "b")


@compiled("law")
def bent(law: Law, x, scale=2.0):
    return {"values": scale * x**law.power, "total": jnp.sum(x)}


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """Return an empty folder of programs; the process has none in its memory either."""
    monkeypatch.setenv("JAX_COMPILATION_CACHE_DIR", str(tmp_path / "programs"))
    programs.forget()
    programs.COUNTS.clear()
    return tmp_path / "programs"


def test_what_comes_back_is_what_was_compiled(folder):
    x = np.linspace(0.0, 2.0, 5)
    first = bent(Law(3), x)
    programs.forget()
    again = bent(Law(3), x, scale=2.0)
    assert dict(programs.COUNTS) == {"compiled": 1, "loaded": 1}
    np.testing.assert_array_equal(again["values"], 2.0 * x**3)
    assert jax.tree.structure(first) == jax.tree.structure(again)


def test_each_shape_and_each_value_compiled_in_has_a_program_of_its_own(folder):
    x = np.linspace(0.0, 2.0, 5)
    for law, values in ((Law(2), x), (Law(3), x), (Law(3, ("c",)), x), (Law(3), x[:4])):
        np.testing.assert_allclose(bent(law, values)["values"], 2.0 * values**law.power)
    np.testing.assert_allclose(bent(Law(3), jnp.asarray(x), 1.0)["values"], x**3)  # as the second
    assert dict(programs.COUNTS) == {"compiled": 4}
    assert len(list(folder.glob(f"*{PROGRAM}"))) == 4


def test_inside_another_function_it_is_traced(folder):
    x = np.linspace(0.0, 2.0, 5)
    slope = jax.grad(lambda x: bent(Law(2), x)["values"].sum())(x)
    np.testing.assert_allclose(slope, 4.0 * x)
    assert not programs.COUNTS


def test_what_no_text_stands_for_is_compiled_and_not_kept(folder):
    @compiled("power")
    def bent_here(power, x):
        return x ** power()

    assert float(bent_here(lambda: 2, np.array(3.0))) == 9.0
    assert dict(programs.COUNTS) == {"compiled": 1, "nameless": 1}
    assert not folder.exists()


def test_what_jax_cannot_write_out_is_run_and_not_kept(folder, monkeypatch):
    def refuse(program):
        raise NotImplementedError("constants")

    monkeypatch.setattr(programs, "serialize", refuse)
    np.testing.assert_allclose(bent(Law(2), np.ones(3))["values"], 2.0)
    assert dict(programs.COUNTS) == {"compiled": 1, "unwritable": 1}


CACHES_OF_ITS_OWN = """
import jax
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
jax.config.update("jax_persistent_cache_min_entry_size_bytes", 0)
import numpy as np
from heatrun.io.programs import COUNTS, compiled

@compiled()
def summed(x):
    return jax.numpy.cumsum(jax.numpy.sin(x) + jax.numpy.arange(x.size) * 0.5)

x = np.linspace(0.0, 1.0, 300)
np.testing.assert_allclose(summed(x), np.cumsum(np.sin(x) + np.arange(300) * 0.5))
print(dict(COUNTS))
"""


@pytest.mark.parametrize("wanted", [None, "true"])
def test_beside_a_cache_of_jax_s_own_no_program_is_kept_without_its_code(tmp_path, wanted):
    """JAX was loaded first, and its cache holds the program that is to be kept."""
    environment = {k: v for k, v in os.environ.items() if k != "JAX_ENABLE_COMPILATION_CACHE"}
    environment |= {"JAX_COMPILATION_CACHE_DIR": str(tmp_path)}
    environment |= {} if wanted is None else {"JAX_ENABLE_COMPILATION_CACHE": wanted}
    script = tmp_path / "script.py"
    script.write_text(CACHES_OF_ITS_OWN)
    for run in range(3):
        done = subprocess.run([sys.executable, script], env=environment, text=True,
                              capture_output=True, check=False)  # fmt: skip
        assert done.returncode == 0, done.stderr
        for kept in tmp_path.glob(f"*{PROGRAM}") if run == 0 else ():
            kept.unlink()  # as after another version of heatrun


def test_the_numbers_of_priors_are_no_part_of_a_program():
    form = network_named("second")
    place, parameter = form.capacitance[0]
    other = replace(
        form, capacitance=((place, replace(parameter, centre=123.0)), *form.capacitance[1:])
    )
    assert programs._text(form, free=False) == programs._text(other, free=False)
    assert programs._text(form, free=False) != programs._text(network_named("first"), free=False)


def test_a_program_depends_on_the_files_that_its_module_may_import():
    # in a process of its own: digests of sources are worked out once in each
    look = (
        "import sys; from pathlib import Path; from heatrun.io import programs as p; "
        "import heatrun, heatrun.model.problem, lptn, heatrun.reports.figures;"
        "read = Path.read_bytes; changed = sys.argv[1];"
        "Path.read_bytes = lambda path: read(path) + ("
        "b'# changed' if changed and str(path).endswith(changed) else b'');"
        "print(p._sources('heatrun.model.problem'))"
    )

    def digest(changed: str) -> str:
        done = subprocess.run(
            [sys.executable, "-c", look, changed],
            capture_output=True, text=True, check=True, env=dict(os.environ),
        )  # fmt: skip
        return done.stdout

    as_is = digest("")
    assert digest("lptn/effects/heat_paths.py") != as_is
    assert digest("heatrun/record/samples.py") != as_is  # a constant alone is taken from it
    assert digest("heatrun/reports/figures.py") == as_is


@pytest.fixture
def waiting(folder, monkeypatch):
    """Return an empty folder; the process has asked for no program."""
    monkeypatch.setattr(ahead, "_asked", {})
    monkeypatch.setattr(ahead, "_loading", {})
    return folder


def begin_anew() -> None:
    """Forget the programs, as in another process."""
    programs.forget()
    ahead._asked.clear()
    ahead._loading.clear()


def in_the_thread_alone(monkeypatch) -> list[Path]:
    """Return where the paths go that a thread has read; elsewhere none is read."""
    executable, seen = programs.executable, []

    def told(path):
        assert threading.current_thread().name == "programs"
        seen.append(path)
        return executable(path)

    monkeypatch.setattr(programs, "executable", told)
    return seen


def joined() -> None:
    for thread in threading.enumerate():
        if thread.name == "programs":
            thread.join()


def test_what_a_command_has_used_is_loaded_ahead_of_the_next(waiting, monkeypatch):
    x = np.linspace(0.0, 2.0, 5)
    bent(Law(3), x)
    ahead.remember("calibrate")
    (kept,) = waiting.glob(f"*{PROGRAM}")
    assert (waiting / "calibrate.used").read_text() == kept.name
    begin_anew()
    ahead.load_ahead("discover", programs.executable)  # of another command nothing is known
    joined()
    seen = in_the_thread_alone(monkeypatch)
    ahead.load_ahead("calibrate", programs.executable)
    joined()
    ahead.load_ahead("calibrate", programs.executable)  # another one in the same process
    joined()
    assert seen == [kept]
    np.testing.assert_array_equal(bent(Law(3), x)["values"], 2.0 * x**3)
    assert dict(programs.COUNTS) == {"compiled": 1, "loaded": 1}


@pytest.mark.parametrize("listed", ["../other.program", "gone.program", "no program", "\0"])
def test_a_list_that_is_wrong_costs_nothing(waiting, listed):
    x = np.linspace(0.0, 2.0, 5)
    bent(Law(3), x)
    begin_anew()
    (waiting / "calibrate.used").write_text(listed)
    ahead.load_ahead("calibrate", programs.executable)
    joined()
    np.testing.assert_array_equal(bent(Law(3), x)["values"], 2.0 * x**3)
    assert dict(programs.COUNTS) == {"compiled": 1, "loaded": 1}


def test_a_program_that_is_damaged_is_compiled_again(waiting):
    x = np.linspace(0.0, 2.0, 5)
    bent(Law(3), x)
    ahead.remember("calibrate")
    (kept,) = waiting.glob(f"*{PROGRAM}")
    kept.write_bytes(kept.read_bytes()[:-1])
    begin_anew()
    ahead.load_ahead("calibrate", programs.executable)
    joined()
    np.testing.assert_array_equal(bent(Law(3), x)["values"], 2.0 * x**3)
    assert dict(programs.COUNTS) == {"compiled": 2}
