"""Linear form, rest and time to a limit, against balances written independently."""

from __future__ import annotations

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import lptn
from lptn import CopperLosses, Drive
from lptn.effects import EFFECTS, build

CW, CS, RW, RS = 666.75, 15060.1, 0.14485, 0.11625
RS0, B, TREF = 0.0062, 234.5, 25.0
CURRENT, POWER, SINK, SPEED, RATED = 110.0, 500.0, 21.0, 240.0, 600.0
K = 3.0 * CURRENT**2 * RS0 / (B + TREF)
BY_ID = {kind.card.id: kind for kind in EFFECTS}

LAWS = {
    "none": ({}, None),
    "speed_cooling": ({"g": 0.8, "m": 0.7}, "stator"),
    "radiation": ({"eA": 0.4}, "stator"),
    "natural_convection": ({"f": 0.6, "n": 0.3}, "stator"),
    "housing_node": ({"x": 0.35, "tau": 250.0}, "stator"),
}


def drive(current=CURRENT, power=POWER, sink=SINK, **more):
    return Drive.constant(
        current_squared=current**2, losses=power, ambient=sink, speed=SPEED,
        rated_speed=RATED, rated_current=150.0, **more,
    )  # fmt: skip


def built(law, network):
    values, _ = LAWS[law]
    return () if law == "none" else (build(BY_ID[law], values, network),)


def rate(law, kind, current=CURRENT, power=POWER, sink=SINK):
    """Return dT/dt of (stator, winding[, housing]) as the cards state the laws."""
    k = 3.0 * current**2 * RS0 / (B + TREF)
    p = LAWS[law][0]

    def slope(t, T):
        stator, winding = T[0], T[1]
        copper = k * (B + winding)
        other = power - copper if kind == "balance" else power
        theta = stator - sink
        out = theta / RS
        if law == "speed_cooling":
            out *= 1.0 + p["g"] * (SPEED / RATED) ** p["m"]
        if law == "radiation":
            out += 5.670374419e-8 * p["eA"] * ((stator + 273.15) ** 4 - (sink + 273.15) ** 4)
        if law == "natural_convection":
            out *= 1.0 - p["f"] + p["f"] * ((theta**2 + 1.0) / 1600.0) ** (0.5 * p["n"])
        more = []
        if law == "housing_node":  # the ladder itself: core, housing, sink
            inner, outer = (1.0 - p["x"]) * RS, p["x"] * RS
            capacity = p["tau"] / (p["x"] * (1.0 - p["x"]) * RS)
            out = (stator - T[2]) / inner
            more = [(out - (T[2] - sink) / outer) / capacity]
        across = (winding - stator) / RW
        return [(other + across - out) / CS, (copper - across) / CW, *more]

    return slope


def jacobian(slope, at):
    """Central differences: the laws are smooth and temperatures are of the order of 100 K."""
    at, h = np.asarray(at, dtype=float), 1e-3
    unit = h * np.eye(at.size)
    return np.stack(
        [(np.subtract(slope(0, at + u), slope(0, at - u))) / (2 * h) for u in unit], axis=1
    )


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_the_state_matrix_of_one_node_is_that_by_hand(kind):
    C, R = 12_500.0, 0.132
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind=kind)
    at = lptn.linearise(lptn.first_order(C, R), losses, drive(), {"winding": 80.0})
    feedback = K if kind == "map" else 0.0
    heat = POWER + (K * B if kind == "map" else 0.0)
    np.testing.assert_allclose(at.A, [[(feedback - 1.0 / R) / C]], rtol=1e-12)
    np.testing.assert_allclose(at.offset, [(heat + SINK / R) / C], rtol=1e-12)
    np.testing.assert_allclose(
        lptn.time_constants(at.A), [R * C / (1.0 - feedback * R)], rtol=1e-12
    )


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_the_state_matrix_of_two_nodes_is_that_by_hand(kind, network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind=kind)
    at = lptn.linearise(network, losses, drive(), {"winding": 80.0, "stator": 60.0})
    moved = K if kind == "balance" else 0.0
    A = np.array([[-(1 / RW + 1 / RS) / CS, (1 / RW - moved) / CS],
                  [1 / (RW * CW), (K - 1 / RW) / CW]])  # fmt: skip
    other = POWER - (K * B if kind == "balance" else 0.0)
    assert at.nodes == ("stator", "winding")
    np.testing.assert_allclose(at.A, A, rtol=1e-12)
    np.testing.assert_allclose(at.offset, [(other + SINK / RS) / CS, K * B / CW], rtol=1e-12)
    mean, det = 0.5 * np.trace(A), np.linalg.det(A)
    root = np.sqrt(mean**2 - det)
    np.testing.assert_allclose(
        lptn.time_constants(at.A), [1 / (root - mean), -1 / (root + mean)], rtol=1e-9
    )


