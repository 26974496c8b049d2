"""Figures that follow from a calibrated model: time constants, rises, currents at the limit."""
