"""A constant drive: rest, time to a limit and the current at it, against SciPy and by hand."""

import subprocess
import sys

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled import linearise, simulate, steady_state, time_to
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from written_balances import (
    BY_ID,
    CS,
    CURRENT,
    CW,
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
from lptn.effects import build

NULL = {
    "speed_cooling": {"g": 0.0, "m": 0.7},
    "radiation": {"eA": 0.0},
    "natural_convection": {"f": 0.0, "n": 0.3},
}
NUM_ROWS = 8
MAP = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
COLD = {"winding": SINK, "stator": SINK}

BALANCED = [*((law, "map") for law in LAWS), *((law, "balance") for law in ("none", *NULL))]
"""Laws and kinds of losses: what the losses are, a housing does not ask."""


def effects_of(law, network):
    """The effect of a law, the others of the base network at null beside it: one program for all.

    That an effect at null is none is asserted in `test_effects.py`.
    """
    if law not in ("none", *NULL):
        return built(law, network)
    values = NULL | ({} if law == "none" else {law: LAWS[law][0]})
    return tuple(build(BY_ID[name], values[name], network) for name in NULL)


@eqx.filter_jit
def answers(network, losses, effects, current, share, stator):
    """Rest, limit and the time to it for rows of currents, shares of the rise, and starts."""

    def one(current, share, stator):
        at = (network, losses, drive(current=current))
        rest = lptn.steady_state(*at, effects=effects)
        limit = SINK + share * (rest["winding"] - SINK)
        start = {"winding": jnp.asarray(SINK), "stator": stator}
        time = lptn.time_to(*at, start, node="winding", limit=limit, effects=effects)
        return rest, limit, time

    return jax.vmap(one)(current, share, stator)


def asked(law, kind, network, *, current=(CURRENT,), share=(0.5,), stator=SINK):
    num = max(len(current), len(share))
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind=kind)
    columns = [np.resize(values, NUM_ROWS) for values in (current, share, stator)]
    found = answers(network, losses, effects_of(law, network), *columns)
    return jax.tree.map(lambda values: np.asarray(values)[:num], found)


@pytest.mark.parametrize(("law", "kind"), BALANCED)
def test_a_network_rests_where_the_heat_that_enters_leaves(law, kind, network):
    found, _, _ = asked(law, kind, network)

    def winding(stator):  # from the balance of the winding alone
        return (stator / RW + K * B) / (1.0 / RW - K)

    def leftover(stator):
        if law == "housing_node":  # nothing is stored: the resistances are in series
            return rate("none", kind)(0, [stator, winding(stator)])[0]
        return rate(law, kind)(0, [stator, winding(stator)])[0]

    stator = brentq(leftover, SINK, 1000.0, xtol=1e-12)
    assert found["stator"][0] == pytest.approx(stator, abs=1e-8)
    assert found["winding"][0] == pytest.approx(winding(stator), abs=1e-8)
    if law == "housing_node":  # the node carried is T0 + (Th - T0)/x, where Th is the housing
        assert found["housing"][0] == pytest.approx(stator, abs=1e-8)


def by_scipy(slope, start, place, limit):
    """Time at which a node reaches a limit, and the state there."""

    def reached(t, T):
        return T[place] - limit

    reached.terminal = True
    exact = solve_ivp(slope, (0.0, 1e6), start, events=reached, method="LSODA", rtol=1e-12,
                      atol=1e-10)  # fmt: skip
    return exact.t_events[0][0], exact.y_events[0][0]


@pytest.mark.parametrize(("law", "kind"), BALANCED)
def test_the_time_to_a_limit_is_that_of_scipy(law, kind, network):
    slope = rate(law, kind)
    first = [SINK + 2.0, SINK] + ([SINK + 0.35 * 2.0] if law == "housing_node" else [])
    shares = np.array([0.05, 0.3, 0.9, 0.99])
    _, limits, times = asked(law, kind, network, share=shares, stator=SINK + 2.0)
    for share, limit, found in zip(shares, limits, times, strict=True):
        exact, there = by_scipy(slope, first, 1, limit)
        error_K = abs(found - exact) * slope(0, there)[1]
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

    at = linearise(four_nodes, losses, drive(power=1500.0), dict.fromkeys(order, 50.0))
    assert list(at.nodes) == order
    A = jacobian(slope, [50.0] * 4)
    np.testing.assert_allclose(at.A, A, rtol=1e-7, atol=1e-12)
    np.testing.assert_allclose(
        lptn.time_constants(at.A), np.sort(-1 / np.linalg.eigvals(A).real), rtol=1e-7
    )
    rest = np.linalg.solve(A, A @ np.full(4, 50.0) - slope(0, np.full(4, 50.0)))
    found = steady_state(four_nodes, losses, drive(power=1500.0))
    np.testing.assert_allclose([found[node] for node in order], rest, rtol=1e-7)
    for place, node in ((0, "magnet"), (2, "winding")):
        limit = SINK + 0.7 * (rest[place] - SINK)
        exact, _ = by_scipy(slope, [SINK] * 4, place, limit)
        start = dict.fromkeys(order, SINK)
        time = time_to(four_nodes, losses, drive(power=1500.0), start, node=node, limit=limit)
        assert float(time) == pytest.approx(exact, rel=1e-5)


