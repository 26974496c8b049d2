"""Derived figures against the formulas of one and two nodes, with effects behind them too."""

import json
import re
from dataclasses import dataclass, replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pandas as pd
import pytest
from msgspec import UNSET
from run_near_truth import TRUTH, run_near_truth, seal
from scipy.linalg import expm
from scipy.optimize import brentq

from heatrun import cli
from heatrun.errors import InputError, UsageError
from heatrun.export import export_ratings
from heatrun.io.texts import Texts
from heatrun.model.draws import Draws, PlausibleEffect, PlausibleEffects
from heatrun.model.model import Model
from heatrun.model.problem import Problem
from heatrun.record.blocks import Blocks
from heatrun.record.motor import Motor, ParameterOverride, ShutDown
from heatrun.record.record import Record
from heatrun.reports.content import _named, _stated
from heatrun.reports.terminal import _rating
from heatrun.runs.duties import current_at_limit
from heatrun.runs.ratings_figures import derive
from heatrun.runs.stated_duty import parse_duty, parse_rating
from lptn.effects import EFFECTS

BY_ID = {kind.card.id: kind for kind in EFFECTS}
TRUE = {name: value for name, value in TRUTH.items() if name != "Rs0"}
RS0, B, TREF = 0.0062, 234.5, 25.0
CURRENT, POWER, SINK, SPEED, LIMIT = 110.0, 620.0, 21.0, 240.0, 155.0
RATED_SPEED = 600.0
LARGEST = 150.0
NUM = 40


def blocks(hottest=150.0, power=POWER):
    """Half an hour: 10 minutes without load, 20 minutes at the load, one reading per block."""
    loaded = np.arange(90) >= 30
    each = lambda values: np.repeat(values, 10)  # noqa: E731
    measured = np.where(loaded, 90.0, SINK)
    measured[-1] = hottest
    measured[40] = np.nan  # the largest current, without a reading: in the range, not in the mean
    squared = np.where(loaded, CURRENT**2, 100.0)
    squared[40] = LARGEST**2
    return Blocks(
        name="duty",
        means={
            "step": np.asarray(2.0),
            "current_squared": each(squared),
            "losses": each(np.where(loaded, power, 30.0)),
            "ambient": each(np.full(90, SINK)),
            "speed": each(np.where(loaded, SPEED, 50.0)),
            "rated_speed": np.asarray(RATED_SPEED),
            "rated_current": np.asarray(150.0),
        },
        measured=measured,
        weight=np.full((90, 10), 0.1),
        position=np.full((90, 10), 0.5),
        count=np.full(90, 20.0),
        time=20.0 * np.arange(90) + 10.0,
        block_s=20.0,
        rounding_K=0.0,
        start_degC=SINK,
        sample_s=0.5,
    )


def motor(losses="balance", **more):
    settings: dict[str, Any] = {"insulation_class": "F", "phase_resistance_ohm": RS0} | more
    return Motor(name="test", losses=losses, **settings)


def posterior(order, machine, values, effects=(), tests=None):
    kinds = tuple(BY_ID[name] for name in effects)
    problem = Problem.of(Model.of(order, machine, kinds), machine, tests or [blocks()])
    z = np.zeros((NUM, problem.num_parameters + 3))
    for position, slot in enumerate(problem.parameters.slots):
        if slot.parameter.name in values:
            z[:, position] = slot.parameter.score(values[slot.parameter.name])
    drawn = Draws(problem.model, machine, problem.parameters, z)
    return SimpleNamespace(fit=SimpleNamespace(problem=problem), draws=drawn)


@pytest.fixture(scope="module")
def draws():
    """The four parameters, each by 10 %, and the scale of the losses by 1 %."""
    rng = np.random.default_rng(5)
    values = {n: v * np.exp(0.1 * rng.standard_normal(NUM)) for n, v in TRUE.items()}
    return values | {"power_gain": 0.01 * rng.standard_normal(NUM)}


@dataclass
class ByHand:
    """The formulas of the second order with P_ol held, one array element per draw."""

    k: float
    other: np.ndarray
    values: dict

    @classmethod
    def of(cls, kind, draws, factor=1.0):
        k = factor * 3.0 * CURRENT**2 * RS0 / (B + TREF)
        channel = (1.0 + draws["power_gain"]) * POWER
        loaded = (58 * 90.0 + 150.0) / 59
        other = channel - k * (B + loaded) if kind == "balance" else channel
        return cls(k, other, draws)

    def steady_rise(self):
        Rw, Rs = self.values["Req_w"], self.values["Req_sr"]
        both = Rw + Rs
        return (self.k * (B + SINK) * both + Rs * self.other) / (1.0 - self.k * both)

    def continuous_A(self):
        Rw, Rs = self.values["Req_w"], self.values["Req_sr"]
        per_square = self.k / CURRENT**2 * (B + LIMIT)
        return np.sqrt((LIMIT - SINK - Rs * self.other) / ((Rw + Rs) * per_square))

    def matrix(self, k, moved):
        Cw, Cs, Rw, Rs = (self.values[n] for n in TRUE)
        rows = [[(k - 1 / Rw) / Cw, 1 / (Rw * Cw)],
                [(1 / Rw - moved) / Cs, -(1 / Rw + 1 / Rs) / Cs]]  # fmt: skip
        return np.stack([np.stack(np.broadcast_arrays(*row), -1) for row in rows], -2)

    def times(self, k, moved):
        A = self.matrix(k, moved)
        half = 0.5 * (A[:, 0, 0] + A[:, 1, 1])
        root = np.sqrt(half**2 - (A[:, 0, 0] * A[:, 1, 1] - A[:, 0, 1] * A[:, 1, 0]))
        return 1.0 / (root - half), -1.0 / (root + half)

    def after(self, index, squared, is_on, start, time):
        """Return the temperatures after a time at a current, exactly."""
        one = {n: v[index : index + 1] for n, v in self.values.items()}
        k = self.k * squared / CURRENT**2
        A = ByHand(k, self.other, one).matrix(k, 0.0)[0]
        stator = is_on * self.other[index] + SINK / one["Req_sr"][0]
        heat = np.array([k * B / one["Ceq_w"][0], stator / one["Ceq_sr"][0]])
        rest = -np.linalg.solve(A, heat)
        return rest + expm(A * time) @ (start - rest)

    def time_to_limit(self, index, start):
        square = CURRENT**2
        return brentq(
            lambda t: self.after(index, square, 1.0, start, t)[0] - LIMIT, 0.0, 5e4, xtol=1e-9
        )


