"""Reports as files: names, tables, folders, hostile names; there together or not at all."""

import csv
import io
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import typst
from PIL import Image
from pypdf import PdfReader

from heatrun.cli import main
from heatrun.io.whole_files import FileSet
from heatrun.readers.joined import read_test, read_tests
from heatrun.record.motor import Motor
from heatrun.reports.pdf import lay_out
from heatrun_reports import CARDS, TEST_TYPES, job, make_report
from heatrun_reports.command import TYPES
from heatrun_reports.document import TEMPLATE, neutral, number, printed, set_name

CAR = Motor("car", gear_ratio=9.1, wheel_radius_m=0.3)
TEST = "Test_2022_12_07_001.csv"
HOSTILE = '=HYPERLINK("x") #panic() $a_1$ *b* <script> \x1b[31m'


def write_drive(path: Path, *, current_A: float = 10.0) -> Path:
    """A drive of four samples, 30 s, 300 m at 36 km/h."""
    rows = [f"{t},100,{current_A},36,{20 + t}" for t in (0, 10, 20, 30)]
    head = "time_s,dc_voltage_V,dc_current_A,vehicle_speed_km_per_h,winding_degC"
    path.write_text("\n".join([head, *rows]) + "\n", encoding="utf-8")
    return path


def write_motor(folder: Path) -> Path:
    path = folder / "motor.toml"
    path.write_text('[motor]\nname = "car"\n', encoding="utf-8")
    return path


def text_of(pdf: Path) -> str:
    return "".join("".join(page.extract_text() for page in PdfReader(pdf).pages).split())


@pytest.fixture
def unset(monkeypatch):
    """Write an empty page in place of the PDF, where only its name is of interest."""
    monkeypatch.setattr(job, "write_pdf", lambda *words: words[2].write_bytes(b"%PDF"))


def test_the_cards_are_those_of_the_command_and_of_the_thesis():
    assert tuple(CARDS) == TYPES
    assert TEST_TYPES["general"].stem == "GeneralInformationTest"
    assert TEST_TYPES["energy"].lacks({"speed_rpm", "dc_power_W"}) == ""
    assert TEST_TYPES["energy"].lacks({"speed_rpm", "dc_voltage_V"}) == "electrical power"
    assert "winding_degC" in TEST_TYPES["thermal"].channels
    assert TEST_TYPES["virtual"].needs_reference


def test_a_report_is_named_after_its_test_and_holds_the_same_in_pdf_csv_and_json(tmp_path):
    test = write_drive(tmp_path / TEST)
    (outcome,) = make_report("general", CAR, [test], tmp_path / "Reports")
    assert [path.name for path in outcome.written] == [
        f"GeneralInformationTest_2022_12_07_001.{ending}" for ending in ("pdf", "csv", "json")
    ]
    # 1000 W over 30 s and 300 m: 30000 J = 8.3333 Wh, 27.778 Wh/km
    text = text_of(outcome.pdf)
    assert "Test_2022_12_07_001" in text
    assert "27.778Wh/km" in text
    table = list(csv.DictReader(io.StringIO(outcome.csv.read_text("utf-8-sig"))))
    (row,) = [r for r in table if r["quantity"] == "Consumption"]
    assert float(row["value"]) == pytest.approx(30000 / 3600 / 0.3)
    assert row["unit"] == "Wh/km"
    content = json.loads(outcome.json.read_text("utf-8"))
    assert content["date"] == "2022-12-07"
    assert content["date_from"] == "file name"
    assert content["sources"][0]["sha256"] in content["identity"]