@pytest.mark.parametrize("law", LAWS)
def test_the_simulation_passes_through_what_is_foretold(law, network):
    """The three answers and `simulate` are one right-hand side."""
    effects = effects_of(law, network)
    rests, (limit,), (time,) = asked(law, "map", network, share=(0.6,))
    num = 30_000
    inputs = lptn.Inputs(
        step=jnp.asarray(time / 1000), rated_speed=RATED, rated_current=150.0,
        **{name: jnp.asarray(np.full(num, value)) for name, value in (
            ("current_squared", CURRENT**2), ("losses", POWER), ("ambient", SINK),
            ("speed", SPEED))},
    )  # fmt: skip
    trace = simulate(network, MAP, inputs, COLD, effects=effects)
    assert float(trace.temperature["winding"][1000]) == pytest.approx(limit, abs=1e-3)
    for node, (T,) in rests.items():
        assert float(trace.temperature[node][-1]) == pytest.approx(T, abs=1e-3)


def test_what_never_gets_there_takes_for_ever(network):
    rest = steady_state(network, MAP, drive())

    def time(start, limit, **more):
        return float(time_to(network, MAP, drive(**more), start, node="winding", limit=limit))

    assert time(COLD, float(rest["winding"]) + 1e-3) == np.inf
    assert np.isfinite(time(COLD, float(rest["winding"]) - 1e-3))
    assert time(rest, float(rest["winding"])) == 0.0
    assert time(COLD, 10.0) == 0.0
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
    network = lptn.first_order(C, R)
    squared = 1.5 / R / float(MAP.slope(jnp.asarray(1.0)))  # k R = 1.5
    given = Drive.constant(current_squared=squared, losses=0.0, ambient=SINK)
    assert np.isnan(steady_state(network, MAP, given)["winding"])
    time = time_to(network, MAP, given, {"winding": SINK}, node="winding", limit=155.0)
    # C dT/dt = k (B + T) - (T - T0)/R = a + b (T - T0)
    a, b = 1.5 / R * (B + SINK), 0.5 / R
    expected = C / b * np.log1p(b * (155.0 - SINK) / a)
    assert float(time) == pytest.approx(expected, rel=1e-6)
    at = linearise(network, MAP, given, {"winding": SINK})
    assert lptn.time_constants(at.A)[0] == np.inf
    assert not jax.jit(lptn.is_stable)(at.A)


def test_radiation_catches_a_winding_that_runs_away(network):
    """A second start from far above finds the equilibrium that Newton misses from the sink."""
    k = 1.2 / (RW + RS)  # above 1/(RW + RS) the copper feeds itself
    current = np.sqrt(k * (B + TREF) / (3.0 * RS0))
    found, _, _ = asked("radiation", "map", network, current=(current,))
    assert np.isnan(steady_state(network, MAP, drive(current=current))["winding"])
    slope = rate("radiation", "map", current=current)
    last = solve_ivp(slope, (0.0, 2e5), [SINK, SINK], method="LSODA", rtol=1e-11, atol=1e-9)
    np.testing.assert_allclose([found["stator"][0], found["winding"][0]], last.y[:, -1], rtol=1e-7)


@eqx.filter_jit
def steady_current(network, losses, drive, effects):
    return lptn.steady_current(network, losses, drive, 155.0, effects=effects)


