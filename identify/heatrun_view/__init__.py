"""The live view: bench tests in the browser, from signals to a calibrated model (extra `app`)."""

import heatrun as heatrun  # settings of JAX before its first use
