"""The ions of the corona in a scene: field and current density along the drum, and who shares them."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..constants import VACUUM_PERMITTIVITY
from ..errors import InputError, engine_errors
from .electrics import INSTANT, TURN, USUAL_RESIDENCE, decays, follows_charging
from .field import GridField, all_electrodes, largest_field, most_voltage

if TYPE_CHECKING:
    from ..corona import IonisedField
    from .effects import Decision
    from .scene import Scene

LEAST_CURRENT = 1e-9  # A/m2, that the engine takes


def has_ions(scene: Scene) -> bool:
    """Whether the ion flow is solved for, and not given by an arc."""
    return scene.corona is not None and scene.corona.model != "arc"


def ionised_field(scene: Scene) -> IonisedField:
    """The field and the current of a validated scene's corona wires along its drum."""
    corona = scene.corona
    if corona is None or scene.drum is None:
        raise InputError("is missing: ions need a corona and a drum", path="corona" if corona is None else "drum")
    if not any(electrode.kind == "corona" for electrode in all_electrodes(scene)):
        raise InputError(
            "has no wire to send ions: no electrode is of kind 'corona'",
            path="corona",
            allowed="corona.model = 'arc', or an electrode with kind = 'corona'",
        )
    if isinstance(scene.field, GridField):
        raise InputError(
            "is 'grid', which rounds a wire off: its ions need the field on it",
            path="field.kind",
            value="grid",
            allowed="corona.model = 'arc', or another field",
        )
    if corona.model == "drift":
        _must_be_one_wire(scene)
    wanted = {"drum", "electrode", "electrodes", "field", "corona", "air"}
    return _solved(scene.model_dump_json(include=wanted))


def _must_be_one_wire(scene: Scene) -> None:
    """Ions that drift are solved for one wire and the drum; all else would lie inside their strip."""
    others = len(all_electrodes(scene)) - 1
    beside = [f"{others} more electrode{'s' * (others > 1)}"] if others else []
    beside += ["a box"] if getattr(scene.field, "enclosure", None) is not None else []
    beside += ["a dielectric"] if getattr(scene.field, "dielectrics", []) else []
    if beside:
        raise InputError(
            f"is 'drift', which knows one wire over the drum alone: here is {' and '.join(beside)}",
            path="corona.model",
            value="drift",
            allowed="'deutsch'",
        )


@lru_cache(maxsize=16)
def _solved(text: str) -> IonisedField:
    """Kept, because decisions, checks and definitions ask for it many times."""
    from ..corona import PEEK_DENSITY, IonisedField, Wire
    from .scene import Scene

    scene = Scene.model_validate_json(text)
    corona, drum = scene.corona, scene.drum
    assert corona is not None
    assert drum is not None
    wires = [Wire(e.center(), e.radius, e.voltage) for e in all_electrodes(scene) if e.kind == "corona"]
    density = max(scene.air.density, 1e-3 * PEEK_DENSITY) / PEEK_DENSITY
    with engine_errors():
        if corona.model == "drift":
            from ..ion_drift import DriftingIons

            return DriftingIons(
                drum.radius, wires[0], roughness=corona.roughness, density=density, mobility=corona.mobility
            )
        return IonisedField(
            scene.electric_field(),
            wires,
            drum.radius,
            roughness=corona.roughness,
            density=density,
            mobility=corona.mobility,
        )


def charging_field(scene: Scene) -> float:
    """Largest field in V/m that charges insulators in the corona."""
    if has_ions(scene):
        found = ionised_field(scene)
        return float(np.max(found.field, where=found.current_density > 0.0, initial=0.0))
    given = scene.corona.field if scene.corona is not None else None
    return largest_field(scene) if given is None else given


def captured(scene: Scene) -> float:
    """Share of the ion flow to the drum that grains on it would take if each took as much as one alone.

    A sphere without charge draws the field lines of 3 k pi r^2, k = eps_r/(eps_r + 2), 1 of a conductor: from
    Pauthenier's dQ/dt = Qs/tau = 3 k pi r^2 J. So the share is 3 k times the coverage of the drum.
    """
    from .choices import births, coverage
    from .composites import grain_materials

    fed, covered = births(scene), coverage(scene).get("drum", 0.0)
    if not len(fed) or covered == 0.0:
        return 0.0
    permittivity = np.array([m.permittivity or math.inf for m in grain_materials(scene).values()])[fed["material"]]
    k = np.where(np.isinf(permittivity), 1.0, 1.0 - 2.0 / (permittivity + 2.0))
    area = fed["diameter"] ** 2
    return float(3.0 * covered * np.sum(k * area) / np.sum(area))


