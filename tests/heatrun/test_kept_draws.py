from __future__ import annotations

import numpy as np
import pytest

from heatrun.posterior.posterior import NUM_KEPT, keep


@pytest.mark.parametrize("num_steps", [800, 1200, 2000, 4000, 9600])
@pytest.mark.parametrize("num_walkers", [64, 66])
def test_every_walker_is_among_the_kept_draws(num_steps, num_walkers):
    """2000 steps of 64 walkers once left the draws of one walker alone."""
    walker = np.broadcast_to(np.arange(num_walkers), (2, num_steps, num_walkers))
    kept = keep(walker)
    count = np.bincount(kept.ravel(), minlength=num_walkers)
    assert np.all(count == count[0])
    assert NUM_KEPT <= kept.size <= 1.1 * NUM_KEPT


def test_rows_are_walker_by_walker_and_even_in_time():
    step = np.broadcast_to(np.arange(2000)[:, None], (2, 2000, 64))
    track = keep(step)[0, : keep(step).shape[1] // 64]
    assert np.all(np.diff(track) == np.diff(track)[0])
    assert np.diff(track)[0] > 0
