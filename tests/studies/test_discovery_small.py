"""The discovery study in small: cases through the command, down to the written run folder."""

import pytest

pytestmark = pytest.mark.slow

DEVELOPMENT_SEED = 4_000


@pytest.fixture(scope="module")
def event():
    from discovery_cases import run

    return run({"group": "event", "hidden": ("cooling_step",), "order": "second", "only_test": 1,
                "target_K": 0.8, "seed": DEVELOPMENT_SEED})  # fmt: skip


def test_an_event_in_one_test_of_two_is_named_in_that_test(event):
    from discovery import is_right

    assert event["exit_code"] == 0, event["failure"]
    assert event["verdict"] in ("named", "ambiguous")
    assert is_right(event, "cooling_step") == "exact"
    assert [n["test"] for n in event["named"] if n["id"] == "cooling_step"] == ["test_2"]
    assert is_right({**event, "only_test": 0}, "cooling_step") == "missed"


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