def unknown_of(entry, language="de"):
    """What of an entry a sheet in another language cannot say."""
    say = Texts(language)
    _stated(entry, say)
    return list(say.unknown)


def check(entry, expected, rtol=1e-6):
    """Compare median, spread and interval with those of draws worked out independently."""
    assert entry.value == pytest.approx(np.median(expected), rel=rtol)
    assert entry.sd == pytest.approx(np.std(expected), rel=rtol)
    assert entry.interval_95 == pytest.approx(
        tuple(np.quantile(expected, [0.025, 0.975])), rel=rtol
    )


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_the_figures_of_the_second_order_are_those_of_the_formulas(kind, draws):
    power = {"balance": 850.0, "map": POWER}[kind]
    found = derive(posterior("second", motor(kind), draws, tests=[blocks(230.0, power)]))
    by_hand = ByHand.of(kind, draws)
    loaded = (58 * 90.0 + 230.0) / 59
    if kind == "balance":
        by_hand.other = (1.0 + draws["power_gain"]) * power - by_hand.k * (B + loaded)
    check(found["tau_winding_s"], draws["Req_w"] * draws["Ceq_w"])
    check(found["tau_stator_s"], draws["Req_sr"] * draws["Ceq_sr"])
    fast, slow = by_hand.times(0.0, 0.0)
    check(found["tau_fast_s"], fast)
    check(found["tau_slow_s"], slow)
    # the other losses are held, as for the steady rise: under a balance too
    fast, slow = by_hand.times(by_hand.k, 0.0)
    check(found["tau_fast_feedback_s"], fast)
    check(found["tau_slow_feedback_s"], slow)
    check(found["steady_rise_K"], by_hand.steady_rise())
    check(found["continuous_current_A"], by_hand.continuous_A())
    rest = by_hand.steady_rise()
    flow = by_hand.other + by_hand.k * (B + SINK + rest)
    for name, share in (("cold", 0.0), ("hot", 0.75)):
        times = []
        for index in range(NUM):
            rises = share * np.array([rest[index], draws["Req_sr"][index] * flow[index]])
            is_there = SINK + rises[0] >= LIMIT
            never = SINK + rest[index] <= LIMIT
            times.append(0.0 if is_there else np.inf if never
                         else by_hand.time_to_limit(index, SINK + rises))  # fmt: skip
        entry = found[f"time_to_limit_{name}_s"]
        assert np.mean(np.isfinite(times)) > 0.5
        # 1e-4: the march keeps the temperature to 2e-5 of the rise
        assert entry.value == pytest.approx(np.median(times), rel=1e-4)
        finite = np.asarray(times)[np.isfinite(times)]
        assert entry.interval_95[0] == pytest.approx(np.quantile(finite, 0.025), rel=1e-4)


def test_the_currents_of_duties_are_those_of_the_exact_solution(draws, tmp_path):
    rows = ["seconds,current_A", "100,90", "140,45", "200,0"]
    (tmp_path / "hoist.csv").write_text("\n".join(rows))
    by_hand = ByHand.of("balance", draws)
    cold = np.array([SINK, SINK])

    def excess(current, index, phases, num):
        state, top = cold, 0.0
        for _ in range(num):
            for number, (seconds, share, other) in enumerate(phases):
                state = by_hand.after(index, (share * current) ** 2, other, state, seconds)
                # at the end of each phase: within one, the hottest moment is at either end
                top = max(top if number else 0.0, state[0])
        return top - (SINK + 105.0)  # the permitted rise, as on page 1 and in the map

    slow = np.median(by_hand.times(0.0, 0.0)[1])
    by_cycle = {"S3-40": [(240.0, 1.0, 1.0), (360.0, 0.0, 0.0)],
                "S6-40": [(240.0, 1.0, 1.0), (360.0, 0.0, 1.0)],
                "hoist": [(100.0, 1.0, 1.0), (140.0, 0.5, 1.0), (200.0, 0.0, 0.0)],
                "S4-40:3x10": [(10.0, 3.0, 1.0), (230.0, 1.0, 1.0), (360.0, 0.0, 0.0)],
                "S5-40:3x10,2x5,12/h": [(10.0, 3.0, 1.0), (105.0, 1.0, 1.0), (5.0, 2.0, 1.0),
                                        (180.0, 0.0, 0.0)],
                "S7:3x10,2x5": [(10.0, 3.0, 1.0), (585.0, 1.0, 1.0), (5.0, 2.0, 1.0)],
                "S8:1x100,0.5x140,0x200": [(100.0, 1.0, 1.0), (140.0, 0.5, 1.0),
                                           (200.0, 0.0, 0.0)]}  # fmt: skip
    duties = {"S2-30": ([(1800.0, 1.0, 1.0)], 1)} | {
        name: (phases, round(5 * slow / sum(p[0] for p in phases)))
        for name, phases in by_cycle.items()
    }
    asked = ("S1", *(f"{tmp_path}/hoist.csv" if name == "hoist" else name for name in duties))
    found = derive(posterior("second", motor(), draws), asked)
    for name, duty in duties.items():
        currents = [brentq(excess, 10.0, 400.0, args=(i, *duty)) for i in range(NUM)]
        entry = found[f"{name}_current_A"]
        # the search halves 0...6 LARGEST sixteen times
        assert entry.value == pytest.approx(np.median(currents), abs=2.0 * 6.0 * LARGEST / 2**16)
        assert ("none at rest" in entry.condition) == (name not in ("S6-40", "S7:3x10,2x5"))
        largest = entry.value * max(share for _, share, _ in duty[0])
        assert ("extrapolated" in entry.condition) == (largest > 1.2 * LARGEST)
        assert name == "hoist" or not unknown_of(entry)
    assert "permitted rise 105 K" in found["S2-30_current_A"].condition
    assert found["S1_current_A"] == found["continuous_current_by_rise_A"]


PERMITTED = SINK + 105.0


def resting(by_hand, index, current=CURRENT):
    return by_hand.after(index, current**2, 1.0, np.array([SINK, SINK]), 1e6)


