"""Electric fields as functions of points, one file per model."""

from .base import ElectricField
from .conductors import Conductors, Cylinder
from .finite_element import FiniteElement
from .grid import Grid
from .two_cylinders import TwoCylinders

__all__ = ["Conductors", "Cylinder", "ElectricField", "FiniteElement", "Grid", "TwoCylinders"]