@pytest.mark.parametrize(
    ("name", "head", "stem"),
    [
        ("Test_2023_06_23_14_16_08.csv", "", "2023_06_23_14_16_08"),
        ("run20240229-007.csv", "", "run_2024_02_29_007"),
        ("run.csv", "Start: 20/11/2025 18:02:33\n", "run_2025_11_20"),
        ("run.csv", "Start: 03/04/2025 18:02:33\n", "run"),  # March or April
        ("Test_2023_02_30.csv", "", "Test_2023_02_30"),  # there is no such day
        ("Test.csv", "", "undated_001"),
        ("Prüfling 7, warm_2024_02_29.csv", "", "Prüfling_7_warm_2024_02_29"),
        ("export_2025_11_21.csv", "Datum: 20.11.2025\n", "export_2025_11_20"),
        ("Test_2025_11_20_007.csv", "Datum: 20.11.2025\n", "2025_11_20_007"),
    ],
)
@pytest.mark.usefixtures("unset")
def test_the_date_comes_from_the_record_else_from_the_name_and_never_from_the_file(
    tmp_path, name, head, stem
):
    test = write_drive(tmp_path / name)
    test.write_text(head + test.read_text("utf-8"), encoding="utf-8")
    os.utime(test, (1e9, 1e9))  # 2001-09-09 01:46:40 UTC
    (outcome,) = make_report("general", CAR, [test], tmp_path / "out")
    assert outcome.error is None
    assert outcome.pdf.name == f"GeneralInformationTest_{stem}.pdf"


@pytest.mark.usefixtures("unset")
def test_the_clock_of_a_record_says_the_date_before_any_name(tmp_path):
    head = "time,dc_voltage_V,dc_current_A,winding_degC\n"
    rows = "".join(f"2026-03-04 10:00:{t:02},100,10,{20 + t}\n" for t in (0, 10, 20, 30))
    for name, stem in (
        ("export_2026_03_09.csv", "export_2026_03_04"),
        ("Test_2026_03_04_17.csv", "2026_03_04_17"),
    ):
        (tmp_path / name).write_text(head + rows, encoding="utf-8")
        (outcome,) = make_report("general", CAR, [tmp_path / name], tmp_path / name[:4])
        assert outcome.pdf.name == f"GeneralInformationTest_{stem}.pdf"
        content = json.loads(outcome.json.read_text("utf-8"))
        assert (content["date"], content["date_from"]) == ("2026-03-04", "clock of the record")


def test_the_time_of_a_file_is_no_date_of_a_test(tmp_path):
    test = write_drive(tmp_path / "run.csv")
    os.utime(test, (1e9, 1e9))
    (outcome,) = make_report("general", CAR, [test], tmp_path / "out")
    assert outcome.pdf.name == "GeneralInformationTest_run.pdf"
    content = json.loads(outcome.json.read_text("utf-8"))
    assert content["date"] is None
    assert content["date_from"] is None
    assert "Dateofthetestnotknown" in text_of(outcome.pdf)


@pytest.mark.usefixtures("unset")
def test_another_test_of_the_same_name_is_a_second_one_and_the_same_keeps_its_own(tmp_path):
    (tmp_path / "other").mkdir()
    one = write_drive(tmp_path / TEST)
    two = write_drive(tmp_path / "other" / "Test_2022_12_07_001.csv", current_A=5.0)
    first, second, again = make_report("general", CAR, [one, two, one], tmp_path / "out")
    assert second.pdf.name == "GeneralInformationTest_2022_12_07_001-2.pdf"
    assert again.pdf == first.pdf
    other = write_drive(tmp_path / TEST, current_A=7.0)
    (third,) = make_report("general", CAR, [other], tmp_path / "out")
    assert third.pdf.name == "GeneralInformationTest_2022_12_07_001-3.pdf"
    assert json.loads(first.json.read_text())["table"][0]["value"] == pytest.approx(30 / 3600)
    assert json.loads(second.json.read_text())["table"][0]["value"] == pytest.approx(15 / 3600)


@pytest.mark.usefixtures("unset")
def test_a_report_of_unknown_origin_is_not_overwritten(tmp_path):
    kept = tmp_path / "GeneralInformationTest_2022_12_07_001.pdf"
    kept.write_bytes(b"by hand")
    (outcome,) = make_report("general", CAR, [write_drive(tmp_path / TEST)], tmp_path)
    assert kept.read_bytes() == b"by hand"
    assert outcome.pdf.name == "GeneralInformationTest_2022_12_07_001-2.pdf"


