"""A measured body that is a node of the network is fitted beside the winding."""

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from measured_machine import measured_record
from msgspec import UNSET
from recovered import holds, sd
from test_noise import NOISE, covariance, log_normal

import heatrun
from heatrun.calibration import Settings, calibrate, load_tests, manifest
from heatrun.errors import InputError
from heatrun.fit.fit import fit
from heatrun.fit.fit_result import Fit
from heatrun.model.bodies import body_courses
from heatrun.model.draws import Draws
from heatrun.model.model import Model
from heatrun.model.noise import log_density, whiten
from heatrun.model.problem import Problem
from heatrun.motor.file import load_motor
from heatrun.posterior.comparison import verdict
from heatrun.posterior.posterior import normal_draws
from heatrun.posterior.predict import of_test
from heatrun.record.reduction import reduce
from heatrun.results import FitResult, from_json
from heatrun.runs.run_folder import RunFolder
from heatrun.runs.write import write_run

STORED = Path(__file__).parents[1] / "stored" / "fit-1.json"


@pytest.fixture(scope="module")
def record(generator):
    return measured_record(generator, generator.duty(3600.0), 71)


@pytest.fixture(scope="module")
def test(record, motor):
    return reduce(record, motor)


@pytest.fixture(scope="module")
def bench_files(record, tmp_path_factory):
    """A motor file, and the test with a yoke too that runs 4 K below the stator."""
    folder = tmp_path_factory.mktemp("bench")
    channels = pd.DataFrame(record.channels)
    warm = channels.stator_degC - channels.ambient_degC
    channels["yoke_degC"] = channels.ambient_degC + 0.6 * warm
    channels.to_csv(folder / "duty.csv", index=False)
    (folder / "motor.toml").write_text(
        '[motor]\nname = "reference"\nlosses = "balance"\n'
        "[winding]\nphase_resistance_ohm = 0.0062\n"
    )
    return folder


@dataclass(frozen=True)
class Calibrated:
    """The fit and the draws of a run, and where the run is."""

    fit: Fit
    draws: Draws
    path: Path


@pytest.fixture(scope="module")
def calibrated(bench_files):
    """A run of the second order, with draws from around its fit and no look for other effects.

    Nor is a longer test forecast. A slow test below makes the run as the command does.
    """
    motor = load_motor(bench_files / "motor.toml")
    tests = load_tests(motor, [bench_files / "duty.csv"])
    settings = Settings(networks=["second"])
    with pytest.MonkeyPatch.context() as patch:
        for name in ("find", "small_effects"):
            patch.setattr(f"heatrun.calibration.{name}", lambda *_, **__: None)
        patch.setattr("heatrun.runs.result.forecast", lambda _: {})
        patch.setattr(
            "heatrun.calibration.sample", lambda fit, *, seed, **_: normal_draws(fit, seed=seed)
        )
        made = calibrate(motor, tests, settings)
    run = RunFolder.begin(bench_files / "run", {})
    write_run(run, made.motor, made.result, made.posteriors, made.predictions)
    run.finish(manifest(made, settings))
    posterior = made.posteriors["second"]
    return Calibrated(posterior.fit, posterior.draws, bench_files / "run")


@pytest.fixture(scope="module")
def found(calibrated):
    return calibrated.fit


def test_parameters_and_the_sensor_are_found(found, truth):
    holds(found, truth | {"stator_lag": 15.0})
    assert sd(found, "stator_lag") < 0.3  # of the logarithm, prior 1


@pytest.mark.parametrize("warm_K", [0.0, 12.0])
def test_the_first_readings_of_a_body_tell_where_it_starts_in_a_test_that_is_held_out(
    calibrated, record, motor, warm_K
):
    """The sensor's offset is known to some tenths of a kelvin from the test that was fitted."""
    channels = dict(record.channels)
    channels["ambient_degC"] = record["ambient_degC"] - warm_K
    other = reduce(replace(record, name="other", channels=channels), motor)
    drawn = of_test(calibrated.draws, other, fitted_as=None)
    start = drawn.values["Tsr_start"]
    assert start.std() < 0.6
    assert start.mean() == pytest.approx(record["stator_degC"][:20].mean(), abs=3.0 * start.std())


@pytest.mark.slow
def test_in_a_short_test_the_body_tells_what_the_winding_does_not(generator, motor):
    short = reduce(measured_record(generator, generator.constant_load(900.0), 72), motor)
    model = Model.of("second", motor)
    found = [fit(Problem.of(model, motor, [test])) for test in (short, model.with_bodies(short))]
    alone, with_body = (sd(each, "Ceq_sr") for each in found)
    assert with_body < 0.5 * alone