def test_the_time_to_the_limit_is_that_of_the_exact_solution_from_any_state(draws):
    by_hand = ByHand.of("balance", draws)
    share = [(60.0 - SINK) / (resting(by_hand, i)[0] - SINK) for i in range(NUM)]
    starts = {
        "cold": lambda i: np.array([SINK, SINK]),
        "hot": lambda i: resting(by_hand, i),
        "60": lambda i: SINK + share[i] * (resting(by_hand, i) - SINK),
        "winding=80,stator=50": lambda i: np.array([80.0, 50.0]),
    }
    asked = [f"time:{load}A:{start}" for start in starts for load in (180, 240)]
    found = derive(posterior("second", motor(), draws), asked)
    for start, state in starts.items():
        for load in (180, 240):

            def at(index, time, load=load, state=state):
                return by_hand.after(index, load**2, 1.0, state(index), time)[0] - PERMITTED

            times = [0.0 if at(i, 0.0) >= 0.0 else brentq(lambda t, i=i: at(i, t), 0.0, 5e4)
                     for i in range(NUM)]  # fmt: skip
            entry = found[f"time_to_limit_{load}A_{start}_s"]
            if np.median(times) == 0.0:
                assert "at 126 °C or above at the start" in entry.refused
            else:
                check(entry, times, rtol=1e-3)
                assert f"{load} A" in entry.condition
            assert not unknown_of(entry, "it")
    assert "extrapolated, tested up to 150 A" in found["time_to_limit_240A_cold_s"].condition


def test_the_time_to_the_limit_is_the_time_limited_current_turned_round():
    known = posterior("second", motor(), TRUE)
    current = derive(known, ["S2-30"])["S2-30_current_A"].value
    found = derive(known, [f"time:{current}A", "time:60A", "time:1A:winding=80"])
    assert found[f"time_to_limit_{current}A_cold_s"].value == pytest.approx(1800.0, rel=1e-3)
    never = found["time_to_limit_60A_cold_s"].refused
    assert never == "never with a probability of 100 %, 60 A does not reach 126 °C"
    wrong = found["time_to_limit_1A_winding=80_s"].refused
    assert wrong == "expected start temperatures of winding and stator, got winding"
    say = Texts("de")
    assert [say.again(each) for each in (never, wrong)]
    assert not say.unknown


def test_a_time_says_how_probably_the_limit_is_reached(draws):
    by_hand = ByHand.of("balance", draws)
    # the continuous current of the permitted rise: about half of the machines reach it
    rests = [brentq(lambda A, i=i: resting(by_hand, i, A)[0] - PERMITTED, 50.0, 150.0)
             for i in range(NUM)]  # fmt: skip
    current = round(float(np.quantile(rests, 0.7)), 1)
    share = np.mean(np.array(rests) < current)
    found = derive(posterior("second", motor(), draws), [f"time:{current}A"])
    name = f"time_to_limit_{current}A_cold_s"
    entry = found[name]
    assert f"reached with a probability of {100.0 * share:.0f} %" in entry.condition
    assert "… ∞ " in _rating(name, entry)
    assert _stated(entry, Texts())[2].endswith("… ∞")
    assert _named(name, Texts("de")) == f"Zeit bis zur Grenze, {current}A kalt"
    assert _named("S4-40:5x2_current_A", Texts()) == "Current, S4-40:5x2"


def test_starts_and_the_pause_are_those_of_the_exact_solution(draws):
    by_hand = ByHand.of("balance", draws)
    found = derive(posterior("second", motor(rated_current_A=CURRENT), draws), ["starts:5x5,0x30"])

    def started(index, state):
        hot = by_hand.after(index, (5.0 * CURRENT) ** 2, 1.0, state, 5.0)
        return hot[0], by_hand.after(index, 0.0, 0.0, hot, 30.0)

    for name, first in (("cold", lambda i: np.array([SINK, SINK])),
                        ("hot", lambda i: resting(by_hand, i))):  # fmt: skip
        counts = []
        for index in range(NUM):
            state, count = first(index), 0
            while (after := started(index, state))[0] < PERMITTED:
                state, count = after[1], count + 1
            counts.append(count)
        entry = found[f"starts_5x5,0x30_{name}"]
        num = int(np.median(counts))
        assert entry.value == num
        low, high = np.quantile(counts, [0.025, 0.975])
        assert entry.interval_95 == (np.floor(low), np.ceil(high))
        pauses = []
        for index in range(NUM):
            state = first(index)
            for _ in range(num):
                state = started(index, state)[1]

            def late(pause, index=index, state=state):
                rested = by_hand.after(index, 0.0, 0.0, state, pause)
                return started(index, rested)[0] - PERMITTED

            pauses.append(0.0 if late(0.0) < 0.0 else brentq(late, 0.0, 2e4))
        check(found[f"pause_5x5,0x30_{name}_s"], pauses, rtol=2e-3)
        assert f"after {num} starts" in found[f"pause_5x5,0x30_{name}_s"].condition
        for each in (entry, found[f"pause_5x5,0x30_{name}_s"]):
            assert not unknown_of(each) + unknown_of(each, "it")


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("time:150A:warm", "expected time:LOAD or time:LOAD:START"),
        ("time:150A@300", "expected time:LOAD"),
        ("time:", "expected time:LOAD"),
        ("starts:600A", "or starts:PHASES"),
        ("starts:0x5", "expected a load, got none"),
        ("time:1.2", "got 1.2 times a rated current that is not stated"),
    ],
)
def test_a_stated_load_that_is_none_is_refused(wrong, said):
    with pytest.raises(UsageError, match=said):
        parse_rating(wrong, 1.0, None)


def test_start_temperatures_are_those_of_one_of_the_networks():
    networks = [("winding",), ("winding", "stator")]
    for start in ("winding=80", "stator=50,winding=80"):
        parse_rating(f"time:150A:{start}", 1.0, None, networks)
    said = "expected start temperatures of winding, or winding and stator, got rotor and winding"
    with pytest.raises(UsageError, match=said):
        parse_rating("time:150A:rotor=70,winding=80", 1.0, None, networks)


@pytest.mark.parametrize("kind", ["balance", "map"])
def test_the_figures_of_the_first_order(kind):
    rng = np.random.default_rng(2)
    C, R = 15e3 * np.exp(0.1 * rng.standard_normal((2, NUM)))
    R = R / 15e3 * 0.12
    found = derive(posterior("first", motor(kind), {"Ceq": C, "Req": R}))
    check(found["tau_s"], R * C)
    if kind == "balance":  # the total is known, whatever the copper takes of it
        check(found["steady_rise_K"], R * POWER)
        assert "one node" in found["continuous_current_A"].refused
        assert "tau_feedback_s" not in found
        return
    k = 3.0 * CURRENT**2 * RS0 / (B + TREF)
    check(found["tau_feedback_s"], R * C / (1.0 - k * R))
    check(found["steady_rise_K"], R * (POWER + k * (B + SINK)) / (1.0 - k * R))
    room = (LIMIT - SINK - R * POWER) / (R * 3 * RS0 * (B + LIMIT) / (B + TREF))
    check(found["continuous_current_A"], np.sqrt(room))


