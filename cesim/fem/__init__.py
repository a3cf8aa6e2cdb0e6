"""Finite elements for the electric field of a machine: geometry, mesh, solution, sampling and cache.

`cesim.fields.FiniteElement` is what a user calls. scikit-fem and pyamg (the extra `fem`) are imported only when a
geometry is solved that the cache does not know.
"""

from .geometry import Box, Conductor, Cylinder, Machine, Slab

__all__ = ["Box", "Conductor", "Cylinder", "Machine", "Slab"]
