import warnings
from dataclasses import replace

import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.record.blocks import length_class
from heatrun.record.motor import Motor
from heatrun.record.record import Record
from heatrun.record.reduction import reduce
from heatrun.record.samples import rounding_step


def record(time, current=100.0, winding=None, **channels):
    full = np.full(time.size, 1.0)
    return Record(
        "made",
        {
            "time_s": time,
            "phase_current_A": full * current,
            "losses_W": full * 500.0,
            "ambient_degC": full * 20.0,
            "winding_degC": 20.0 + 0.01 * time if winding is None else winding,
            **channels,
        },
    )


def test_power_and_squared_current_are_conserved(motor):
    rng = np.random.default_rng(1)
    time = np.cumsum(rng.uniform(0.05, 0.3, 9000))
    made = record(time, current=rng.uniform(0, 200, time.size))
    made = replace(made, channels={**made.channels, "losses_W": rng.uniform(0, 900, time.size)})
    blocks = reduce(made, motor)
    for values, channel in (
        (blocks.inputs.losses, made["losses_W"]),
        (blocks.inputs.current_squared, made["phase_current_A"] ** 2),
    ):
        span = time[-1] - time[0]
        held = channel[-1] * (blocks.duration_s - span)  # the last step runs past the record
        total = float(np.sum(values)) * float(blocks.inputs.step)
        assert total == pytest.approx(np.trapezoid(channel, time) + held, rel=1e-9)


def test_model_and_measurement_are_averaged_over_the_same_instants(motor):
    """Of a ramp, the model's block means must be the measured ones, or a delay would be found."""
    rng = np.random.default_rng(2)
    for time in (np.arange(0.0, 4000.0, 0.5), np.cumsum(rng.uniform(0.1, 3.0, 4000)),
                 np.arange(0.0, 4000.0, 7.3)):  # fmt: skip
        made = record(time)
        blocks = reduce(made, motor)
        edges = blocks.first_s + np.arange(blocks.inputs.num_time + 1) * float(blocks.inputs.step)
        observation = blocks.observation()
        ramp = 20.0 + 0.01 * edges
        shape = observation.weight.shape
        before, after = ramp[:-1].reshape(shape), ramp[1:].reshape(shape)
        means = np.sum(blocks.weight * (before + blocks.position * (after - before)), axis=1)
        seen = blocks.is_observed
        np.testing.assert_allclose(means[seen], blocks.measured[seen], atol=1e-9)


def test_a_gap_leaves_empty_blocks_and_a_note(motor):
    time = np.arange(0.0, 4000.0, 1.0)
    winding = 20.0 + 0.01 * time
    winding[1000:1200] = np.nan
    losses = np.full(time.size, 500.0)
    losses[10:12] = np.nan
    blocks = reduce(record(time, winding=winding, losses_W=losses), motor)
    assert np.sum(~blocks.is_observed) >= 9
    assert any("losses_W" in note for note in blocks.notes)
    # what is modelled there has a mean like any other
    edges = 20.0 + 0.01 * (blocks.first_s + np.arange(blocks.inputs.num_time + 1) * float(
        blocks.inputs.step))  # fmt: skip
    before, after = (each.reshape(blocks.weight.shape) for each in (edges[:-1], edges[1:]))
    means = np.sum(blocks.weight * (before + blocks.position * (after - before)), axis=1)
    own = 20.0 + 0.01 * (blocks.first_s + blocks.time)
    np.testing.assert_allclose(means, own, atol=1e-9)


def test_short_tests_get_short_blocks(motor):
    blocks = reduce(record(np.arange(0.0, 180.0, 0.3)), motor)
    assert blocks.measured.size >= 80
    assert blocks.block_s <= 2.5


def readings(step, *, noise=0.3, size=4000):
    """Return a warming winding with noise, rounded to a step [degC]."""
    time = np.arange(size)
    noises = np.random.default_rng(3).normal(0.0, noise, size)
    warm = 20.0 + 70.0 * (1.0 - np.exp(-time / 900.0)) + noises
    return np.round(warm / step) * step


