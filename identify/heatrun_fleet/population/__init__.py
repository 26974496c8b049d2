"""The population of a type: what its machines share, how they differ, and which do not fit it.

Two stages: each machine is calibrated by itself, and its posterior, with the prior divided out,
is the datum of the second.

Reference: D. Lunn, J. Barrett, M. Sweeting, S. Thompson, Fully Bayesian hierarchical modelling in
    two stages, with application to meta-analysis, Journal of the Royal Statistical Society C 62
    (2013) 551-572.
"""
