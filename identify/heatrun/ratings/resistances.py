"""Resistances that depend on speed, flow or temperature, at stated conditions."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from lptn import Drive, link_resistances, steady_state

from ..inference.model import Model
from ..inference.posterior import Posterior
from ..results.derived import AT_REST, LOADED, DerivedFigure
from .behind import alone, with_effects
from .figure import figure
from .machine import under_load
from .tested import Tested, tested

SAME = 1e-3
"""Relative difference up to which a resistance at conditions is the parameter itself [1]."""


def at_conditions(posterior: Posterior) -> dict[str, DerivedFigure]:
    """Return the resistances that effects change, at the mean load of the tests and at rest.

    At rest they stand for the same temperatures. What an effect that the network may miss would
    change is in the interval, not in the value.

    Args:
        posterior: Draws, of any network with any effects.
    """
    problem = posterior.fit.problem
    if not problem.model.effects:
        return {}
    seen = tested([test.winding for test in problem.tests])
    base = alone(posterior)
    behind = with_effects(posterior, base)
    winding = jnp.asarray(seen.loaded_winding_degC)
    speed = seen.loaded.speed
    nodes, loaded = _at(behind.model, behind.values, seen.loaded, seen.loaded, winding)
    rest = loaded
    if speed is not None:
        still = replace(seen.loaded, speed=0.0 * speed, speed_rad=0.0 * speed)
        rest = _at(behind.model, behind.values, seen.loaded, still, winding)[1]
    result = {}
    for link, parameter in problem.model.form.resistance:
        name = parameter.name
        draws = np.asarray(behind.values[name])
        if np.allclose(np.asarray(loaded[link]), draws, rtol=SAME, equal_nan=True):
            continue
        for ending, at in ((LOADED, loaded), (AT_REST, rest)):
            if ending == LOADED or not np.allclose(
                at[link], loaded[link], rtol=SAME, equal_nan=True
            ):
                words = _condition(seen, nodes, link, is_at_rest=ending == AT_REST)
                result[f"{name}{ending}"] = figure(
                    np.asarray(at[link]), "K/W", words, posterior.plausible
                )
    return result


@partial(jax.jit, static_argnames="model")
def _at(
    model: Model,
    values: dict[str, Float[Array, " draw"]],
    loaded: Drive,
    drive: Drive,
    winding: Float[Array, ""],
):
    """Return temperatures at the load [degC], and resistances under another drive [K/W]."""

    def one(values: dict[str, Float[Array, ""]]):
        at = under_load(model, values, loaded, winding)
        T = steady_state(at.network, at.losses, at.drive, effects=at.effects)
        own = replace(drive, losses=at.drive.losses)
        return T, link_resistances(at.network, at.losses, own, T, effects=at.effects)

    return jax.vmap(one)(values)


def _condition(
    seen: Tested, nodes: dict[str, Array], link: tuple[str, str], *, is_at_rest: bool
) -> str:
    """Return what a resistance holds under, in words."""
    parts = []
    rpm = seen.loaded.speed_rad
    if rpm is not None:
        parts.append("0 rpm" if is_at_rest else f"{float(rpm) * 30.0 / np.pi:.0f} rpm")
    parts += [f"{end} {float(np.nanmedian(nodes[end])):.0f} °C" for end in link if end in nodes]
    return ", ".join([*parts, f"sink {seen.sink_degC:.0f} °C"])