def test_cooling_by_speed_is_a_smaller_resistance_at_the_tests_speed(draws):
    g, m = np.full(NUM, 0.6), np.full(NUM, 0.8)
    values = {"speed_cooling.g": g, "speed_cooling.m": m}
    made = posterior("second", motor(), draws | values, ("speed_cooling",))
    found = derive(made, ("S2-30",))
    factor = 1.0 + g * (SPEED / RATED_SPEED) ** m
    same = derive(posterior("second", motor(), draws | {"Req_sr": draws["Req_sr"] / factor}),
                  ("S2-30",))  # fmt: skip
    assert not found["continuous_current_A"].refused
    for name, entry in same.items():
        if name == "tau_stator_s":  # of the parameters themselves, which hold at standstill
            continue
        if not entry.refused:
            assert found[name].value == pytest.approx(entry.value, rel=1e-9), name
            assert found[name].interval_95 == pytest.approx(entry.interval_95, rel=1e-9), name
    for name in ("tau_slow_s", "continuous_current_A", "S2-30_current_A"):
        if not found[name].refused:
            assert ", 2292 rpm" in found[name].condition  # 240 rad/s
    assert "rpm" not in same["tau_slow_s"].condition


def test_an_ac_loss_comes_out_of_the_measured_total(draws):
    """The copper takes k s^2/r^2 more, and under a balance the other losses give it."""
    values = {"ac_copper_loss.k": np.full(NUM, 0.8)}
    made = posterior("second", motor(), draws | values, ("ac_copper_loss",))
    found = derive(made)

    def copper(winding):
        factor = 1.0 + 0.8 * (SPEED / RATED_SPEED * (B + TREF) / (B + winding)) ** 2
        return factor * 3.0 * CURRENT**2 * RS0 * (B + winding) / (B + TREF)

    channel = (1.0 + draws["power_gain"]) * POWER
    other = channel - copper((58 * 90.0 + 150.0) / 59)
    Rs, both = draws["Req_sr"], draws["Req_w"] + draws["Req_sr"]
    rise = np.zeros(NUM)
    for _ in range(200):
        rise = both * copper(SINK + rise) + Rs * other
    check(found["steady_rise_K"], rise)
    per_square = copper(LIMIT) / CURRENT**2
    check(found["continuous_current_A"],
          np.sqrt((LIMIT - SINK - Rs * other) / (both * per_square)))  # fmt: skip


def test_an_event_is_not_there_at_the_start(draws):
    values = {"cooling_step.k": np.full(NUM, 2.0), "cooling_step.t_star": np.full(NUM, 1500.0)}
    found = derive(posterior("second", motor(), draws | values, ("cooling_step",)))
    same = derive(posterior("second", motor(), draws))
    for name, entry in same.items():
        if not entry.refused:
            assert found[name].value == pytest.approx(entry.value, rel=1e-9)
    text = "as at the start of the first test"
    assert text in found["tau_slow_s"].condition
    assert text not in same["tau_slow_s"].condition


def test_a_third_node_has_a_third_time_constant(draws):
    C, tau = 4e3, 900.0
    values = {"neighbour_body.C": np.full(NUM, C), "neighbour_body.tau": np.full(NUM, tau)}
    found = derive(posterior("second", motor(), draws | values, ("neighbour_body",)))
    by_hand = ByHand.of("balance", draws)
    A = np.zeros((NUM, 3, 3))
    A[:, :2, :2] = by_hand.matrix(0.0, 0.0)
    A[:, 1, 1] -= C / tau / draws["Ceq_sr"]
    A[:, 1, 2] = C / tau / draws["Ceq_sr"]
    A[:, 2, 1], A[:, 2, 2] = 1.0 / tau, -1.0 / tau
    times = np.sort(-1.0 / np.linalg.eigvals(A).real, axis=1)
    for place, name in enumerate(("tau_fast_s", "tau_2_s", "tau_slow_s")):
        check(found[name], times[:, place])
    # at rest it takes no heat
    check(found["continuous_current_A"], by_hand.continuous_A())


def test_radiation_lets_more_current_through(draws):
    made = {"radiation.eA": np.full(NUM, 0.3)}
    found = derive(posterior("second", motor(), draws | made, ("radiation",)))
    by_hand = ByHand.of("balance", draws)
    currents = []
    for index in range(NUM):
        Rw, Rs, other = draws["Req_w"][index], draws["Req_sr"][index], by_hand.other[index]

        def leftover(stator, Rw=Rw, Rs=Rs, other=other):
            copper = (LIMIT - stator) / Rw
            lost = 5.670374419e-8 * 0.3 * ((stator + 273.15) ** 4 - (SINK + 273.15) ** 4)
            return copper + other - (stator - SINK) / Rs - lost

        copper = (LIMIT - brentq(leftover, SINK, LIMIT)) / Rw
        currents.append(np.sqrt(copper / (by_hand.k / CURRENT**2 * (B + LIMIT))))
    check(found["continuous_current_A"], np.asarray(currents))


def test_an_offset_of_the_torque_is_no_heat(draws):
    """Pd is electrical in minus mechanical out: what the torque hides at speed is not lost."""
    override = {"torque_offset": ParameterOverride(fixed=0.25)}
    found = derive(posterior("second", motor(parameters=override), draws))
    by_hand = ByHand.of("balance", draws)
    by_hand.other = by_hand.other - 0.25 * SPEED
    check(found["steady_rise_K"], by_hand.steady_rise())


def test_the_steady_rise_is_that_of_the_rated_current(draws):
    """The copper loss goes with its square; the other losses are those of the tests."""
    rated = 0.9 * CURRENT
    found = derive(posterior("second", motor(rated_current_A=rated), draws))
    by_hand = ByHand.of("balance", draws)
    check(found["steady_rise_K"], ByHand(0.81 * by_hand.k, by_hand.other, draws).steady_rise())
    assert found["steady_rise_K"].condition.startswith("rated current 99 A, other losses")
    check(found["continuous_current_A"], by_hand.continuous_A())
    far = derive(posterior("second", motor(rated_current_A=1.3 * CURRENT), draws))
    assert far["steady_rise_K"].condition.endswith(", extrapolated, tested up to 150 °C")
    away = derive(posterior("second", motor(rated_current_A=3.0 * CURRENT), draws))
    assert away["steady_rise_K"].refused == "the tests do not tell, tested up to 150 °C"