@pytest.mark.parametrize("law", [law for law in LAWS if law not in ("none", "housing_node")])
def test_the_state_matrix_with_an_effect_is_the_slope_of_the_law(law, network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    temperature = {"winding": 120.0, "stator": 85.0}
    at = lptn.linearise(network, losses, drive(), temperature, effects=built(law, network))
    slope = rate(law, "map")
    np.testing.assert_allclose(at.A, jacobian(slope, [85.0, 120.0]), rtol=1e-7)
    value = np.asarray(at.A) @ [85.0, 120.0] + np.asarray(at.offset)
    np.testing.assert_allclose(value, slope(0, [85.0, 120.0]), rtol=1e-10)


def test_the_time_constants_of_a_housing_are_those_of_the_ladder(network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    effects = built("housing_node", network)
    at = lptn.linearise(
        network, losses, drive(), {"winding": 20.0, "stator": 20.0}, effects=effects
    )
    assert at.nodes == ("housing", "stator", "winding")
    ladder = np.linalg.eigvals(jacobian(rate("housing_node", "map"), [20.0, 20.0, 20.0]))
    np.testing.assert_allclose(lptn.time_constants(at.A), np.sort(-1.0 / ladder.real), rtol=1e-7)


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


@pytest.mark.parametrize(
    ("law", "values", "place", "factor"),
    [
        ("cooling_step", {"k": 1.6, "t_star": 3600.0}, "Rs", lambda t: 1.0 + 0.6 * (t > 3600.0)),
        ("contact_drift", {"d": 0.1}, "Rw", lambda t: 1.0 / (1.0 + 0.1 * t / 3600.0)),
    ],
)
@pytest.mark.parametrize("time", [0.0, 7200.0])
def test_an_effect_of_time_stands_as_it_is_at_the_drives_instant(law, values, place, factor,
                                                                  time, network):  # fmt: skip
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    effects = (build(BY_ID[law], values, network),)
    then = {"Rw": RW, "Rs": RS}
    then[place] /= factor(time)
    same = lptn.second_order(CW, CS, then["Rw"], then["Rs"])
    at = drive(time=time)
    got = lptn.steady_state(network, losses, at, effects=effects)
    expected = lptn.steady_state(same, losses, drive())
    # 1e-9: at 3600 s from its moment the step is over to e^-240
    assert float(got["winding"]) == pytest.approx(float(expected["winding"]), rel=1e-9)
    start = {"winding": SINK, "stator": SINK}
    A = lptn.linearise(network, losses, at, start, effects=effects).A
    np.testing.assert_allclose(A, lptn.linearise(same, losses, drive(), start).A, rtol=1e-9)
    times = [
        float(lptn.time_to(*case, at, start, node="winding", limit=75.0, effects=more))
        for case, more in (((network, losses), effects), ((same, losses), ()))
    ]
    assert np.isfinite(times[0])
    assert times[0] == pytest.approx(times[1], rel=1e-9)


def test_an_ambient_drift_is_the_sink_of_the_drives_instant(network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    effects = (build(BY_ID["ambient_drift"], {"d": 3.0}, network),)
    got = lptn.steady_state(network, losses, drive(time=7200.0), effects=effects)
    expected = lptn.steady_state(network, losses, drive(sink=SINK + 6.0))
    assert float(got["winding"]) == pytest.approx(float(expected["winding"]), rel=1e-12)


@pytest.mark.parametrize("law", ["time_shift", "sensor_lag"])
def test_an_effect_on_the_sensor_does_not_enter(law, network):
    values = {"time_shift": {"d": 9.0}, "sensor_lag": {"tau": 20.0}}[law]
    losses = CopperLosses(Rs0=jnp.asarray(RS0))
    start = {"winding": SINK, "stator": SINK}

    def both(effects):
        at = (network, losses, drive())
        time = lptn.time_to(*at, start, node="winding", limit=50.0, effects=effects)
        return float(time), float(lptn.steady_state(*at, effects=effects)["winding"])

    assert both((build(BY_ID[law], values, network),)) == both(())


def test_compiled_and_mapped_is_one_by_one(network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    start = {"winding": SINK, "stator": SINK}

    def all_three(Rs, eA):
        network = lptn.second_order(CW, CS, RW, Rs)
        effects = (build(BY_ID["radiation"], {"eA": eA}, network),)
        at = drive(current=120.0)
        rest = lptn.steady_state(network, losses, at, effects=effects)
        time = lptn.time_to(network, losses, at, start, node="winding", limit=155.0,
                            effects=effects)  # fmt: skip
        A = lptn.linearise(network, losses, at, start, effects=effects).A
        return rest["winding"], time, A

    Rs, eA = jnp.asarray([0.05, 0.1, 0.2]), jnp.asarray([0.0, 0.2, 0.4])
    mapped = jax.jit(jax.vmap(all_three))(Rs, eA)
    for index in range(3):
        for many, one in zip(mapped, all_three(Rs[index], eA[index]), strict=True):
            np.testing.assert_allclose(many[index], one, rtol=1e-9)
    assert lptn.time_constants(mapped[2]).shape == (3, 2)
    assert float(mapped[1][0]) == np.inf
    assert np.isfinite(float(mapped[1][2]))


def test_wrong_questions_are_refused(network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0))
    start = {"winding": SINK, "stator": SINK}
    with pytest.raises(ValueError, match="no node 'rotor'"):
        lptn.time_to(network, losses, drive(), start, node="rotor", limit=100.0)
    with pytest.raises(ValueError, match="expected one for each node"):
        lptn.linearise(network, losses, drive(), {"winding": 20.0})
    with pytest.raises(ValueError, match="none of"):
        lptn.linearise(network, losses, drive(), start | {"housing": 20.0})
    still = Drive.constant(current_squared=1e4, losses=300.0, ambient=20.0)
    with pytest.raises(ValueError, match="needs the channel speed_rpm"):
        lptn.steady_state(network, losses, still, effects=built("speed_cooling", network))
    with pytest.raises(ValueError, match=r"Drive\.speed is None"):
        lptn.steady_state(network, CopperLosses(jnp.asarray(RS0), torque_offset=0.1), still)
    many = jax.vmap(lambda squared: Drive.constant(
        current_squared=squared, losses=300.0, ambient=20.0))(jnp.arange(3.0))  # fmt: skip
    with pytest.raises(ValueError, match="expected one number"):
        lptn.steady_state(network, losses, many)


def test_the_physics_does_not_load_diffrax():
    code = "import sys, lptn; print(any(name.split('.')[0] == 'diffrax' for name in sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "False"
