"""What the installation must be: sums as NumPy has them, and packages that import no other."""

from importlib.metadata import version
from types import SimpleNamespace

import jax.numpy as jnp
import numpy as np
import pytest

import heatrun
from heatrun import commands
from heatrun.cli import main
from heatrun.effects.found import find
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.io import programs
from heatrun.io.programs import refuse_wrong_sums, sums_of_squares
from heatrun_fleet.batch.fit import fit_batch
from heatrun_fleet.machine import fit_machines

BEGINNINGS = {
    # wrong sums are refused before anything is looked at: no test is needed here
    "a fit": lambda: fit(None),
    "a discovery": lambda: find(None, None, []),
    "a batch": lambda: fit_batch([]),
    "a fleet": lambda: fit_machines([], seed=0, num_planned=0),
}
"""All that begins to fit."""


@pytest.fixture
def unchecked():
    """What the check found before is forgotten, and so is what it finds here."""
    refuse_wrong_sums.cache_clear()
    yield
    refuse_wrong_sums.cache_clear()


@pytest.fixture
def wrong(unchecked, monkeypatch):
    """Sums of which the last ten are those of other rows."""

    def shifted(matrix, rows):
        right = np.array(sums_of_squares(matrix, rows))
        right[-10:] = right[:10]
        return right

    monkeypatch.setattr(programs, "sums_of_squares", shifted)


# jaxlib 0.10.2 has the last of 16 385, and 3616 of 20 000, wrong; and more with a square matrix
@pytest.mark.parametrize(
    ("num_sums", "num_columns", "num_rows"),
    [(5, 3, 1000), (5, 3, 16_385), (5, 6, 20_000), (3, 3, 40_000), (8, 8, 20_000), (1, 4, 65_536)],
)
def test_sums_of_squares_are_those_of_numpy(num_sums, num_columns, num_rows):
    rng = np.random.default_rng(1)
    matrix = rng.standard_normal((num_sums, num_columns))
    rows = rng.standard_normal((num_rows, num_columns))
    found = sums_of_squares(jnp.asarray(matrix), jnp.asarray(rows))
    # rounding alone: some ten terms, of either sign within a product
    np.testing.assert_allclose(
        found, np.sum((rows @ matrix.T) ** 2, axis=1), rtol=1e-11, atol=1e-13
    )


def test_the_installed_version_passes(unchecked):
    refuse_wrong_sums()


def test_what_is_right_is_looked_at_once(unchecked, monkeypatch):
    looked = []

    def counted(matrix, rows):
        looked.append(rows.shape)
        return sums_of_squares(matrix, rows)

    monkeypatch.setattr(programs, "sums_of_squares", counted)
    refuse_wrong_sums()
    refuse_wrong_sums()
    assert len(looked) == 1


def test_wrong_sums_are_refused_by_version_and_remedy_each_time(wrong):
    here = version("jaxlib")
    for _ in range(2):
        with pytest.raises(InputError) as refused:
            refuse_wrong_sums()
        assert refused.value.problem.startswith(f"jaxlib {here} computes wrong sums")
        assert "10 of 20000 sums" in refused.value.problem
        assert f'pip install "jax!={here}" "jaxlib!={here}"' in refused.value.remedy


@pytest.mark.parametrize("begin", BEGINNINGS.values(), ids=BEGINNINGS)
def test_nothing_is_fitted_on_wrong_sums(wrong, begin):
    with pytest.raises(InputError, match="computes wrong sums"):
        begin()


def test_names_of_other_packages_are_reached_and_unknown_ones_refused():
    assert {"calibrate", "calibrate_fleet", "population"} <= set(dir(heatrun))
    assert heatrun.calibrate_fleet.__module__ == "heatrun_fleet.api"
    with pytest.raises(AttributeError, match="no attribute 'nonsense'"):
        _ = heatrun.nonsense


def test_a_command_of_another_package_stands_last_in_the_help_and_runs(monkeypatch, capsys):
    def add_parser(parsers):
        return parsers.add_parser("weigh", help="the mass")

    module = SimpleNamespace(add_parser=add_parser, run=lambda options: print("4 kg") or 0)
    entries = [SimpleNamespace(name="weigh", load=lambda: module),
               SimpleNamespace(name="check", load=lambda: module)]  # fmt: skip
    monkeypatch.setattr(commands, "entry_points", lambda group: entries)
    assert list(commands.all_commands()) == [*commands.COMMANDS, "weigh"]
    assert commands.all_commands()["check"]() is not module  # ours are not replaced
    assert main(["weigh"]) == 0
    assert capsys.readouterr().out == "4 kg\n"
