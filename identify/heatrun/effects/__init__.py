"""Which effects the tests ask for: one evidence, for calibrations and discoveries."""
