"""A machine, step by step: the engine's arrays with names, checks at the door, and save and restore."""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Any, SupportsIndex

import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import engine
from .arguments import numbers, quaternions, scalars, seconds, thread_count, vectors, whole
from .errors import InputError, engine_errors, show, unknown
from .health import Balance, Health

if TYPE_CHECKING:
    from .scene import Scene
    from .scene.shapes import Shape
    from .shapes import Template

Array = NDArray[np.float64]
OWN = object()  # the material of a grain of which none is named

LANDED = np.dtype(
    [
        *(("id", "i8"), ("material", "i4"), ("t", "f8"), ("position", "f8", (3,)), ("velocity", "f8", (3,))),
        *(("charge", "f8"), ("mass", "f8"), ("diameter", "f8"), ("birth", "f8")),
        *(("surface", "i4"), ("collisions", "i4")),
    ]
)


def landed(rows: NDArray[np.void], lost: int = 0) -> NDArray[np.void]:
    """The engine's rows that landed (or were lost), with the names users see."""
    kept = rows[rows["lost"] == lost]
    result = np.empty(len(kept), LANDED)
    for name in LANDED.names or ():
        result[name] = kept["time" if name == "t" else name]
    return result


def named(names: tuple[str, ...], rows: NDArray[np.void]) -> NDArray[np.void]:
    """The engine's rows with a column of names in front."""
    kinds = [(name, rows.dtype[name].base, rows.dtype[name].shape) for name in rows.dtype.names or ()]
    result = np.empty(len(rows), [("name", "U48"), *kinds])
    result["name"] = names
    for name in rows.dtype.names or ():
        result[name] = rows[name]
    return result