@pytest.mark.usefixtures("unset")
def test_a_folder_is_done_as_far_as_it_can_be_and_the_rest_is_named(tmp_path, capsys):
    folder = tmp_path / "day"
    (folder / "afternoon").mkdir(parents=True)
    write_drive(folder / "Test_2022_12_07_001.csv")
    write_drive(folder / "afternoon" / "Test_2022_12_07_002.csv", current_A=7.0)
    (folder / "Test_2022_12_07_003.csv").write_bytes(b"\x89PNG no table at all")
    (folder / "README.txt").write_text("notes")
    (folder / "photo.jpg").write_bytes(b"\xff\xd8")
    words = ["report", "--type", "energy", "--json", "--out", str(tmp_path / "out")]
    code = main([*words, str(write_motor(tmp_path)), str(folder)])
    said = capsys.readouterr()
    reports = json.loads(said.out)["reports"]
    assert code == 1
    assert [Path(r["file"]).name for r in reports] == [
        f"Test_2022_12_07_00{n}.csv" for n in (1, 3, 2)
    ]
    assert ["error" in r for r in reports] == [False, True, False]
    assert reports[1]["error"]["problem"]
    assert len(list((tmp_path / "out").glob("*.pdf"))) == 2
    assert "README.txt, photo.jpg" in said.err


@pytest.mark.usefixtures("unset")
def test_a_second_pass_over_the_folder_does_not_report_on_its_own_reports(tmp_path):
    write_drive(tmp_path / TEST)
    for _ in range(2):
        outcomes = make_report("general", CAR, [tmp_path], tmp_path)
        assert [outcome.error for outcome in outcomes] == [None]


def test_a_folder_without_bench_files_is_an_error_with_exit_code_1(tmp_path, capsys):
    (tmp_path / "empty").mkdir()
    motor = write_motor(tmp_path)
    assert main(["report", "--type", "general", str(motor), str(tmp_path / "empty")]) == 1
    assert "none in it" in capsys.readouterr().err


@pytest.mark.parametrize(
    "words",
    [
        ["--type", "virtual"],
        ["--type", "real"],
        ["--type", "general", "--run", "run"],
        ["--type", "energy", "--reference", "other.csv"],
        ["--type", "virtual", "--reference", "other.csv", "--run", "run"],
        ["--type", "real", "--reference", "other.csv", "--tolerance", "winding_degC"],
    ],
)
def test_wrong_use_ends_with_exit_code_2(tmp_path, words):
    test = write_drive(tmp_path / TEST)
    assert main(["report", *words, str(write_motor(tmp_path)), str(test)]) == 2


def test_a_missing_speed_of_a_vehicle_says_what_to_map(tmp_path, capsys):
    test, motor = tmp_path / TEST, write_motor(tmp_path)
    test.write_text("time_s,dc_power_W\n0,1\n1,1\n2,1\n")
    words = ["report", "--type", "energy", "--out", str(tmp_path), str(motor), str(test)]
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "Distance" not in said
    assert "vehicle_speed_km_per_h" not in said
    motor.write_text(motor.read_text() + "[vehicle]\ngear_ratio = 9.1\nwheel_radius_m = 0.3\n")
    assert main(words) == 0
    said = capsys.readouterr().out
    assert "vehicle_speed_km_per_h or speed_rpm" in said
    assert "Distance" in said


def test_a_file_that_is_replaced_while_it_is_read_gets_no_report(tmp_path, monkeypatch):
    test = write_drive(tmp_path / TEST)

    def read_and_replace(path, motor, **options):
        records = read_tests(path, motor, **options)
        write_drive(test, current_A=99.0)
        return records

    monkeypatch.setattr(job, "read_tests", read_and_replace)
    (outcome,) = make_report("general", CAR, [test], tmp_path / "out")
    assert outcome.error is not None
    assert "replaced while it was read" in outcome.error.problem
    assert not list((tmp_path / "out").iterdir())


def test_hostile_names_act_neither_in_pdf_nor_in_csv_nor_on_the_terminal(tmp_path, capsys):
    test = write_drive(tmp_path / f"{HOSTILE}.csv")
    motor = tmp_path / "motor.toml"
    motor.write_text(f"[motor]\nname = {json.dumps('@SUM(1) ' + HOSTILE)}\n", encoding="utf-8")
    words = ["report", "--type", "general", "--out", str(tmp_path / "out"), str(motor), str(test)]
    assert main(words) == 0
    said = capsys.readouterr()
    assert "\x1b" not in said.out + said.err
    (pdf,) = (tmp_path / "out").glob("*.pdf")
    text = text_of(pdf)
    for word in ("#panic()", "$a_1$", "*b*", "<script>", "@SUM(1)", "=HYPERLINK"):
        assert word in text
    (table,) = (tmp_path / "out").glob("*.csv")
    for row in csv.reader(io.StringIO(table.read_text("utf-8-sig"))):
        assert not any(cell.lstrip()[:1] in ("=", "@", "+") for cell in row)
        assert not any("\x1b" in cell for cell in row)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("=1+1", "'=1+1"),
        ("  @SUM(A1)", "  '@SUM(A1)"),
        ("a;=1+1", "a;'=1+1"),  # a cell of its own where the delimiter is a semicolon
        ("a\t-1", "a -1"),  # the tab is gone, so nothing begins behind it
        ("\uff1d1", "'\uff1d1"),
        ("speed - rpm", "speed - rpm"),
    ],
)
def test_texts_that_a_spreadsheet_would_run_get_an_apostrophe(text, expected):
    assert neutral(text) == expected


