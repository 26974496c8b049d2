"""The plots of the live view: lines of signals over one time axis, and what can be read off."""
