"""heatrun identifies the thermal network of an electric motor from bench transients.

Importing this package switches JAX to float64, which the thermal models need (a thousandth of
a kelvin over an hour does not survive float32), and sets the one XLA option that makes small
loops compile whole. Both happen before JAX is first used, in `heatrun.runtime`.
"""

from . import runtime as runtime

__version__ = "0.1.0"
