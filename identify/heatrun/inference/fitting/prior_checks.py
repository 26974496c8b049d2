"""Estimates that lie where their priors do not expect them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.special import erfc

from ...bench.record import Finding
from ..parameters import Slot
from ..posterior import Posterior

BEYOND = 2.0
"""Standard deviations of its prior that an estimate may be from the centre [1]."""

CHANCE = 0.02
"""Share of calibrations in which instruments as good as declared may raise the finding [1]. All
findings together may do so in 0.05, of which `missing_effect` takes 0.01."""


def prior_findings(posterior: Posterior) -> list[Finding]:
    """Return findings on the network's parameters and the instruments' errors.

    Args:
        posterior: Draws of a calibrated network.
    """
    values = posterior.values()
    scores = [
        (slot, slot.parameter.score(values[slot.name]))
        for slot in posterior.fit.slots
        if slot.parameter.role in ("instrument", "network", "resistance")
    ]
    informed = [
        1.0 - float(np.var(draws)) for slot, draws in scores if slot.parameter.role == "instrument"
    ]
    found = []
    for slot, draws in scores:
        median, score = float(np.median(values[slot.name])), float(np.median(draws))
        if abs(score) <= BEYOND:
            continue
        if slot.parameter.role != "instrument":
            found.append(_conflict(posterior, slot, median, score))
        elif (p := instruments_p(score, informed)) < CHANCE:
            found.append(_beyond(posterior, slot, median, score, p))
    return found


def instruments_p(score: float, informed: Sequence[float]) -> float:
    """Return the chance that any of several errors of instruments lies so far from its centre.

    Where the prior holds, the estimate of an error is spread about the centre by what the tests
    take off the prior's variance: an error that they leave open stays at the centre.

    Args:
        score: Distance from the centre [prior standard deviations].
        informed: Of each error, share of the prior's variance that the tests take off [1].
    """
    spread = np.sqrt(2.0 * np.clip(informed, 1e-6, 1.0))
    return float(min(1.0, np.sum(erfc(abs(score) / spread))))


def _conflict(posterior: Posterior, slot: Slot, median: float, score: float) -> Finding:
    """Return the finding that the tests and a prior of the network contradict each other."""
    parameter = slot.parameter
    low, high = parameter.prior_interval_95()
    unit = parameter.unit
    return Finding(
        id="prior_conflict",
        severity="warning",
        message=f"the tests put {slot.name} ({parameter.meaning}) at {median:.3g} {unit}, its "
        f"prior at {low:.3g} to {high:.3g} {unit} ({parameter.basis}): {abs(score):.1f} standard "
        "deviations apart. The interval is drawn towards the prior.",
        where=posterior.fit.problem.label,
        remedy="Check the units of current, losses and temperatures. If the machine is such, state "
        f"a wider prior with [parameters.{parameter.name}] in the motor file; if it is not, the "
        "network does not suit it.",
        values={slot.name: median, "prior_sd": score},
    )


def _beyond(posterior: Posterior, slot: Slot, median: float, score: float, p: float) -> Finding:
    """Return the finding that an instrument's error is larger than its prior makes likely."""
    parameter = slot.parameter
    low, high = parameter.prior_interval_95()
    return Finding(
        id="instrument_beyond_prior",
        severity="warning",
        message=f"the fit puts {slot.name} ({parameter.meaning}) at {median:.3g} "
        f"{parameter.unit}, {abs(score):.1f} prior standard deviations from what is "
        f"expected ({low:.3g} to {high:.3g} {parameter.unit}): it may stand for an effect "
        "that the network misses, and the other parameters are then off too.",
        where=posterior.fit.problem.label,
        remedy=f"Check the instrument. If such an error is possible, widen its prior with "
        f"[parameters.{parameter.name}] in the motor file; if not, search with `heatrun "
        "discover`.",
        values={slot.name: median, "prior_sd": score, "familywise_p": p},
    )
