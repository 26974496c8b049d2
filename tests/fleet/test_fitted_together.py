"""Machines that are fitted together get the rows that each gets alone."""

import json
from dataclasses import replace

import numpy as np
import pytest
from simulated_fleet import calibrated, planned, write_fleet

from heatrun_fleet.batch import fit as batch_fit
from heatrun_fleet.batch.fit import TOO_FEW
from heatrun_fleet.machine import FEWEST, Prepared, fit_machines, prepare, work_out
from heatrun_fleet.rows import read_part, table_bytes

NUM = FEWEST + 2


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A fleet with a machine of garbage, and one whose test is much longer than the others'."""
    folder = tmp_path_factory.mktemp("fleet")
    write_fleet(folder, num=NUM + 2)
    (folder / "tests" / "M001.csv").write_text("t,Is\n0,1\n")
    other = folder.parent / "longer"
    write_fleet(other, num=4, minutes=60.0)
    (other / "tests" / "M003.csv").rename(folder / "tests" / "M003.csv")
    return folder


def is_number(value):
    return isinstance(value[0] if isinstance(value, list) and value else value, float)


@pytest.mark.slow
def test_rows_are_those_of_each_machine_alone(bench, tmp_path):
    together = calibrated(bench, tmp_path / "64", batch=64, seed=0)
    alone = calibrated(bench, tmp_path / "7", batch=7, seed=0)
    timing = json.loads((together.path / "timing.json").read_text())
    assert timing["batches"][0]["fitted_alone"] == {"M003": TOO_FEW}
    rows = zip(together.table().to_pylist(), alone.table().to_pylist(), strict=True)
    for own, other in rows:
        for name, value in own.items():
            if is_number(value):
                np.testing.assert_allclose(value, other[name], rtol=1e-6, atol=1e-8, err_msg=name)
            else:
                assert value == other[name], name


@pytest.mark.slow
def test_a_batch_taken_apart_gives_the_same_bytes(bench):
    (batch,) = planned(bench, 64)
    whole = work_out(batch)
    for place in (0, 7):
        (entry,) = (e for e in batch.entries if e.machine == f"M{place:03d}")
        single = work_out(batch.of_one(entry))
        own, other = read_part(single.part), read_part(whole.part).slice(place, 1)
        assert table_bytes([own]) == table_bytes([other])


def test_what_one_machine_raises_does_not_touch_the_others(bench, monkeypatch):
    """The fit of many raises; each is fitted by itself then, and one raises again."""
    (batch,) = planned(bench, 64)
    ready = prepare(batch.entries[0], batch)
    assert isinstance(ready, Prepared)
    problem = ready.problem
    spoilt = replace(problem, tests=())
    monkeypatch.setattr(batch_fit, "why_not", lambda problem: "")
    found = fit_machines([problem, spoilt], 0, NUM)
    assert isinstance(found.fits[1], Exception)
    assert not isinstance(found.fits[0], Exception)
    assert set(found.alone) == {0, 1}
