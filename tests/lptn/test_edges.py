"""The simulation at the edge of what parameters and records can be, against SciPy and formulas."""

import jax.numpy as jnp
import numpy as np
import pytest
from compiled import NUM, constant, simulate
from scipy.linalg import expm

import lptn
from lptn import CopperLosses, Inputs

B, T_REF = lptn.COPPER_COEFFICIENT, 25.0
REFERENCE = {"Ceq_w": 666.75, "Ceq_sr": 15060.1, "Req_w": 0.14485, "Req_sr": 0.11625}


def matrix(Ceq_w, Ceq_sr, Req_w, Req_sr, k=0.0, kind="balance"):
    """A of dT/dt = A T + q for two nodes by hand, stator first, k in W/K."""
    back = -k if kind == "balance" else 0.0
    return np.array(
        [
            [(-1 / Req_w - 1 / Req_sr) / Ceq_sr, (1 / Req_w + back) / Ceq_sr],
            [1 / Req_w / Ceq_w, (-1 / Req_w + k) / Ceq_w],
        ]
    )


def source(Ceq_w, Ceq_sr, Req_w, Req_sr, losses, ambient, k=0.0, kind="balance"):
    copper = k * B
    other = losses - copper if kind == "balance" else losses
    return np.array([(other + ambient / Req_sr) / Ceq_sr, copper / Ceq_w])


def exact(values, start, times, *, losses, ambient=20.0, k=0.0):
    """Stator and winding [degC] at some times of a load that is held, from the same two."""
    A = matrix(**values, k=k)
    steady = np.linalg.solve(A, -source(**values, losses=losses, ambient=ambient, k=k))
    return np.stack([steady + expm(A * t) @ (start - steady) for t in times])


def both(trace, at):
    return np.stack([np.asarray(trace.temperature[n])[at] for n in ("stator", "winding")], axis=-1)


COLD = {"winding": 20.0, "stator": 20.0}
LOSSES = CopperLosses(Rs0=jnp.asarray(0.0062))


def slope_at(current):
    """Copper loss by kelvin [W/K]."""
    return 3 * 0.0062 / (B + T_REF) * current**2


@pytest.mark.parametrize("seed", range(5))
def test_random_machines_against_scipy(seed):
    """Parameters log-uniform over three decades each way, loads that change, a cold sink."""
    rng = np.random.default_rng(seed)
    values = {
        "Ceq_w": 500.0 * 10 ** rng.uniform(-3, 3),
        "Ceq_sr": 15000.0 * 10 ** rng.uniform(-3, 3),
        "Req_w": 0.15 * 10 ** rng.uniform(-3, 3),
        "Req_sr": 0.12 * 10 ** rng.uniform(-3, 3),
    }
    network = lptn.second_order(**values)
    step = 0.2 * float(lptn.longest_step(network))
    num = 400
    # heat that warms a kelvin or so per step, whatever the size of the machine
    pace = min(values["Ceq_w"], values["Ceq_sr"]) / step * 1e-2
    power = pace * rng.uniform(1.0, 3.0, num)
    squared = rng.uniform(0.0, 1.0, num)
    Rs0 = 0.3 * pace / 3.0
    losses = CopperLosses(Rs0=jnp.asarray(Rs0))
    inputs = Inputs(
        step=jnp.asarray(step),
        current_squared=jnp.asarray(np.pad(squared, (0, NUM - num))),
        losses=jnp.asarray(np.pad(power, (0, NUM - num))),
        ambient=jnp.asarray(np.full(NUM, -40.0)),
    )
    trace = simulate(network, losses, inputs, {"winding": -40.0, "stator": -40.0})
    got = both(trace, slice(None))
    state, gaps, largest = np.array([-40.0, -40.0]), [], 1.0
    for index in range(num):
        k = 3.0 * Rs0 / (B + T_REF) * squared[index]
        A = matrix(**values, k=k)
        q = source(**values, losses=power[index], ambient=-40.0, k=k)
        # exact over an interval in which nothing changes, whatever the size of the machine
        whole = expm(step * np.block([[A, q[:, None]], [np.zeros((1, 3))]]))
        state = whole[:2, :2] @ state + whole[:2, 2]
        gaps.append(np.max(np.abs(state - got[index + 1])))
        largest = max(largest, np.max(np.abs(state + 40.0)))
    # the step is a fifth of the longest, h lambda < 0.2: 0.2^3/24 of the change in a step or so
    assert np.isfinite(gaps).all()
    assert max(gaps) < 4e-4 * largest


