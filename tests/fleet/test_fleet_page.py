"""The page on fleets says the columns that there are; its queries run."""

from __future__ import annotations

import re
from pathlib import Path

import duckdb

from heatrun.fleet.entries import COLUMNS as OF_A_TABLE
from heatrun.fleet.fleet_file import KEYS
from heatrun.fleet.rows import COLUMNS

PAGE = (Path(__file__).parents[2] / "notebooks" / "fleet.md").read_text("utf-8")


def test_the_page_lists_every_column_of_the_rows():
    expected = [
        f"| `{name}` | {kind} | {unit} | {meaning} |" for name, kind, unit, meaning in COLUMNS
    ]
    start = PAGE.index(expected[0])
    assert PAGE[start:].splitlines()[: len(expected)] == expected


def test_the_page_says_every_key_and_column_of_the_fleet_file():
    assert all(re.search(rf"^    {key} = ", PAGE, re.M) for key in KEYS)
    assert all(f"`{name}`" in PAGE for name in OF_A_TABLE)


def test_the_queries_run(finished, monkeypatch):
    monkeypatch.chdir(finished / "out")
    queries = re.findall(r"^    (select .*?);$", PAGE, re.M | re.S)
    assert len(queries) == 5
    for query in queries:
        duckdb.sql(query).fetchall()
