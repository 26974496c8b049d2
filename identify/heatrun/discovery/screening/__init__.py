"""All effects in one compiled model, scored in one pass."""