@pytest.mark.parametrize(("used", "K"), [(None, 105.0), ("B", 80.0)])
def test_the_permitted_rise_leaves_less_than_the_class(draws, used, K):
    """Class F permits 105 K by resistance, 126 °C here, and stands 155 °C at its hottest spot."""
    found = derive(posterior("second", motor(shutdown=ShutDown(utilisation_class=used)), draws))
    by_hand = ByHand.of("balance", draws)
    left = K - by_hand.steady_rise()
    check(found["rise_margin_K"], left)
    chance = f"within it with a probability of {100.0 * np.mean(left >= 0.0):.0f} %"
    said = f"class {used or 'F'}, permitted rise {K:.0f} K, {chance}, 110 A rms"
    assert found["rise_margin_K"].condition.startswith(said)
    per_square = by_hand.k / CURRENT**2 * (B + SINK + K)
    both = draws["Req_w"] + draws["Req_sr"]
    allowed = np.sqrt((K - draws["Req_sr"] * by_hand.other) / (both * per_square))
    check(found["continuous_current_by_rise_A"], allowed)
    assert found["continuous_current_by_rise_A"].value < found["continuous_current_A"].value
    assert "rise_margin_K" not in derive(posterior("second", motor(sink="coolant"), draws))
    cold = Motor("cold", insulation_class="F")
    assert [cold.permitted_rise(T) for T in (20.0, 50.0)] == [("F", 105.0), ("F", 95.0)]


def test_without_a_class_the_limit_is_refused_and_the_rest_stands(draws):
    found = derive(posterior("second", motor(insulation_class=None), draws), ("S2-30",))
    for name in ("continuous_current_A", "time_to_limit_cold_s", "time_to_limit_hot_s",
                 "S2-30_current_A"):  # fmt: skip
        assert "no insulation class" in found[name].refused
    check(found["steady_rise_K"], ByHand.of("balance", draws).steady_rise())
    cool = derive(posterior("second", motor(), draws, tests=[blocks(hottest=100.0)]))
    within = derive(posterior("second", motor(), draws))
    for name in ("steady_rise_K", "continuous_current_A"):
        assert cool[name].value == pytest.approx(within[name].value, rel=2e-3)
        assert cool[name].condition == (
            f"{within[name].condition}, extrapolated, tested up to 100 °C"
        )
    for entry in found.values():
        assert len(_stated(entry, Texts())) == 3  # the sheet prints whatever comes


def test_beyond_the_tests_a_figure_is_refused_where_its_interval_says_nothing(draws):
    wide = draws | {"Req_sr": draws["Req_sr"] * np.geomspace(0.4, 2.5, NUM)}
    cool = [blocks(hottest=100.0)]
    found = derive(posterior("second", motor(), wide, tests=cool), ("S2-30",))
    assert found["continuous_current_A"].refused == "the tests do not tell, tested up to 100 °C"
    assert "extrapolated" in found["S2-30_current_A"].condition  # half an hour tells


def test_a_network_of_four_nodes_is_rated_too():
    C = {"winding": 437.0, "tooth": 6509.0, "yoke": 10666.0, "rotor": 3511.0}
    R = {("winding", "tooth"): 0.0499, ("tooth", "yoke"): 0.0207, ("tooth", "rotor"): 0.4,
         ("yoke", "ambient"): np.geomspace(0.05, 0.1, NUM)}  # fmt: skip
    values = {f"Ceq_{node}": each for node, each in C.items()}
    values |= {f"Req_{a}_{b}": each for (a, b), each in R.items()}
    values |= {"share_yoke": 0.3, "share_rotor": 0.1}
    found = derive(posterior("four", motor(), values))
    k = 3.0 * CURRENT**2 * RS0 / (B + TREF)
    other = POWER - k * (B + (58 * 90.0 + 150.0) / 59)
    nodes, rises, times = list(C), [], []
    for index in range(NUM):
        K = np.zeros((4, 4))
        for (a, b), each in R.items():
            g, i = 1.0 / np.broadcast_to(each, NUM)[index], nodes.index(a)
            K[i, i] += g
            if b in C:
                j = nodes.index(b)
                K[j, j], K[i, j], K[j, i] = K[j, j] + g, -g, -g
        times.append(np.sort(1.0 / np.linalg.eigvals(K / np.array(list(C.values()))[:, None]).real))
        heat = [k * (B + SINK), 0.6 * other, 0.3 * other, 0.1 * other]
        rises.append(np.linalg.solve(K - np.diag([k, 0.0, 0.0, 0.0]), heat)[0])
    check(found["steady_rise_K"], np.array(rises))
    for place, name in enumerate(("tau_fast_s", "tau_2_s", "tau_3_s", "tau_slow_s")):
        check(found[name], np.array(times)[:, place])


NONE = -1
FIGURES = ("steady_rise_K", "continuous_current_A", "time_to_limit_cold_s", "S2-30_current_A")


def behind(effects, which, size=1.0):
    """The draws at `TRUE`, with one effect of some behind each, or none."""
    drawn = posterior("second", motor(), TRUE)
    sizes = size * (np.broadcast_to(which, NUM)[:, None] == np.arange(len(effects)))
    drawn.draws = replace(drawn.draws, plausible=PlausibleEffects(tuple(effects), sizes))
    return drawn


def effect(name, amounts, shift=None, probability=0.9, test=None):
    """An effect with given amounts; without it, the parameters of `shift` have other values."""
    own = {f"{name}.{key}": value for key, value in amounts.items()}
    nulls = {f"{name}.{key}": q.null for key, q in BY_ID[name].card.parameters.items()}
    without = own | {k: v for k, v in nulls.items() if v is not None} | TRUE
    return PlausibleEffect(BY_ID[name], test, probability, own | TRUE | (shift or {}), without)


def values(drawn):
    """The figures that are not refused."""
    found = derive(drawn, ["S2-30"])
    return {name: found[name].value for name in FIGURES if found[name].refused is UNSET}


