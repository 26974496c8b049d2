"""The study of shut-downs: its cases go through the command, its table counts what it says."""

import numpy as np
import pytest
from shutdown import jobs, run, table
from shutdown_machines import machine


def test_a_small_version_of_the_study():
    planned = [
        {"seed": 900 + seed, "kind": kind, "delay_s": delay}
        for seed, (kind, delay) in enumerate([("bridge", 30.0)] * 3 + [("sensor", 30.0)])
    ]
    rows = [run(job) for job in planned]
    for row in rows:
        # 5 standard uncertainties: another machine than the priors allow
        assert abs(row["winding_degC"] - row["truth"]) < 5.0 * row["standard_uncertainty_K"]
        assert row["by_hand"]["logarithm of the rise, line to 0 s"] < row["truth"]
    text = table(rows, 900)
    assert "| bridge | 30 s | 3 | 0 |" in text
    assert "| sensor | 30 s | 1 | 0 |" in text


def test_the_table_counts_what_it_says():
    row = {"seed": 1, "kind": "bridge", "delay_s": 30.0, "truth": 100.0, "winding_degC": 101.0,
           "winding_95_degC": [99.0, 103.0], "is_determinable": True, "seconds": 1.0,
           "standard_uncertainty_K": 1.0, "gum_uncertainty_K": 0.9,
           "by_hand": {"parabola to 0 s": 94.0}}  # fmt: skip
    missed = row | {"winding_95_degC": [100.5, 103.0]}
    text = table([row, row, row, missed], 1)
    assert "75.0 % (3 of 4)" in text
    assert "| heatrun | +1.0, 1.0 |" in text
    assert "| parabola to 0 s | -6.0, 6.0 |" in text


def test_each_case_has_a_seed_of_its_own():
    seeds = [job["seed"] for job in jobs(50_000)]
    assert len(set(seeds)) == len(seeds) == 830


def test_the_machine_of_the_study_keeps_its_heat():
    """What leaves the nodes without losses goes to the air, nowhere else."""
    made = machine(np.random.default_rng(3))
    T = np.array([95.0, 90.0, 80.0, 70.0, 75.0])
    lost = -float(made.C @ made.slope(T, 0.0, is_on=False))
    rise = T[3] - made.ambient_degC
    assert lost == pytest.approx(made.G[4] * made.still * (rise / 40.0) ** made.exponent * rise)
