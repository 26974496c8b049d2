"""R-hat and Pareto k, computed by ArviZ: these are all calls of it that inference makes.

Works on ArviZ 0.23 and 1.x. What ArviZ has no figure for stays where it is needed: the
autocorrelation of an ensemble, whose walkers are no independent chains, is emcee's, and Kish's
effective sample size of importance samples is one line.
"""

from __future__ import annotations

import sys
import threading
import warnings
from importlib import import_module
from typing import Any

import numpy as np
from jaxtyping import Float

_LOADING = threading.Lock()


def split_rhat(
    chains: Float[np.ndarray, "chain draw parameter"],
) -> Float[np.ndarray, " parameter"]:
    r"""Return R-hat of chains and their halves.

    $$ \hat R = \sqrt{\frac{n-1}{n} + \frac{\mathrm{var}(\bar x_i)}{W}} $$

    with the means $\bar x_i$ of the half chains of n draws and the mean W of their variances. Not
    the rank-normalised form (Vehtari et al., 2021): it sorts all draws at every look, which takes
    1.1 s for 256,000 draws of 12 parameters where this takes 0.02 s.

    Args:
        chains: Draws in the order in which they were made.

    Returns:
        R-hat [1] of each parameter.

    Reference: A. Gelman et al., Bayesian Data Analysis, 3rd ed., section 11.4.
    """
    arviz = load_arviz()
    found = arviz.rhat(arviz.convert_to_dataset({"x": chains}), method="split")
    return np.asarray(found["x"])


def pareto_shape(log_weight: Float[np.ndarray, " draw"]) -> float:
    """Return the shape of the generalised Pareto law of the largest weights, the Pareto k [1].

    Args:
        log_weight: Logarithms of importance weights, up to a constant; -inf for a weight of zero.

    Returns:
        Pareto k; infinite where there is no tail to fit, as with equal weights.

    Reference: A. Vehtari, D. Simpson, A. Gelman, Y. Yao, J. Gabry, Pareto Smoothed Importance
        Sampling, Journal of Machine Learning Research 25 (2024) 72.
    """
    if np.unique(log_weight[np.isfinite(log_weight)]).size < 2:
        return float("inf")
    arviz = load_arviz()
    if hasattr(arviz, "psislw"):
        shape = float(arviz.psislw(log_weight)[1])
    else:
        from arviz_stats.base import array_stats  # pyright: ignore[reportMissingImports]

        shape = float(array_stats.psislw(-log_weight)[1])  # 1.x takes log likelihoods: negative
    return float("inf") if np.isnan(shape) else shape


def load_arviz() -> Any:
    """Return the module; it is loaded when it is first needed, for it takes a second."""
    with _LOADING:  # the orders are sampled in threads, and filters of warnings belong to all
        if "arviz" not in sys.modules:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")  # 0.23 announces 1.0 when it is imported
                import_module("arviz")
        return sys.modules["arviz"]
