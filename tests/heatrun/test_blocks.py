from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.bench.record import Record
from heatrun.bench.reduction import reduce, rounding_step
from heatrun.errors import InputError
from heatrun.motor import Motor


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


def test_short_tests_get_short_blocks(motor):
    blocks = reduce(record(np.arange(0.0, 180.0, 0.3)), motor)
    assert blocks.measured.size >= 80
    assert blocks.block_s <= 2.5


@pytest.mark.parametrize("step", [1.0, 0.5, 0.1])
def test_resolution_is_seen(step):
    values = np.random.default_rng(3).uniform(20, 90, 500)
    assert rounding_step(np.round(values / step) * step) == step
    assert rounding_step(values) == 0.0


def test_what_cannot_be_reduced_is_said(motor):
    time = np.arange(0.0, 1000.0, 1.0)
    with pytest.raises(InputError, match="3 samples"):
        reduce(record(time[:3]), motor)
    backwards = time.copy()
    backwards[500] = 0.0
    with pytest.raises(InputError, match="time must increase"):
        reduce(record(backwards), motor)
    with pytest.raises(InputError, match="coolant_degC is missing"):
        reduce(record(time), Motor("cooled", sink="coolant"))
