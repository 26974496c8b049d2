"""Rest, time to a limit and the current at it, against SciPy on hand-written balances."""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from written_balances import (
    CURRENT,
    LAWS,
    POWER,
    RATED,
    RS,
    RS0,
    RW,
    SINK,
    SPEED,
    TREF,
    B,
    K,
    built,
    drive,
    jacobian,
    rate,
)

import lptn
from lptn import CopperLosses, Drive


@pytest.mark.parametrize("kind", ["balance", "map"])
@pytest.mark.parametrize("law", LAWS)
def test_a_network_rests_where_the_heat_that_enters_leaves(law, kind, network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind=kind)
    found = lptn.steady_state(network, losses, drive(), effects=built(law, network))

    def winding(stator):  # from the balance of the winding alone
        return (stator / RW + K * B) / (1.0 / RW - K)

    def leftover(stator):
        if law == "housing_node":  # nothing is stored: the resistances are in series
            return rate("none", kind)(0, [stator, winding(stator)])[0]
        return rate(law, kind)(0, [stator, winding(stator)])[0]

    stator = brentq(leftover, SINK, 1000.0, xtol=1e-12)
    assert float(found["stator"]) == pytest.approx(stator, abs=1e-8)
    assert float(found["winding"]) == pytest.approx(winding(stator), abs=1e-8)
    if law == "housing_node":  # the node carried is T0 + (Th - T0)/x, where Th is the housing
        assert float(found["housing"]) == pytest.approx(stator, abs=1e-8)


@pytest.mark.parametrize("kind", ["balance", "map"])
@pytest.mark.parametrize("law", LAWS)
def test_the_time_to_a_limit_is_that_of_scipy(law, kind, network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind=kind)
    effects = built(law, network)
    start = {"winding": SINK, "stator": SINK + 2.0}

    @jax.jit
    @jax.vmap
    def times_to(share):
        at = (network, losses, drive())
        rest = lptn.steady_state(*at, effects=effects)["winding"]
        limit = SINK + share * (rest - SINK)
        return limit, lptn.time_to(*at, start, node="winding", limit=limit, effects=effects)

    slope = rate(law, kind)
    first = [SINK + 2.0, SINK] + ([SINK + 0.35 * 2.0] if law == "housing_node" else [])
    shares = np.array([0.05, 0.3, 0.9, 0.99])
    for share, limit, found in zip(shares, *map(np.asarray, times_to(shares)), strict=True):

        def reached(t, T, limit=limit):
            return T[1] - limit

        reached.terminal = True
        exact = solve_ivp(slope, (0.0, 1e6), first, events=reached, method="LSODA",
                          rtol=1e-12, atol=1e-10)  # fmt: skip
        error_K = abs(found - exact.t_events[0][0]) * slope(0, exact.y_events[0][0])[1]
        # stated: 2e-5 of the largest change on the way, the winding's rise at rest at most
        assert error_K < 2e-5 * (limit - SINK) / share


