"""Pareto-smoothed weights and Pareto k by ArviZ: these are all calls of it that inference makes.

Works on ArviZ 0.23 and 1.x. What ArviZ has no figure for stays where it is needed: the convergence
of ensembles, whose walkers are no chains, and Kish's effective sample size, which is one line.
"""

from __future__ import annotations

import sys
import threading
import warnings
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy.special import logsumexp

_LOADING = threading.Lock()


@dataclass(frozen=True)
class Smoothed:
    """Importance weights whose largest are replaced by the quantiles of a law fitted to them.

    Attributes:
        log_weight: Their logarithms, normalised; -inf for a weight of zero, shape (draw,).
        pareto_k: Shape of the generalised Pareto law of the largest weights [1]; infinite where
            there is no tail to fit, as with equal weights, which stay as they are.
    """

    log_weight: Float[np.ndarray, " draw"]
    pareto_k: float


def pareto_smoothed(log_weight: Float[np.ndarray, " draw"]) -> Smoothed:
    """Return weights with a Pareto-smoothed tail: hardly biased, and of far smaller variance.

    Args:
        log_weight: Logarithms of importance weights, up to a constant; -inf for a weight of zero.
            Where all are zero they come back as they are.

    Reference: A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, Pareto Smoothed Importance
        Sampling, Journal of Machine Learning Research 25 (2024) 72.
    """
    if not np.any(np.isfinite(log_weight)):
        return Smoothed(log_weight, float("inf"))
    raw = log_weight - logsumexp(log_weight)
    if np.unique(log_weight[np.isfinite(log_weight)]).size < 2:
        return Smoothed(raw, float("inf"))
    arviz = load_arviz()
    if hasattr(arviz, "psislw"):
        smoothed, shape = arviz.psislw(log_weight)
    else:
        from arviz_stats.base import array_stats  # pyright: ignore[reportMissingImports]

        smoothed, shape = array_stats.psislw(-log_weight)  # 1.x takes log likelihoods: negative
    if not np.isfinite(shape):
        return Smoothed(raw, float("inf"))
    smoothed = np.asarray(smoothed, dtype=float)
    return Smoothed(smoothed - logsumexp(smoothed), float(shape))


def load_arviz() -> Any:
    """Return the module; it is loaded when it is first needed, for it takes a second."""
    with _LOADING:  # the orders are sampled in threads, and filters of warnings belong to all
        if "arviz" not in sys.modules:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # 0.23 announces 1.0 when it is imported
                import_module("arviz")
        return sys.modules["arviz"]
