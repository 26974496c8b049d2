"""Thermal networks of electric machines as pure JAX: networks, losses, effects, simulation.

Knows no file, no data frame and no statistics. SI units inside, temperatures in degC, currents
rms, speed in rad/s. Needs float64: `jax.config.update("jax_enable_x64", True)`.
"""

from .constant_drive import (
    Linearised,
    SteadyCurrent,
    growth_rate,
    heat_input,
    is_stable,
    linearise,
    link_resistances,
    steady_current,
    steady_state,
    time_constants,
)
from .effects import EFFECTS
from .effects.losses import SpeedLoss
from .hold import Held, hold, time_to
from .inputs import SIGNALS, Drive, Inputs
from .march import accumulate
from .network import (
    ALUMINIUM_COEFFICIENT,
    COPPER_COEFFICIENT,
    CopperLosses,
    Network,
    Sensor,
    copper_loss,
    first_order,
    second_order,
)
from .simulate import Trace, block_means, longest_step, reading, reference, simulate

__all__ = [
    "ALUMINIUM_COEFFICIENT",
    "COPPER_COEFFICIENT",
    "EFFECTS",
    "SIGNALS",
    "CopperLosses",
    "Drive",
    "Held",
    "Inputs",
    "Linearised",
    "Network",
    "Sensor",
    "SpeedLoss",
    "SteadyCurrent",
    "Trace",
    "accumulate",
    "block_means",
    "copper_loss",
    "first_order",
    "growth_rate",
    "heat_input",
    "hold",
    "is_stable",
    "link_resistances",
    "linearise",
    "longest_step",
    "reading",
    "reference",
    "second_order",
    "simulate",
    "steady_current",
    "steady_state",
    "time_constants",
    "time_to",
]
