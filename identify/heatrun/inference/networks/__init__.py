"""Networks as data: their form, their text, and the two that are built in."""

from .form import NetworkForm
from .text import BUILT_IN, network_named, networks_of, pair_of

__all__ = ["BUILT_IN", "NetworkForm", "network_named", "networks_of", "pair_of"]