@pytest.mark.parametrize(
    ("value", "expected"),
    [(0.0039, "0.0039"), (247.11654, "247.12"), (-3.0, "-3"), (None, "–"), (float("nan"), "–"),
     (1234567.0, "1230000"), (-8.164e-4, "-0.000816"), (9.999e-4, "0.001"), (3e-12, "3.00e-12"),
     (100.0, "100"), (-0.0, "0")],
)  # fmt: skip
def test_numbers_are_printed_with_five_digits_and_no_exponent_that_can_be_spared(value, expected):
    assert number(value) == expected


def test_a_long_word_can_break_and_an_endless_text_ends():
    assert printed("x" * 300).replace("\u200b", "") == "x" * 300
    assert max(map(len, printed("x" * 300).split("\u200b"))) <= 40
    assert printed("word " * 1000).endswith("…")


def test_both_prototypes_from_the_command_line_with_names_longer_than_a_line(tmp_path, capsys):
    """A long word may break anywhere; what is read, searched or copied is the name alone."""
    data = Path(__file__).parents[2] / "data" / "synthetic" / "prototypes"
    name = "Test_2024_03_05_001_" + "and_again_" * 16  # longer than a line
    other = tmp_path / f"{name}.csv.gz"
    shutil.copy(data / "Road_2024_03_05_001.csv.gz", other)
    words = ["report", "--type", "real", "--reference", str(other), "--out", str(tmp_path / "out"),
             str(data / "motor.toml"), str(data / "Test_2024_03_05_001.csv.gz")]  # fmt: skip
    assert main(words) == 0
    told = capsys.readouterr().out
    assert "u200b" not in told
    assert name in told
    pdf = tmp_path / "out" / "SemiRealVsRealPrototypeValidation_2024_03_05_001.pdf"
    report = json.loads(pdf.with_suffix(".json").read_text("utf-8"))
    table = {row["name"]: row["value"] for row in report["table"]}
    assert table["offset_s"] == pytest.approx(-37.4, abs=0.3)  # stamps of 0.2 and 1 s
    assert len(report["sources"]) == 2
    pages = PdfReader(pdf).pages
    lines = "\n".join(page.extract_text() for page in pages).splitlines()
    assert not any("\u200b" in line for line in lines)
    assert "\u200b" not in str(PdfReader(pdf).metadata)
    assert name in text_of(pdf)
    assert "biased" in text_of(pdf)
    assert not any(name in line for line in lines)  # 180 characters do not fit into 176 mm


def _table(num_lines: int) -> dict:
    return {"title": "Signals", "head": ["", "mean"], "lines": [["a", "1"]] * num_lines,
            "notes": ["a note"]}  # fmt: skip


