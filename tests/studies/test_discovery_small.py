"""The discovery study in small: two cases through the command, down to the written run folder."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

DEVELOPMENT_SEED = 4_000


@pytest.fixture(scope="module")
def rows():
    """An event in the second of two tests; a cooled machine looked at from the first order."""
    from discovery_cases import run

    common = {"target_K": 0.8, "seed": DEVELOPMENT_SEED}
    return [
        run({"group": "event", "hidden": ("cooling_step",), "order": "second", "only_test": 1,
             **common}),
        run({"group": "one node", "hidden": ("speed_cooling",), "order": "first",
             "only_test": None, **common}),
    ]  # fmt: skip


def test_the_command_ends_with_a_result(rows):
    for row in rows:
        assert row["exit_code"] == 0, row["failure"]
        assert row["failure"] == ""
        assert row["verdict"] in ("named", "ambiguous")


def test_an_event_in_one_test_of_two_is_named_in_that_test(rows):
    from discovery_gates import is_right

    event = rows[0]
    assert is_right(event, "cooling_step") == "exact"
    assert [n["test"] for n in event["named"] if n["id"] == "cooling_step"] == ["test_2"]
    assert is_right({**event, "only_test": 0}, "cooling_step") == "missed"


def test_from_the_first_order_the_winding_is_named_and_the_held_out_gap_closed(rows):
    from discovery_gates import all_right, is_right

    one_node = rows[1]
    assert is_right(one_node, "winding_node") == "exact"
    # what the winding closes is no measure of what the next effect must close
    assert all_right(one_node)
    gap = one_node["holdout"]
    assert gap["rmse_after_K"] < 0.1 * gap["rmse_before_K"]
    assert gap["took_part_in_selection"] is True


def test_gates_and_table_count_what_failed(rows):
    from discovery import table
    from discovery_gates import gates

    failed = {**rows[0], "exit_code": None, "failure": "Traceback", "verdict": "none",
              "named": [], "traces": [], "holdout": None}  # fmt: skip
    listed = [{**row, "place": place} for place, row in enumerate([*rows, failed])]
    found = {gate["what"]: gate for gate in gates(listed)}
    crash = found["tracebacks, or no result written"]
    assert (crash["count"], crash["cases"], crash["holds"]) == (1, 3, False)
    # Clopper and Pearson, 1 of 3: the published limits
    assert crash["limits_95"] == pytest.approx([0.0084, 0.9057], abs=1e-4)
    winding = found["from the first order: the winding named"]
    assert (winding["count"], winding["cases"]) == (0, 0)
    both = found["from the first order, a second effect beside it: both named"]
    assert (both["count"], both["cases"]) == (1, 1)
    text = table(listed, list(found.values()), "discovery.py", DEVELOPMENT_SEED, 3)
    assert (
        "| tracebacks, or no result written | 0 | 33.3 % | 1 of 3 | 1…91 % | **missed** |" in text
    )
    assert "cooling_step in test_2 alone" in text
