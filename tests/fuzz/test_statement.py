"""Files that state what their values are: none is read otherwise without a question."""

from __future__ import annotations

import random

import pytest


@pytest.mark.parametrize("seed", range(4))
def test_no_reading_departs_from_what_the_file_states(seed, targets):
    rng = random.Random(seed)
    faults = []
    for _ in range(20):
        try:
            targets["statement"].run(rng.randbytes(rng.choice((3, 8, 20, 40))))
        except AssertionError as fault:
            faults.append(str(fault))
    assert not faults, "\n".join(faults)
