"""The study of accidents: its cases are struck as they say, its table counts what it says."""

import pytest
from accidents import is_named, run, table


def test_clean_records_are_not_accused_and_accidents_are_named(tmp_path):
    names = ["", "sensor falls off", "a phase reads nothing", "marker in the power"]
    rows = [run({"accident": name, "seed": 1}, tmp_path) for name in names]
    assert all(is_named(row) for row in rows if row["accident"])
    text = table(rows, 1)
    assert "0 of 1 accused" in text
    assert "| sensor falls off | 1 | 1 | 1 |" in text
    assert "| **all** | 3 | 3 | 3 |" in text


def test_a_fast_machine_at_rest_on_a_rounded_reading_is_not_clipped(tmp_path):
    """The rest of the record leaves open where it comes to rest, and a network has it all."""
    assert "saturation" not in [
        found[0] for found in run({"accident": "", "seed": 54112}, tmp_path)["findings"]
    ]


@pytest.mark.parametrize("seed", [1006, 1009])
def test_an_amplitude_is_named_where_a_scale_of_the_power_would_do_as_well(tmp_path, seed):
    """Nobody answers for a scale in [columns]: the check that lists all causes tells it."""
    assert is_named(run({"accident": "peak in place of rms", "seed": seed}, tmp_path))


def test_another_moment_or_another_finding_is_not_named():
    found = ["sensor_detached", "error", "To leave its readings out: mask = [[1, 2]].", 900.0]
    row = {"accident": "sensor falls off", "seed": 1, "at_s": 900.0, "findings": [found]}
    assert is_named(row)
    assert not is_named(row | {"at_s": 2000.0})
    assert not is_named(row | {"findings": [["time_gap", *found[1:]]]})
