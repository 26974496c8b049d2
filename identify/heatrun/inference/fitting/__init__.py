"""The fit, its spread, and what it shows of the model."""
