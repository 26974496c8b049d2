"""How large a shared effect is, and how far it differs from machine to machine."""

from __future__ import annotations

import numpy as np

from .pooled import CLIP, FREE
from .rounds import Round

SEEN = 2.0
"""Standard deviations beyond what tests leave open, from which on machines differ [1]."""


def amplitude(found: Round, best: int) -> tuple[float, float, float]:
    """Return amplitude, its standard deviation, and the spread over machines, in scores.

    Args:
        found: The tests.
        best: Place of the effect.
    """
    pool = found.pool
    num = pool.num_parameters
    given = [*range(num), *(num + each for each in found.accepted)]
    D = np.array([*found.precision, *([FREE] * len(found.accepted))])
    L_ee = pool.information[:, given][:, :, given]
    L_ea = pool.information[:, given, num + best]
    H = L_ee.sum(axis=0) + np.diag(D)
    shared = np.linalg.solve(H, pool.score[:, given].sum(axis=0))
    A = np.linalg.solve(H, L_ea.sum(axis=0))
    own = pool.information[:, num + best, num + best]
    m = own - 2.0 * L_ea @ A + np.einsum("e,ief,f->i", A, L_ee, A)
    total = float(found.information[best])
    of_prior = float(np.sum(D * A**2))
    shares = pool.score[:, num + best] - L_ea @ shared - (pool.score[:, given] - L_ee @ shared) @ A
    pulled = float(A @ (D * shared))
    score = (float(np.sum(shares)) + pulled) / total
    left = shares
    for _ in range(5):
        # what a machine says of the effect once shared parameters have moved with it
        left = shares - m * score
        limit = CLIP * 1.4826 * np.median(np.abs(left - np.median(left)))
        left = np.clip(left, -limit, limit)
        score += (float(np.sum(left)) + pulled - of_prior * score) / total
    variance = float(np.sum(left**2)) * left.size / (left.size - 1) + of_prior
    beyond = float(np.sum(left**2 - m))
    is_seen = beyond > SEEN * float(np.sqrt(2.0 * np.sum(m**2)))
    answer = own - L_ea @ A  # to an amplitude of its own, shared parameters held
    spread = beyond / float(np.sum(answer**2)) if is_seen else 0.0
    return score, float(np.sqrt(variance)) / total, float(np.sqrt(spread))
