"""Prototypes of one machine: their clocks, their network, and what they are held against."""

import csv
import gzip
import importlib.util
import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pypdf import PdfReader
from run_near_truth import FITTED, run_near_truth

from heatrun.cli import main
from heatrun.errors import InputError, UsageError
from heatrun.motor.file import load_motor
from heatrun.readers.read import read_record
from heatrun.record.motor import Motor
from heatrun.record.record import Record, Source
from heatrun_reports import Reference, build_report, make_prototypes_report, read_reference
from heatrun_reports.prototypes import Prototype, confront, parse_roles, read_prototypes
from heatrun_reports.prototypes_report import prototypes_report

PROTOTYPES = Path(__file__).parents[2] / "data" / "synthetic" / "prototypes"
BENCH = PROTOTYPES / "Test_2024_03_05_001.csv.gz"
ROAD = PROTOTYPES / "Road_2024_03_05_001.csv.gz"
MOTOR = PROTOTYPES / "motor.toml"
LATER_S, BIAS_K, GAIN = 12.0, 2.5, 1.08
"""Put into the repeat: its logger starts later, its winding reads high, its current by 8 %."""


def columns(path: Path) -> dict[str, np.ndarray]:
    """The columns of a packed CSV, by a reader of the test's own."""
    rows = list(csv.reader(io.StringIO(gzip.decompress(path.read_bytes()).decode())))
    values = np.array(rows[1:], dtype=float)
    return dict(zip(rows[0], values.T, strict=True))


def write(path: Path, table: dict[str, np.ndarray]) -> Path:
    rows = np.stack(list(table.values()), 1)
    np.savetxt(path, rows, delimiter=",", comments="", header=",".join(table), fmt="%.5f")
    return path


def energy_kWh(table: dict[str, np.ndarray], from_s: float, to_s: float) -> float:
    t = table["time_s"]
    inside = (t >= from_s) & (t <= to_s)
    power = (table["dc_voltage_V"] * table["dc_current_A"])[inside]
    return float(np.trapezoid(power, t[inside])) / 3.6e6


