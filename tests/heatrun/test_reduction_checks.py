"""What a slow logger loses is measured, and said where it matters."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from heatrun.posterior.identifiability import (
    BETWEEN_K,
    _simulated,
    between_samples,
    check_reduction,
    reduction_error,
)
from heatrun.record.record import Record
from heatrun.record.reduction import reduce


@pytest.fixture(scope="module")
def at_4_hz(generator):
    """Records of the reference motor by profile, sampled at points without noise."""

    def make(profile):
        truth = generator.simulate(
            generator.reference_motor(), profile, sample_s=0.25, steps_per_sample=4
        )
        return Record("cycle", {
            "time_s": truth.time_s,
            "phase_current_A": np.abs(truth.current_A),
            "losses_W": truth.losses_W,
            "ambient_degC": truth.ambient_degC,
            "winding_degC": truth.winding_degC,
            "speed_rpm": truth.speed_rpm,
        })  # fmt: skip

    return make


def thinned(record, every):
    return replace(record, channels={name: v[::every] for name, v in record.channels.items()})


def test_a_drive_cycle_in_points_a_second_apart_is_doubted(fitted, motor, at_4_hz, generator):
    fast = at_4_hz(generator.drive_cycle(1800.0))
    slow = thinned(fast, 4)
    blocks, finest = reduce(slow, motor), reduce(fast, motor)
    stated = between_samples(fitted, slow, blocks, motor)
    error, findings = check_reduction(fitted, slow, blocks, motor)
    assert error < BETWEEN_K
    assert [finding.id for finding in findings] == ["between_samples"]
    assert findings[0].values["between_samples_K"] == stated > BETWEEN_K
    assert "every 1 s" in findings[0].message

    as_is, true = _simulated(fitted, motor, blocks, [blocks, replace(blocks, means=finest.means)])
    really = np.sqrt(np.mean((as_is - true) ** 2))
    assert stated / 10.0 < really < stated


def test_a_duty_in_points_and_a_drive_cycle_at_4_hz_are_not(fitted, motor, at_4_hz, generator):
    duty = thinned(at_4_hz(generator.duty(1800.0)), 4)
    assert 0.0 < between_samples(fitted, duty, reduce(duty, motor), motor) < BETWEEN_K
    fast = at_4_hz(generator.drive_cycle(1800.0))
    assert between_samples(fitted, fast, reduce(fast, motor), motor) == 0.0


def test_a_load_logged_more_slowly_than_the_rest_counts_by_its_own_samples(
    fitted, motor, at_4_hz, generator
):
    """Rows at 4 Hz of which only every fourth holds the load, as in a file of several rasters."""
    fast = at_4_hz(generator.drive_cycle(1800.0))
    channels = {name: values.copy() for name, values in fast.channels.items()}
    for name in ("phase_current_A", "losses_W", "speed_rpm"):
        channels[name][np.arange(fast.time_s.size) % 4 != 0] = np.nan
    slow = thinned(fast, 4)
    mixed = between_samples(fitted, replace(fast, channels=channels), reduce(slow, motor), motor)
    assert mixed == pytest.approx(
        between_samples(fitted, slow, reduce(slow, motor), motor), rel=1e-6
    )


def test_the_steps_are_held_against_finer_ones(fitted, motor, at_4_hz, generator):
    record = at_4_hz(generator.duty(1800.0))
    coarse = reduce(record, motor, step_s=10.0, block_s=20.0)
    fine = reduce(record, motor)
    assert reduction_error(fitted, record, coarse, motor) > 4.0 * reduction_error(
        fitted, record, fine, motor
    )
