"""Two columns of one name are told apart, and either can be named."""

from __future__ import annotations

import gzip

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.init.survey import survey
from heatrun.readers.read import read_raw, read_record
from heatrun.record.motor import Motor

HEAD = ["t [s]", "T_w [K]", "T_w [K]", "T_w [K]", "losses_W"]
ROWS = [[i, 300.0 + i, 310.0 + i, 320.0 + i, 100.0] for i in range(5)]
TEXT = "\n".join(",".join(map(str, row)) for row in [HEAD, *ROWS])


def as_csv(path):
    path.write_text(TEXT)


def as_gzip(path):
    path.write_bytes(gzip.compress(TEXT.encode()))


def as_workbook(path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    for row in [HEAD, *ROWS]:
        book.active.append(row)
    book.save(path)


@pytest.fixture(params=[("t.csv", as_csv), ("t.csv.gz", as_gzip), ("t.xlsx", as_workbook)],
                ids=lambda one: one[0])  # fmt: skip
def bench(request, tmp_path):
    name, write = request.param
    write(tmp_path / name)
    return tmp_path / name


@pytest.mark.parametrize(
    ("line", "first"),
    [
        ("T_w [K] #1", 26.85),
        ("T_w [K] #2", 36.85),
        ("T_w [K] #3", 46.85),
        ("T_w [K] #2 [degC]", 310),
    ],
)
def test_each_of_them_can_be_named_and_keeps_its_unit(bench, line, first):
    record = read_record(bench, Motor("M", columns={"winding_degC": line}))
    np.testing.assert_allclose(record["winding_degC"], first + np.arange(5))
    assert len(record.unused) == 2
    assert any("3 columns are called 'T_w [K]'" in note for note in record.notes)


@pytest.mark.parametrize("line", ["T_w", "T_w [K]"])
def test_a_name_that_is_two_is_a_question_with_an_answer(bench, line):
    with pytest.raises(InputError, match=r"'T_w \[K\] #1' and 'T_w \[K\] #2'") as error:
        read_record(bench, Motor("M", columns={"winding_degC": line}))
    assert 'winding_degC = "T_w [K] #1"' in str(error.value)


def test_init_offers_both(bench):
    free = {column.name: column for column in survey(bench).free}
    assert set(free) == {"T_w [K] #1", "T_w [K] #2", "T_w [K] #3"}
    assert free["T_w [K] #2"].unit == "K"
    assert "T_w [K] #2" in {one.line for one in free["T_w [K] #2"].proposals}


def test_a_name_that_is_there_already_is_not_taken(tmp_path):
    (tmp_path / "t.csv").write_text("t,a,a #2,a\n0,1,2,3\n1,1,2,3\n")
    names = [column.name for column in read_raw(tmp_path / "t.csv").columns]
    assert names == ["t", "a #1", "a #2", "a #3"]
