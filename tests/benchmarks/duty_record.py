"""The record of the benchmark: a duty of the reference motor at 10 Hz."""

import numpy as np
import ours

import lptn

TRUTH = np.array([666.75, 15060.1, 0.14485, 0.11625, 0.0062, 20.0])
"""Ceq_w, Ceq_sr, Req_w, Req_sr, Rs0, start temperature."""

SEED = 5


def record(num: int, seed: int = SEED) -> dict:
    rng = np.random.default_rng(seed)
    hold = 2400
    level = np.repeat(rng.uniform(40.0, 125.0, num // hold + 1), hold)[:num]
    made = {
        "step": 0.1,
        "current_squared": level**2,
        "losses": 400.0 + 0.02 * level**2,
        "ambient": np.full(num, 20.0),
        "measured": np.zeros(num),
    }
    network, losses, start = ours.build(TRUTH)
    reading = lptn.reading(network, losses, ours.inputs_of(made), start)
    made["measured"] = np.asarray(reading[1:]) + 0.3 * rng.standard_normal(num)
    return made


def around(num: int, seed: int = 1) -> np.ndarray:
    """Return rows of parameters within 0.1 % of the truth, shape (num, 6)."""
    return TRUTH * (1 + 1e-3 * np.random.default_rng(seed).standard_normal((num, 6)))