def test_density_of_two_sensors_with_one_heat_is_that_of_the_dense_covariance(test, motor):
    model = Model.of("second", motor)
    both = model.with_bodies(test)
    rng = np.random.default_rng(3)
    heat = 100.0 * rng.standard_normal((both.measured.size, 5))
    observation = both.observation(heat, [1.0, 2.5])
    residual = rng.standard_normal(both.measured.size)
    alone = [
        test.observation(np.zeros((test.measured.size, 0))),
        test.observation(np.zeros((test.measured.size, 0))),
    ]
    size = test.measured.size
    dense = np.zeros((2 * size, 2 * size))
    dense[:size, :size] = covariance(alone[0], NOISE)
    body = test.body("stator_degC")
    of_body = type(alone[1])(**{
        **vars(alone[1]),
        "count": np.asarray(body.count),
        "known_variance": body.rounding_K**2 / 12.0 / body.count,
    })  # fmt: skip
    dense[size:, size:] = covariance(of_body, NOISE.scaled(2.5))
    dense += (float(NOISE.heat) * heat) @ (float(NOISE.heat) * heat).T
    found = float(log_density(residual, NOISE, observation))
    assert found == pytest.approx(log_normal(residual, dense), rel=1e-9)
    rows, half_log_det = whiten(residual, NOISE, observation)
    squares = residual @ np.linalg.solve(dense, residual)
    assert float(np.sum(np.square(rows))) == pytest.approx(squares, rel=1e-9)
    assert float(half_log_det) == pytest.approx(0.5 * np.linalg.slogdet(dense)[1], rel=1e-9)


@pytest.fixture(scope="module")
def run(calibrated):
    return heatrun.open_run(calibrated.path)


def test_a_run_with_a_body_reads_back_and_predicts(run, bench_files):
    entry = run.result.models["second"].nuisances["stator_lag"]
    assert entry.unit == "s"
    assert 8.0 < entry.value < 25.0
    again = run.predict(bench_files / "duty.csv")
    assert again.rmse_K < 0.3
    stator, yoke = again.bodies
    assert stator.is_fitted
    assert float(np.sqrt(np.mean(stator.error**2))) < 0.3
    assert stator.coverage_95() > 0.9
    assert not yoke.is_fitted
    assert run.idata.observed_data["stator_0"].size == run.idata.observed_data["winding_0"].size


def test_a_body_that_is_no_node_is_held_against_the_model(run):
    rows = {row.body: row for row in run.result.models["second"].bodies}
    assert (rows["stator_degC"].node, rows["stator_degC"].fitted) == ("stator", True)
    assert (rows["yoke_degC"].node, rows["yoke_degC"].fitted) == ("stator", False)
    assert rows["yoke_degC"].mean_K < -2.0
    (found,) = [f for f in run.findings if f.id == "body_disagrees"]
    assert "yoke_degC" in found.message
    assert "measured_yoke_degC" in run.courses()[0]


def test_networks_of_other_readings_are_not_compared_by_evidence(run, test, motor):
    first = Model.of("first", motor)
    assert first.with_bodies(test) is test
    course = {"winding": test.measured}
    assert body_courses(first.form, test, {}, course, {"winding": (course, course)}) == ()
    models = from_json(STORED.read_bytes(), FitResult, "fit.json", "run").models
    assert models["first"].bodies is UNSET
    bodies = run.result.models["second"].bodies
    found = verdict(models | {"second": replace(models["second"], bodies=bodies)})
    assert found.log_bayes_factor is None
    assert "stator_degC" in found.sentence


@pytest.mark.slow
def test_a_quick_run_of_both_networks_with_a_body(bench_files, tmp_path):
    """As the command makes it, with the look for other effects and importance sampling."""
    motor, test = bench_files / "motor.toml", bench_files / "duty.csv"
    done = heatrun.calibrate(motor, test, method="quick", out=tmp_path / "run")
    run = heatrun.open_run(done.path)
    assert run.result.models["second"].posterior.method == "importance"
    test_a_run_with_a_body_reads_back_and_predicts(run, bench_files)
    test_a_body_that_is_no_node_is_held_against_the_model(run)
    assert run.result.models["first"].bodies is UNSET
    assert run.result.verdict.log_bayes_factor is None
    assert "stator_degC" in run.result.verdict.sentence


def test_the_motor_file_says_which_node_a_body_is(test, motor):
    held = Model.of("second", replace(motor, sensors={"stator_degC": "none"}))
    assert held.with_bodies(test) is test
    wrong = Model.of("second", replace(motor, sensors={"stator_degC": "winding"}))
    assert wrong.body_sensors(
        {"stator_gain": 0.0, "stator_offset": 0.0, "stator_lag": 1.0}, ["stator_degC"]
    )[0].node == "winding"  # fmt: skip


def test_a_node_that_no_network_has_is_refused(bench_files, tmp_path):
    text = (bench_files / "motor.toml").read_text() + '[sensors]\nstator_degC = "statr"\n'
    (tmp_path / "motor.toml").write_text(text)
    with pytest.raises(InputError, match=r"names no node.*stator"):
        heatrun.calibrate(tmp_path / "motor.toml", bench_files / "duty.csv", out=tmp_path / "run")


def test_a_channel_that_is_no_body_is_refused(tmp_path):
    (tmp_path / "motor.toml").write_text(
        '[motor]\nname = "x"\n[sensors]\nwinding_degC = "stator"\n'
    )
    with pytest.raises(InputError, match="winding_degC"):
        load_motor(tmp_path / "motor.toml")
