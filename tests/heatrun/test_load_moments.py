"""A load step between two samples: the blocks behind it count for what is not known of it."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from heatrun.calibration import load_tests
from heatrun.checks.load_moments import with_load_moments
from heatrun.motor.file import parse_motor
from heatrun.record.blocks import strongest
from heatrun.record.record import Record
from heatrun.record.reduction import reduce

C_W, C_SR, R_W, R_SR = 20.0, 400.0, 0.6, 1.5
"""A coil with a time constant of 12 s [J/K, K/W]."""
OHM = 0.01
SECONDS = 3600.0
MOTOR = f"""[motor]
name = "coil"
phases = 1
[winding]
phase_resistance_ohm = {OHM}
"""


def motor():
    return parse_motor(MOTOR.encode(), "motor.toml")


def truth(edges_s, amperes, seconds=SECONDS, body=C_SR):
    """Return once a second current, losses and winding [A, W, degC], by the eigenvectors."""
    time = np.arange(0.0, seconds + 0.5)
    T, now = np.empty(time.size), np.array([25.0, 25.0])
    bounds = [0.0, *edges_s, seconds]
    T[0] = 25.0
    for begin, end, A in zip(bounds[:-1], bounds[1:], amperes, strict=True):
        k = OHM * A**2 / 259.5
        slope = np.array([[k - 1.0 / R_W, 1.0 / R_W], [1.0 / R_W, -1.0 / R_W - 1.0 / R_SR]])
        rates, modes = np.linalg.eig(slope / [[C_W], [body]])
        rest = np.linalg.solve(slope, [-234.5 * k, -25.0 / R_SR])
        parts = modes * np.linalg.solve(modes, now - rest)
        inside = np.flatnonzero((time > begin) & (time <= end))
        T[inside] = rest[0] + np.exp(np.outer(time[inside] - begin, rates)) @ parts[0]
        now = rest + parts @ np.exp((end - begin) * rates)
    current = np.asarray(amperes)[np.searchsorted(edges_s, time, side="right")]
    return time, current, OHM * current**2 * (234.5 + T) / 259.5, T


def record(edges_s, amperes=(0.0, 60.0, 0.0, 40.0, 0.0), seconds=SECONDS, body=C_SR):
    time, current, losses, T = truth(edges_s, amperes, seconds, body)
    return Record("coil", {
        "time_s": time, "phase_current_A": current, "losses_W": losses,
        "ambient_degC": np.full(time.size, 25.0), "winding_degC": T,
    })  # fmt: skip


EDGES = np.array([60.0, 1500.0, 2000.0, 3000.0])


def with_moments(test):
    return with_load_moments(reduce(test, motor()), test, motor())


def total(blocks):
    """Return the variance of the blocks' means from the moments of load steps [K^2]."""
    return blocks.load_variance + np.sum(blocks.moments[: blocks.num_blocks] ** 2, axis=1)


def test_the_variance_is_that_of_steps_at_any_moment_between_their_samples():
    """Against many simulations whose steps fall elsewhere between the same two samples."""
    rng = np.random.default_rng(3)
    records = [record(EDGES + rng.uniform(1e-3, 1.0 - 1e-3, EDGES.size)) for _ in range(60)]
    # the load reads the same in all of them, so that a model says the same: ten of them tell
    stated = np.mean([total(with_moments(each)) for each in records[:10]], axis=0)
    spread = np.var([reduce(each, motor()).measured for each in records], axis=0)
    behind = spread > 0.1 * spread.max()
    assert behind.sum() == 4  # the first block behind each step
    # 60 draws know a variance to a fifth; the quick fit knows the winding to a tenth
    np.testing.assert_allclose(stated[behind], spread[behind], rtol=0.6)
    assert np.sum(stated) == pytest.approx(np.sum(spread), rel=0.3)
    assert np.all(stated[~behind] < 0.1 * spread.max())


def test_blocks_behind_one_step_err_together():
    """In a test of two minutes a block lasts a second, and a step is felt in dozens of them."""
    rng = np.random.default_rng(5)
    edges, amperes = np.array([6.0, 70.0]), (0.0, 60.0, 0.0)
    records = [record(edges + rng.uniform(1e-3, 1.0 - 1e-3, 2), amperes, 120.0) for _ in range(60)]
    behind = slice(8, 20)  # a time constant of the winding
    means = [np.mean(reduce(each, motor()).measured[behind]) for each in records]
    at_samples = [with_moments(each) for each in records[:10]]
    (num,) = {blocks.measured[behind].size for blocks in at_samples}
    stated = [
        np.sum(np.sum(blocks.moments[behind], axis=0) ** 2) + np.sum(blocks.load_variance[behind])
        for blocks in at_samples
    ]
    ratio = np.mean(stated) / num**2 / np.var(means)
    assert 0.5 < ratio < 2.0  # 60 draws know a variance to a fifth
    alone = np.mean([np.sum(total(blocks)[behind]) for blocks in at_samples]) / num**2
    assert alone < 0.2 * np.var(means)


