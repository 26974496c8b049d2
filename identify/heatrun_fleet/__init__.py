"""Many machines of a type: their calibrations and their population."""

import heatrun as heatrun  # settings of JAX before its first use