STIFF = {"Ceq_w": 20.0, "Ceq_sr": 15000.0, "Req_w": 0.05, "Req_sr": 0.12}


@pytest.mark.parametrize("factor", [1.01, 10.0, 1e3])
def test_a_step_beyond_the_fast_time_constant_is_refused_in_words(factor):
    network = lptn.second_order(**STIFF)
    step = factor * float(lptn.longest_step(network))
    with pytest.raises(ValueError, match=r"longer than the fastest node allows.*finer grid"):
        lptn.simulate(network, LOSSES, constant(step), COLD)


def test_the_longest_step_that_is_taken_is_still_right():
    """Stiff at the limit: what the fast node does wrong is bounded and dies away."""
    network = lptn.second_order(**STIFF)
    step = 0.999 * float(lptn.longest_step(network))
    trace = simulate(network, LOSSES, constant(step, current=100.0, losses=500.0), COLD)
    at = np.array([1, 10, 4000])
    expected = exact(STIFF, [20.0, 20.0], at * step, losses=500.0, k=slope_at(100.0))[:, 1]
    got = both(trace, at)[:, 1]
    # h/tau = 0.5: the third-order series misses the exponential by 0.5^4/24 = 0.26 % of the
    # winding's own rise of 10 K in a step
    np.testing.assert_allclose(got, expected, atol=0.03)
    np.testing.assert_allclose(got[-1], expected[-1], atol=1e-4)


@pytest.mark.parametrize(("product", "sign"), [(0.99, -1), (1.01, 1), (3.0, 1)])
def test_thermal_runaway_begins_where_the_formula_says(product, sign):
    """One node, losses from a map: dT/dt grows from m I^2 Rs0 Req/(B + Tref) = 1 on."""
    C, R = 12_500.0, 0.132
    losses = CopperLosses(Rs0=jnp.asarray(0.0062), kind="map")
    squared = product / R / float(losses.slope(jnp.asarray(1.0)))
    rate = lptn.growth_rate(lptn.first_order(C, R), losses, squared)
    assert rate == pytest.approx((product - 1.0) / (R * C), rel=1e-9)
    assert np.sign(rate) == sign
    inputs = constant(5.0, current=np.sqrt(squared))
    trace = simulate(lptn.first_order(C, R), losses, inputs, {"winding": 20.0})
    pace = np.diff(np.asarray(trace.temperature["winding"])[:2001])
    assert np.sign(pace[-1] - pace[0]) == sign
    # the growth that the simulation shows is the eigenvalue
    shown = np.log(pace[-1] / pace[-101]) / (100 * 5.0)
    assert shown == pytest.approx(rate, rel=1e-6)


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_the_growth_rate_of_two_nodes_is_the_eigenvalue_by_hand(kind, network):
    losses = CopperLosses(Rs0=jnp.asarray(0.0062), kind=kind)
    for current in (0.0, 100.0, 600.0):
        A = matrix(**REFERENCE, k=slope_at(current), kind=kind)
        expected = np.linalg.eigvals(A).real.max()
        rate = lptn.growth_rate(network, losses, current**2)
        assert rate == pytest.approx(expected, rel=1e-9)


def test_no_current_is_the_passive_network_and_no_losses_the_cooling_curve(network):
    for power in (0.0, 300.0):
        inputs = constant(2.0, losses=power, ambient=-40.0)
        trace = simulate(network, LOSSES, inputs, {"winding": 120.0, "stator": 60.0})
        expected = exact(REFERENCE, [60.0, 120.0], [100.0, 2000.0], losses=power, ambient=-40.0)
        # (2/92)^3/24 of a change of 100 K: 4e-5 K
        np.testing.assert_allclose(both(trace, [50, 1000]), expected, atol=5e-5)
        assert np.max(np.abs(trace.copper_loss)) == 0.0


def test_a_gap_of_one_sample_is_one_long_step(network):
    """Steps of 1 s with one of 2 s, as where a sample is missing: the same as without the gap."""
    whole = simulate(network, LOSSES, constant(1.0, 100.0, 500.0), COLD)
    steps = np.ones(599)
    steps[299] = 2.0
    gap = Inputs(
        step=jnp.asarray(steps),
        current_squared=jnp.asarray(np.full(599, 1e4)),
        losses=jnp.asarray(np.full(599, 500.0)),
        ambient=jnp.asarray(np.full(599, 20.0)),
    )
    trace = simulate(network, LOSSES, gap, COLD)
    # the one long step: (2/92)^3/24 of what is left of a change of 30 K
    assert float(trace.reading[-1]) == pytest.approx(float(whole.reading[600]), abs=1e-5)
