"""The discovery study in small: cases through the command, down to the written run folder."""

import pytest

pytestmark = pytest.mark.slow

DEVELOPMENT_SEED = 4_000


COMMON = {"target_K": 0.8, "seed": DEVELOPMENT_SEED}


@pytest.fixture(scope="module")
def event():
    from discovery_cases import run

    return run({"group": "event", "hidden": ("cooling_step",), "order": "second", "only_test": 1,
                **COMMON})  # fmt: skip


@pytest.fixture(scope="module")
def one_node():
    from discovery_cases import run

    return run({"group": "one node", "hidden": ("speed_cooling",), "order": "first",
                "only_test": None, **COMMON})  # fmt: skip


def check_end(row):
    assert row["exit_code"] == 0, row["failure"]
    assert row["failure"] == ""
    assert row["verdict"] in ("named", "ambiguous")


def test_an_event_in_one_test_of_two_is_named_in_that_test(event):
    from discovery import is_right

    check_end(event)
    assert is_right(event, "cooling_step") == "exact"
    assert [n["test"] for n in event["named"] if n["id"] == "cooling_step"] == ["test_2"]
    assert is_right({**event, "only_test": 0}, "cooling_step") == "missed"


@pytest.mark.slow
def test_from_the_first_order_the_winding_is_named_and_the_held_out_gap_closed(one_node):
    from discovery import all_right, gates, is_right

    check_end(one_node)
    assert is_right(one_node, "winding_node") == "exact"
    # what the winding closes is no measure of what the next effect must close
    assert all_right(one_node)
    gap = one_node["holdout"]
    assert gap["rmse_after_K"] < 0.1 * gap["rmse_before_K"]
    assert gap["took_part_in_selection"] is False
    both = "from the first order, a second effect beside it: both named | ≥ 75 % | 100.0 % (1 of 1)"
    assert any(both in gate for gate in gates([{**one_node, "place": 0}]))


def test_the_table_counts_what_failed(event):
    from discovery import table

    failed = {**event, "exit_code": None, "failure": "Traceback", "verdict": "none",
              "named": [], "traces": [], "holdout": None}  # fmt: skip
    listed = [{**row, "place": place} for place, row in enumerate([event, failed])]
    text = table(listed, "discovery.py", DEVELOPMENT_SEED, 2)
    # Clopper and Pearson, 1 of 2: 1 - 0.975^(1/2) and 0.975^(1/2)
    crash = "tracebacks, or no result written | ≤ 0 % | 50.0 % (1 of 2) | 1…99 % | **missed** |"
    assert f"| {crash}" in text
    assert "| from the first order: the winding named | ≥ 95 % | – | – | – |" in text
    assert "cooling_step in test_2 alone" in text
