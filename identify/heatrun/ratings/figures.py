"""Figures that follow from the parameters: time constants, rises, continuous current, times.

Each comes with an interval and the condition it holds under, or is refused with a reason.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial

import jax.numpy as jnp
import numpy as np

from lptn import time_constants

from ..inference.posterior import Posterior
from ..io.quantities import rounded
from ..results.derived import DerivedFigure
from .at_limit import LIMIT_DEGC, Limit, at_limit
from .behind import alone, with_effects
from .duty_currents import Rated, duty_current
from .figure import bounded_rise, figure
from .machine import machines
from .rates import Rates, rates
from .resistances import at_conditions
from .tested import tested


def derive(posterior: Posterior, duties: Sequence[str] = ()) -> dict[str, DerivedFigure]:
    """Return the derived figures by name, as they stand in `fit.json`.

    Args:
        posterior: Draws, of any network with any effects.
        duties: Ratings asked for, such as `"S2-30"` and `"S3-40"`.

    Raises:
        UsageError: If a rating is none of these.
    """
    problem = posterior.fit.problem
    seen = tested([test.winding for test in problem.tests])
    insulation = problem.motor.insulation_class
    limit = None if insulation is None else Limit(insulation, LIMIT_DEGC[insulation])
    is_within = limit is not None and seen.beyond_limit(limit.degC) is None
    base = alone(posterior)
    behind = with_effects(posterior, base)
    winding = jnp.asarray(seen.loaded_winding_degC)
    degC = jnp.asarray(limit.degC if limit is not None and is_within else np.nan)
    network = rates(base.model, base.values, seen.loaded, winding)
    rated = problem.motor.rated_current_A if seen.amperes > 0.0 else None
    scale = 1.0 if rated is None else (rated / seen.amperes) ** 2
    drawn = machines(behind.model, behind.values, seen.loaded, winding, degC, jnp.asarray(scale))
    times = time_constants(network.A)
    around = partial(
        seen.surroundings,
        base.model.effects,
        follows_time=bool(np.any(network.follows_time)),
        second_sink=base.model.form.second_sink,
    )
    is_fed = bool(np.any(drawn.copper_slope))
    figures = at_conditions(posterior)
    figures |= _time_constants(network, is_fed, times, seen.amperes, around())
    surroundings = around(likely=behind.likely)
    heated = (
        f"other losses {np.median(drawn.other):.0f} W, sink {seen.sink_degC:.0f} °C{surroundings}"
    )
    at = f"{rounded(seen.amperes)} A rms" if rated is None else f"rated current {rounded(rated)} A"
    figures["steady_rise_K"] = bounded_rise(np.asarray(drawn.rise), f"{at}, {heated}", seen)
    figures |= at_limit(drawn, seen, limit, heated)
    if not duties:
        return figures
    if behind is not base:  # the body of an effect may be faster
        times = time_constants(rates(behind.model, behind.values, seen.loaded, winding).A)
    machine = Rated(behind, drawn, times, seen, limit, surroundings)
    for duty in duties:
        figures[f"{duty}_current_A"] = duty_current(machine, duty)
    return figures


def _time_constants(
    network: Rates, is_fed: bool, times: np.ndarray, amperes: float, surroundings: str
) -> dict[str, DerivedFigure]:
    """Return all time constants, of the nodes and of the network."""
    figures = {
        f"tau_{node}_s": figure(
            np.asarray(draws), "s", f"capacity of the {node} times its resistance towards the sink"
        )
        for node, draws in sorted(network.node_times.items(), reverse=True)
    }
    num = times.shape[-1]
    text = "eigenvalue of the network, constant copper loss"
    for name, draws in zip(_names(num, ""), times.T, strict=True):
        figures[name] = figure(draws, "s", text + surroundings)
    if is_fed:
        fed = time_constants(network.A_fed)
        text = f"eigenvalue with R(T) at {rounded(amperes)} A"
        for name, draws in zip(_names(num, "_feedback"), fed.T, strict=True):
            figures[name] = figure(draws, "s", text + surroundings)
    return figures


def _names(num: int, suffix: str) -> list[str]:
    """Return the names of a network's time constants, shortest first."""
    if num == 1:
        return [f"tau{suffix}_s"]
    middle = [str(number) for number in range(2, num)]
    return [f"tau_{word}{suffix}_s" for word in ("fast", *middle, "slow")]
