from dataclasses import replace

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from fleet_machines import machine

from heatrun.fit.fit import delays, fit
from heatrun.fit.restricted import polished_noise
from heatrun.io.programs import COUNTS
from heatrun.model.problem import Problem, whitened
from heatrun.record.motor import ParameterOverride
from heatrun_fleet.batch.fit import NotBatched, bucket, fit_batch, key_of, pack
from heatrun_fleet.batch.residuals import residuals_of_group

SAME = 1e-6


def assert_same(found, alone):
    """The batch's fit is that of the machine alone, to 1e-6: scores of the priors' widths."""
    assert not isinstance(found, NotBatched), found
    assert found.z == pytest.approx(alone.z, rel=SAME, abs=SAME)
    assert found.noise_z == pytest.approx(alone.noise_z, rel=SAME, abs=SAME)
    assert found.log_evidence == pytest.approx(alone.log_evidence, rel=SAME)
    for of_batch, of_one in (
        (found.covariance, alone.covariance),
        (found.covariance_type_a, alone.covariance_type_a),
    ):
        widths = np.sqrt(np.diag(of_one))
        scale = widths[:, None] * widths
        np.testing.assert_allclose(of_batch / scale, of_one / scale, rtol=0.0, atol=SAME)
    for of_batch, of_one in zip(found.residual, alone.residual, strict=True):
        np.testing.assert_allclose(of_batch, of_one, rtol=0.0, atol=1e-6)
    for of_batch, of_one in zip(found.problem.heat, alone.problem.heat, strict=True):
        largest = np.max(np.abs(of_one @ of_one.T))
        assert np.max(np.abs(of_batch @ of_batch.T - of_one @ of_one.T)) < 1e-6 * largest
    assert [f.id for f in found.findings] == [f.id for f in alone.findings]
    assert found.modes.shape == alone.modes.shape
    assert found.result is alone.result
    for name in ("rmse_white_K", "low_frequency_excess", "num_starts"):
        assert found.stats[name] == pytest.approx(alone.stats[name], rel=SAME), name


def assert_as_alone(problems):
    """The batch's fits are those of each machine alone; returned."""
    found = fit_batch(problems, width=4)
    for of_batch, problem in zip(found, problems, strict=True):
        assert_same(of_batch, fit(problem))
    return found


@eqx.filter_jit
def residuals(structure, machines, z, group):
    return residuals_of_group(structure, machines, z, group)


@pytest.fixture(scope="module")
def short(generator):
    """One test each: a full one, a shorter one, and one of a poor step of load."""
    return [
        machine(generator, 1, [generator.duty(1900.0)]),
        machine(generator, 2, [generator.duty(1840.0)]),
        machine(generator, 3, [generator.constant_load(1900.0, torque=0.2, speed=0.1)]),
    ]


