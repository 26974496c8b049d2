"""The laws of effects worked out by hand, at an instant or as a course; a winding of its own."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled import constant, reading, simulate
from written_balances import BY_ID

import lptn
from lptn import EFFECTS, CopperLosses
from lptn.effects import applies, build, build_all
from lptn.effects.bodies import WindingNode
from lptn.effects.sensors import SensorPickup, TimeShift
from lptn.stepping import heat_balance

TEMPERATURE = {"winding": jnp.asarray(90.0), "stator": jnp.asarray(80.0)}
MOMENT = lptn.Drive(
    time=jnp.asarray(1800.0),
    current_squared=jnp.asarray(100.0**2),
    losses=jnp.asarray(700.0),
    ambient=jnp.asarray(20.0),
    speed=jnp.asarray(-0.5),  # the direction of rotation changes nothing
    speed_rad=jnp.asarray(-200.0),
    coolant=jnp.asarray(35.0),
    fan=jnp.asarray(0.6),
    current_ratio_squared=jnp.asarray(0.25),
)
COPPER_W = 3 * 100.0**2 * 0.0062 * (234.5 + 90.0) / (234.5 + 25.0)
WINDING_PATH = ("winding", "stator")
SINK_PATH = ("stator", "ambient")


@pytest.fixture(params=["balance", "map"])
def moment(request, network):
    """The balance of the moment under some effect, for either meaning of the loss channel."""
    losses = CopperLosses(Rs0=jnp.asarray(0.0062), kind=request.param)

    def terms(kind=None, **values):
        effects = [] if kind is None else [build(BY_ID[kind], values, network)]
        return heat_balance(network, losses, effects, TEMPERATURE, MOMENT)

    return terms


def added(base, seen, node):
    return float(seen.heat[node] - base.heat[node])


@pytest.mark.parametrize(
    ("kind", "values", "link", "factor"),
    [
        ("fan_cooling", {"g": 0.5}, SINK_PATH, 1.0 + 0.5 * 0.6),
        ("speed_cooling", {"g": 3.0, "m": 0.7}, SINK_PATH, 1.0 + 3.0 * 0.5**0.7),
        ("cooling_step", {"k": 2.0, "t_star": 600.0}, SINK_PATH, 2.0),
        ("cooling_step", {"k": 2.0, "t_star": 3000.0}, SINK_PATH, 1.0),
        ("cooling_step", {"k": 2.0, "t_star": 1800.0}, SINK_PATH, 1.5),
        # 60 K against the 40 K at which it holds, rounded off below 1 K
        ("natural_convection", {"f": 0.6, "n": 0.25}, SINK_PATH,
         0.4 + 0.6 * (3601 / 1600) ** 0.125),
        ("insulation_conductivity", {"b": 0.004}, WINDING_PATH, 1.0 + 0.004 * 30.0),
        ("contact_drift", {"d": 0.1}, WINDING_PATH, 1.0 / 1.05),
    ],
)  # fmt: skip
def test_a_path_conducts_by_the_law(kind, values, link, factor, moment):
    base, seen = moment(), moment(kind, **values)
    for path, conductance in base.conductance.items():
        expected = factor if path == link else 1.0
        # 1200 s are 80 widths of the logistic course: nothing is left of its tails
        assert float(seen.conductance[path] / conductance) == pytest.approx(expected, rel=1e-12)
    assert seen.heat == base.heat
    assert seen.sink == base.sink


@pytest.mark.parametrize(
    ("kind", "values", "rise"),
    [
        ("coolant_sink", {"a": 0.4}, 0.4 * 15.0),
        ("ambient_drift", {"d": -3.0, "tau": 2.0}, -6.0 * (1.0 - np.exp(-0.25))),
    ],
)
def test_the_sink_sits_where_the_law_puts_it(kind, values, rise, moment):
    base, seen = moment(), moment(kind, **values)
    assert float(seen.sink) == pytest.approx(20.0 + rise, rel=1e-12)
    assert seen.heat == base.heat
    assert seen.conductance == base.conductance


@pytest.mark.parametrize("order", [1, -1])
def test_surfaces_see_the_sink_whatever_order_effects_are_named_in(network, order):
    wanted = [("radiation", {"eA": 0.3}), ("coolant_sink", {"a": 0.4}),
              ("ambient_recirculation", {"r": 0.01})][::order]  # fmt: skip
    effects = build_all([(BY_ID[kind], values) for kind, values in wanted], network)
    found = [effect.card.id for effect in effects]
    assert found == ["ambient_recirculation", "coolant_sink", "radiation"]


def test_recirculation_goes_with_all_losses(moment):
    total = 700.0 if moment().losses.kind == "balance" else 700.0 + COPPER_W
    seen = moment("ambient_recirculation", r=0.01)
    assert float(seen.sink) == pytest.approx(20.0 + 0.01 * total, rel=1e-12)


@pytest.mark.parametrize(
    ("kind", "values", "watts"),
    [
        ("winding_resistance", {"g": 0.1}, 0.1 * COPPER_W),
        ("ac_copper_loss", {"k": 0.4}, 0.4 * COPPER_W * (0.5 * 259.5 / 324.5) ** 2),
        ("copper_coefficient", {"dB": 10.0}, COPPER_W * (334.5 / 269.5 * 259.5 / 324.5 - 1.0)),
    ],
)
def test_copper_losses_move_under_a_balance_and_add_under_a_map(kind, values, watts, moment):
    base, seen = moment(), moment(kind, **values)
    taken = -watts if base.losses.kind == "balance" else 0.0
    assert added(base, seen, "winding") == pytest.approx(watts, rel=1e-9)
    assert added(base, seen, "stator") == pytest.approx(taken, abs=1e-9)


def test_other_losses_move_and_leave(moment):
    base, other = moment(), float(moment().other)
    put_in = float(sum(base.heat.values()))
    stray = moment("stray_load_loss", k=100.0)
    node = "winding" if base.losses.kind == "balance" else "stator"
    assert added(base, stray, node) == pytest.approx(100.0 * 0.25 * 0.5**1.5, rel=1e-9)
    moved = moment("iron_loss_in_winding", k=40.0, n=1.3, m=-0.2)
    assert added(base, moved, "winding") == pytest.approx(40.0 * 0.5**1.3 * 1.15)
    assert float(sum(moved.heat.values())) == pytest.approx(put_in)
    none = moment("iron_loss_in_winding", k=40.0, n=-0.1, m=1.4)  # 0.25 of the load: less than none
    assert added(base, none, "winding") == 0.0
    left = moment("external_loss", k=0.1, m=1.0)
    assert put_in - float(sum(left.heat.values())) == pytest.approx(0.1 * other * 0.5)


@pytest.mark.parametrize(
    ("kind", "values", "watts"),
    [
        ("standby_loss", {"P0": 20.0}, 20.0),
        ("bearing_friction", {"T_f": 0.1, "kappa": 0.03}, 0.1 * 200.0 * math.exp(-0.03 * 60.0)),
        ("loss_gain", {"g": 0.05}, 0.05 * 700.0),
        ("radiation", {"eA": 0.5}, -0.5 * 5.670374419e-8 * (353.15**4 - 293.15**4)),
    ],
)
def test_losses_that_change_the_total_heat_the_stator(kind, values, watts, moment):
    """The loss channel is 700 W under a balance (all losses) and under a map (without copper)."""
    base, seen = moment(), moment(kind, **values)
    assert added(base, seen, "stator") == pytest.approx(watts, rel=1e-12)
    assert float(seen.heat["winding"]) == float(base.heat["winding"])


@pytest.mark.parametrize(
    ("kind", "values", "expected"),
    [
        ("sensor_contact", {"k": 0.25}, [57.5, 77.5]),
        ("sensor_contact", {"k": -0.1}, [61.0, 95.0]),
        ("sensor_gain", {"g": 0.02}, [60.0 + 0.02 * 40.0, 90.0 + 0.02 * 70.0]),
    ],
)
def test_the_sensor_reads_by_the_law(kind, values, expected, network):
    nothing = jnp.zeros(1)
    inputs = lptn.Inputs(jnp.asarray(2.0), nothing, nothing, jnp.full(1, 20.0))
    winding = jnp.asarray([60.0, 90.0])
    temperature = {"winding": winding, "stator": jnp.asarray([50.0, 40.0])}
    seen = build(BY_ID[kind], values, network).observe(winding, temperature, inputs)
    np.testing.assert_allclose(seen, expected, rtol=1e-12)


EQUAL = {"winding": 20.0, "stator": 20.0}


def course(network, losses, inputs, kind, values):
    effect = build(BY_ID[kind], values, network)
    return effect, simulate(network, losses, inputs, EQUAL, effects=[effect])


def test_a_housing_is_a_ladder_as_seen_from_the_winding(network, losses, short):
    """The equivalent form against the ladder itself, at a constant sink."""
    still = eqx.tree_at(lambda i: i.ambient, short, jnp.asarray(np.full(short.num_time, 20.0)))
    x, tau, R = 0.4, 200.0, 0.11625
    ladder = lptn.Network(
        capacitance={"winding": jnp.asarray(666.75), "stator": jnp.asarray(15060.1),
                     "housing": jnp.asarray(tau / (x * (1 - x) * R))},
        resistance={("winding", "stator"): jnp.asarray(0.14485),
                    ("stator", "housing"): jnp.asarray((1 - x) * R),
                    ("housing", "ambient"): jnp.asarray(x * R)},
        share={"stator": jnp.asarray(1.0)},
    )  # fmt: skip
    _, seen = course(network, losses, still, "housing_node", {"x": x, "tau": tau})
    expected = simulate(ladder, losses, still, {**EQUAL, "housing": 20.0})
    # two explicit third-order marches of different nodes: (2 s/97 s)^3/24 of 15 K at most
    np.testing.assert_allclose(seen.reading, expected.reading, atol=1e-5)
    housing = 20.0 + x * (np.asarray(seen.temperature["housing"]) - 20.0)
    assert float(housing[-1]) > 20.01
    np.testing.assert_allclose(housing, expected.temperature["housing"], atol=1e-5)


def rotor_got(trace, inputs, P, rise, tau):
    """Heat that a rotor has kept and handed on [J]."""
    kept = P * tau / rise * float(trace.temperature["rotor"][-1] - 20.0)
    return kept - float(np.sum(trace.flow["stator", "rotor"]) * inputs.step)


def test_the_rotor_hands_on_what_it_gets(network, losses, short):
    values = {"P": 300.0, "rise": 40.0, "tau": 300.0, "n": 1.5, "m": 0.6}
    _, trace = course(network, losses, short, "rotor_node", values)
    drive = short.drive()
    speed, load = np.asarray(drive.speed), np.asarray(drive.current_ratio_squared)
    rate = 0.4 * speed**1.5 + 0.6 * load * np.maximum(speed, 0.01) ** 1.5
    got = 300.0 * float(np.sum(rate) * short.step)
    assert rotor_got(trace, short, 300.0, 40.0, 300.0) == pytest.approx(got, rel=1e-9)
    assert -float(np.sum(trace.flow["stator", "rotor"])) > 0.0


@pytest.mark.parametrize(("n", "least", "most"), [(0.05, 0.75, 0.85), (1.5, 0.0, 0.01)])
@pytest.mark.parametrize("load", [0.0, 1.0])
def test_a_locked_rotor_has_the_heat_of_a_cage_and_none_of_magnets(
    network, losses, short, n, least, most, load
):
    """Over that at rated speed and current."""
    values = {"P": 300.0, "rise": 40.0, "tau": 300.0, "n": n, "m": 1.0}
    still = jnp.zeros_like(short.speed)
    locked = eqx.tree_at(
        lambda i: (i.speed, i.current_squared), short, (still, still + load * 150.0**2)
    )
    _, trace = course(network, losses, locked, "rotor_node", values)
    got = rotor_got(trace, short, 300.0, 40.0, 300.0) / (300.0 * 240.0)
    assert load * least - 1e-9 <= got <= load * most + 1e-9


def _mean(T, i):
    return 0.5 * (T[i] + T[i + 1])


def test_overhang_and_slot_share_the_winding(network, losses, short):
    values = {"f": 0.4, "tau": 25.0, "p": 1.0}
    effect, trace = course(network, losses, short, "end_winding_node", values)
    extended = effect.extend(network)
    assert float(extended.capacitance["winding"]) == pytest.approx(0.6 * 666.75)
    assert float(extended.capacitance["overhang"]) == pytest.approx(0.4 * 666.75)
    winding = trace.temperature["winding"]
    ahead = np.subtract(trace.temperature["overhang"], winding)
    np.testing.assert_allclose(np.subtract(trace.reading, winding), ahead, atol=1e-12)
    assert float(ahead[-1]) > 0.0  # it is heated and only the slots cool it
    # each part's copper has the loss of its own temperature, under a measured sum
    C, T = extended.capacitance["overhang"], trace.temperature["overhang"]
    i = short.num_time // 2
    loss = 0.4 * trace.copper_loss[i] * (234.5 + _mean(T, i)) / (234.5 + _mean(winding, i))
    flow = C / 25.0 * (_mean(T, i) - _mean(winding, i))
    np.testing.assert_allclose(C * (T[i + 1] - T[i]) / short.step, loss - flow, rtol=1e-3)


@pytest.mark.parametrize("delay", [-3.3, 0.0, 0.9, 7.0, 8.0, 1e4, -1e4])
def test_a_shift_reads_between_the_edges_of_equal_intervals_as_of_any(delay):
    inputs = constant(2.0, num=199)
    edges = 2.0 * np.arange(200)
    reading = jnp.asarray(60.0 + 20.0 * np.sin(edges / 31.0) + 0.1 * edges)

    def shifted(d, inputs=inputs):
        return TimeShift(d).observe(reading, {}, inputs)

    any_steps = eqx.tree_at(lambda each: each.step, inputs, jnp.full(199, 2.0))
    at = jnp.asarray(delay)
    expected = np.interp(edges - delay - 1e-9, edges, reading)
    np.testing.assert_allclose(jax.jit(shifted)(at), expected, atol=1e-9)
    ones = jnp.ones(())
    slopes = [
        jax.jvp(lambda d, of=of: shifted(d, of), (at,), (ones,))[1] for of in (inputs, any_steps)
    ]
    np.testing.assert_allclose(slopes[0], slopes[1], atol=1e-6)


@pytest.mark.parametrize("exponent", [0.05, 1.0, 2.0])
def test_what_a_line_picks_up_is_there_at_once(exponent):
    """A step inside an interval, a ramp, rest: by hand."""
    current = np.array([0.0, 0.0, 50.0, 100.0, 100.0, 100.0, 100.0, 0.0, 0.0])
    squared = current**2
    squared[2] = 0.25 * 100.0**2  # the load comes after three quarters of it
    inputs = lptn.Inputs(
        step=jnp.asarray(2.0),
        current_squared=jnp.asarray(squared),
        losses=jnp.zeros(9),
        ambient=jnp.full(9, 20.0),
        rated_current=200.0,
    )
    picked_up = SensorPickup(jnp.asarray(4.0), jnp.asarray(exponent))
    added = np.asarray(picked_up.observe(jnp.zeros(10), {}, inputs))
    full = 4.0 * 0.5**exponent
    np.testing.assert_allclose(added[[0, 1, 9]], 0.0, atol=1e-12)
    np.testing.assert_allclose(added[[4, 5, 6, 7]], [full, full, full, 0.5 * full], rtol=1e-9)
    # samples that end its intervals see it from the middle of the third on
    seen = np.sum(0.25 * added[1:4] + 0.75 * added[2:5])
    assert abs(seen - 1.5 * full) <= full / 16.0 + 1e-9  # of an interval, by straight lines


Ceq_w, Ceq_sr, Req_w, Req_sr = 666.75, 15060.1, 0.14485, 0.11625
ONE = lptn.first_order(Ceq_w + Ceq_sr, Req_sr)
SAME = {"x": Req_w / Req_sr, "tau": Req_w * Ceq_w * Ceq_sr / (Ceq_w + Ceq_sr)}
"""By hand: two bodies through a resistance even out with R C1 C2/(C1 + C2)."""

START = {"winding": jnp.asarray(21.0)}
BOTH = {"winding": jnp.asarray(21.0), "stator": jnp.asarray(21.0)}

BESIDE = [
    ("speed_cooling", {"g": 1.5, "m": 0.8}),
    ("ac_copper_loss", {"k": 0.5}),
    ("neighbour_body", {"C": 5000.0, "tau": 1500.0}),
    ("housing_node", {"x": 0.4, "tau": 300.0}),
    ("rotor_node", {"P": 40.0, "rise": 9.0, "tau": 900.0, "n": 1.0, "m": 0.5}),
]
NAMES = [kind for kind, _ in BESIDE]


@pytest.mark.parametrize("loss_kind", ["balance", "map"])
def test_the_first_order_with_it_is_the_second(loss_kind, short):
    losses = CopperLosses(Rs0=jnp.asarray(0.0062), kind=loss_kind)
    effects = [build(WindingNode, SAME, ONE)]
    found = simulate(ONE, losses, short, START, effects=effects)
    second = simulate(lptn.second_order(Ceq_w, Ceq_sr, Req_w, Req_sr), losses, short, BOTH)
    # K; the affine and the general step differ by rounding
    np.testing.assert_allclose(found.reading, second.reading, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(
        found.flow["winding", "stator"], second.flow["winding", "stator"], rtol=0.0, atol=1e-7
    )


# two by `make test`, the others by `make test-slow`
@pytest.mark.parametrize(
    ("kind", "values"),
    [pytest.param(*case, marks=() if place % 3 == 0 else pytest.mark.slow)
     for place, case in enumerate(BESIDE)],
    ids=NAMES,
)  # fmt: skip
def test_at_its_null_any_other_effect_does_what_it_does_to_one_node(kind, values, short, losses):
    """A winding that is not there must not bend the signature of what is."""
    gone = [(WindingNode, {"x": 0.0, "tau": 80.0}), (BY_ID[kind], values)]
    alone = reading(ONE, losses, short, START, effects=[build(BY_ID[kind], values, ONE)])
    both = reading(ONE, losses, short, START, effects=build_all(gone, ONE))
    # 1e-12 W/K or shares keep gradients finite
    np.testing.assert_allclose(both, alone, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize("place", range(len(BESIDE)), ids=NAMES)
def test_beside_it_any_other_effect_does_what_it_does_to_two_nodes(place, short, losses):
    """Named before it or after it, in turn."""
    kind, values = BESIDE[place]
    wanted = [(WindingNode, SAME), (BY_ID[kind], values)][:: -1 if place % 2 else 1]
    second = lptn.second_order(Ceq_w, Ceq_sr, Req_w, Req_sr)
    both = reading(ONE, losses, short, START, effects=build_all(wanted, ONE))
    expected = reading(second, losses, short, BOTH, effects=[build(BY_ID[kind], values, second)])
    np.testing.assert_allclose(both, expected, rtol=0.0, atol=1e-8)


def test_a_winding_too_fast_for_the_steps_stays_bounded(short, losses):
    """Close to the null the share is at its limit: what is left goes with the resistance."""
    base = np.asarray(reading(ONE, losses, short, START))
    far, near = (
        reading(ONE, losses, short, START,
                effects=[build(WindingNode, {"x": x, "tau": 80.0}, ONE)]) - base
        for x in (2e-3, 1e-3)
    )  # fmt: skip
    assert 1e-4 < np.max(np.abs(near)) < 0.1
    np.testing.assert_allclose(far, 2.0 * near, rtol=0.02, atol=1e-5)


def test_it_applies_to_one_node_alone(four_nodes, network):
    assert applies(WindingNode, ONE)
    tied = lptn.first_order(1e4, 0.1).with_node(
        "body", capacitance=jnp.asarray(1e3), links={"winding": jnp.asarray(1.0)}
    )
    for other in (four_nodes, network, tied):
        assert not applies(WindingNode, other)
        with pytest.raises(ValueError, match="winding_node"):
            build(WindingNode, SAME, other)
        with pytest.raises(ValueError, match="winding_node"):
            WindingNode(**{k: jnp.asarray(v) for k, v in SAME.items()}).extend(other)
    assert WindingNode in EFFECTS
