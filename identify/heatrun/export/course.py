"""What `lptn` makes of the variables of `prova.mat`: the course that other programs must meet."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np

from lptn import CopperLosses, Inputs, first_order, longest_step, second_order, simulate

from .grid import SHARE_OF_LONGEST, Grid


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
    grid = Grid.of(time, SHARE_OF_LONGEST * float(longest_step(network)))
    inputs = Inputs(
        step=jnp.asarray(grid.step),
        current_squared=grid.mean(variables["Is"] ** 2),
        losses=grid.mean(variables["Pd"]),
        ambient=grid.mean(variables["Te"]),
    )
    trace = simulate(network, losses, inputs, start)
    at_samples = {node: np.asarray(T)[grid.first] for node, T in trace.temperature.items()}
    return Course(time, at_samples["winding"], at_samples.get("stator"))
