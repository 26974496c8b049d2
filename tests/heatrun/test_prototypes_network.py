"""One network judged on bench and road, and what must be said before anything else."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from run_near_truth import FITTED, run_near_truth

from heatrun.readers.read import read_record
from heatrun.record.motor import Motor
from heatrun.record.record import Record, Source
from heatrun_reports import Reference, build_report, read_reference
from heatrun_reports.prototypes.prototype import Prototype, read_prototypes
from heatrun_reports.prototypes.report import prototypes_report

MOTOR = Motor("reference", phase_resistance_ohm=0.0062)
BIAS_K, EARLIER_S = 4.0, 25.0


@pytest.fixture(scope="module")
def machine(tmp_path_factory, bench, generator):
    """A run, a test on the bench, and the road's record of it without current and losses."""
    folder = tmp_path_factory.mktemp("network")
    run = run_near_truth(folder / "run", MOTOR, bench(generator.duty(600.0), seed=20))
    test = bench(generator.duty(1800.0), seed=21, name="bench")
    kept = ("time_s", "ambient_degC", "winding_degC", "speed_rpm")
    channels = {name: test[name][EARLY:] for name in kept}
    channels["time_s"] = channels["time_s"] - EARLY + EARLIER_S
    channels["winding_degC"] = channels["winding_degC"] + BIAS_K
    return run, test, Record("road", channels)


EARLY = 60
"""Samples of the bench, one a second, that the road's logger did not see."""


def test_the_network_is_judged_on_the_bench_and_by_its_load_on_the_road(machine):
    run, test, road = machine
    prototypes = (Prototype("semi-real", Reference(test)), Prototype("real", Reference(road)))
    report = prototypes_report(MOTOR, prototypes, run=run)
    on_bench, on_road = report.result.networks
    assert (on_bench.driven_by, on_road.driven_by) == ("semi-real", "semi-real")
    # the road counts 25 s where the bench counts 60 s
    assert report.result.shift_s["real"] == pytest.approx(EARLY - EARLIER_S, abs=0.5)
    (bench_winding,) = on_bench.temperatures
    (road_winding,) = on_road.temperatures
    # the start is read to 1 K; parameters within 0.5 % of the truth
    assert abs(bench_winding.bias) < 0.6
    assert bench_winding.verdict == "agrees"
    assert road_winding.bias - bench_winding.bias == pytest.approx(BIAS_K, abs=0.2)
    assert road_winding.verdict == "biased"
    (table,) = [t for t in report.tables if t.title == "The network of the run on each prototype"]
    assert [line.name for line in table.lines] == ["winding, semi-real", "winding, real"]
    assert "Network of the run on real: winding biased" in report.summary
    for drawing in report.drawings:
        assert drawing.draw().axes


def test_a_prototype_that_calibrated_the_run_is_told_on_the_first_line(machine):
    run, test, road = machine
    fitted = replace(test, sources=(Source("a.csv", FITTED),))
    prototypes = (Prototype("semi-real", Reference(fitted)), Prototype("real", Reference(road)))
    report = prototypes_report(MOTOR, prototypes, run=run)
    assert report.summary.startswith("bench is the calibration test duty of the run run")
    assert report.summary.count("same SHA-256") == 1  # the road's record was not fitted
    thermal = build_report("thermal", MOTOR, fitted, run=run)
    virtual = build_report("virtual", MOTOR, fitted, run=run)
    for each in (thermal, virtual):
        assert each.summary.startswith("bench is the calibration test duty of the run run")
    assert "SHA-256" not in build_report("thermal", MOTOR, test, run=run).summary


def test_a_run_stands_for_the_virtual_prototype_on_the_clock_of_what_drove_it(machine, tmp_path):
    run, test, road = machine
    paths = []
    for record in (test, road):
        path = tmp_path / f"{record.name}.csv"
        table = np.stack(list(record.channels.values()), 1)
        np.savetxt(path, table, delimiter=",", comments="", header=",".join(record.channels))
        paths.append(path)
    # the road comes first, but has no current and losses to drive the network
    roles = [("real", paths[1]), ("virtual", run), ("semi-real", paths[0])]
    report = prototypes_report(MOTOR, read_prototypes(roles, MOTOR))
    assert report.result.base.role == "semi-real"
    pairs = {pair.name: pair.validation for pair in report.result.pairs}
    assert pairs["semi-real − virtual"].pair.offset.offset_s == 0.0
    # a reader counts from the first sample, so the clock of the file begins at 0
    assert pairs["real − virtual"].pair.offset.offset_s == pytest.approx(-EARLY, abs=0.5)
    offset = pairs["real − virtual"].pair.offset
    assert offset.method == "by way of semi-real"
    assert offset.sd_s == pairs["semi-real − real"].pair.offset.sd_s > 0.0
    (winding,) = pairs["real − virtual"].judged
    assert winding.bias == pytest.approx(BIAS_K, abs=0.6)


def simulated(path: Path, record: Record) -> Path:
    """The columns of a file that `heatrun simulate` writes."""
    columns = {**record.channels, "copper_loss_W": np.ones(record.time_s.size)}
    columns["other_loss_W"] = columns["copper_loss_W"]
    table = np.stack(list(columns.values()), 1)
    np.savetxt(path, table, delimiter=",", comments="", header=",".join(columns))
    return path


def test_a_simulation_given_as_real_is_told_on_the_first_line(machine, tmp_path):
    _, test, _ = machine
    path = simulated(tmp_path / "drive.csv", test)
    told = "drive, given as {}, is a simulation by heatrun and no measured prototype."
    other = read_reference(path, MOTOR)
    real = build_report("real", MOTOR, test, reference=other)
    assert real.summary.startswith(told.format("the reference"))
    virtual = build_report("virtual", MOTOR, test, reference=other)
    assert "given as" not in virtual.summary
    swapped = build_report("real", MOTOR, read_record(path, MOTOR), reference=Reference(test))
    assert swapped.summary.startswith(told.format("the test"))
    prototypes = (Prototype("semi-real", Reference(test)), Prototype("real", other))
    assert prototypes_report(MOTOR, prototypes).summary.startswith(told.format("real"))


def test_one_file_in_two_roles_is_told_on_the_first_line(machine):
    _, test, _ = machine
    known = replace(test, sources=(Source("b.csv", "b"),))
    prototypes = (Prototype("real", Reference(known)), Prototype("real-2", Reference(known)))
    report = prototypes_report(MOTOR, prototypes)
    assert report.summary.startswith("bench and bench are the same file (same SHA-256).")
