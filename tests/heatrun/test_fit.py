from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from heatrun.errors import InputError
from heatrun.fit import fit as fit_module
from heatrun.fit.fit import fit
from heatrun.fit.fit_result import RESULT
from heatrun.fit.restricted import whiten_fit
from heatrun.io.texts import Texts
from heatrun.model.model import Model
from heatrun.model.model_parameters import parameters
from heatrun.model.problem import Problem, log_posterior, predictions, residuals
from heatrun.record.motor import Motor, ParameterOverride
from heatrun.record.reduction import reduce
from heatrun.reports.printed import told
from lptn.effects import SensorContact


def test_known_parameters_come_back_within_their_uncertainty(fitted, truth):
    assert fitted.result.name == "converged"
    values = fitted.values()
    for name, true in truth.items():
        position = fitted.problem.parameters.index(name)
        sd = np.sqrt(fitted.covariance[position, position]) * fitted.slots[position].parameter.sd
        z = np.log(values[name] / true) / sd
        assert abs(z) < 3.5, (name, values[name], z)
    assert fitted.stats["num_at_best"] >= 12
    assert not fitted.findings


def test_a_fit_that_did_not_converge_says_what_to_do(fitted):
    found = fit_module.not_converged(fitted.problem)
    assert found.remedy == "Give a prior or fix a parameter in the motor file, or add a test."
    assert told(found, Texts("de"))[1]


def test_instruments_enter_as_type_b(fitted):
    """The scale is not visible: C and R carry the 1 % of the power, type A does not."""
    position = fitted.problem.parameters.index("Req_sr")
    both = fitted.covariance[position, position]
    type_a = fitted.covariance_type_a[position, position]
    scale = fitted.slots[position].parameter.sd
    assert np.sqrt(both - type_a) * scale > 0.0095
    assert type_a < 0.5 * both


def test_several_tests_share_the_network_and_not_the_start(bench, generator, motor, fitted):
    second = bench(generator.staircase(2400.0), seed=12, name="stairs")
    problem = Problem.of(
        Model.of("second", motor), motor, [*fitted.problem.tests, reduce(second, motor)]
    )
    joint = fit(problem, num_starts=4)
    names = problem.parameters.names
    assert "Tw_start[duty]" in names
    assert "Tsr_start[stairs]" in names
    assert names.count("Ceq_w") == 1
    position = problem.parameters.index("Ceq_w")
    # type A only: a second test cannot hurt
    assert (
        joint.covariance_type_a[position, position]
        < fitted.covariance_type_a[
            fitted.problem.parameters.index("Ceq_w"), fitted.problem.parameters.index("Ceq_w")
        ]
    )


def test_jacobian_agrees_with_differences(fitted):
    problem = fitted.problem
    _, jacobian = problem.linearised(fitted.z)

    @jax.jit
    @jax.vmap
    def seen(z):
        return residuals(problem.structure, problem.data, z)[0][: jacobian.shape[0]]

    steps = 1e-5 * np.eye(problem.num_parameters)
    ahead, behind = seen(fitted.z + steps), seen(fitted.z - steps)
    slopes = (np.asarray(ahead) - np.asarray(behind)).T / 2e-5
    # truncation and rounding of the differences are both near 1e-7 of 100 K
    np.testing.assert_allclose(jacobian, slopes, atol=1e-4)


def test_the_fit_is_where_the_posterior_is_stationary(fitted):
    problem = fitted.problem
    slope = jax.jit(jax.grad(lambda vector: log_posterior(problem.structure, problem.data, vector)))
    size = problem.num_parameters
    gradient = np.asarray(slope(jnp.asarray(fitted.vector)))[:size]
    # expected gain of a full Newton step in nat: negligible against one
    gain = 0.5 * gradient @ fitted.covariance[:size, :size] @ gradient
    assert gain < 1e-2


def test_fixed_parameters_stay_and_are_gone_from_the_vector(blocks, motor):
    fixed = replace(motor, parameters={"Req_sr": ParameterOverride(fixed=0.11625)})
    problem = Problem.of(Model.of("second", fixed), fixed, [blocks])
    assert "Req_sr" not in problem.parameters.names
    values = problem.data.priors.values(problem.structure.form, jnp.zeros(10), 0)
    assert float(values["Req_sr"]) == 0.11625


def test_a_first_order_fit_says_that_it_misfits(blocks, motor):
    found = fit(Problem.of(Model.of("first", motor), motor, [blocks]))
    (misfit,) = [finding for finding in found.findings if finding.id == "misfit"]
    assert misfit.values["rmse_K"] > 5.0
    assert "RMSE" not in misfit.message  # a user reads one for a test, that of the run's median
    # and stays where plain least squares is: noise and heat have not swallowed the misfit
    assert found.rmse_K() < 1.1 * found.stats["rmse_white_K"]


@pytest.mark.parametrize(
    ("wrong", "match"),
    [
        (Motor("none"), "phase resistance is not given"),
        (
            Motor("typo", phase_resistance_ohm=1e-2,
                  parameters={"Req_st": ParameterOverride(fixed=1.0)}),
            "Did you mean 'Req_sr'",
        ),
        (
            Motor("sign", phase_resistance_ohm=1e-2,
                  parameters={"Req_sr": ParameterOverride(fixed=-1.0)}),
            "positive value",
        ),
        (
            Motor("relative", phase_resistance_ohm=1e-2,
                  parameters={"sensor_offset": ParameterOverride(relative_sd=0.1)}),
            "relative_sd has no meaning",
        ),
    ],
)  # fmt: skip
def test_wrong_motor_files_are_refused(wrong, match, blocks):
    with pytest.raises(InputError, match=match):
        parameters(Model.of("second", wrong), wrong, [blocks])


