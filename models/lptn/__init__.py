"""Thermal networks of electric machines as pure JAX: nodes, links, losses, effects, simulation."""