def test_residuals_and_slopes_are_those_of_one_machine(short):
    key = key_of(short[0])
    assert all(key_of(problem) == key for problem in short)
    rng = np.random.default_rng(0)
    z = 0.3 * rng.standard_normal((short[0].num_parameters, len(short)))
    machines = pack(key, short)
    (group,) = machines.groups
    found = residuals(key.structure, machines, jnp.asarray(z), group)
    for lane, problem in enumerate(short):
        residual, jacobian = problem.linearised(z[:, lane])
        num = residual.shape[0]
        of_residual, of_jacobian = (np.asarray(each)[..., lane] for each in found)
        np.testing.assert_allclose(of_residual[:num], residual, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(of_jacobian[:num], jacobian, rtol=1e-9, atol=1e-8)
        assert not np.any(of_residual[num:])
        assert not np.any(of_jacobian[num:])


@pytest.fixture(scope="module")
def slow(generator):
    """Machines whose load is sampled once a second: their readings may be late or early."""
    profiles = [generator.duty(1900.0), generator.staircase(1900.0)]
    return [machine(generator, seed, profiles, sample_s=1.0) for seed in (5, 6)]


@pytest.mark.parametrize("late_s", [-1.9, -0.4, 0.0, 0.7, 1.9])
def test_a_late_reading_is_that_of_one_machine(slow, late_s):
    key = key_of(slow[0])
    machines = pack(key, slow)
    rng = np.random.default_rng(1)
    z = 0.3 * rng.standard_normal((slow[0].num_parameters, len(slow)))
    of_timing = [i for i, each in enumerate(slow[0].parameters.slots) if "load_timing" in each.name]
    assert len(of_timing) == 2
    sds = [[p.parameters.slots[i].parameter.sd for p in slow] for i in of_timing]
    z[of_timing] = late_s * np.array([[1.0, -0.5], [1.0, 0.8]]) / np.array(sds)
    (group,) = machines.groups
    found = residuals(key.structure, machines, jnp.asarray(z), group)
    by_test = [np.split(np.asarray(rows), len(group.tests), axis=-1) for rows in found]
    for lane, problem in enumerate(slow):
        residual, jacobian = problem.linearised(z[:, lane])
        rows = zip(*(problem.split(each) for each in (residual, jacobian)), strict=True)
        for test, (of_residual, of_jacobian) in enumerate(rows):
            num = of_residual.shape[0]
            ours = by_test[0][test][:num, lane], by_test[1][test][:num, ..., lane]
            np.testing.assert_allclose(ours[0], of_residual, rtol=0.0, atol=1e-9)
            np.testing.assert_allclose(ours[1], of_jacobian, rtol=1e-9, atol=1e-8)


@pytest.fixture(scope="module")
def on_time(generator):
    """A machine of which one test is most probably read on time: a corner of the likelihood."""
    profiles = [generator.duty(1900.0), generator.staircase(1900.0)]
    return machine(generator, 64, profiles, sample_s=1.0)


@pytest.mark.slow
def test_a_delay_at_its_corner_is_held_there_and_all_else_is_at_its_best(on_time):
    found = fit(on_time)
    (at_corner, elsewhere) = delays(on_time.structure.form)
    assert found.z[at_corner] == 0.0
    assert found.z[elsewhere] != 0.0

    def half_squares(z):
        rows = whitened(found.problem.structure, found.problem.data, jnp.asarray(z), found.noise)
        return 0.5 * float(np.sum(np.square(rows)))

    best = half_squares(found.z)
    for place in range(found.z.size):
        for change in (-1e-3, 1e-3):
            z = found.z.copy()
            z[place] += change
            assert half_squares(z) > best, on_time.parameters.slots[place].name


@pytest.mark.slow
def test_a_delay_at_its_corner_is_that_of_one_machine(on_time, slow):
    (found, *_) = fit_batch([on_time, *slow], width=4)
    assert_same(found, fit(on_time))


@pytest.mark.slow
def test_machines_with_slow_loggers_fit_as_one_does(slow):
    first, second = slow[1].tests
    later = {name: np.roll(first.means[name], -3) for name in ("losses", "current_squared")}
    late = replace(slow[1], tests=(replace(first, means=first.means | later), second))
    *found, too_late = fit_batch([*slow, late], width=4)
    for of_batch, problem in zip(found, slow, strict=True):
        assert_same(of_batch, fit(problem))
    assert isinstance(too_late, NotBatched)
    assert "late" in too_late.reason


@pytest.mark.slow
def test_load_steps_at_unknown_moments_are_those_of_one_machine(slow):
    """In one of two tests of one machine, two columns; the other has none, and knows of none."""
    first, second = slow
    duty, stairs = first.tests
    blocks = np.arange(duty.num_blocks)
    columns = np.stack([0.4 * np.exp(-0.2 * (blocks - at)) * (blocks >= at) for at in (12, 40)], 1)
    known = replace(duty, load_columns=columns, measured=duty.measured + columns @ [1.5, -0.8])
    uneasy = replace(first, tests=(known, stairs))
    found = assert_as_alone([uneasy, second])
    plain = fit(replace(first, tests=(replace(known, load_columns=None), stairs)))
    assert found[0].log_evidence > plain.log_evidence + 2.0


@pytest.mark.slow
def test_a_batch_fits_as_one_does(short):
    assert_as_alone(short)


@pytest.mark.slow
def test_nothing_is_compiled_for_a_number_of_machines(short):
    fit_batch(short, width=4)
    before = COUNTS["compiled"]
    found = fit_batch([short[1], *short, *short], width=4)
    assert COUNTS["compiled"] == before
    # neither the place in a batch nor what stands beside changes a digit
    for one, other in ((found[0], found[2]), (found[2], found[5])):
        for name in ("z", "noise_z", "covariance", "log_evidence"):
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


@pytest.mark.slow
def test_machines_of_another_kind_are_left_to_the_full_job(short, generator):
    profiles = [generator.duty(1900.0), generator.duty(1800.0)]
    of_two = machine(generator, 4, profiles)
    unlike = replace(of_two.tests[1], sample_s=1.0)
    model = replace(short[0].model, change_sd=0.1)
    changing = replace(short[0], model=model)
    mixed = Problem.of(of_two.model, of_two.motor, [of_two.tests[0], unlike])
    reasons = [found.reason for found in fit_batch([mixed, changing], width=4)]
    assert "unlike" in reasons[0]
    assert "change" in reasons[1]


@pytest.mark.slow
def test_a_machine_with_garbage_does_not_touch_its_neighbours(short):
    (blocks,) = short[0].tests
    rng = np.random.default_rng(3)
    garbage = replace(blocks, measured=1e9 * rng.standard_normal(blocks.measured.shape))
    spoilt = replace(short[0], tests=(garbage,))
    with_it, without = fit_batch([spoilt, short[1]], width=4), fit_batch([short[1]], width=4)
    assert isinstance(with_it[0], NotBatched)
    np.testing.assert_array_equal(with_it[1].z, without[0].z)
    np.testing.assert_array_equal(with_it[1].covariance, without[0].covariance)


@pytest.mark.slow
def test_the_polished_noise_is_where_the_likelihood_is_flat(short):
    found = fit(short[0])
    residual, jacobian = np.concatenate(found.residual), np.concatenate(found.jacobian)
    exact = polished_noise(found.problem, found.noise_z, found.z, residual, jacobian)
    moved = polished_noise(found.problem, found.noise_z + 3e-3, found.z, residual, jacobian)
    np.testing.assert_allclose(moved, exact, rtol=0.0, atol=1e-8)


@pytest.mark.parametrize(("num", "size"), [(90, 96), (96, 96), (97, 128), (360, 384)])
def test_buckets_hold_their_tests(num, size):
    assert bucket(num) == size


@pytest.mark.slow
@pytest.mark.parametrize("network", ["first", "second"])
def test_two_tests_of_unlike_length_in_a_batch(generator, network):
    problems = [
        machine(generator, 10 + seed, [generator.duty(first), generator.staircase(second)], network)
        for seed, (first, second) in enumerate([(3600.0, 2400.0), (3300.0, 2300.0)])
    ]
    assert_as_alone(problems)


@pytest.mark.slow
def test_a_map_of_losses_and_fixed_parameters(generator):
    problems = [
        machine(
            generator, 20 + seed, [generator.duty(1900.0)], losses="map",
            parameters={"sensor_offset": ParameterOverride(fixed=0.1)},
        )
        for seed in range(2)
    ]  # fmt: skip
    assert_as_alone(problems)
