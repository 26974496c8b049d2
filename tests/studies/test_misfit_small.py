"""The table of the misfit study counts what it says, on rows made by hand."""

import pytest

PARAMETERS = ("Ceq_w", "Ceq_sr", "Req_w", "Req_sr")


def row(kind: str, seed: int, *, off: float = 0.0, use: str = "usable", has=(), maybe=()):
    """A row whose Ceq_sr is off by so many standard deviations of 1."""
    truth = dict.fromkeys(PARAMETERS, 100.0)
    value = {**truth, "Ceq_sr": 100.0 + off}
    return {
        "kind": kind, "seed": seed, "exit_code": 0, "processor_s": 5.0, "visible_K": 0.2,
        "truth": truth, "value": value, "sd": dict.fromkeys(PARAMETERS, 1.0),
        "interval_95": {n: [v - 1.96, v + 1.96] for n, v in value.items()},
        "interval_95_with_truth": {n: [v - 0.98, v + 0.98] for n, v in value.items()},
        "holdout_coverage_95": 0.95, "use": use, "has": list(has), "maybe": dict(maybe),
    }  # fmt: skip


@pytest.fixture(scope="module")
def text():
    from misfit import table

    rows = [
        row("nothing", 1),
        row("nothing", 2, has=["radiation"]),
        row("rotor_node", 3, off=4.0),  # silent
        row("rotor_node", 4, off=4.0, use="restricted", maybe={"rotor_node": 0.6}),
        row("rotor_node", 5, off=2.5, has=["rotor_node"]),
        row("rotor_node", 6, off=4.0, use="not usable"),
    ]
    return table(rows, "misfit.py", 1, 6)


def test_off_is_silent_on_a_page_that_says_usable(text):
    (line,) = [line for line in text.splitlines() if line.startswith("| rotor_node")]
    cells = [cell.strip() for cell in line.split("|")[1:-1]]
    assert cells[3:8] == ["2 / 1 / 1", "3 (4)", "1", "1", "1"]
    assert cells[8] == "2.00"
    assert "| silent, visible above 0.1 K | ≤ 3 % | 25.0 % (1 of 4)" in text


def test_an_effect_that_is_not_there_counts_on_clean_machines(text):
    (line,) = [line for line in text.splitlines() if line.startswith("| nothing")]
    assert "another in 1" in line
    assert "| clean machines with an effect in the model | ≤ 5 % | 50.0 % (1 of 2)" in text
