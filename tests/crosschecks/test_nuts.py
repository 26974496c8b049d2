"""The same posterior by the No-U-Turn samplers of numpyro and blackjax."""

from __future__ import annotations

import numpy as np
import pytest

from heatrun.posterior import sample

FAR = 4.5
"""Largest difference in Monte Carlo errors: chance passes it once in 2000 comparisons of 14
parameters by 5 statistics."""


@pytest.fixture(scope="module")
def ensemble(found):
    return sample(found, seed=1)


def largest(z):
    return max(((abs(v), name, key) for name, row in z.items() for key, v in row.items()))


def test_emcee_and_numpyro_draw_from_the_same_posterior(found, ensemble):
    pytest.importorskip("numpyro")
    import chains

    draws, diverging = chains.by_numpyro(found, num_warmup=300, num_draws=500, num_chains=2, seed=4)
    assert diverging == 0
    theirs = chains.statistics(found, draws)
    ours = chains.statistics(found, ensemble.vectors)
    assert largest(chains.z_values(ours, theirs))[0] < FAR, largest(chains.z_values(ours, theirs))
    # what is said of the kept draws must hold for them, not only for all that were drawn
    kept = min(row["ess_bulk"][0] for row in ours.values())
    assert kept > 0.3 * ensemble.convergence.effective_size


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
def test_blackjax_and_long_chains_agree_too(found, ensemble):
    pytest.importorskip("blackjax")
    pytest.importorskip("numpyro")
    import chains

    long = {"num_warmup": 1000, "num_draws": 4000, "num_chains": 4}
    first, none = chains.by_blackjax(found, **long, seed=5)
    second, neither = chains.by_numpyro(found, **long, seed=6)
    assert none == neither == 0
    by_name = [chains.statistics(found, v) for v in (first, second, ensemble.vectors)]
    for one, other in ((0, 1), (0, 2), (1, 2)):
        z = chains.z_values(by_name[one], by_name[other])
        assert largest(z)[0] < FAR, largest(z)
        # the errors are right only if the z values are of size one
        assert 0.6 < np.sqrt(np.mean([v**2 for row in z.values() for v in row.values()])) < 1.5
