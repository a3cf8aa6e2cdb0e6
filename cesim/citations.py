"""What to cite for what a run used."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from . import engine

if TYPE_CHECKING:
    from .result import Run

SOFTWARE = "cesim: simulation of corona electrostatic separators, version {version}"
CONTACT = {
    "coulomb": "G. De Saxce, Z.-Q. Feng, The bipotential method: a constructive approach to design the complete "
    "contact law with friction and improved numerical algorithms, "
    "Mathematical and Computer Modelling 28 (1998) 225-245",
    "ccp": "M. Anitescu, A. Tasora, An iterative approach for cone complementarity problems for nonsmooth dynamics, "
    "Computational Optimization and Applications 47 (2010) 207-235",
}
FIELD = {
    "two_cylinders": "J. Li, H. Lu, Z. Xu, Y. Zhou, J. Hazardous Materials 151 (2008) 52 (field of two cylinders)",
    "conductors": "W. R. Smythe, Static and Dynamic Electricity, 3rd ed., McGraw-Hill 1968, ch. IV (plane fields)",
    "finite_element": "T. Gustafsson, G. D. McBain, scikit-fem, J. Open Source Software 5 (2020) 2369; N. Bell, "
    "L. N. Olson, J. Schroder, B. Southworth, PyAMG, J. Open Source Software 8 (2023) 5495 (finite elements)",
    "grid": "C. de Boor, A Practical Guide to Splines, Springer 1978 (interpolation of the potential on a grid)",
}
MODEL = (
    "I. Critelli, A. Tasora, A. Degiorgi, M. Colledani, Particle simulation of granular flows in electrostatic "
    "separation processes, SIMUL 2014"
)


def citations(definition: dict[str, Any], field: str = "") -> list[str]:
    """Citations for what an engine's definition uses: the program, the model, the contact law, field and effects.

    Parameters
    ----------
    definition : what the engine takes
    field : the scene's model of the field, where the engine is given only what came of it
    """
    from . import __version__

    found = [SOFTWARE.format(version=__version__), MODEL, CONTACT["ccp"]]
    found.append(CONTACT[definition["contact_law"]])
    if definition["field"] is not None:
        found += [FIELD[kind] for kind in (field, definition["field"]["kind"]) if kind in FIELD]
    sources = {row["name"]: row["source"] for row in engine.effects()}
    found += [f"{effect['name']}: {sources[effect['name']]}" for effect in definition["effects"]]
    return list(dict.fromkeys(line for line in found if not line.endswith(": ")))


def cite(run: Run) -> list[str]:
    """Citations for what a run used.

    Returns
    -------
    list of str
        The program first, then the model, the methods, and for each effect that was on where its law comes from.
    """
    return list(run.citations)