class Simulation:
    """A scene in motion.

    Parameters
    ----------
    scene : Scene
        Copied: changing it later changes nothing here.
    seed : int
        Of the feed and of everything random; the same seed gives the same stream.
    threads : int, optional
        Default: ``scene.numerics.threads``; else one for a thin feed, which more would not speed up, and the processors
        this process may use for a dense one. The bits do not depend on it.

    Attributes
    ----------
    shapes : tuple of cesim.shapes.Template
        The shapes that grains may have, the sphere first: those of the feed and of ``scene.shapes``.

    Examples
    --------
    >>> sim = cesim.Simulation(cesim.scenes.single_particle())
    >>> sim.add([0, 0.17, 0], material="copper", diameter=0.7e-3)
    array([0])
    >>> sim.step(100)
    """

    def __init__(self, scene: Scene, seed: int = 1, threads: int | None = None) -> None:
        from .scene.composites import composites, grain_materials
        from .scene.definition import grain_shapes

        self.seed = whole("seed", seed, 0, 2**64 - 1)
        scene = scene.validated()
        self.toml = scene.to_toml()
        self.definition = scene.definition()
        self.field_record = scene.field.record(scene)
        self.material_names: tuple[str, ...] = tuple(grain_materials(scene))
        self.shapes: tuple[Template, ...] = tuple(grain_shapes(scene))
        composed = composites(scene)
        self._named_shapes: dict[str, Shape] = {**scene.shapes, **composed}
        self._composites = {shape.model_dump_json(): name for name, shape in composed.items()}
        self.surface_names: tuple[str, ...] = tuple(s["name"] for s in self.definition["surfaces"])
        self.part_names: tuple[str, ...] = tuple(part["name"] for part in self.definition["parts"])
        self.joint_names: tuple[str, ...] = tuple(joint["name"] for joint in self.definition["joints"])
        with engine_errors():
            self.engine = engine.Scene(
                self.definition, seed=self.seed, threads=thread_count(scene, self.definition, threads)
            )

    # ---- in ----------------------------------------------------------------------------------------------------------

    def add(
        self,
        position: ArrayLike,
        velocity: ArrayLike = 0,
        material: Any = OWN,
        diameter: ArrayLike = 1e-3,
        charge: ArrayLike = 0,
        shape: Any = None,
        *,
        angular_velocity: ArrayLike = 0,
        orientation: ArrayLike = (1.0, 0.0, 0.0, 0.0),
    ) -> NDArray[np.int64]:
        """Add grains. All or nothing: after an InputError the state is what it was.

        Parameters
        ----------
        position : (3,) or (n, 3) m
        velocity, angular_velocity : 0, (3,) or (n, 3), in m/s and rad/s
        material : name or index, or n of them; default: copper, of a composite its own
        diameter, charge : number or (n,), in m and C
        shape : None (a sphere), a name in ``scene.shapes``, or a shape that is there or in the feed; or n of them
        orientation : (4,) or (n, 4), quaternions (w, x, y, z), body to world; made unit quaternions

        Returns
        -------
        ids : (n,)
        """
        where = numbers("position", position)
        if where.ndim == 1 and where.shape == (3,):
            where = where[None, :]
        if where.ndim != 2 or where.shape[1] != 3:
            raise InputError(f"has shape {where.shape}, must be (3,) or (n, 3)", path="position")
        n = len(where)
        shapes = self._shapes(shape, n)
        columns = (
            vectors("velocity", velocity, n),
            vectors("angular_velocity", angular_velocity, n),
            self._own_materials(shapes) if material is OWN else self._materials(material, n),
            scalars("diameter", diameter, n),
            scalars("charge", charge, n),
            quaternions("orientation", orientation, n),
            shapes,
        )
        with engine_errors():
            return self.engine.add(where, *columns)

    def _materials(self, material: Any, n: int) -> NDArray[np.int32]:
        given = [material] if isinstance(material, str) or np.ndim(material) == 0 else list(material)
        if len(given) not in (1, n):
            raise InputError(f"has {len(given)} entries, must be one or {n}", path="material")
        indices = np.array([self._material(m) for m in given], np.int32)
        return np.ascontiguousarray(np.broadcast_to(indices, (n,)))

    def _own_materials(self, shapes: NDArray[np.int32]) -> NDArray[np.int32]:
        own = [template.name if template.phases else "copper" for template in self.shapes]
        return np.array([self.material_names.index(name) for name in own], np.int32)[shapes]

    def _material(self, material: Any) -> int:
        names = self.material_names
        if isinstance(material, str):
            if material not in names:
                raise unknown("material", material, names).at("material")
            return names.index(material)
        return whole("material", material, 0, len(names) - 1)

    def _shapes(self, shape: Any, n: int) -> NDArray[np.int32]:
        given = list(shape) if isinstance(shape, list | tuple) else [shape]
        if len(given) not in (1, n):
            raise InputError(f"has {len(given)} entries, must be one or {n}", path="shape")
        indices = np.array([self._shape(one) for one in given], np.int32)
        return np.ascontiguousarray(np.broadcast_to(indices, (n,)))

    def _shape(self, shape: Any) -> int:
        from .scene.definition import shape_index
        from .scene.shapes import Shape

        if shape is None:
            return 0
        if isinstance(shape, str):
            if shape not in self._named_shapes:
                raise unknown("shape", shape, self._named_shapes).at("shape")
            shape = self._named_shapes[shape]
        if not isinstance(shape, Shape):
            raise InputError(f"is {show(shape)}, must be a shape, a name in scene.shapes, or None", path="shape")
        index = shape_index(list(self.shapes), shape, self._composites.get(shape.model_dump_json(), ""))
        if index < 0:
            raise InputError(
                f"is {show(shape)}, not of this scene; put it into scene.shapes before the simulation is made",
                path="shape",
                value=shape,
            )
        return index

    def step(self, n: SupportsIndex = 1) -> None:
        """Take n steps. Ctrl-C stops between two steps; the state is then a state like any other."""
        with engine_errors():
            self.engine.step(whole("n", n, 0, 2**31 - 1))

    def run(self, until: float | str) -> None:
        """Step until the simulated time is at least ``until`` (text with a unit, or seconds)."""
        self.step(self.steps_to(seconds(until)))

    def steps_to(self, time: float) -> int:
        """Number of steps from now to a simulated time in s."""
        # Counted from the start: the clock is step index times step size, so that long runs do not drift.
        return max(0, int(np.ceil(time / self.step_size - 1e-9)) - self.engine.step_index)

    # ---- out ---------------------------------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated time, s."""
        return self.engine.time

    @property
    def step_size(self) -> float:
        """Step, s."""
        return self.engine.step_size

    @property
    def threads(self) -> int:
        """Threads of the engine."""
        return self.engine.threads

    @property
    def count(self) -> int:
        """Grains inside now."""
        return self.engine.count

    @property
    def ids(self) -> NDArray[np.int64]:
        """Identities, (count,), for ever, never reused; all rows are in their order."""
        return self.engine.id

    @property
    def position(self) -> Array:
        """Centres, (count, 3) m. A writable view: it may be stale after a step, it never dangles."""
        return self.engine.position

    @property
    def velocity(self) -> Array:
        """(count, 3) m/s, writable."""
        return self.engine.velocity

    @property
    def angular_velocity(self) -> Array:
        """(count, 3) rad/s, writable."""
        return self.engine.angular_velocity

    @property
    def orientation(self) -> Array:
        """Unit quaternions (w, x, y, z), body to world, (count, 4), writable."""
        return self.engine.orientation

    @property
    def charge(self) -> Array:
        """(count,) C, writable."""
        return self.engine.charge

    @property
    def conducted(self) -> Array:
        """The part of `charge` on what conducts of a mixture or composite, (count,) C, writable; else zeros."""
        return self.engine.conducted

    @property
    def mass(self) -> Array:
        """(count,) kg."""
        return self.engine.mass

    @property
    def diameter(self) -> Array:
        """Of the sphere of equal volume, (count,) m."""
        return self.engine.diameter

    @property
    def material(self) -> NDArray[np.int32]:
        """Index into `material_names`, (count,)."""
        return self.engine.material

    @property
    def shape(self) -> NDArray[np.int32]:
        """Index into `shapes`, (count,)."""
        return self.engine.shape

    @property
    def birth(self) -> Array:
        """Time of birth, (count,) s."""
        return self.engine.birth

    @property
    def landings(self) -> NDArray[np.void]:
        """What landed, in the order of landing: a structured array.

        Fields: id, material (index), t [s], position (3) [m], velocity (3) [m/s], charge [C], mass [kg], diameter [m],
        birth [s], surface (index of the one touched last, -1: none), collisions.
        """
        return landed(self.engine.landings())

    @property
    def lost(self) -> NDArray[np.void]:
        """What left the bounds of the scene without landing; fields as in `landings`."""
        return landed(self.engine.landings(), lost=1)

    @property
    def contacts(self) -> NDArray[np.void]:
        """Contacts of the last step: a structured array.

        Fields: a (id), b (id, or -1 - index into `surface_names`), part_a and part_b (which sphere of a cluster, which
        feature of a convex body; 0 for a sphere), point (3) [m], normal (3) from b to a, gap [m],
        impulse (3) [N s] on a.
        """
        return self.engine.contacts

    @property
    def parts(self) -> NDArray[np.void]:
        """The dynamic parts now: a structured array.

        Fields: name, position (3) of the centre of mass [m], orientation (4), velocity (3) [m/s],
        angular_velocity (3) [rad/s].
        """
        return named(self.part_names, self.engine.parts)

    @property
    def joints(self) -> NDArray[np.void]:
        """The joints at the end of the last step, forces as means over it: a structured array.

        Fields: name; travel [rad or m] and speed of a against b; effort [N m or N] and power [W] of the motor on a,
        energy [J] and impulse (effort times time) that it gave so far; force (3) [N] and moment (3) [N m] of the whole
        joint on a at its anchor; at_limit (1: the motor gives all it may), at_stop (-1, 0, 1).
        """
        return named(self.joint_names, self.engine.joints)

    @property
    def health(self) -> Health:
        """Contacts, iterations, residual, penetration, energy and wall time; print it."""
        return Health.of(self.engine)

    @property
    def balance(self) -> Balance:
        """fed = landed + resident + lost, in grains and kg."""
        return Balance.of(self.engine)

    @property
    def scene(self) -> Scene:
        """A copy of the scene this was made from."""
        from .scene import Scene

        return Scene.from_toml(self.toml)

    def state_hash(self) -> int:
        """A 64-bit hash of the full state: equal for equal definitions, seeds and steps, whatever the threads."""
        return self.engine.state_hash()

    def save(self, path: str | os.PathLike[str]) -> None:
        """Write scene and state to a file; it appears under its name only when it is whole."""
        from .files import write_restart

        write_restart(Path(path), self.toml, self.seed, self.engine.state())

    @classmethod
    def restore(cls, path: str | os.PathLike[str], threads: int | None = None) -> Simulation:
        """Continue from `save` or from a result file, bit for bit, in any process and with any number of threads.

        Parameters
        ----------
        path : path
            What `save` wrote, or a result file, whose newest state counts.
        threads : int, optional
            As for `Simulation`.

        Raises
        ------
        InputError
            Where the file cannot be read, holds no state, or is damaged.
        """
        from .files import read_restart
        from .scene import Scene

        toml, seed, state = read_restart(Path(path))
        sim = cls(Scene.from_toml(toml), seed, threads)
        with engine_errors():
            sim.engine.restore(state)
        return sim

    def __repr__(self) -> str:
        return f"<cesim.Simulation at {self.time:.6g} s: {self.count} grains, {len(self.landings)} landed>"