def test_the_four_node_network_agrees_with_scipy(four_nodes):
    C = {"winding": 437.0, "tooth": 6509.0, "yoke": 10666.0, "magnet": 3511.0}
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="balance")
    order = ["magnet", "tooth", "winding", "yoke"]

    def slope(t, T):
        m, o, w, y = T
        copper = K * (B + w)
        rest = 1500.0 - copper
        wo, wy, yo = (w - o) / 0.0899, (w - y) / 0.0375, (y - o) / 0.0707
        om, out = (o - m) / 0.4, (y - SINK) / 0.018
        return [(0.2 * rest + om) / C["magnet"], (0.5 * rest + wo + yo - om) / C["tooth"],
                (copper - wo - wy) / C["winding"],
                (0.3 * rest + wy - yo - out) / C["yoke"]]  # fmt: skip

    at = lptn.linearise(four_nodes, losses, drive(power=1500.0), dict.fromkeys(order, 50.0))
    assert list(at.nodes) == order
    A = jacobian(slope, [50.0] * 4)
    np.testing.assert_allclose(at.A, A, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(
        lptn.time_constants(at.A), np.sort(-1 / np.linalg.eigvals(A).real), rtol=1e-7
    )
    rest = np.linalg.solve(A, A @ np.full(4, 50.0) - slope(0, np.full(4, 50.0)))
    found = lptn.steady_state(four_nodes, losses, drive(power=1500.0))
    np.testing.assert_allclose([found[node] for node in order], rest, rtol=1e-7)
    for place, node in ((0, "magnet"), (2, "winding")):
        limit = SINK + 0.7 * (rest[place] - SINK)

        def reached(t, T, place=place, limit=limit):
            return T[place] - limit

        reached.terminal = True
        exact = solve_ivp(slope, (0.0, 1e6), [SINK] * 4, events=reached, method="LSODA",
                          rtol=1e-12, atol=1e-10)  # fmt: skip
        start = dict.fromkeys(order, SINK)
        time = lptn.time_to(four_nodes, losses, drive(power=1500.0), start, node=node, limit=limit)
        assert float(time) == pytest.approx(exact.t_events[0][0], rel=1e-5)


@pytest.mark.parametrize("law", LAWS)
def test_the_simulation_passes_through_what_is_foretold(law, network):
    """The three answers and `simulate` are one right-hand side."""
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    effects = built(law, network)
    rest = lptn.steady_state(network, losses, drive(), effects=effects)
    start = {"winding": SINK, "stator": SINK}
    limit = SINK + 0.6 * (rest["winding"] - SINK)
    time = float(lptn.time_to(network, losses, drive(), start, node="winding",
                              limit=limit, effects=effects))  # fmt: skip
    num = 30_000
    inputs = lptn.Inputs(
        step=jnp.asarray(time / 1000), current_squared=jnp.full(num, CURRENT**2),
        losses=jnp.full(num, POWER), ambient=jnp.full(num, SINK), speed=jnp.full(num, SPEED),
        rated_speed=RATED, rated_current=150.0,
    )  # fmt: skip
    trace = lptn.simulate(network, losses, inputs, start, effects=effects)
    assert float(trace.temperature["winding"][1000]) == pytest.approx(float(limit), abs=1e-3)
    for node, T in rest.items():
        assert float(trace.temperature[node][-1]) == pytest.approx(float(T), abs=1e-3)


def test_what_never_gets_there_takes_for_ever(network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    rest = lptn.steady_state(network, losses, drive())
    cold = {"winding": SINK, "stator": SINK}

    @jax.jit
    def compiled(start, limit, at):
        return lptn.time_to(network, losses, at, start, node="winding", limit=limit)

    def time(start, limit, **more):
        return float(compiled(start, limit, drive(**more)))

    assert time(cold, float(rest["winding"]) + 1e-3) == np.inf
    assert np.isfinite(time(cold, float(rest["winding"]) - 1e-3))
    assert time(rest, float(rest["winding"])) == 0.0
    assert time(cold, 10.0) == 0.0
    # cooling down, with nothing on
    assert time({"winding": 80.0, "stator": 80.0}, 90.0, current=0.0, power=0.0) == np.inf
    # a hot stator lifts a cold winding above where both come to rest
    hump = time({"winding": SINK, "stator": 90.0}, 60.0, current=0.0, power=0.0)
    exact = solve_ivp(rate("none", "map", current=0.0, power=0.0), (0.0, 1000.0), [90.0, SINK],
                      dense_output=True, method="LSODA", rtol=1e-12, atol=1e-10)  # fmt: skip
    expected = brentq(lambda t: exact.sol(t)[1] - 60.0, 1.0, 150.0)
    assert hump == pytest.approx(expected, rel=1e-4)
    assert time({"winding": SINK, "stator": 90.0}, 89.0, current=0.0, power=0.0) == np.inf


def test_a_winding_that_runs_away_has_no_rest_and_reaches_every_limit():
    C, R = 12_500.0, 0.132
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    network = lptn.first_order(C, R)
    squared = 1.5 / R / float(losses.slope(jnp.asarray(1.0)))  # k R = 1.5
    given = Drive.constant(current_squared=squared, losses=0.0, ambient=SINK)
    assert np.isnan(lptn.steady_state(network, losses, given)["winding"])
    time = lptn.time_to(network, losses, given, {"winding": SINK}, node="winding", limit=155.0)
    # C dT/dt = k (B + T) - (T - T0)/R = a + b (T - T0)
    a, b = 1.5 / R * (B + SINK), 0.5 / R
    expected = C / b * np.log1p(b * (155.0 - SINK) / a)
    assert float(time) == pytest.approx(expected, rel=1e-6)
    at = lptn.linearise(network, losses, given, {"winding": SINK})
    assert lptn.time_constants(at.A)[0] == np.inf
    assert not lptn.is_stable(at.A)


def test_radiation_catches_a_winding_that_runs_away(network):
    """A second start from far above finds the equilibrium that Newton misses from the sink."""
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    k = 1.2 / (RW + RS)  # above 1/(RW + RS) the copper feeds itself
    current = np.sqrt(k * (B + TREF) / (3.0 * RS0))
    found = lptn.steady_state(
        network, losses, drive(current=current), effects=built("radiation", network)
    )
    assert np.isnan(lptn.steady_state(network, losses, drive(current=current))["winding"])
    slope = rate("radiation", "map", current=current)
    last = solve_ivp(slope, (0.0, 2e5), [SINK, SINK], method="LSODA", rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose([found["stator"], found["winding"]], last.y[:, -1], rtol=1e-7)


@pytest.mark.parametrize("law", LAWS)
def test_the_current_that_holds_the_copper_at_a_limit(law, network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    effects = built(law, network)
    found = lptn.steady_current(network, losses, drive(), 155.0, effects=effects)

    @jax.jit
    def rest(current):
        at = drive(current=current)
        return lptn.steady_state(network, losses, at, effects=effects)["winding"]

    if law == "none":  # by hand: 155 = T0 + P R_s + k (B + 155)(R_w + R_s)
        by_hand = (155.0 - SINK - POWER * RS) / ((RW + RS) * 3 * RS0 * (B + 155) / (B + TREF))
        assert float(found.squared) == pytest.approx(by_hand, rel=1e-12)
    current = brentq(lambda current: float(rest(current)) - 155.0, 20.0, 175.0, xtol=1e-9)
    assert np.sqrt(float(found.squared)) == pytest.approx(current, rel=1e-8)
    assert float(found.temperature["winding"]) == 155.0
