"""The study of populations: its machines obey physics, its table counts what its rows say."""

import json
from pathlib import Path

import numpy as np
import pytest
from fleet import table
from fleet_cases import NAMES, B_degC, REFERENCE_degC, ROOM_degC, courses, draw_fleet, write_fleet
from scipy.integrate import solve_ivp

from heatrun_fleet.fleet_file import load_fleet


def test_a_machine_warms_as_scipy_says():
    values = np.array([[667.0, 15060.0, 0.145, 0.116], [500.0, 9000.0, 0.2, 0.08]])
    ohm = np.array([0.0062, 0.0070])
    load = np.array([[120.0], [90.0]]), np.array([[250.0], [400.0]])
    current, other = (np.repeat(each, 1800, axis=1) for each in load)
    winding, _ = courses(values, current, other, ohm)

    def slope(_, T, row):
        C_w, C_sr, R_w, R_sr = values[row]
        warm = (B_degC + T[0]) / (B_degC + REFERENCE_degC)
        copper = 3.0 * ohm[row] * warm * load[0][row, 0] ** 2
        flow = (T[0] - T[1]) / R_w
        out = (T[1] - ROOM_degC) / R_sr
        return [(copper - flow) / C_w, (load[1][row, 0] + flow - out) / C_sr]

    for row in range(2):
        exact = solve_ivp(slope, (0.0, 1799.0), [ROOM_degC] * 2, args=(row,), rtol=1e-10,
                          atol=1e-10).y[0, -1]  # fmt: skip
        assert winding[row, -1] == pytest.approx(exact, abs=1e-6)


def test_a_fleet_is_what_it_was_drawn_from():
    fleet = draw_fleet(3, 4000, outliers=0.05, short=0.25)
    fits = ~fleet.is_outlier
    apart = fleet.logs - fleet.mean - fleet.is_south[:, None] * fleet.supplier
    assert np.mean(fits) == 0.95
    assert np.mean(fleet.minutes == 30.0) == 0.25
    np.testing.assert_allclose(apart[fits].std(axis=0), fleet.sd, rtol=0.05)
    np.testing.assert_allclose(np.corrcoef(apart[fits].T), fleet.correlation, atol=0.06)
    odd = np.abs(apart[~fits, fleet.odd[~fits]])
    assert np.all(odd > 0.1)
    assert fleet.logs.tolist() == draw_fleet(3, 4000, outliers=0.05, short=0.25).logs.tolist()


def test_its_files_are_a_fleet(tmp_path):
    fleet = draw_fleet(3, 4)
    loaded = load_fleet(write_fleet(fleet, tmp_path / "bench", 3))
    assert [entry.machine for entry in loaded.entries] == fleet.machines
    lines = (tmp_path / "bench" / "tests" / "M0000.csv").read_text().splitlines()
    assert lines[0] == "t,Is,Pd,Te,Tw_m"
    assert len(lines) - 1 == fleet.minutes[0] * 30


def machine(**said):
    good = {
        "is_short": True, "is_outlier": False, "odd": "", "outlier_probability": 0.01,
        "different": [], "error_alone": [0.04] * 4, "error_given": [0.01] * 4,
        "is_inside": [True] * 4, "is_inside_alone": [True] * 4,
    }  # fmt: skip
    return {**good, **said}


def test_the_table_counts():
    entry = {"kind": "median", "parameter": "Req_w", "truth": 1.0, "value": 1.1, "low": 0.9,
             "high": 1.2}  # fmt: skip
    missed = {**entry, "low": 1.05, "kind": "spread"}
    machines = [
        machine(), machine(is_short=False, outlier_probability=0.9),
        machine(is_outlier=True, odd="Req_w", outlier_probability=0.9, different=["Req_w"]),
        machine(is_outlier=True, odd="Ceq_w"),
    ]  # fmt: skip
    row = {"machines": 5, "population": [entry, missed], "machines_found": machines,
           "left_out": [{}], "is_converged": True}  # fmt: skip
    text = table([row], None, {"seed": 1, "command": "c", "versions": {}, "planned": 3})
    assert "all parameters of the population | 93…97 % | 50.0 % (1 of 2)" in text
    assert "| outliers found | ≥ 90 % | 50.0 % (1 of 2)" in text
    assert "that are none | ≤ 2 % | 50.0 % (1 of 2)" in text
    assert "| ≥ 2 | 4.00 (4.0 % to 1.0 %, 1 machines)" in text
    assert "named that differs | ≥ 90 % | 100.0 % (1 of 1)" in text
    assert "1 of 3 fleets, 5 machines" in text
    assert "Left out: 1 of 5 machines. Converged: 1 of 1" in text


def test_scores_of_the_two_stages_are_their_laws():
    """What one stage starts from and is compared with."""
    pytest.importorskip("numpyro")
    import jax
    import jax.numpy as jnp
    from fleet_one_stage import _scores

    from heatrun_fleet.population.gathered import Evidence
    from heatrun_fleet.population.law import Hyperprior, num_scores, unpack
    from heatrun_fleet.population.sampling import Population

    rng = np.random.default_rng(2)
    hyper = Hyperprior(np.arange(4.0), np.full(4, 2.0), np.full(4, 0.2), np.full(4, 0.1))
    drawn = 0.4 * rng.standard_normal((50, num_scores(4, 1)))
    laws, _ = jax.vmap(lambda z: unpack(z, hyper, 1))(jnp.asarray(drawn))
    evidence = Evidence(NAMES, np.zeros((3, 4)), np.tile(np.eye(4), (3, 1, 1)), np.zeros(3))
    two = Population(evidence, np.zeros((3, 1)), hyper, laws, "importance", 0.1, True)
    np.testing.assert_allclose(_scores(two), drawn, atol=1e-9)


def test_what_is_kept_says_how_it_was_made():
    kept = Path(__file__).parents[2] / "results" / "fleet" / "population_rows.json"
    content = json.loads(kept.read_text(encoding="utf-8"))
    assert {"command", "seed", "planned", "versions"} <= set(content)
    assert all(row["seed"] >= content["seed"] for row in content["rows"])