def shielding(scene: Scene) -> float:
    """Factor on the ion current to a grain whose neighbours take their share; 1: none do.

    Captured areas that overlap at random leave 1 - exp(-K) of the drum captured, K = `captured` times
    ``corona.shielding``; shared by all alike, each has (1 - exp(-K))/K of what it would have alone.
    """
    if scene.corona is None or scene.corona.shielding == 0.0:
        return 1.0
    K = scene.corona.shielding * captured(scene)
    return -math.expm1(-K) / K if K > 1e-12 else 1.0


def at_once(scene: Scene) -> float:
    """Current density in A/m2 of a corona that charges at once, for what conducts meanwhile: INSTANT of its arc.

    Two infinite rates have no balance. At this one insulators land where those that are charged at once do.
    """
    assert scene.corona is not None
    speed = abs(scene.drum.speed) if scene.drum is not None else 0.0
    way = (scene.corona.arc[1] - scene.corona.arc[0]) / (speed or TURN / USUAL_RESIDENCE)
    return max(4.0 * VACUUM_PERMITTIVITY * charging_field(scene) / (INSTANT * way), LEAST_CURRENT)


def least_ion_time(scene: Scene) -> float | None:
    """Shortest time in s in which ions charge a grain half way, wherever it is; None: there are none.

    Neighbours would only make it longer.
    """
    corona = scene.corona
    if corona is None or scene.drum is None or scene.field.lacks(scene) or most_voltage(scene) == 0.0:
        return None
    if has_ions(scene):
        found = ionised_field(scene)
        rate = float(np.max(found.current_density / np.maximum(found.field, 1e-9)))
        return 4.0 * VACUUM_PERMITTIVITY / rate if rate > 0.0 else None
    given = corona.current_density if corona.kinetics != "off" else None
    field = charging_field(scene)
    return 4.0 * VACUUM_PERMITTIVITY * field / (given or at_once(scene)) if field else None


def corona_parameters(scene: Scene) -> dict[str, float]:
    """Parameters of the effect corona_charging; with a table, field and current are its largest and give the size."""
    corona = scene.corona
    assert corona is not None
    if has_ions(scene):
        most = float(ionised_field(scene).current_density.max()) * shielding(scene)
        field, current = charging_field(scene), max(most, LEAST_CURRENT)
        arc = (math.nan, math.nan)
    else:
        field = math.nan if corona.field is None else corona.field
        if corona.current_density is not None and follows_charging(scene):
            current = corona.current_density * shielding(scene)
        else:
            current = at_once(scene) if decays(scene) else math.nan
        arc = corona.arc
    return {
        "from": arc[0],
        "to": arc[1],
        "height": corona.height,
        "field": field,
        "current_density": current,
        "scatter": corona.scatter,
    }


def effect_definition(scene: Scene, row: Decision) -> dict[str, Any]:
    """An effect that is on, as the engine takes it."""
    definition: dict[str, Any] = {"name": row.name, "parameters": row.parameters}
    if row.name == "corona_charging" and has_ions(scene):
        definition["table"] = ion_table(scene)
    return definition


def ion_table(scene: Scene) -> NDArray[np.float64]:
    """Angle [rad], field [V/m] and current density [A/m2] that a grain sees along the drum, (n, 3)."""
    return ionised_field(scene).table() * (1.0, 1.0, shielding(scene))


def time_to_charge(scene: Scene) -> tuple[float, float] | None:
    """Time constant of charging and time in the ion flow, s; None where grains are charged at once.

    Where both vary along the drum, the constant is the one that gives the same dose: 4 eps0 over the mean of J/E.
    """
    corona, drum = scene.corona, scene.drum
    if corona is None or drum is None:
        return None
    speed = max(abs(drum.speed), 1e-9)
    if not has_ions(scene):
        if corona.current_density is None:
            return None
        density = corona.current_density * shielding(scene)
        return 4.0 * VACUUM_PERMITTIVITY * charging_field(scene) / density, (corona.arc[1] - corona.arc[0]) / speed
    angle, field, current = ion_table(scene).T
    burns = current > 0.01 * current.max()
    if not burns.any() or current.max() == 0.0:
        return None
    rate = current[burns] / (4.0 * VACUUM_PERMITTIVITY * field[burns])
    way = float(np.count_nonzero(burns) * (angle[1] - angle[0])) / speed
    return 1.0 / float(rate.mean()), way