def test_a_light_body_remembers_what_many_steps_add_up_to():
    """An intermittent duty, whose body has twice the capacity of its winding."""
    rng = np.random.default_rng(7)
    edges = np.arange(30.0, 1500.0, 15.0)
    amperes = (*(60.0 * (number % 2) for number in range(edges.size)), 0.0)

    def drawn():
        moments = edges + rng.uniform(1e-3, 1.0 - 1e-3, edges.size)
        return record(moments, amperes, 1500.0, 2.0 * C_W)

    records = [drawn() for _ in range(60)]
    measured = np.array([reduce(each, motor()).measured for each in records])
    stated = np.mean([total(with_moments(each)) for each in records[:5]], axis=0)
    assert np.sum(stated) == pytest.approx(np.sum(np.var(measured, axis=0)), rel=0.25)
    # between two blocks a minute apart, which no single step ties to each other
    off = measured - measured.mean(axis=0)
    apart = 4
    tied = np.mean(off[:, :-apart] * off[:, apart:]) / np.mean(off**2)
    columns = with_moments(records[0]).moments
    said = np.sum(columns[:-apart] * columns[apart:]) / np.sum(stated)
    assert tied > 0.1
    assert said == pytest.approx(tied, rel=0.6)


def test_a_fast_logger_and_a_steady_load_leave_nothing_open():
    test = record(EDGES + 0.3)
    channels = {name: np.repeat(v, 2)[:-1] for name, v in test.channels.items()}
    channels["time_s"] = 0.5 * np.arange(channels["time_s"].size)
    assert with_moments(replace(test, channels=channels)).load_variance is None
    steady = record(np.array([60.0]), (0.0, 50.0))
    late = total(with_moments(steady))[10:]
    assert np.all(late < 1e-3)


def test_bodies_and_longer_tests_keep_the_rows_of_the_winding():
    test = record(EDGES + 0.3)
    body = {**test.channels, "stator_degC": 25.0 + 0.3 * (test["winding_degC"] - 25.0)}
    blocks = with_moments(replace(test, channels=body))
    both = blocks.with_bodies(["stator_degC"])
    num = blocks.num_blocks
    np.testing.assert_array_equal(both.known_variance[:num], blocks.known_variance)
    np.testing.assert_array_equal(both.moments[:num], blocks.moments)
    assert np.max(np.abs(blocks.moments)) > 0.1
    assert not np.any(both.moments[num:])
    assert np.all(both.known_variance[num:] < 1e-6)
    np.testing.assert_array_equal(
        np.asarray(both.observation().known_variance), both.known_variance
    )


def test_tests_that_are_fitted_know_it_and_tests_that_are_predicted_do_not(tmp_path):
    """From its own readings: a held-out test would tell of itself."""
    test = record(EDGES + 0.3)
    for name in ("coil.csv", "later.csv"):
        pd.DataFrame(dict(test.channels)).to_csv(tmp_path / name, index=False)
    fitted, held_out = load_tests(motor(), [tmp_path / "coil.csv"], [tmp_path / "later.csv"])
    assert np.max(total(fitted.blocks)) > 0.1
    assert held_out.blocks.load_variance is None
    assert held_out.blocks.load_columns is None


def test_the_strongest_directions_are_those_of_the_singular_values():
    rng = np.random.default_rng(3)
    many = rng.standard_normal((40, 30)) * np.geomspace(1.0, 1e-3, 30)
    few = strongest(many, 4)
    turned, length, _ = np.linalg.svd(many, full_matrices=False)
    best = (turned[:, :4] * length[:4] ** 2) @ turned[:, :4].T
    np.testing.assert_allclose(few @ few.T, best, atol=1e-12)
    assert strongest(many[:, :3], 4).shape == (40, 3)
    assert strongest(many[:5], 8).shape == (5, 8)


def test_no_record_ends_where_lapack_finds_no_singular_values(monkeypatch, tmp_path):
    """By divide and conquer LAPACK gives up on some matrices that are as good as any."""

    def gives_up(*_args, **_words):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", gives_up)
    path = tmp_path / "coil.csv"
    pd.DataFrame(dict(record(EDGES + 0.3).channels)).to_csv(path, index=False)
    (test,) = load_tests(motor(), [path], [])
    assert np.max(np.abs(test.blocks.load_columns)) > 0.1
