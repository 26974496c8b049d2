"""From readings after switch-off to the winding's temperature at the instant of switch-off."""
