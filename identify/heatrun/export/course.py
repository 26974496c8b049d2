"""What `lptn` makes of the variables of `prova.mat`: the course that other programs must meet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from lptn import CopperLosses, Inputs, first_order, longest_step, second_order, simulate

SHARE_OF_LONGEST = 0.02
"""Steps stay below this share of the longest that the method takes, about a hundredth of the
fastest time constant: means over a step then stand for straight lines to 1e-4 of a change."""


@dataclass(frozen=True)
class Course:
    """Temperatures at the samples of a record.

    Attributes:
        time: Time of the samples [s], shape (time,).
        winding: Winding [degC], shape (time,).
        stator: Stator [degC], shape (time,); None in the first order.
    """

    time: np.ndarray
    winding: np.ndarray
    stator: np.ndarray | None

    def rmse(self, measured: np.ndarray) -> float:
        """Return the RMSE of the winding to readings [K]; NaN marks a sample without one.

        Args:
            measured: Readings [degC], shape (time,) or (time, 1).
        """
        error = (self.winding - measured.ravel())[np.isfinite(measured.ravel())]
        return float(np.sqrt(np.mean(error**2)))


def simulate_variables(variables: Mapping[str, np.ndarray]) -> Course:
    """Simulate the variables of `prova.mat` at the samples of the record.

    The squared current, the losses and the sink run straight from sample to sample; an interval
    that is long for the network is split.

    Args:
        variables: As `thesis_variables`; without `Ceqsr` it is the first order.

    Valid for: `Pd` the measured total of the losses.
    """
    p = {name: float(value[0, 0]) for name, value in variables.items() if value.size == 1}
    is_second = "Ceqsr" in p
    if is_second:
        network = second_order(p["Ceqw"], p["Ceqsr"], p["Reqw"], p["Reqsr"])
        start = {"winding": p["Two"], "stator": p["Tso"]}
    else:
        network = first_order(p["Ceqw"], p["Reqw"])
        start = {"winding": p["Two"]}
    losses = CopperLosses(
        # the copper loss only enters the second order; its file always has Rrif
        Rs0=jnp.asarray(p.get("Rrif", 0.0)),
        reference_temperature=p["Trif"],
        coefficient=p["B"],
        phases=1,  # Rrif is the resistance of all phases
    )
    time = variables["t"].ravel()
    interval = np.diff(time)
    parts = np.ceil(interval / (SHARE_OF_LONGEST * float(longest_step(network)))).astype(int)
    step = np.repeat(interval / parts, parts)
    first = np.concatenate([[0], np.cumsum(parts)])  # edge at which each sample lies
    inside = np.arange(step.size) - np.repeat(first[:-1], parts)
    middle = np.repeat(time[:-1], parts) + (inside + 0.5) * step

    def mean(values: np.ndarray) -> jnp.ndarray:
        return jnp.asarray(np.interp(middle, time, values.ravel()))

    inputs = Inputs(
        step=jnp.asarray(step),
        current_squared=mean(variables["Is"] ** 2),
        losses=mean(variables["Pd"]),
        ambient=mean(variables["Te"]),
    )
    trace = simulate(network, losses, inputs, start)
    at_samples = {node: np.asarray(T)[first] for node, T in trace.temperature.items()}
    return Course(time, at_samples["winding"], at_samples.get("stator"))
