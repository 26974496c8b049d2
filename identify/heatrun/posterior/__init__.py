"""Draws of what a fit leaves open, what they predict, and what they say of the fit.

Begin with `posterior.Posterior`: `ensemble` draws by emcee, `importance` by importance sampling.
`predict` gives the bands of a test, `identifiability` which parameters the tests determine.
"""