def test_type_a_is_the_scatter_of_fits_to_drawn_readings(fitted):
    """Against simulated fits of the linear model: readings drawn anew, priors held."""
    rng = np.random.default_rng(5)
    problem, size = fitted.problem, fitted.z.size
    white = whiten_fit(
        problem, fitted.noise_z, np.concatenate(fitted.residual), np.concatenate(fitted.jacobian)
    ).jacobian
    # the estimate from readings alone: minimise |J z - noise|^2 + |z|^2
    noise = rng.standard_normal((white.shape[0], 4000))
    fits = np.linalg.lstsq(
        np.concatenate([white, np.eye(size)]),
        np.concatenate([noise, np.zeros((size, 4000))]), rcond=None,
    )[0]  # fmt: skip
    scatter = np.var(fits, axis=1)
    expected = np.diag(fitted.covariance_type_a)
    assert scatter == pytest.approx(expected, rel=0.12)


def test_an_optimum_counts_where_a_visible_share_of_the_posterior_lies(fitted, monkeypatch):
    masses = iter([0.0, -3.0, -6.0])  # 95 %, 4.7 % and 0.2 % of it
    monkeypatch.setattr(fit_module, "_log_mass", lambda *_: next(masses))
    monkeypatch.setattr(fit_module, "_gain", lambda *_: 0.0)
    optima = [fitted.z, fitted.z + 1.0, fitted.z + 2.0]
    kept = fit_module.sharing(fitted.problem, fitted.noise_z, optima)
    assert np.array_equal(kept, np.stack(optima[:2]))


def test_a_place_where_a_search_ran_out_of_steps_is_no_optimum(fitted, monkeypatch):
    """Three standard deviations off along one direction: 4.5 nat by the linear model."""
    width, ways = np.linalg.eigh(fitted.covariance[: fitted.z.size, : fitted.z.size])
    off = fitted.z + 3.0 * np.sqrt(width[-1]) * ways[:, -1]
    monkeypatch.setattr(fit_module, "_log_mass", lambda *_: 0.0)
    kept = fit_module.sharing(fitted.problem, fitted.noise_z, [fitted.z, off])
    assert np.array_equal(kept, fitted.z[None])


def test_the_mass_around_an_optimum_is_that_of_the_linear_model(fitted):
    """Squares and spread by NumPy from the residuals that the noise has whitened."""
    problem, noise_z = fitted.problem, fitted.noise_z

    def mass(z, by):
        residual, jacobian = problem.linearised(z)
        if by == "heatrun":
            rows = map(problem.lengthened, (residual, jacobian))
            return float(fit_module._log_mass(problem.readings, noise_z, z, *rows))
        white = whiten_fit(problem, noise_z, residual, jacobian)
        value, slope = np.concatenate(white.residuals), white.jacobian
        precision = slope.T @ slope + np.eye(z.size)
        gradient = slope.T @ value + z
        squares = value @ value + z @ z - gradient @ np.linalg.solve(precision, gradient)
        return -0.5 * squares - 0.5 * np.linalg.slogdet(precision)[1]

    aside = fitted.z + 0.2
    expected = mass(aside, "numpy") - mass(fitted.z, "numpy")
    assert mass(aside, "heatrun") - mass(fitted.z, "heatrun") == pytest.approx(expected, abs=1e-6)


def test_a_share_is_held_at_its_limit_and_the_rest_is_fitted_there(blocks, motor):
    """A sensor that follows the stator, and beyond: more than all of a reading there is not."""
    network = {"Ceq_w": 620.0, "Ceq_sr": 11_000.0, "Req_w": 0.0555, "Req_sr": 0.116}
    known = {name: ParameterOverride(fixed=value) for name, value in network.items()}
    motor = replace(motor, parameters=known)
    model = Model.of("second", motor, [SensorContact])
    problem = Problem.of(model, motor, [blocks])
    place = problem.parameters.index("sensor_contact.k")
    largest = problem.data.priors.largest[place]
    beyond = np.zeros(problem.num_parameters)
    beyond[place] = largest + 1.0
    read = problem.own(jnp.concatenate(predictions(problem.structure, problem.data, beyond)))
    noise = 0.05 * np.random.default_rng(5).standard_normal(read.size)
    found = fit(Problem.of(model, motor, [replace(blocks, measured=read + noise)]))
    assert found.z[place] == largest
    assert found.result == RESULT.converged
    problem = found.problem
    slope = jax.grad(lambda vector: log_posterior(problem.structure, problem.data, vector))
    gradient = np.asarray(slope(jnp.asarray(found.vector)))[: problem.num_parameters]
    assert np.isfinite(log_posterior(problem.structure, problem.data, jnp.asarray(found.vector)))
    assert gradient[place] > 1.0  # it would go on
    others = np.delete(np.arange(gradient.size), place)
    gain = gradient[others] @ found.covariance[np.ix_(others, others)] @ gradient[others]
    assert 0.5 * gain < 1e-2