@pytest.mark.parametrize("heights", [[2.35] * 7, [2.95, 2.15, 5.8], [8.5], [3.45, 1.9, 2.3, 7.3]])
@pytest.mark.parametrize("num_rows", [4, 18])
def test_no_page_of_a_report_but_the_last_has_an_empty_stripe(heights, num_rows, tmp_path):
    say = {"findings": "Findings", "definitions": "Definitions", "page": "page", "of": "of"}
    content = {
        "title": "T", "test": "a test", "version": "0", "labels": say, "summary": "All is well.",
        "meta": [["Motor", "m"]] * 3, "heading": "Outcome",
        "rows": [["a", "1", "K", ""]] * num_rows,
        "findings": [["note", "a finding " * 30]] * 4, "tables": [_table(8), _table(6), _table(3)],
        "captions": ["all over time"] * len(heights), "remark": "r",
        "definitions": [["a", "what it is " * 20]] * 9,
    }  # fmt: skip
    figures = [tmp_path / f"{number}.png" for number in range(len(heights))]
    for path, height in zip(figures, heights, strict=True):
        Image.new("L", (720, round(100 * height)), 128).save(path)
    lay_out(tmp_path, TEMPLATE, content, figures)
    pages = typst.compile(tmp_path / TEMPLATE.name, root=tmp_path, format="png", ppi=25.4)
    for page in pages[:-1]:  # of one point a millimetre
        drawn = np.asarray(Image.open(io.BytesIO(page)).convert("L")).min(axis=1) < 250
        inked = np.flatnonzero(drawn)
        assert np.max(np.diff(inked)) <= 20 + 1
        assert inked[0] <= 15 + 5


@pytest.mark.usefixtures("unset")
def test_reports_from_records_in_memory(tmp_path):
    record = read_test(write_drive(tmp_path / "a.csv"), CAR)
    memory = type(record)("in memory", record.channels)
    (outcome,) = make_report("energy", CAR, [memory], tmp_path / "out")
    assert outcome.error is None
    assert np.isfinite(outcome.report.result.energy_kWh)


STEM = "GeneralInformationTest_2022_12_07_001"
ENDS = (".csv", ".json", ".pdf")


@pytest.fixture
def test_file(tmp_path):
    return write_drive(tmp_path / TEST)


def report(path: Path, out: Path):
    (outcome,) = make_report("general", CAR, [path], out)
    return outcome


@pytest.mark.usefixtures("unset")
@pytest.mark.parametrize("step", ["write_pdf", "csv_table", "to_json"])
def test_a_full_disk_leaves_the_earlier_report_and_no_piece(step, test_file, tmp_path, monkeypatch):
    out = tmp_path / "out"
    assert report(test_file, out).error is None
    before = {path.name: path.read_bytes() for path in out.iterdir()}

    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(job, step, full)
    outcome = report(test_file, out)
    assert "the report cannot be written: No space left" in str(outcome.error)
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    assert "No space left" in str(report(test_file, tmp_path / "new").error)
    assert not list((tmp_path / "new").iterdir())


def test_a_killed_report_leaves_nothing_that_looks_like_one(test_file, tmp_path):
    out = tmp_path / "out"
    program = (
        "import os, signal, sys, pathlib\n"
        "from heatrun.record.motor import Motor\n"
        "from heatrun_reports import job, make_report\n"
        "job.csv_table = lambda report: os.kill(os.getpid(), signal.SIGKILL)\n"
        f"make_report('general', Motor('car'), [pathlib.Path({str(test_file)!r})], "
        f"pathlib.Path({str(out)!r}))\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert done.returncode == -9
    assert all(path.name.startswith(".") for path in out.iterdir())
    assert report(test_file, out).error is None
    assert sorted(path.name for path in out.iterdir()) == [STEM + end for end in ENDS]


@pytest.mark.usefixtures("unset")
def test_the_mark_that_an_earlier_version_left_is_taken_over(test_file, tmp_path):
    first = report(test_file, tmp_path / "out")
    identity = json.loads(first.json.read_text())["identity"]
    left = tmp_path / "left"
    left.mkdir()
    (left / f"{STEM}.json").write_text(json.dumps({"identity": identity}))
    assert report(test_file, left).pdf.name == f"{STEM}.pdf"
    assert sorted(path.name for path in left.iterdir()) == [STEM + end for end in ENDS]


@pytest.mark.usefixtures("unset")
def test_a_name_that_another_process_has_begun_is_taken_unless_it_is_the_same_report(
    test_file, tmp_path
):
    out = tmp_path / "out"
    other = FileSet.begin(out, set_name(STEM, ["another test"]))
    first = report(test_file, out)
    assert first.pdf.name == f"{STEM}-2.pdf"
    other.drop()
    identity = json.loads(first.json.read_text())["identity"]
    new = tmp_path / "new"
    same = FileSet.begin(new, set_name(STEM, identity))
    assert report(test_file, new).pdf.name == f"{STEM}.pdf"
    same.drop()
    assert sorted(path.name for path in new.iterdir()) == [STEM + end for end in ENDS]
