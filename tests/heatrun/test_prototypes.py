"""Virtual, semi-real and real in one report: what was put into a record is found and judged."""

from __future__ import annotations

import csv
import gzip
import importlib.util
import io
import json
from pathlib import Path

import numpy as np
import pytest
from pypdf import PdfReader

from heatrun.cli import main
from heatrun.errors import UsageError
from heatrun_reports.prototypes.prototype import parse_roles

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
    """The integral of U I by trapezoids between two moments."""
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
    """The report on four prototypes, by the command."""
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
    assert report["test"] == "virtual, semi-real, real and semi-real-2"
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