@pytest.mark.parametrize(
    ("name", "amounts"), [("ambient_recirculation", {"r": 0.02}), ("ac_copper_loss", {"k": 1.0})]
)
def test_an_effect_behind_all_draws_is_the_network_with_it(name, amounts):
    given = effect(name, amounts)
    known = posterior("second", motor(), TRUE | given.with_effect, effects=[name])
    expected, found = values(known), values(behind([given], 0))
    bare = values(posterior("second", motor(), TRUE))
    assert abs(expected["steady_rise_K"] / bare["steady_rise_K"] - 1.0) > 0.01  # it matters
    assert found == pytest.approx(expected, rel=1e-6)


def test_half_the_size_is_half_the_amount():
    whole, half = (effect("ambient_recirculation", {"r": r}) for r in (0.02, 0.01))
    expected, found = values(behind([half], 0)), values(behind([whole], 0, size=0.5))
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_resistance_that_the_effect_acts_on_goes_where_the_effect_has_it():
    """In the draws it stands for its mean over the tests."""
    moved = {"Req_sr": 0.14}
    given = effect("speed_cooling", {"g": 0.3, "m": 0.8}, shift=moved)
    known = posterior("second", motor(), given.with_effect, effects=["speed_cooling"])
    assert values(behind([given], 0)) == pytest.approx(values(known), rel=1e-6)


def test_each_draw_has_its_own_effect_or_none():
    """A third of the draws each: alone, and with either of two effects."""
    first = effect("ambient_recirculation", {"r": 0.02}, probability=0.3)
    second = effect("speed_cooling", {"g": 0.3, "m": 0.8}, probability=0.3)
    which = np.arange(NUM) % 3 - 1
    assert NONE in which
    low, high = derive(behind([first, second], which))["steady_rise_K"].interval_95
    of_each = [derive(behind([first, second], index))["steady_rise_K"].value
               for index in (NONE, 0, 1)]  # fmt: skip
    assert (low, high) == pytest.approx((min(of_each), max(of_each)), rel=1e-9)


def test_a_likely_effect_stands_in_the_condition():
    told = derive(behind([effect("ambient_recirculation", {"r": 0.02})], 0))
    assert told["steady_rise_K"].condition.endswith("with ambient_recirculation")
    assert "recirculation" not in told["tau_slow_s"].condition  # of the network alone
    rare = effect("ambient_recirculation", {"r": 0.02}, probability=0.2)
    assert "recirculation" not in derive(behind([rare], 0))["steady_rise_K"].condition


def test_an_event_of_one_test_is_none_of_the_machine():
    name = next(k.card.id for k in BY_ID.values() if k.card.family == "event")
    amounts = {key: 0.5 * (q.low + q.high) for key, q in BY_ID[name].card.parameters.items()}
    drawn = behind([effect(name, amounts, test="duty")], 0)
    assert values(drawn) == values(posterior("second", motor(), TRUE))


def test_a_heat_capacity_alone_gives_the_closed_form():
    """Adiabatic S2: T = T0 + R I^2 t/C, so I = sqrt((T - T0) C/(R t))."""
    duty = parse_duty("S2-10", 1000.0)

    def highest(current, duty):
        return 20.0 + 0.02 * current**2 * duty.phases[0].seconds / 600.0

    found = current_at_limit(duty, highest, 155.0, 300.0, 3)
    np.testing.assert_allclose(found, np.sqrt(135.0 * 600.0 / (0.02 * 600.0)), rtol=1e-3)
    assert np.all(np.isinf(current_at_limit(duty, highest, 1e6, 300.0, 3)))
    # far above the limit the simulation overflows: that is no current to permit
    overflows = lambda current, duty: np.where(current > 100.0, np.nan, highest(current, duty))  # noqa: E731
    np.testing.assert_allclose(current_at_limit(duty, overflows, 155.0, 300.0, 3), found, 1e-5)
    assert np.all(current_at_limit(duty, highest, 10.0, 300.0, 3) == 0.0)  # hot without current


def test_the_search_for_a_current_takes_few_duties_also_where_copper_runs_away():
    """Copper's resistance grows with its temperature: the rise has a pole, T = T0 + a I^2/(1 - b
    I^2), beyond which there is no temperature.
    """
    a, b, asked = np.array([0.02, 0.03, 0.01]), np.array([1e-4, 2e-5, 1e-5]), []

    def highest(current, duty):
        asked.append(1)
        left = 1.0 - b * current**2
        return np.where(left > 0.0, 20.0 + a * current**2 / np.maximum(left, 1e-9), np.inf)

    found = current_at_limit(parse_duty("S1", 1000.0), highest, 155.0, 300.0, 3)
    np.testing.assert_allclose(found, np.sqrt(135.0 / (a + 135.0 * b)), rtol=1e-5)
    assert len(asked) <= 14


def test_names_are_read():
    duty = parse_duty("S3-40", 1800.0)
    assert [phase.seconds for phase in duty.phases] == [240.0, 360.0]
    assert duty.num_cycles * 600.0 >= 4 * 1800.0
    duty = parse_duty("S5-40:5x2,3x1@500,60/h", 1800.0)
    assert [phase[:3] for phase in duty.phases] == [
        (2.0, 5.0, None), (21.0, 1.0, None), (1.0, 3.0, 500.0), (36.0, 0.0, 0.0)
    ]  # fmt: skip
    assert parse_duty("S2:5x2,1x600", 1800.0).num_cycles == 1


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("S3-140", "expected S3-PERCENT, such as S3-40"),
        ("S2-0", "expected S2-MINUTES"),
        ("S2", "expected S2-MINUTES or S2:PHASES"),
        ("S2-30:5x2", "expected S2-MINUTES"),
        ("S9-1", "expected S1, a CSV file"),
        ("S4-25", "expected S4-PERCENT:START, such as S4-40:5x2"),
        ("S5-25:5x2", "expected S5-PERCENT:START,BRAKING"),
        ("S4:5x2", "expected S4-PERCENT:START"),
        ("S7-40:5x2,3x1", "expected S7:START,BRAKING"),
        ("S4-40:5x400", "leave nothing of 240 s under load"),
        ("S4-40:600Ax2", "Got '600Ax2'"),
        ("S8:5x2,3x0", "Got '3x0'"),
        ("S8:5x2,60/h", "A phase is LOADxSECONDS or LOADxSECONDS@RPM.*Got '60/h'"),
        ("S8:0x2,0x5", "No phase has a load"),
    ],
)
def test_a_duty_that_is_not_stated_says_what_is_missing(wrong, said):
    with pytest.raises(UsageError, match=said):
        parse_duty(wrong, 1.0)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("seconds,current_A\n10,x\n", "expected numbers in the columns seconds"),
        ("seconds,amps\n10,3\n", "got the columns seconds, amps and 1 rows"),
        ("seconds,current_A\n", "and 0 rows"),
        ("seconds,current_A\n10,0\n", "needs a current in one phase"),
        ("seconds,current_A\n-1,5\n", "phases of more than 0 s"),
        ("", "cannot be read"),
    ],
)
def test_a_file_that_is_no_duty_is_refused(tmp_path, text, said):
    (tmp_path / "duty.csv").write_text(text)
    with pytest.raises(InputError, match=said):
        parse_duty(str(tmp_path / "duty.csv"), 1000.0)


