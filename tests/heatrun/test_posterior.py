import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from heatrun.fit.fit import ljung_box
from heatrun.model.catalogue import effects_named
from heatrun.model.model import Model
from heatrun.model.problem import NUM_NOISE, Problem, log_posterior_batch
from heatrun.posterior import ensemble as ensemble_run
from heatrun.posterior import posterior as posterior_module
from heatrun.posterior.convergence import Convergence
from heatrun.posterior.identifiability import forecast
from heatrun.posterior.importance import importance_sample
from heatrun.posterior.posterior import normal_draws, sample
from heatrun.posterior.predict import predict
from heatrun.posterior.proposal import Branches
from heatrun.record.reduction import reduce
from heatrun.runs import netcdf as archive
from heatrun.runs.netcdf import by_name, groups_of

SLOW = pytest.mark.slow


@pytest.fixture(scope="module")
def posterior(fitted):
    """Of 200 steps: for what walkers that start from importance samples show at once."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("heatrun.posterior.posterior.CHUNK", 200)
        return sample(fitted, seed=3, most_steps=400)


@pytest.fixture(scope="module")
def whole_posterior(fitted):
    return sample(fitted, seed=3, most_steps=4000)


@pytest.fixture(scope="module")
def stairs(bench, generator, motor):
    """A test that was not fitted, as long as the one that was: one compilation serves both."""
    return reduce(bench(generator.staircase(3600.0), seed=21, name="stairs"), motor)


@pytest.mark.parametrize("which", ["posterior", pytest.param("whole_posterior", marks=SLOW)])
def test_the_ensemble_agrees_with_the_covariance(request, which, fitted):
    posterior = request.getfixturevalue(which)
    size = fitted.problem.num_parameters
    draws = posterior.flat[:, :size]
    sd = np.sqrt(np.diag(fitted.covariance)[:size])
    error = sd / np.sqrt(posterior.convergence.effective_size)
    # the posterior is close to normal here; 6 Monte Carlo errors plus a tenth of a sd for its skew
    assert np.all(np.abs(draws.mean(axis=0) - fitted.z) < 6 * error + 0.1 * sd + 0.05)
    assert np.all(np.abs(np.log(draws.std(axis=0) / sd)) < 0.25)


@pytest.fixture
def short_chunks(monkeypatch):
    """A checkpoint every 20 steps instead of 250: what follows is the same."""
    monkeypatch.setattr("heatrun.posterior.posterior.CHUNK", 20)


@pytest.fixture
def begun(posterior, monkeypatch):
    """The importance samples that walkers start from, drawn once for several tests."""
    start = posterior.weighted
    monkeypatch.setattr("heatrun.posterior.posterior.starting_sample", lambda *_, **__: start)
    return start


@pytest.fixture
def free_steps(fitted, begun, monkeypatch):
    """Steps through a normal law: for what does not depend on the law that is sampled."""
    start = replace(begun, pareto_k=1.0)  # so that no walker draws from the proposal
    monkeypatch.setattr("heatrun.posterior.posterior.starting_sample", lambda *_, **__: start)
    sd = np.sqrt(np.diag(fitted.covariance))

    def log_density(_, vectors):
        return -0.5 * np.sum(np.square((vectors - fitted.vector) / sd), axis=1)

    monkeypatch.setattr(ensemble_run, "evaluate", log_density)


def test_a_killed_sampling_goes_on_to_the_same_posterior(fitted, tmp_path, begun, short_chunks):
    whole = sample(fitted, seed=7, folder=tmp_path / "whole", most_steps=80)
    shutil.copytree(tmp_path / "whole", tmp_path / "cut")
    killed = sorted((tmp_path / "cut").glob("ensemble_*/chunk_00001.npz"))
    assert killed
    for chunk in killed:
        chunk.unlink()  # as if killed after the first chunk
    again = sample(fitted, seed=7, folder=tmp_path / "cut", most_steps=80)
    np.testing.assert_array_equal(again.vectors, whole.vectors)


def test_a_checkpoint_of_something_else_is_not_taken_up(fitted, tmp_path, free_steps, short_chunks):
    first = sample(fitted, seed=7, folder=tmp_path, most_steps=100)
    other = sample(fitted, seed=8, folder=tmp_path, most_steps=100)
    alone = sample(fitted, seed=8, most_steps=100)
    np.testing.assert_array_equal(other.vectors, alone.vectors)
    assert not np.array_equal(other.vectors, first.vectors)


def test_bands_cover_a_held_out_test(posterior, stairs):
    prediction = predict(posterior, stairs)
    assert prediction.is_held_out
    assert 0.8 <= prediction.coverage_95() <= 1.0  # 180 correlated block means of one test
    low, high = prediction.parameters["95"]
    assert np.all(low <= prediction.median)
    assert np.all(prediction.median <= high)
    wide_low, wide_high = prediction.total["95"]
    assert np.mean(wide_high - wide_low) > np.mean(high - low)
    assert np.all(prediction.nodes["stator"] < np.maximum(prediction.nodes["winding"], 30.0) + 20)


def test_residuals_of_a_right_model_are_white_once_freed_of_their_noise(
    posterior, blocks, stairs, monkeypatch
):
    def gives_up(*_args, **_words):  # as LAPACK does by divide and conquer, on some matrices
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(np.linalg, "svd", gives_up)
    for test in (blocks, stairs):
        found = predict(posterior, test)
        innovations = found.innovations()
        assert innovations.size == int(test.is_observed.sum())
        assert ljung_box(innovations) > 0.001
        assert 0.8 < np.std(innovations) < 1.2
    # of a winding that wanders by 0.4 K in waves of ten minutes they are not
    waves = 0.4 * np.sin(2 * np.pi * stairs.time / 600.0)
    wandering = replace(stairs, measured=stairs.measured + waves)
    assert ljung_box(predict(posterior, wandering).innovations()) < 1e-6


def test_temperatures_and_flows_of_a_row_belong_to_one_mean(posterior, blocks):
    found = predict(posterior, blocks)
    Req_w = np.median(posterior.values()["Req_w"])
    flow = found.flows["winding", "stator"]
    by_nodes = (found.nodes["winding"] - found.nodes["stator"]) / Req_w
    # medians of products are not products of medians: a hundredth of the largest flow
    np.testing.assert_allclose(by_nodes, flow, atol=0.01 * np.max(np.abs(flow)))
    offset = found.nodes["winding"] - found.median  # of the sensor: one number for all rows
    assert np.ptp(offset) < 0.02 * np.ptp(found.median)


def test_a_longer_test_is_forecast_to_say_more(fitted):
    longer = forecast(fitted)
    for name in ("Ceq_sr", "Req_sr"):
        position = fitted.problem.parameters.index(name)
        now = np.sqrt(fitted.covariance[position, position]) * fitted.slots[position].parameter.sd
        assert longer[name] <= now * 1.001


def test_groups_carry_units_and_survive_the_file(posterior, tmp_path):
    path = tmp_path / "posterior.nc"
    archive.write(posterior, path)
    group = archive.from_bytes(path.read_bytes())["posterior"]
    assert group["Ceq_w"].attrs["units"] == "J/K"
    assert group["Tw_start"].dims == ("chain", "draw", "test")
    np.testing.assert_allclose(group["Req_sr"], posterior.values()["Req_sr"])
    stored = by_name(groups_of(path.read_bytes()))
    for slot, draws in posterior.values().items():  # those of one test among them
        np.testing.assert_allclose(stored[slot], draws.ravel())
    assert "Ceq_w" in archive.as_arviz(archive.groups(posterior)).posterior


def test_a_heavy_tail_of_the_weights_leaves_the_proposal_among_the_moves(posterior):
    """Along a thin bent sheet evolution alone takes no step that is accepted (a cool-down whose
    heat is not known: 12,500 steps were forgotten no more than 128 times)."""
    heavy = replace(posterior.weighted, pareto_k=1.3)
    few = np.full(heavy.weights.size, 1e-9)
    few[:100] = 0.01
    moves, without = (ensemble_run._moves(each) for each in (heavy, replace(heavy, weights=few)))
    assert len(moves) == len(without) + 1
    assert sum(share for _, share in moves) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("autocorrelation", "num_steps", "steps", "planned"),
    [(99.0, 1000, 2000, 2000), (790.0, 1000, 9000, 6000), (400.0, 1000, 1250, 3000)],
)
def test_steps_are_told_only_once_walkers_have_forgotten(
    autocorrelation, num_steps, steps, planned
):
    seen = Convergence(800, autocorrelation, 100.0, 100.0, 1.1, 0.0)
    assert posterior_module._planned(seen, num_steps, steps, 12_000) == planned


@pytest.mark.slow
def test_draws_from_a_proposal_that_is_off_are_accepted_as_the_posterior_wants(
    fitted, whole_posterior, monkeypatch
):
    """A third of a standard deviation off and a third wider, and no other move beside it."""
    weighted = whole_posterior.weighted
    branches = weighted.proposal.branches
    branches = Branches.of(
        branches.optimum, branches.share, branches.shift + 0.33, 1.33 * branches.shape
    )
    off = replace(weighted, proposal=replace(weighted.proposal, branches=branches))
    moves = ensemble_run._moves
    monkeypatch.setattr(ensemble_run, "_moves", lambda weighted: moves(weighted)[-1:])
    ensemble = ensemble_run.Ensemble.begin(fitted, off, 64, 0, 11, None)
    ensemble.advance(1500)
    chain = ensemble.chain()[300:].reshape(-1, fitted.vector.size)
    right = whole_posterior.flat
    sd = right.std(axis=0)
    assert np.max(np.abs(chain.mean(axis=0) - right.mean(axis=0)) / sd) < 0.12
    assert np.max(np.abs(chain.std(axis=0) / sd - 1.0)) < 0.1


def test_weighted_draws_that_cannot_be_trusted_give_way_to_the_ensemble_which_says_why(
    fitted, monkeypatch, short_chunks
):
    monkeypatch.setattr("heatrun.posterior.weighted.PARETO_LIMIT", -1.0)
    # few draws, for none of them is good enough
    monkeypatch.setattr("heatrun.posterior.importance.MOST_ROUNDS", 1)
    monkeypatch.setattr("heatrun.posterior.importance.NUM_DRAWS", 256)
    monkeypatch.setattr("heatrun.posterior.importance.NUM_ADAPTATIONS", 0)
    told = []
    asked = sample(
        fitted,
        method="quick",
        seed=1,
        most_steps=200,
        progress=lambda sentence, share: told.append(sentence),
    )
    assert asked.method == "emcee"
    assert asked.convergence is not None
    assert asked.convergence.num_steps == 80  # half of the steps, less the burn-in: too few
    assert 6.0 * asked.convergence.autocorrelation > 160
    assert "With `--quick`, MCMC took the place of importance sampling" in asked.sentence()
    said = f"tail of the weights, Pareto k {asked.weighted.pareto_k:.2f}, limit 0.7;"
    assert said in asked.sentence()
    assert told.pop(0).endswith("MCMC instead: the first steps")  # the plan is made anew
    assert told
    assert all("importance sampling is not reliable here" in sentence for sentence in told)
    counts = [re.search(r"(\d+) of about (\d+) steps", sentence).groups() for sentence in told]
    assert all(int(done) < int(wanted) for done, wanted in counts)


def test_a_share_of_more_than_one_has_no_probability(motor, blocks):
    model = Model.of("second", motor, effects_named(["end_winding_node"], "test"))
    problem = Problem.of(model, motor, [blocks])
    place = problem.parameters.index("end_winding_node.f")
    at = np.zeros((2, problem.num_parameters + NUM_NOISE))
    share = problem.parameters.slots[place].parameter
    at[:, place] = share.score(np.array([0.95, 1.05]))
    density = log_posterior_batch(problem.structure, problem.data, at)
    assert np.isfinite(density[0])
    assert density[1] == -np.inf


def test_of_draws_of_a_normal_law_the_mean_is_stated(fitted):
    posterior = normal_draws(fitted)
    mean = posterior.flat[:, : fitted.z.size].mean(axis=0)
    sd = np.sqrt(np.diag(fitted.covariance))
    for position, slot in enumerate(fitted.slots):
        off = slot.parameter.score(posterior.stated[slot.name]) - mean[position]
        assert abs(off) < 0.25 * sd[position], slot.name  # 64 draws make the course


def test_what_is_stated_has_the_mean_course_where_the_mean_has_not(fitted):
    """Machines of any size have one course where losses and copper go with it."""
    problem, rng = fitted.problem, np.random.default_rng(3)
    larger = 1.0 + 0.2 * rng.standard_normal(400)
    vectors = fitted.vector + 1e-3 * rng.standard_normal((400, fitted.vector.size))
    for position, slot in enumerate(fitted.slots):
        if (name := slot.parameter.name) == "power_gain":
            vectors[:, position] = slot.parameter.score(larger - 1.0)
        elif name[:3] in ("Ceq", "Req", "Rs0"):
            way = -1.0 if name.startswith("Req") else 1.0
            vectors[:, position] += way * np.log(larger) / slot.parameter.sd
    posterior = replace(normal_draws(fitted), vectors=vectors[None])
    z = vectors[:, : fitted.z.size]
    middle = np.mean([problem.linearised(each)[0] for each in z], axis=0)

    def off_K(at):
        return problem.rmse_K(problem.linearised(at)[0] - middle)

    assert np.median([off_K(each) for each in z[::10]]) < 0.2
    assert off_K(z.mean(axis=0)) > 0.5
    stated = np.array([s.parameter.score(posterior.stated[s.name]) for s in fitted.slots])
    assert off_K(stated) < 0.1
    assert np.all(np.abs(stated - z.mean(axis=0)) < z.std(axis=0))


def test_where_no_draw_is_possible_the_optimum_stands_for_them(fitted, monkeypatch):
    """As where all lead to a network too stiff for the steps of the tests."""

    def at_the_optimum_alone(fit, vectors):
        return np.where(np.all(vectors == fit.vector, axis=1), 0.0, -np.inf)

    monkeypatch.setattr("heatrun.posterior.importance.evaluate", at_the_optimum_alone)
    monkeypatch.setattr("heatrun.posterior.importance.NUM_DRAWS", 64)
    monkeypatch.setattr("heatrun.posterior.importance.NUM_ADAPTATIONS", 1)
    found = importance_sample(fitted, seed=2)
    assert not found.is_sound
    np.testing.assert_array_equal(
        found.resample(3, np.random.default_rng(0)), np.tile(fitted.vector, (3, 1))
    )
