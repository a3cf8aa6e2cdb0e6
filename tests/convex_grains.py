"""Boxes as convex grains of the engine, for tests."""

from __future__ import annotations

import itertools
import math

import numpy as np
from scipy.spatial.transform import Rotation

import cesim
from cesim import engine

UPRIGHT = (1.0, 0.0, 0.0, 0.0)
CORNERS = np.array(list(itertools.product((-0.5, 0.5), repeat=3)))
SPHERE = {"name": "sphere", "kind": "sphere", "moments": (0.1, 0.1, 0.1)}


class Box:
    """A box of edges in m as a shape of the engine, and the diameter of the sphere of its volume."""

    def __init__(self, *edges):
        self.edges = np.array(edges, dtype=float)
        self.diameter = (6.0 * self.edges.prod() / math.pi) ** (1.0 / 3.0)
        self.corners = CORNERS * self.edges
        squares = self.edges**2
        self.moments = (squares.sum() - squares) / 12.0 / self.diameter**2
        self.shape = {
            "name": "box",
            "kind": "convex",
            "moments": tuple(self.moments),
            "vertices": self.corners / self.diameter,
        }


def engine_of(scene, boxes, threads=1, **coefficients):
    """The engine with boxes as its shapes 1, 2, ..."""
    sim = cesim.Simulation(scene, threads=1)
    definition = sim.definition
    definition["shapes"] = [SPHERE, *(box.shape for box in boxes)]
    for name, value in coefficients.items():
        for where in ("surface", "grain"):
            definition[f"{where}_{name}"] = np.full_like(definition[f"{where}_{name}"], value)
    return engine.Scene(definition, seed=1, threads=threads)


def add(scene, box, index, position, velocity=(0.0, 0.0, 0.0), orientation=UPRIGHT, spin=(0.0, 0.0, 0.0)):
    position = np.atleast_2d(np.asarray(position, dtype=float))
    n = len(position)

    def rows(values):
        return np.ascontiguousarray(np.broadcast_to(np.asarray(values, dtype=float), (n, np.shape(values)[-1])))

    diameter = np.full(n, box.diameter if box is not None else 1e-3)
    zeros, shape = np.zeros(n, np.int32), np.full(n, index, np.int32)
    return scene.add(position, rows(velocity), rows(spin), zeros, diameter, np.zeros(n), rows(orientation), shape)


def quaternion(rotation):
    x, y, z, w = rotation.as_quat()
    return (w, x, y, z)


def rotations(scene):
    w, x, y, z = np.array(scene.orientation).T
    return Rotation.from_quat(np.column_stack([x, y, z, w]))