@pytest.mark.parametrize("step", [2.0, 1.0, 0.5, 0.1, 1.0 / 16.0])
def test_resolution_is_seen_whatever_the_grid_begins_at(step):
    assert rounding_step(readings(step)) == pytest.approx(step, rel=1e-6)
    in_kelvin = readings(step) + 273.15  # rounded as kelvin, converted by the reader
    assert rounding_step(in_kelvin - 2 * 273.15) == pytest.approx(step, rel=1e-6)


def test_resolution_in_fahrenheit_is_seen():
    assert rounding_step(readings(5.0 / 9.0) - 160.0 / 9.0) == pytest.approx(5.0 / 9.0, rel=1e-6)


def test_resolution_is_seen_in_random_and_in_32_bit_readings():
    values = np.random.default_rng(3).uniform(20, 90, 500)
    assert rounding_step(np.round(values, 1)) == pytest.approx(0.1, rel=1e-6)
    assert rounding_step(readings(0.1).astype(np.float32)) == pytest.approx(0.1, rel=1e-4)
    assert rounding_step(values) is None


def test_resolution_is_seen_in_few_equal_steps_and_not_in_a_failing_sensor():
    slow = np.repeat([20.0, 21.0, 22.0, 23.0, 24.0], 60)
    assert rounding_step(slow) == 1.0
    assert rounding_step(np.repeat([20.0, 20.3, 51.2, 20.0], 60)) is None


def test_changes_far_below_the_others_are_no_step_and_raise_no_warning():
    # one course written in two units: a few changes are differences of two roundings
    changes = np.concatenate([[0.0011, 0.0017, 0.0017, 0.0022], np.linspace(0.0578, 0.19, 235)])
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert rounding_step(np.cumsum(changes)) is None


def test_a_fit_books_the_rounding_of_a_shifted_grid(motor):
    time = np.arange(0.0, 4000.0, 1.0)
    blocks = reduce(record(time, winding=readings(1.0) + 0.15), motor)
    assert blocks.rounding_K == pytest.approx(1.0, rel=1e-6)


def test_what_cannot_be_reduced_is_said(motor):
    time = np.arange(0.0, 1000.0, 1.0)
    with pytest.raises(InputError, match="3 samples"):
        reduce(record(time[:3]), motor)
    backwards = time.copy()
    backwards[500] = 0.0
    with pytest.raises(InputError, match="time must increase"):
        reduce(record(backwards), motor)
    with pytest.raises(InputError, match="Missing: coolant_degC"):
        reduce(record(time), Motor("cooled", sink="coolant"))


def test_a_few_lengths_serve_the_tests_of_all():
    classes = [length_class(num) for num in range(2000)]
    assert all(num <= found <= max(1.25 * num, 4.0) for num, found in enumerate(classes))
    assert len({found for found in classes if found >= 90}) == 19
    assert all(length_class(found) == found for found in classes)
    seldom = {length_class(num, is_seldom=True) for num in range(1, 2000)}
    assert seldom == {8, 16, 32, 64, 128, 256, 512, 1024, 2048}
    assert length_class(256, is_seldom=True) == 256


@pytest.mark.parametrize(("is_seldom", "whole"), [(False, 112), (True, 128)])
def test_rows_that_are_added_stand_behind_those_of_each_sensor(motor, is_seldom, whole):
    time = np.arange(0.0, 2000.0, 1.0)
    both = reduce(record(time, stator_degC=30.0 + 0.0 * time), motor).with_bodies(["stator_degC"])
    num = both.num_blocks
    assert num == 100
    longer = both.observation().padded(is_seldom=is_seldom)
    assert longer.inputs.num_time == whole * both.weight.shape[1]
    np.testing.assert_array_equal(longer.measured.reshape(2, -1)[:, num:], 0.0)
    np.testing.assert_array_equal(both.own(longer.measured), both.measured)
    rows = np.arange(6.0 * num).reshape(3, -1)
    more = both.lengthened(rows.T, is_seldom=is_seldom).T
    assert more.shape == (3, 2 * whole)
    np.testing.assert_array_equal(both.own(more, axis=1), rows)
