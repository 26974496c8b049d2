"""The same simulation by scipy and diffrax, from a balance written independently."""

import pytest
import simulation

# error of a third-order step of 2 s, ~ (h/tau)^3/24 of a load change of 50 K: time constants are
# 1650 s, 90 s and 11 s (437 J/K through 0.0265 K/W); measured 3e-9, 9e-6 and 1.3e-3 K
LIMIT_K = {"first order": 1e-7, "second order": 5e-5, "four nodes, five effects": 5e-3}


@pytest.mark.parametrize("name", simulation.NODES)
def test_the_simulation_is_that_of_scipy_and_diffrax(name):
    found = simulation.gaps(name, simulation.bundled_inputs("duty_90min", 2.0, 450))
    for rival in ("scipy DOP853", "diffrax Dopri8"):
        # two adaptive methods at 1e-11...1e-12 relative, over 450 restarts at about 100 degC
        assert found[f"reference / {rival}"] < 1e-8
        assert found[f"simulate / {rival}"] < LIMIT_K[name]


def test_a_wrong_law_would_be_seen(monkeypatch):
    """A radiating surface that is 1 % larger is more than the limit allows."""
    monkeypatch.setitem(simulation.independent.EFFECTS, "eA", 0.303)
    right = simulation.cases()["four nodes, five effects"]
    monkeypatch.setitem(simulation.independent.EFFECTS, "eA", 0.3)
    inputs = simulation.bundled_inputs("duty_90min", 2.0, 450)
    network, effects, slope = right
    edges, drive = simulation.plain(inputs)
    theirs = simulation.independent.by_scipy(slope, [20.0] * 4, edges, drive)
    found = simulation.ours(network, effects, inputs, simulation.lptn.simulate)
    assert abs(found["yoke"] - theirs[:, 2]).max() > LIMIT_K["four nodes, five effects"]
