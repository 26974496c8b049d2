"""The campaign in small, and that it can fail: what is torn, missing or left over is seen."""

import io
import json
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import h5py
import pytest
from tally import Tally, upper_limit
from wholeness import Expected, differs_from_manifest, marked_processes, pieces_of, torn

CAMPAIGN = Path(__file__).with_name("campaign.py")


def netcdf(value: float) -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w") as file:
        file["posterior/a"] = [value] * 1000
    return buffer.getvalue()


def workbook() -> bytes:
    from openpyxl import Workbook

    buffer = io.BytesIO()
    Workbook().save(buffer)
    return buffer.getvalue()


def document() -> bytes:
    from pypdf import PdfWriter

    writer, buffer = PdfWriter(), io.BytesIO()
    writer.add_blank_page(100, 100)
    writer.write(buffer)
    return buffer.getvalue()


CONTENTS = {
    "a.json": b'{"a": 1, "b": 2}',
    "a.csv": b"t,Tw\n0,20\n",
    "a.png": b"\x89PNG....IEND\xaeB`\x82",
}


@pytest.fixture
def result(tmp_path):
    """A whole result of every kind of file."""
    place = tmp_path / "out"
    place.mkdir()
    makers = {"a.nc": netcdf(1.0), "a.xlsx": workbook(), "a.pdf": document()}
    for name, content in {**CONTENTS, **makers}.items():
        (place / name).write_bytes(content)
    return place


def test_a_whole_result_has_no_fault(result):
    assert torn(result) == []
    assert pieces_of(result) == []


@pytest.mark.parametrize("name", [*CONTENTS, "a.nc", "a.xlsx", "a.pdf"])
def test_a_file_cut_anywhere_is_torn(name, result):
    content = (result / name).read_bytes()
    for share in (0.0, 0.3, 0.6, 0.95):
        (result / name).write_bytes(content[: int(share * len(content))])
        assert [fault.split(" ")[0] for fault in torn(result)] == [name]


def test_a_report_of_82_bytes_is_torn(result):
    (result / "a.json").write_text(json.dumps({"identity": ["0" * 64]}))
    assert "holds nothing but ['identity']" in torn(result)[0]


def test_what_lacks_is_seen_and_what_was_there_before_is_not_a_part(result):
    expected = Expected.learn(result, result, before=frozenset({"a.csv"}))
    assert expected.missing(result) == []
    (result / "a.pdf").unlink()
    assert expected.missing(result) == ["a.pdf"]
    for path in result.iterdir():
        path.unlink() if path.name != "a.csv" else None
    assert expected.missing(result) == []  # nothing was begun
    assert "a.pdf is not there" in expected.differences(result)


def test_a_value_that_differs_is_seen_also_in_files_that_are_never_the_same_bytes(result, tmp_path):
    other = tmp_path / "other"
    other.mkdir()
    for path in result.iterdir():
        (other / path.name).write_bytes(path.read_bytes())
    for place, date in ((result, 1), (other, 2)):
        (place / "a.json").write_text(json.dumps({"value": 0.1, "date": date}))
    expected = Expected.learn(result, other, frozenset())
    assert expected.differences(other) == []
    (other / "a.json").write_text(json.dumps({"value": 0.1 + 1e-15, "date": 2}))
    (other / "a.nc").write_bytes(netcdf(1.0 + 1e-15))
    assert expected.differences(other) == ["a.nc has other bytes", "a.json differs at ['/value']"]


def test_a_member_of_a_workbook_that_is_damaged_is_seen(result):
    data = bytearray((result / "a.xlsx").read_bytes())
    with zipfile.ZipFile(io.BytesIO(bytes(data))) as archive:
        start = archive.getinfo("xl/workbook.xml").header_offset
    data[start + 60] ^= 0xFF
    (result / "a.xlsx").write_bytes(bytes(data))
    assert [fault.split(" ")[0] for fault in torn(result)] == ["a.xlsx"]


def test_pieces_and_files_that_the_manifest_does_not_know_are_seen(result):
    (result / ".a.pdf.17.partial").write_bytes(b"")
    assert pieces_of(result) == [".a.pdf.17.partial"]
    digests = {"a.csv": "0" * 64}
    (result / "manifest.json").write_text(json.dumps({"files": digests, "format": ""}))
    assert differs_from_manifest(result) == ["a.csv: not the file that the manifest lists"]


def test_a_process_that_is_left_is_seen():
    mark = f"left behind by {os.getpid()};"
    words = [sys.executable, "-c", "print('here', flush=True); input()"]
    environment = {**os.environ, "HEATRUN_FAULTS_MARK": mark}
    pipe = subprocess.PIPE
    with subprocess.Popen(words, env=environment, stdin=pipe, stdout=pipe) as process:
        # Before that the kernel may not have set the environment of the new program.
        assert process.stdout.readline() == b"here\n"
        assert marked_processes(mark) == [process.pid]
        process.communicate(b"\n")
    assert marked_processes(mark) == []


def test_the_tally_goes_on_and_counts_its_own_packages_alone(tmp_path):
    tally = Tally(tmp_path / "kills.jsonl", "new")
    Tally(tally.path, "old").add([{"kind": "kill"}])
    tally.add([{"kind": "kill"}, {"kind": "end"}])
    with tally.path.open("a") as file:
        file.write('{"kind": "ki')  # as a kill of the campaign leaves it
    tally.add([{"kind": "late"}])
    assert [row["kind"] for row in tally.rows()] == ["kill", "end", "late"]
    assert tally.others() == {"old": 1}


def test_the_upper_limit_of_none_in_a_thousand_is_three():
    assert upper_limit(0, 1000) == pytest.approx(1 - 0.05 ** (1 / 1000))
    assert upper_limit(1, 10) > upper_limit(0, 10)


def test_a_command_that_is_killed_goes_on_and_so_does_the_campaign(tmp_path):
    results = tmp_path / "results"
    words = [sys.executable, str(CAMPAIGN), "--only", "check", "--parts", "kills"]
    words += ["--workers", "1", "--minutes", "5", "--results", str(results)]
    words += ["--scratch", str(tmp_path / "scratch")]
    before = ""
    for kills in (1, 3):
        done = subprocess.run(
            [*words, "--kills", str(kills)], capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stderr
        lines = (results / "kills.jsonl").read_text()
        assert lines.startswith(before)
        before = lines
    rows = [json.loads(line) for line in before.splitlines()]
    assert [row["same"] for row in rows if row["kind"] == "learnt"] == [[]]  # check writes none
    assert sum(row["kind"] == "kill" for row in rows) >= 3
    assert all(row["faults"] == [] for row in rows)
    assert "| check | SIG" in (results / "table.md").read_text()
