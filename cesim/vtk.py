"""The group /VTKHDF of a result file: /frames as ParaView and VTK read it, without a second copy.

Points and point data are hard links to the columns of /frames. Every grain is one vertex, and vertices are numbered
from the first grain of their frame, so that one ramp 0, 1, 2, ... serves all frames. (A ramp for each frame would be
legal too, but VTK 9.4 to 9.7 reads it wrongly after a frame without grains.) For VTK 9.4 and later.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from .files import FRAME_COLUMNS

if TYPE_CHECKING:
    import h5py

VERSION = (2, 0)
POINT_DATA = {"material": "i4", "diameter": "f4"}  # per grain and frame, besides the columns of /frames
LINKS = {
    "Points": "/frames/position",
    "Steps/Values": "/frames/time",
    "Steps/PointOffsets": "/frames/offset",
    "Steps/ConnectivityIdOffsets": "Steps/CellOffsets",
    "Vertices/NumberOfCells": "NumberOfPoints",
    "Vertices/NumberOfConnectivityIds": "NumberOfPoints",
    "Vertices/Connectivity": "Vertices/Offsets",
}


def steps(offset: NDArray[np.int64]) -> dict[str, NDArray[np.int64]]:
    """The tables that follow from the offsets of the frames, by their path in /VTKHDF."""
    counts = np.diff(offset)
    n = len(counts)
    return {
        "NumberOfPoints": counts,
        "Steps/PartOffsets": np.arange(n, dtype=np.int64),
        "Steps/NumberOfParts": np.ones(n, np.int64),
        "Steps/CellOffsets": np.zeros((n, 4), np.int64),  # of vertices, lines, polygons, strips
        "Vertices/Offsets": np.arange(counts.max(initial=0) + 1, dtype=np.int64),
        "Lines/NumberOfCells": np.zeros(n, np.int64),
    }


def link(group: h5py.Group) -> None:
    """Attributes and hard links of /VTKHDF, next to the tables of `steps` and `POINT_DATA`.

    Parameters
    ----------
    group : /VTKHDF of a file that has /frames; the tables exist, with any number of rows
    """
    group.attrs.update({"Type": np.bytes_(b"PolyData"), "Version": np.array(VERSION, np.int64)})
    group["Steps"].attrs["NSteps"] = np.int64(0)
    for name, target in LINKS.items():
        group[name] = group[target]
    for kind in ("Lines", "Polygons", "Strips"):  # there are none
        for name in ("NumberOfCells", "NumberOfConnectivityIds"):
            if f"{kind}/{name}" not in group:
                group[f"{kind}/{name}"] = group["Lines/NumberOfCells"]
        for name in ("Offsets", "Connectivity"):
            group[f"{kind}/{name}"] = group["Vertices/Offsets"]
    for name in FRAME_COLUMNS:
        if name != "position":
            group[f"PointData/{name}"] = group[f"/frames/{name}"]
    for name in group["PointData"]:
        group[f"Steps/PointDataOffsets/{name}"] = group["/frames/offset"]
