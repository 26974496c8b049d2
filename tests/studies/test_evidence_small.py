"""The study of the evidence: what counts, what is said of it, and one machine through it."""

import pytest
from evidence import SEED, counts, pairs, run, table


def drawn(laplace, sampled, is_sound=True, is_held=False):
    return {"laplace": laplace, "sampled": sampled, "sd": 0.3, "pareto_k": 0.2,
            "is_sound": is_sound, "is_held": is_held}  # fmt: skip


ROW = {
    "kind": "hub motor", "seed": SEED, "effects": ["lag", "fan", "drift"],
    "core": drawn(100.0, 101.0),
    "without": {"lag": drawn(90.0, 93.0), "fan": drawn(20.0, 5.0, is_sound=False),
                "drift": drawn(50.0, 9.0, is_held=True)},
}  # fmt: skip


def test_bayes_factors_are_differences_and_doubtful_ones_do_not_count():
    lag, fan, drift = pairs([ROW])
    assert (lag["laplace"], lag["sampled"]) == (10.0, 8.0)
    assert lag["sd"] == pytest.approx(0.3 * 2**0.5)
    assert counts(lag) == "yes"
    assert "guard" in counts(fan)
    assert "prior" in counts(drift)
    said = table([ROW])
    assert "1 of 3 pairs count" in said
    assert "median 2.0 nat" in said
    assert "otherwise in 0 of them" in said


@pytest.mark.slow
def test_laplace_and_sampling_agree_on_a_machine():
    row = run({"kind": "drone outrunner", "seed": 8_004})
    every = [each for each in pairs([row]) if counts(each) == "yes"]
    assert len(every) >= 2
    assert all(abs(each["laplace"] - each["sampled"]) < 8.0 for each in every)
