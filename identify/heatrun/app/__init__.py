"""The live view: bench tests in the browser, from signals to a calibrated model (extra `app`)."""