@pytest.fixture(scope="module")
def truth() -> dict[str, np.ndarray]:
    """What truly happened, by the generator of the records: the virtual prototype."""
    spec = importlib.util.spec_from_file_location("prototypes", PROTOTYPES / "generate.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.simulate(module.drive())


@pytest.fixture(scope="module")
def folder(tmp_path_factory, truth) -> Path:
    """Virtual prototype, and a repeat on the bench with what was put into it."""
    at = tmp_path_factory.mktemp("prototypes")
    virtual = {name: values[::20] for name, values in truth.items()}
    write(at / "Model_2024_03_05_001.csv", virtual)
    bench = columns(BENCH)
    later = bench["time_s"] >= LATER_S
    repeat = {name: values[later] for name, values in bench.items()}
    repeat["time_s"] = repeat["time_s"] - LATER_S
    repeat["winding_degC"] = repeat["winding_degC"] + BIAS_K
    repeat["dc_current_A"] = GAIN * repeat["dc_current_A"]
    write(at / "Bench_2024_03_06_001.csv", repeat)
    return at


@pytest.fixture(scope="module")
def report(folder) -> dict:
    words = ["report", "--type", "prototypes", str(MOTOR)]
    words += [f"virtual={folder / 'Model_2024_03_05_001.csv'}", f"semi-real={BENCH}"]
    words += [f"real={ROAD}", f"semi-real-2={folder / 'Bench_2024_03_06_001.csv'}"]
    assert main([*words, "--out", str(folder / "out")]) == 0
    (path,) = (folder / "out").glob("*.json")
    return json.loads(path.read_text("utf-8"))


def cells(report: dict, title: str, name: str) -> dict:
    (table,) = [t for t in report["tables"] if t["title"] == title]
    (line,) = [each for each in table["lines"] if each["name"] == name]
    return {cell["quantity"]: cell["value"] for cell in line["cells"]}


SIGNALS = "Signal by signal, pair by pair"
FIGURES = "Energy, distance and consumption, pair by pair"


@pytest.mark.parametrize(
    ("pair", "offset_s"),
    [
        # what is added to the earlier one's clock to give the later one's
        ("semi-real − virtual", 0.0),
        ("real − semi-real", 37.4),
        ("semi-real-2 − semi-real", -LATER_S),
        ("semi-real-2 − real", -LATER_S - 37.4),
        ("real − virtual", 37.4),
    ],
)
def test_every_pair_of_clocks_is_found_within_its_uncertainty(report, pair, offset_s):
    clock = cells(report, "Clocks of the pairs", pair)
    # k = 2: of six pairs one may lie outside of one standard uncertainty
    assert clock["clock offset"] == pytest.approx(offset_s, abs=2 * clock["standard uncertainty"])
    assert clock["standard uncertainty"] < 0.5  # a step of 1 s at most, and its fit


def test_the_bias_that_was_put_in_is_found_and_judged(report):
    winding = cells(report, SIGNALS, "winding, semi-real-2 − semi-real")
    # the same readings but for the bias: what is left is interpolation between 0.2 s
    assert winding["bias"] == pytest.approx(BIAS_K, abs=0.01)
    assert winding["RMSE"] == pytest.approx(BIAS_K, abs=0.02)
    assert winding["correlation"] > 0.999
    assert winding["verdict"] == "biased"
    assert winding["decided by"] == "instruments"
    # two sensors of 0.5 K and 0.5 % of a rise of 14.7 K, read to 0.1 K: k = 2
    assert winding["tolerance"] == pytest.approx(2 * np.sqrt(2 * (0.25 + 0.0054 + 0.00083)), 0.01)
    # the road reads 3 K high: the two biases are told apart
    road = cells(report, SIGNALS, "winding, semi-real-2 − real")
    assert road["bias"] == pytest.approx(BIAS_K - 3.0, abs=0.1)
    assert road["verdict"] == "agrees"


def test_the_energy_error_that_was_put_in_is_found_and_judged(report):
    energy = cells(report, FIGURES, "Energy, semi-real-2 − semi-real")
    assert energy["difference"] == pytest.approx(100.0 * (GAIN - 1.0), abs=0.2)
    assert energy["verdict"] == "differs"
    assert cells(report, FIGURES, "Distance, semi-real-2 − semi-real")["verdict"] == "agrees"
    wanted = cells(report, FIGURES, "Consumption, semi-real-2 − semi-real")
    assert wanted["difference"] == pytest.approx(100.0 * (GAIN - 1.0), abs=0.2)
    assert wanted["verdict"] == "differs"
    # but the current itself differs by less than 5 % of its largest magnitude
    current = cells(report, SIGNALS, "DC current, semi-real-2 − semi-real")
    assert current["verdict"] == "agrees"


def test_general_information_stands_side_by_side_over_the_time_in_common(report, truth):
    energy = cells(report, "General Information over the time in common", "Energy")
    assert list(energy) == ["virtual", "semi-real", "real", "semi-real-2"]
    common_s = next(row["value"] for row in report["table"] if row["name"] == "common_s")
    from_s = LATER_S  # the repeat begins last, the road logger ends first
    assert common_s == pytest.approx(columns(ROAD)["time_s"][-1] - 37.4 - from_s, abs=1.0)
    wanted = energy_kWh(columns(BENCH), from_s, from_s + common_s)
    assert energy["semi-real"] == pytest.approx(wanted, rel=1e-3)
    assert energy["semi-real-2"] == pytest.approx(GAIN * wanted, rel=2e-3)
    assert energy["virtual"] == pytest.approx(
        energy_kWh(truth, from_s, from_s + common_s), rel=3e-3
    )


def test_the_titles_are_the_roles_and_the_files_are_as_of_other_reports(report, folder):
    assert report["test"] == "virtual, semi-real, real, semi-real-2"
    assert report["title"] == "Comparison of prototypes"
    names = sorted(path.name for path in (folder / "out").iterdir())
    assert names == [f"PrototypesComparison_2024_03_05_001.{end}" for end in ("csv", "json", "pdf")]
    text = "".join(page.extract_text() for page in PdfReader(folder / "out" / names[2]).pages)
    assert "Semi-real against" not in text
    # 11 signals and 7 figures: what was put in shows in the winding, and by way of the current in
    # two energies and two consumptions
    told = (
        "semi-real-2 − semi-real: 13 of 18 agree; not winding, energy, energy without "
        "regeneration, consumption, consumption without regeneration."
    )
    assert told in report["summary"]
    assert told.replace(" ", "") in "".join(text.split())


@pytest.mark.parametrize(
    ("texts", "told"),
    [
        (["virtual=a.csv"], "two or more"),
        (["virtual=a.csv", "b.csv"], "ROLE=FILE"),
        (["real=a.csv", "real=b.csv"], "real-2"),
        (["=a.csv", "real=b.csv"], "ROLE=FILE"),
        (["x" * 25 + "=a.csv", "real=b.csv"], "24 characters"),
    ],
)
def test_roles_that_are_none_are_wrong_use(texts, told):
    with pytest.raises(UsageError, match=told):
        parse_roles(texts)


def test_an_equals_sign_in_a_path_is_kept():
    assert parse_roles(["a=x=1.csv", "b=y.csv"])[0] == ("a", Path("x=1.csv"))


def test_a_file_that_is_not_there_is_told_and_the_exit_code_is_1(capsys):
    code = main(["report", "--type", "prototypes", str(MOTOR), f"a={BENCH}", "b=none.csv"])
    assert code == 1
    assert "none.csv" in capsys.readouterr().err


BARE = Motor("car")
CLOCK = np.arange(0.0, 900.0)
POWER = ([0, 60, 65, 200, 204, 380, 390, 520, 523, 900], [0, 0, 8, 8, -3, -3, 5, 5, 1, 1])
SPEED = ([0, 40, 50, 150, 170, 350, 360, 600, 640, 900], [0, 0, 3, 3, 5, 5, 1, 1, 4, 4])
TORQUE = ([0, 90, 100, 300, 304, 480, 490, 700, 703, 900], [0, 0, 50, 50, 10, 10, 80, 80, 5, 5])


def logger(role: str, earlier_s: float, seed: int, **signals: float) -> Prototype:
    """A prototype whose logger started earlier; each signal lags by so many seconds."""
    rng = np.random.default_rng(seed)
    courses = {"dc_power_W": (*POWER, 1000.0), "torque_Nm": (*TORQUE, 1.0)}
    courses["speed_rpm"] = (*SPEED, 1000.0)
    channels = {"time_s": CLOCK}
    for name, lag_s in signals.items():
        times, values, scale = courses[name]
        course = scale * np.interp(CLOCK - earlier_s - lag_s, times, values)
        channels[name] = course + 0.01 * scale * rng.normal(size=CLOCK.size)
    return Prototype(role, Reference(Record(role, channels)))


def test_ways_between_clocks_that_agree_are_no_finding():
    both = {"dc_power_W": 0.0, "torque_Nm": 0.0}
    shown = [
        logger("a", 0.0, 1, **both),
        logger("b", 20.0, 2, **both),
        logger("c", -15.0, 3, **both),
    ]
    found = confront(shown, BARE)
    # added to the clock of each to give that of a
    assert found.shift_s["b"] == pytest.approx(-20.0, abs=0.5)
    assert found.shift_s["c"] == pytest.approx(15.0, abs=0.5)
    assert "clocks_do_not_close" not in {f.id for f in found.findings}
    # from where b and c have begun, to where the first ends, on the clock of a
    assert found.window_s == pytest.approx((15.0, 879.0), abs=1.0)


def test_ways_between_clocks_that_contradict_each_other_are_told():
    # by power and torque all clocks are one, but the speed of b lags by 30 s behind that of c
    a = logger("a", 0.0, 1, dc_power_W=0.0, torque_Nm=0.0)
    b = logger("b", 0.0, 2, dc_power_W=0.0, speed_rpm=30.0)
    c = logger("c", 0.0, 3, torque_Nm=0.0, speed_rpm=0.0)
    found = confront([a, b, c], BARE)
    (told,) = [f for f in found.findings if f.id == "clocks_do_not_close"]
    # what is added to the clock of b to give that of c
    assert told.values["left_s"] == pytest.approx(-30.0, abs=1.0)


def test_the_report_stands_without_a_pair_that_shares_nothing():
    a = logger("a", 0.0, 1, dc_power_W=0.0)
    b = logger("b", 0.0, 2, dc_power_W=0.0, torque_Nm=0.0)
    c = logger("c", 0.0, 3, torque_Nm=0.0)
    report = prototypes_report(BARE, (b, a, c))
    assert report.summary.startswith("Agree in all that is judged: a − b, c − b.")
    assert "pair_not_compared" in {f.id for f in report.findings}


def test_records_of_different_drives_are_refused():
    a = logger("a", 0.0, 1, dc_power_W=0.0)
    noise = np.random.default_rng(4).normal(size=CLOCK.size)
    other = Prototype("b", Reference(Record("b", {"time_s": CLOCK, "dc_power_W": noise})))
    with pytest.raises(InputError, match="records of one manoeuvre"):
        confront([a, other], BARE)


def test_the_part_that_the_motor_file_uses_is_compared(tmp_path):
    paths = []
    for role, seed in (("first", 1), ("second", 2)):
        record = logger(role, 0.0, seed, dc_power_W=0.0, torque_Nm=0.0).record
        paths.append(tmp_path / f"{role}.csv")
        table = np.stack(list(record.channels.values()), 1)
        np.savetxt(paths[-1], table, delimiter=",", comments="", header=",".join(record.channels))
    file = tmp_path / "motor.toml"
    file.write_text('[motor]\nname = "car"\n[tests.second]\nuse = [[100, 700]]\n', "utf-8")
    motor = load_motor(file)
    first, second = read_prototypes([("a", paths[0]), ("b", paths[1])], motor)
    assert first.record.duration_s == pytest.approx(899.0)
    assert second.record.duration_s == pytest.approx(600.0, abs=1.0)


REFERENCE = Motor("reference", phase_resistance_ohm=0.0062)
HIGH_K, EARLIER_S = 4.0, 25.0


@pytest.fixture(scope="module")
def machine(tmp_path_factory, bench, generator):
    """A run, a test on the bench, and the road's record of it without current and losses."""
    folder = tmp_path_factory.mktemp("network")
    run = run_near_truth(folder / "run", REFERENCE, bench(generator.duty(600.0), seed=20))
    test = bench(generator.duty(1800.0), seed=21, name="bench")
    kept = ("time_s", "ambient_degC", "winding_degC", "speed_rpm")
    channels = {name: test[name][EARLY:] for name in kept}
    channels["time_s"] = channels["time_s"] - EARLY + EARLIER_S
    channels["winding_degC"] = channels["winding_degC"] + HIGH_K
    return run, test, Record("road", channels)


EARLY = 60
"""Samples of the bench, one a second, that the road's logger did not see."""


def test_the_network_is_judged_on_the_bench_and_by_its_load_on_the_road(machine):
    run, test, road = machine
    prototypes = (Prototype("semi-real", Reference(test)), Prototype("real", Reference(road)))
    report = prototypes_report(REFERENCE, prototypes, run=run)
    on_bench, on_road = report.result.networks
    assert (on_bench.driven_by, on_road.driven_by) == ("semi-real", "semi-real")
    # the road counts 25 s where the bench counts 60 s
    assert report.result.shift_s["real"] == pytest.approx(EARLY - EARLIER_S, abs=0.5)
    (bench_winding,) = on_bench.validation.judged
    (road_winding,) = on_road.validation.judged
    # the start is read to 1 K; parameters within 0.5 % of the truth
    assert abs(bench_winding.bias) < 0.6
    assert bench_winding.verdict == "agrees"
    assert road_winding.bias - bench_winding.bias == pytest.approx(HIGH_K, abs=0.2)
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
    report = prototypes_report(REFERENCE, prototypes, run=run)
    assert report.summary.startswith("bench is the calibration test duty of the run run")
    assert report.summary.count("same SHA-256") == 1  # the road's record was not fitted
    thermal = build_report("thermal", REFERENCE, fitted, run=run)
    virtual = build_report("virtual", REFERENCE, fitted, run=run)
    for each in (thermal, virtual):
        assert each.summary.startswith("bench is the calibration test duty of the run run")
    assert "SHA-256" not in build_report("thermal", REFERENCE, test, run=run).summary


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
    report = prototypes_report(REFERENCE, read_prototypes(roles, REFERENCE))
    assert report.result.base.role == "semi-real"
    pairs = {pair.name: pair.validation for pair in report.result.pairs}
    assert pairs["semi-real − virtual"].pair.offset.offset_s == 0.0
    # a reader counts from the first sample, so the clock of the file begins at 0
    assert pairs["real − virtual"].pair.offset.offset_s == pytest.approx(-EARLY, abs=0.5)
    offset = pairs["real − virtual"].pair.offset
    assert offset.method == "by way of semi-real"
    assert offset.sd_s == pairs["semi-real − real"].pair.offset.sd_s > 0.0
    (winding,) = pairs["real − virtual"].judged
    assert winding.bias == pytest.approx(HIGH_K, abs=0.6)


def test_without_a_vehicle_the_report_is_called_after_the_test_and_names_no_distance(
    machine, tmp_path
):
    run, test, _ = machine
    path = tmp_path / "Pumpe 4 warm.csv"
    table = np.stack(list(test.channels.values()), 1)
    np.savetxt(path, table, delimiter=",", comments="", header=",".join(test.channels))
    roles = [("real", path), ("virtual", run)]
    made = make_prototypes_report(REFERENCE, roles, tmp_path / "out")
    assert made.pdf.name == "PrototypesComparison_Pumpe_4_warm.pdf"
    (information,) = (t for t in made.report.tables if t.title.startswith("General Information"))
    assert [line.name for line in information.lines] == ["Energy", "Energy without regeneration"]


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
    other = read_reference(path, REFERENCE)
    real = build_report("real", REFERENCE, test, reference=other)
    assert real.summary.startswith(told.format("the reference"))
    virtual = build_report("virtual", REFERENCE, test, reference=other)
    assert "given as" not in virtual.summary
    swapped = build_report(
        "real", REFERENCE, read_record(path, REFERENCE), reference=Reference(test)
    )
    assert swapped.summary.startswith(told.format("the test"))
    prototypes = (Prototype("semi-real", Reference(test)), Prototype("real", other))
    assert prototypes_report(REFERENCE, prototypes).summary.startswith(told.format("real"))


def test_one_file_in_two_roles_is_told_on_the_first_line(machine):
    _, test, _ = machine
    known = replace(test, sources=(Source("b.csv", "b"),))
    prototypes = (Prototype("real", Reference(known)), Prototype("real-2", Reference(known)))
    report = prototypes_report(REFERENCE, prototypes)
    assert report.summary.startswith("bench and bench are the same file (same SHA-256).")