@pytest.mark.parametrize("law", LAWS)
def test_the_current_that_holds_the_copper_at_a_limit(law, network):
    found = steady_current(network, MAP, drive(), effects_of(law, network))
    if law == "none":  # by hand: 155 = T0 + P R_s + k (B + 155)(R_w + R_s)
        by_hand = (155.0 - SINK - POWER * RS) / ((RW + RS) * 3 * RS0 * (B + 155) / (B + TREF))
        assert float(found.squared) == pytest.approx(by_hand, rel=1e-12)
        bare = steady_current(network, MAP, drive(), ())
        assert float(bare.squared) == pytest.approx(by_hand, rel=1e-12)
    # the rest at currents a hundred millionth below and above it is on either side of the limit
    current = np.sqrt(float(found.squared))
    assert 20.0 < current < 175.0
    rest, _, _ = asked(law, "map", network, current=current * (1.0 + np.array([-1e-8, 1e-8])))
    below, above = rest["winding"]
    assert below < 155.0 < above
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
    effects = (build(BY_ID[law], values, network),)
    then = {"Rw": RW, "Rs": RS}
    then[place] /= factor(time)
    same = lptn.second_order(CW, CS, then["Rw"], then["Rs"])
    at = drive(time=time)
    got = steady_state(network, MAP, at, effects=effects)
    expected = steady_state(same, MAP, drive())
    # 1e-9: at 3600 s from its moment the step is over to e^-240
    assert float(got["winding"]) == pytest.approx(float(expected["winding"]), rel=1e-9)
    A = linearise(network, MAP, at, COLD, effects=effects).A
    np.testing.assert_allclose(A, linearise(same, MAP, drive(), COLD).A, rtol=1e-9)
    times = [
        float(time_to(*case, at, COLD, node="winding", limit=75.0, effects=more))
        for case, more in (((network, MAP), effects), ((same, MAP), ()))
    ]
    assert np.isfinite(times[0])
    assert times[0] == pytest.approx(times[1], rel=1e-9)


def test_an_ambient_drift_is_the_sink_of_the_drives_instant(network):
    effects = (build(BY_ID["ambient_drift"], {"d": 3.0, "tau": 2.0}, network),)
    got = steady_state(network, MAP, drive(time=7200.0), effects=effects)
    expected = steady_state(network, MAP, drive(sink=SINK + 6.0 * (1.0 - np.exp(-1.0))))
    assert float(got["winding"]) == pytest.approx(float(expected["winding"]), rel=1e-12)


@pytest.mark.parametrize("law", ["time_shift", "sensor_lag"])
def test_an_effect_on_the_sensor_does_not_enter(law, network):
    values = {"time_shift": {"d": 9.0}, "sensor_lag": {"tau": 20.0}}[law]

    def both(effects):
        at = (network, MAP, drive())
        time = time_to(*at, COLD, node="winding", limit=50.0, effects=effects)
        return float(time), float(steady_state(*at, effects=effects)["winding"])

    assert both((build(BY_ID[law], values, network),)) == both(())


def test_wrong_questions_are_refused(network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0))
    with pytest.raises(ValueError, match="no node 'rotor'"):
        lptn.time_to(network, losses, drive(), COLD, node="rotor", limit=100.0)
    with pytest.raises(ValueError, match="expected one for each node"):
        lptn.linearise(network, losses, drive(), {"winding": 20.0})
    with pytest.raises(ValueError, match="none of"):
        lptn.linearise(network, losses, drive(), COLD | {"housing": 20.0})
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


@pytest.mark.parametrize(("law", "kind"), [case for case in BALANCED if case[0] != "housing_node"])
def test_the_state_matrix_is_the_slope_of_the_law(law, kind, network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind=kind)
    temperature = {"winding": 120.0, "stator": 85.0}
    at = linearise(network, losses, drive(), temperature, effects=built(law, network))
    slope = rate(law, kind)
    assert at.nodes == ("stator", "winding")
    np.testing.assert_allclose(at.A, jacobian(slope, [85.0, 120.0]), rtol=1e-7)
    value = np.asarray(at.A) @ [85.0, 120.0] + np.asarray(at.offset)
    np.testing.assert_allclose(value, slope(0, [85.0, 120.0]), rtol=1e-10)


def test_the_time_constants_of_a_housing_are_those_of_the_ladder(network):
    effects = built("housing_node", network)
    at = linearise(network, MAP, drive(), {"winding": 20.0, "stator": 20.0}, effects=effects)
    assert at.nodes == ("housing", "stator", "winding")
    ladder = np.linalg.eigvals(jacobian(rate("housing_node", "map"), [20.0, 20.0, 20.0]))
    np.testing.assert_allclose(lptn.time_constants(at.A), np.sort(-1.0 / ladder.real), rtol=1e-7)


def test_a_node_that_is_fast_does_not_keep_the_answer_waiting(network):
    """Explicit steps gave up before the limit was reached."""
    given = {"f": 1e-4, "tau": 1e-3, "p": 0.0}
    effects = (build(BY_ID["end_winding_node"], given, network),)
    fast, bare = (
        float(time_to(network, MAP, drive(), COLD, node="winding", limit=75.0, effects=more))
        for more in (effects, ())
    )
    assert fast == pytest.approx(bare, rel=1e-4)
