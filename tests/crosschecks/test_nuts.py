"""The same posterior by the No-U-Turn samplers of numpyro and blackjax."""

import numpy as np
import pytest

from heatrun.posterior.posterior import sample

FAR = 4.5
"""Largest difference in Monte Carlo errors: chance passes it once in 2000 comparisons of 14
parameters by 5 statistics."""


WHITE = -2
"""Place of the white part of the noise; unmodelled heat comes last."""


@pytest.fixture(scope="module")
def ensemble(found):
    return sample(found, seed=1)


def largest(z):
    return max(((abs(v), name, key) for name, row in z.items() for key, v in row.items()))


@pytest.mark.slow
def test_emcee_and_numpyro_draw_from_the_same_posterior(found, ensemble):
    pytest.importorskip("numpyro")
    import chains

    draw = chains.by_numpyro(found, num_warmup=300, num_draws=500, num_chains=2, seed=4)
    draws, diverging = draw()
    assert diverging == 0
    theirs = chains.statistics(found, draws)
    ours = chains.statistics(found, ensemble.vectors)
    assert largest(chains.z_values(ours, theirs))[0] < FAR, largest(chains.z_values(ours, theirs))
    # what is said of the kept draws must hold for them, not only for all that were drawn
    kept = min(row["ess_bulk"][0] for row in ours.values())
    assert kept > 0.3 * ensemble.convergence.effective_size


@pytest.mark.slow
def test_a_posterior_that_is_off_would_be_seen(found, ensemble):
    """A third of a standard deviation, or a spread that is a quarter too wide."""
    import chains

    ours = chains.statistics(found, ensemble.vectors)
    sd = ensemble.flat.std(axis=0)
    shifted = chains.statistics(found, ensemble.vectors + 0.33 * sd)
    centre = ensemble.flat.mean(axis=0)
    wide = chains.statistics(found, centre + 1.25 * (ensemble.vectors - centre))
    assert all(abs(row["mean"]) > FAR for row in chains.z_values(ours, shifted).values())
    assert all(abs(row["sd"]) > FAR for row in chains.z_values(ours, wide).values())


@pytest.mark.slow
def test_quick_draws_find_the_tail_of_a_noise_that_does_not_show():
    """The white part of the noise may be as small as its prior allows: many cheap draws tell."""
    import chains

    from heatrun.posterior.importance import importance_sample, linear_sample

    found = chains.fitted("duty_90min", "second")

    def sd(weighted):
        return np.array(
            [row["sd"][0] for row in chains.weighted_statistics(found, weighted).values()]
        )

    many = sd(linear_sample(found, num_draws=16_384))
    gaps = np.log([sd(importance_sample(found, seed=seed)) / many for seed in (2, 3)])
    assert np.all(gaps[:, WHITE] > np.log(0.7))
    others = np.delete(gaps, len(many) + WHITE, axis=1)
    assert np.all(np.abs(others) < np.log(1.25))


@pytest.mark.parametrize(
    "seed", [0, *(pytest.param(s, marks=pytest.mark.slow) for s in range(1, 6))]
)
def test_weighted_draws_find_a_long_tail_or_say_that_they_did_not(found, seed, monkeypatch):
    """One coordinate falls off four times as slowly to one side, as white noise near zero does."""
    from heatrun.posterior import importance as proposal

    left, right = 2.0, 0.5  # standard deviations of the two halves, in those of the fit

    def evaluate(_, vectors):
        x = (vectors - found.vector) @ np.linalg.inv(np.linalg.cholesky(found.covariance)).T
        skewed = np.where(x[:, WHITE] < 0, x[:, WHITE] / left, x[:, WHITE] / right)
        return -0.5 * np.sum(np.delete(x, WHITE, axis=1) ** 2, axis=1) - 0.5 * skewed**2

    monkeypatch.setattr(proposal, "evaluate", evaluate)
    weighted = proposal.linear_sample(found, seed=seed)
    if not weighted.is_sound:
        return
    x = (weighted.vectors - found.vector) @ np.linalg.inv(np.linalg.cholesky(found.covariance)).T
    mean = weighted.weights @ x[:, WHITE]
    spread = np.sqrt(weighted.weights @ (x[:, WHITE] - mean) ** 2)
    # of a split normal with halves a and b: mean (b - a) sqrt(2/pi), second moment a^2 - ab + b^2
    expected = (right - left) * np.sqrt(2 / np.pi)
    width = np.sqrt(left**2 - left * right + right**2 - expected**2)
    # 16384 draws, of which the tail gets a share that keeps a sd good to a few per cent
    assert abs(mean - expected) < 0.1 * width, (mean, expected)
    assert abs(np.log(spread / width)) < 0.1, (spread, width)
