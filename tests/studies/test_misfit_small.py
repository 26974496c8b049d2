"""The table of the misfit study counts what it says, on rows made by hand."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

PARAMETERS = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")


def row(kind: str, seed: int, *, off: float = 0.0, findings=(), p: float = 0.5, **measures):
    """A row whose Ceq_sr is off by so many standard deviations of 1."""
    truth = dict.fromkeys(PARAMETERS, 100.0)
    value = {**truth, "Ceq_sr": 100.0 + off}
    return {
        "kind": kind, "seed": seed, "exit_code": 0, "processor_s": 5.0, "visible_K": 0.2,
        "truth": truth, "value": value, "sd": dict.fromkeys(PARAMETERS, 1.0),
        "interval_95": {n: [v - 1.96, v + 1.96] for n, v in value.items()},
        "interval_95_with_truth": {n: [v - 0.98, v + 0.98] for n, v in value.items()},
        "holdout_coverage_95": 0.95,
        "findings": [[id, text] for id, text in findings],
        "measures": {"missing_effect_p": p, "unmodelled_heat": 0.0015, "noise_time_s": 40.0,
                     "instruments_p": 0.5} | measures,
    }  # fmt: skip


SEEN = ("missing_effect", "is incomplete")
SLOW = ("misfit", "its residuals are correlated over more than 150 s")


@pytest.fixture(scope="module")
def rows():
    return [
        row("nothing", 1),
        row("nothing", 2, p=0.015),
        row("rotor_node", 3, off=4.0),  # silent
        row("rotor_node", 4, off=4.0, findings=[SEEN], p=0.002),
        row("rotor_node", 5, off=2.5, findings=[SLOW], noise_time_s=155.0),
        row("rotor_node", 6, off=4.0, p=0.012),  # silent, seen at twice the threshold
    ]


def test_thresholds_are_counted_at_half_and_at_twice_their_value(rows):
    from misfit import findings_at, thresholds

    assert findings_at(rows[3], "missing_effect_p", 0.5) == {"missing_effect"}
    assert findings_at(rows[3], "missing_effect_p", 0.1) == set()
    assert findings_at(rows[4], "noise_time_s", 1.0) == {"misfit"}
    assert findings_at(rows[4], "noise_time_s", 2.0) == set()
    assert findings_at(rows[4], "unmodelled_heat", 2.0) == {"misfit"}, "another reason stays"
    (line,) = [line for line in thresholds(rows) if "missing_effect" in line]
    assert "| 0, 0, 1 of 2 | 2, 2, 1 of 4 |" in line


def test_the_table_sets_an_earlier_release_beside(rows):
    from misfit import table

    before = [row("rotor_node", seed, off=4.0) for seed in (4, 5, 6)]
    text = table(rows, "misfit.py", 1, 6, before)
    (line,) = [line for line in text.splitlines() if line.startswith("| rotor_node")]
    cells = [cell.strip() for cell in line.split("|")]
    assert cells[4] == "3 (3) of 3"
    assert cells[6] == "2 (2) of 4"
    assert cells[9] == "2.00"
    assert "silent by more than 3 sds, visible above 0.1 K | ≤ 3 % | 50.0 % (2 of 4)" in text