def test_a_phase_may_have_a_speed_and_losses_of_its_own(draws, tmp_path):
    """The losses of the tests at their speed, written out, are the S6 of the name."""
    other = float(np.median(ByHand.of("balance", draws).other))
    same = draws | {"Rs0": np.full(NUM, RS0)}
    at = f"{SPEED * 30 / np.pi},{other}"
    rows = ["seconds,current_A,speed_rpm,other_losses_W", f"240,50,{at}", f"360,0,{at}"]
    (tmp_path / "own.csv").write_text("\n".join(rows))
    found = derive(posterior("second", motor(), same), ("S6-40", f"{tmp_path}/own.csv"))
    assert found["own_current_A"].value == pytest.approx(found["S6-40_current_A"].value, rel=0.02)
    assert "other losses as the file has them" in found["own_current_A"].condition


def test_a_shaft_that_turns_without_current_has_the_losses_of_the_tests(tmp_path):
    (tmp_path / "idle.csv").write_text("seconds,current_A,speed_rpm\n4,100,1500\n4,0,1500\n4,0,0\n")
    phases = parse_duty(str(tmp_path / "idle.csv"), 100.0).phases
    assert [phase.other_W for phase in phases] == [None, None, 0.0]


def test_the_rms_of_a_cycle_is_that_of_the_exact_solution_where_it_applies(draws, tmp_path):
    """A short cycle of half load with the other losses held: the winding sees the mean square."""
    cold = {name: np.full(NUM, value) for name, value in TRUE.items()}
    for name, seconds in (("short", 4.0), ("long", 400.0)):
        rows = ["seconds,current_A", f"{seconds},100", f"{seconds},50"]
        (tmp_path / f"{name}.csv").write_text("\n".join(rows))
    (tmp_path / "rests.csv").write_text("seconds,current_A\n4,100\n4,0")
    names = ("short", "long", "rests")
    asked = [str(tmp_path / f"{name}.csv") for name in names]
    found = derive(posterior("second", motor(), cold), asked)
    continuous = found["continuous_current_by_rise_A"].value
    rms = np.sqrt(0.5 * (1.0 + 0.5**2))
    entry, exact = found["short_rms_current_A"], found["short_current_A"]
    assert entry.value == pytest.approx(continuous / rms)
    # five slow time constants leave 0.7 % of the rise, 0.6 % of the current; the ripple is below
    assert entry.value == pytest.approx(exact.value, rel=0.01)
    apart = 100.0 * (entry.value / exact.value - 1.0)
    word = "more" if apart > 0.0 else "less"
    assert f"it permits {abs(apart):.1f} % {word} than by simulation" in entry.condition
    assert "a cycle of 800 s is not short against" in found["long_rms_current_A"].refused
    # and on the unsafe side
    assert "more than by simulation" in found["long_rms_current_A"].refused
    rests = found["rests_rms_current_A"].refused
    assert "on average" in rests
    assert "less than by simulation" in rests
    assert not any(unknown_of(found[f"{name}_rms_current_A"]) for name in names)


TWO = ((2000.0, 620.0), (4000.0, 900.0))
"""Speeds [rpm], each with all losses [W]."""


@pytest.fixture(scope="module")
def two_speeds(tmp_path_factory):
    """A run on half an hour at each of two speeds, with its course; its machine is known."""
    time_s = np.arange(0.0, 3600.0, 4.0)
    later = time_s >= 1800.0
    rpm, watts = (np.where(later, *pair[::-1]) for pair in zip(*TWO, strict=True))
    channels = {"time_s": time_s, "phase_current_A": np.full(900, CURRENT), "losses_W": watts,
                "ambient_degC": np.full(900, SINK), "winding_degC": 60.0 + 0.015 * time_s,
                "speed_rpm": rpm}  # fmt: skip
    machine = motor(rated_current_A=100.0)
    folder = tmp_path_factory.mktemp("speeds") / "run"
    run_near_truth(folder, machine, Record("duty", channels), others=TRUE)
    course = pd.DataFrame(channels).rename(columns={"winding_degC": "measured_degC"})
    course[::5].to_csv(folder / "course_1.csv", index=False)
    seal(folder)
    return folder


def continuous_at(rpm, other=None):
    """The current at the permitted rise by hand, with the other losses of the tests or given."""
    k = 3.0 * CURRENT**2 * RS0 / (B + TREF)
    means = 60.0 + 0.015 * np.array([890.0, 2690.0])
    split = [watts - k * (B + T) for (_, watts), T in zip(TWO, means, strict=True)]
    other = np.interp(rpm, [n for n, _ in TWO], split) if other is None else other
    both = TRUE["Req_w"] + TRUE["Req_sr"]
    return np.sqrt((105.0 - TRUE["Req_sr"] * other) / (both * k / CURRENT**2 * (B + SINK + 105.0)))


