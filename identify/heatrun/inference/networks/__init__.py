"""Networks as data: their form, their text, and the two that are built in."""

from .built_in import BUILT_IN, network_named, networks_of, pair_of
from .form import NetworkForm

__all__ = ["BUILT_IN", "NetworkForm", "network_named", "networks_of", "pair_of"]
