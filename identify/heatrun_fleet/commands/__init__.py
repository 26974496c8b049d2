"""`heatrun fleet` and `heatrun population`, as the modules of `heatrun.commands`."""
