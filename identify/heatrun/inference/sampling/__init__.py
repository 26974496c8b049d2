"""Samplers of the posterior: importance sampling around the fit, and emcee."""