def test_the_map_has_the_losses_of_each_speed(two_speeds, tmp_path):
    rows = ["speed_rpm,other_losses_W", "2000,", "3000,", "4000,", "6000,500", "7000,2000"]
    (tmp_path / "speeds.csv").write_text("\n".join(rows))
    said = export_ratings(two_speeds, speeds=str(tmp_path / "speeds.csv"), folder=tmp_path / "map")
    table = pd.read_csv(tmp_path / "map" / "ratings.csv", comment="#")
    by = {(row.speed_rpm, row.duty): row for row in table.itertuples()}
    # 4e-3: medians of 500 draws of 0.5 %
    for rpm, other in ((2000, None), (3000, None), (4000, None), (6000, 500.0)):
        assert by[rpm, "S1"].current_A == pytest.approx(continuous_at(rpm, other), rel=4e-3)
        currents = [by[rpm, duty].current_A for duty in ("S1", "S2-60", "S2-30", "S2-10")]
        assert currents == sorted(currents)
    assert by[3000, "S1"].other_losses_from == "interpolated between tests"
    assert by[6000, "S1"].condition.endswith("extrapolated, tested at 2000 … 4000 rpm")
    assert "extrapolated" not in by[4000, "S1"].condition
    assert by[4000, "S2-10"].current_A > 1.2 * CURRENT
    assert by[4000, "S2-10"].condition.endswith("extrapolated, tested up to 110 A")
    for duty in ("S1", "S2-60", "S2-30"):
        assert "other losses alone lead to 126 °C" in by[7000, duty].refused
    assert said["ratings"]["limit"] == "class F, permitted rise 105 K"
    assert json.loads((tmp_path / "map" / "ratings.json").read_text())["tested_rpm"] == [2000, 4000]
    for language, words in (("de", "zwischen Prüfungen interpoliert"), ("it", "tra le prove")):
        out = ["--out", str(tmp_path / language), "--speeds", str(tmp_path / "speeds.csv")]
        command = ["export", str(two_speeds), "--to", "ratings", "--language", language, *out]
        assert cli.main(command) == 0
        other = pd.read_csv(tmp_path / language / "ratings.csv", comment="#")
        assert words in other.other_losses_from[4]
        numbers = ["speed_rpm", "current_A", "low_95_A", "high_95_A"]
        pd.testing.assert_frame_equal(other[numbers], table[numbers])
        said = " ".join(other[["condition", "refused", "other_losses_from"]].fillna("").sum())
        assert not re.search(r"\b(sink|losses|tested|rise|other|from|current|class|at)\b", said)


def test_the_map_has_the_rms_of_the_cycle_of_a_file(two_speeds, tmp_path):
    cycle = tmp_path / "short.csv"
    cycle.write_text("seconds,current_A\n4,100\n4,50\n")
    found = export_ratings(two_speeds, speeds="2000", duties=[str(cycle)], folder=tmp_path / "map")
    by = {row["duty"]: row for row in found["ratings"]["ratings"]}
    rms = np.sqrt(0.5 * (1.0 + 0.5**2))
    assert by["short_rms"]["current_A"] == pytest.approx(by["S1"]["current_A"] / rms)
    assert by["short_rms"]["current_A"] == pytest.approx(by["short"]["current_A"], rel=0.01)
    assert "than by simulation" in by["short_rms"]["condition"]


def test_a_rating_that_is_none_is_said_before_anything_is_computed(two_speeds, monkeypatch):
    monkeypatch.setattr("heatrun.runs.rating_map.machines", None)
    with pytest.raises(UsageError, match="start temperatures of"):
        export_ratings(two_speeds, duties=["time:150A:nowhere=80"])


@pytest.mark.parametrize(
    ("speeds", "code", "said"),
    [
        ("4000,6000", 1, "how large the other losses are at 6000 rpm: under load they ran at 2000"),
        ("500", 1, "no test tells how the machine cools at 500 rpm"),
        ("fast", 2, "expected speeds such as"),
        ("-100", 2, "expected speeds such as"),
        ("{path}/none.csv", 1, "the speeds cannot be read"),
        ("{path}/wrong.csv", 1, "got the columns speed_rpm, losses and 1 rows"),
    ],
)
def test_speeds_that_nothing_tells_are_refused(two_speeds, tmp_path, capsys, speeds, code, said):
    (tmp_path / "wrong.csv").write_text("speed_rpm,losses\n100,3\n")
    words = ["export", str(two_speeds), "--to", "ratings", f"--speeds={speeds}"]
    assert cli.main([word.format(path=tmp_path) for word in words]) == code
    assert said in capsys.readouterr().err
    assert not (two_speeds / "ratings").exists()


def test_any_duty_and_stated_load_is_rated_at_each_speed(two_speeds, tmp_path, capsys):
    """A current that is permitted for half an hour reaches the limit after half an hour."""
    words = ["export", str(two_speeds), "--to", "ratings", "--speeds", "2000,4000"]
    asked = ["--rating", "S2-30", "--rating", "S1", "--rating", "S2:1x1800"]
    assert cli.main([*words, *asked, "--out", str(tmp_path / "duties")]) == 0
    assert not (tmp_path / "duties" / "stated_loads.csv").exists()
    table = pd.read_csv(tmp_path / "duties" / "ratings.csv", comment="#")
    assert list(table.duty) == 2 * ["S1", "S2-30", "S2:1x1800"]
    half = table.set_index(["speed_rpm", "duty"]).current_A
    assert half[4000, "S2:1x1800"] == pytest.approx(half[4000, "S2-30"], rel=1e-3)

    asked = ["--rating", f"time:{half[4000, 'S2-30']}A", "--rating", "starts:1x9"]
    assert cli.main([*words, *asked, "--out", str(tmp_path / "loads"), "--language", "de"]) == 0
    rows = pd.read_csv(tmp_path / "loads" / "stated_loads.csv", comment="#")
    times = rows[rows.name.str.startswith("time_to_limit")].set_index("speed_rpm").value
    assert times[4000] == pytest.approx(1800.0, rel=2e-3)
    assert times[2000] > 1.1 * times[4000]  # where the other losses are smaller
    names = ["starts_1x9_cold", "pause_1x9_cold_s", "starts_1x9_hot", "pause_1x9_hot_s"]
    assert list(rows.name[1:5]) == names
    assert not re.search(r"\b(sink|losses|reach)\b", " ".join(rows.condition.fillna("")))
    assert "2000 rpm  time_to_limit_" in capsys.readouterr().out

    assert cli.main([*words, "--rating", "S9-1", "--out", str(tmp_path / "none")]) == 2
    assert cli.main(["export", str(two_speeds), "--to", "drive", "--rating", "S1"]) == 2


def test_another_map_is_not_replaced_without_being_asked(two_speeds, tmp_path, capsys):
    words = ["export", str(two_speeds), "--to", "ratings", "--out", str(tmp_path), "--speeds"]
    assert cli.main([*words, "2000"]) == 0
    assert "S2-30 [A]" in capsys.readouterr().out
    assert cli.main([*words, "4000"]) == 1
    assert cli.main([*words, "4000", "--force"]) == 0
    assert cli.main([*words, "4000", "--to", "drive"]) == 2


def test_a_wrong_rating_is_wrong_use(tmp_path, capsys):
    from heatrun.commands.demo import bundled

    data = bundled("synthetic")
    words = ["calibrate", str(data / "motor.toml"), str(data / "step_30min.csv.gz"), "--rating",
             "S9-1", "--out", str(tmp_path / "run")]  # fmt: skip
    assert cli.main(words) == 2
    assert "S9-1" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
