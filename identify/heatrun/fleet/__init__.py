"""Many machines of a type: their calibrations and their population."""
