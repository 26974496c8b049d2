"""The page on fleets says the columns that there are; its queries run."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import duckdb
import pytest

import heatrun
from heatrun_fleet.entries import COLUMNS as OF_A_TABLE
from heatrun_fleet.fleet_file import KEYS
from heatrun_fleet.population.table import COLUMNS as OF_A_POPULATION
from heatrun_fleet.rows import COLUMNS

PAGE = (Path(__file__).parents[2] / "docs" / "fleet.md").read_text("utf-8")


@pytest.mark.parametrize("columns", [COLUMNS, OF_A_POPULATION], ids=["fleet", "population"])
def test_the_page_lists_every_column_of_the_rows(columns):
    expected = [
        f"| `{name}` | {kind} | {unit} | {meaning} |" for name, kind, unit, meaning in columns
    ]
    start = PAGE.index(expected[0])
    assert PAGE[start:].splitlines()[: len(expected)] == expected


def test_the_page_says_every_key_and_column_of_the_fleet_file():
    assert all(re.search(rf"^    {key} = ", PAGE, re.M) for key in KEYS)
    assert all(f"`{name}`" in PAGE for name in OF_A_TABLE)


def test_the_queries_run(finished, tmp_path, monkeypatch):
    shutil.copy(finished / "out" / "machines.parquet", tmp_path)
    heatrun.population(finished / "out", out=tmp_path)
    monkeypatch.chdir(tmp_path)
    queries = re.findall(r"^    (select .*?);$", PAGE, re.M | re.S)
    assert len(queries) == 7
    for query in queries:
        duckdb.sql(query).fetchall()
