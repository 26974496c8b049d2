"""A constant drive: its state matrix by hand, effects of time and of the sensor, refusals."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled import linearise, steady_state, time_to
from written_balances import (
    BY_ID,
    CS,
    CW,
    LAWS,
    POWER,
    RS,
    RS0,
    RW,
    SINK,
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
    got = steady_state(network, losses, at, effects=effects)
    expected = steady_state(same, losses, drive())
    # 1e-9: at 3600 s from its moment the step is over to e^-240
    assert float(got["winding"]) == pytest.approx(float(expected["winding"]), rel=1e-9)
    start = {"winding": SINK, "stator": SINK}
    A = linearise(network, losses, at, start, effects=effects).A
    np.testing.assert_allclose(A, linearise(same, losses, drive(), start).A, rtol=1e-9)
    times = [
        float(time_to(*case, at, start, node="winding", limit=75.0, effects=more))
        for case, more in (((network, losses), effects), ((same, losses), ()))
    ]
    assert np.isfinite(times[0])
    assert times[0] == pytest.approx(times[1], rel=1e-9)


def test_an_ambient_drift_is_the_sink_of_the_drives_instant(network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    effects = (build(BY_ID["ambient_drift"], {"d": 3.0, "tau": 2.0}, network),)
    got = steady_state(network, losses, drive(time=7200.0), effects=effects)
    expected = steady_state(network, losses, drive(sink=SINK + 6.0 * (1.0 - np.exp(-1.0))))
    assert float(got["winding"]) == pytest.approx(float(expected["winding"]), rel=1e-12)


@pytest.mark.parametrize("law", ["time_shift", "sensor_lag"])
def test_an_effect_on_the_sensor_does_not_enter(law, network):
    values = {"time_shift": {"d": 9.0}, "sensor_lag": {"tau": 20.0}}[law]
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    start = {"winding": SINK, "stator": SINK}

    def both(effects):
        at = (network, losses, drive())
        time = time_to(*at, start, node="winding", limit=50.0, effects=effects)
        return float(time), float(steady_state(*at, effects=effects)["winding"])

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
    compiled = jax.jit(all_three)
    for index in range(3):
        for many, one in zip(mapped, compiled(Rs[index], eA[index]), strict=True):
            np.testing.assert_allclose(many[index], one, rtol=1e-9)
    # and as it is, with nothing compiled as a whole
    network = lptn.second_order(CW, CS, RW, 0.2)
    effects = (build(BY_ID["radiation"], {"eA": 0.4}, network),)
    at = drive(current=120.0)
    time = lptn.time_to(network, losses, at, start, node="winding", limit=155.0, effects=effects)
    np.testing.assert_allclose(mapped[1][2], time, rtol=1e-9)
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


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_the_state_matrix_of_two_nodes_is_that_by_hand(kind, network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind=kind)
    at = linearise(network, losses, drive(), {"winding": 80.0, "stator": 60.0})
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
    at = linearise(network, losses, drive(), temperature, effects=built(law, network))
    slope = rate(law, "map")
    np.testing.assert_allclose(at.A, jacobian(slope, [85.0, 120.0]), rtol=1e-7)
    value = np.asarray(at.A) @ [85.0, 120.0] + np.asarray(at.offset)
    np.testing.assert_allclose(value, slope(0, [85.0, 120.0]), rtol=1e-10)


def test_the_time_constants_of_a_housing_are_those_of_the_ladder(network):
    losses = CopperLosses(Rs0=jnp.asarray(RS0), kind="map")
    effects = built("housing_node", network)
    at = linearise(network, losses, drive(), {"winding": 20.0, "stator": 20.0}, effects=effects)
    assert at.nodes == ("housing", "stator", "winding")
    ladder = np.linalg.eigvals(jacobian(rate("housing_node", "map"), [20.0, 20.0, 20.0]))
    np.testing.assert_allclose(lptn.time_constants(at.A), np.sort(-1.0 / ladder.real), rtol=1e-7)
