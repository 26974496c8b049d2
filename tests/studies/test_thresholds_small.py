"""The study of the discovery's thresholds: each is read where the study sets it."""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from discovery_thresholds import AS_IT_IS, ROOM, THRESHOLDS, changed, jobs, table


@pytest.mark.parametrize("threshold", THRESHOLDS, ids=lambda t: f"{t.places[0]}.{t.name}")
def test_a_threshold_is_set_in_every_module_that_reads_it(threshold):
    before = threshold.value
    low, high = threshold.others
    assert low < before < high
    with threshold.at(high):
        for place in threshold.places:
            assert getattr(import_module(f"{ROOM}.{place}"), threshold.name) == high
    assert threshold.value == before
    readers = [
        path
        for path in Path(import_module(ROOM).__path__[0]).rglob("*.py")
        if f"import {threshold.name}" in (text := path.read_text("utf-8"))
        or f", {threshold.name}" in "".join(row for row in text.splitlines() if " import " in row)
    ]
    # one tells of thresholds and decides nothing, one has a threshold of its own from it
    named = {place.split(".")[-1] for place in threshold.places} | {"fates"}
    named |= {"acceptance"} if threshold.name == "VISIBLE_K" else set()
    for path in readers:
        source = path.read_text("utf-8")
        if f"{threshold.places[0].split('.')[-1]} import" in source:
            assert path.stem in named, f"{path.stem} reads {threshold.name} too"


def test_the_table_counts_what_changed():
    found = {AS_IT_IS: {"verdict": "adequate", "named": []}}
    for place, threshold in enumerate(THRESHOLDS):
        for value in threshold.others:
            found[f"{place} {value:g}"] = dict(found[AS_IT_IS])
    claimed = {"verdict": "named", "named": [{"id": "radiation", "test": None, "equivalents": []}]}
    first = THRESHOLDS[0]
    row = {"group": "clean", "hidden": (), "only_test": None, "seed": 1, "is_visible": False}
    rows = [
        {**row, "found": {**found, f"0 {first.others[1]:g}": claimed}},
        {**row, "seed": 2, "found": found},
    ]
    assert changed(rows[0]) == [f"0 {first.others[1]:g}"]
    lines = table(rows, 1, 2).splitlines()
    mine = next(line for line in lines if first.meaning in line)
    assert "| 0, 0, 1 of 2 |" in mine
    assert mine.endswith("| 0, 1 of 2 |")
    assert sum("0, 0, 0 of 2" in line for line in lines) == len(THRESHOLDS) - 1


def test_groups_take_turns():
    listed = jobs(1, 3)
    assert [job["group"] for job in listed[:4]] == ["clean", "unknown", "effect", "pair"]
    assert len({job["seed"] for job in listed}) == len(listed) == 12
