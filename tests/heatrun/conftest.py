"""What several files of tests share: a calibrated record, and a run on the disk."""

import os
import shutil
import sys
from collections import Counter
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

import numpy as np
import pytest
from filelock import FileLock
from run_files import CHANNELS, write_csv

from heatrun import cli
from heatrun.fit.fit import fit
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce

DATA = Path(__file__).parents[2] / "data" / "synthetic"

NAMES = {column: channel for channel, column in CHANNELS.items()}


@pytest.fixture(scope="session")
def motor():
    return Motor("reference", phase_resistance_ohm=0.0062, insulation_class="F")


@pytest.fixture(scope="session")
def truth():
    return {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625}


@pytest.fixture(scope="session")
def bench(generator):
    """Records of the reference motor, made by the independent generator at 1 Hz."""

    def make(profile, seed, name="duty", **instruments):
        machine = generator.reference_motor()
        truth = generator.simulate(machine, profile, sample_s=1.0, steps_per_sample=20)
        rng = np.random.default_rng(seed)
        columns = generator.measure(truth, rng, generator.Instruments(**instruments))
        return Record(name, {NAMES[key]: np.asarray(v) for key, v in columns.items()})

    return make


@pytest.fixture(scope="session")
def duty(bench, generator):
    return bench(generator.duty(3600.0), seed=11)


@pytest.fixture(scope="session")
def blocks(duty, motor):
    return reduce(duty, motor)


@pytest.fixture(scope="session")
def fitted(blocks, motor):
    return fit(Problem.of(Model.of("second", motor), motor, [blocks]))


@pytest.fixture(scope="session")
def finished_day(tmp_path_factory, duty, bench, generator):
    """A folder with a motor file, two records at 1 Hz and a run of both orders on them.

    The command made it, with `--quick` and `--json`; what it printed lies beside it, in
    `printed.json` and `said.txt`. The one calibration of both orders that the tests of runs,
    sheets and exports read: nobody writes into it. The duty is the one that other tests fit too.
    Where the tests run in several processes, the first that needs it makes it for all.
    """
    own = tmp_path_factory.getbasetemp()
    folder = (own.parent if "PYTEST_XDIST_WORKER" in os.environ else own) / "finished_day"
    with FileLock(folder.with_suffix(".lock")):
        if not folder.exists():
            partial = tmp_path_factory.mktemp("bench_day")
            _calibrate_day(partial, duty, bench(generator.constant_load(1800.0), seed=5))
            partial.rename(folder)
    return folder


def _calibrate_day(folder, duty, step):
    shutil.copy(DATA / "motor.toml", folder / "motor.toml")
    write_csv(duty, folder / "duty.csv")
    write_csv(step, folder / "step.csv")
    words = ["calibrate", "motor.toml", "duty.csv", "--holdout", "step.csv", "--quick", "--json",
             "-v", "--out", "run"]  # fmt: skip
    with (
        pytest.MonkeyPatch.context() as patch,
        (folder / "printed.json").open("w", encoding="utf-8") as out,
        (folder / "said.txt").open("w", encoding="utf-8") as err,
        redirect_stdout(out),
        redirect_stderr(err),
    ):
        patch.chdir(folder)
        assert cli.main(words) == 0


@pytest.fixture
def day(finished_day, tmp_path, monkeypatch):
    """A copy of it to spoil, as the working directory."""
    shutil.copytree(finished_day, tmp_path / "day")
    monkeypatch.chdir(tmp_path / "day")
    return Path()


@pytest.fixture(scope="session")
def num_calls() -> Callable[[Callable[[], object]], int]:
    """Count the calls that something makes, of Python's and of C's functions.

    A loop over the samples shows in them, on any machine and under any load.
    """

    def count(do: Callable[[], object]) -> int:
        calls: Counter[str] = Counter()
        before = sys.getprofile()
        sys.setprofile(lambda _, event, __: calls.update((event,)))
        try:
            do()
        finally:
            sys.setprofile(before)
        return calls["call"] + calls["c_call"]

    return count
