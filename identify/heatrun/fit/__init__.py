"""Least squares and maximum a posteriori: the most probable parameters of a problem.

Begin with `fit`.
"""
