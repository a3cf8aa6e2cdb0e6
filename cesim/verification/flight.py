"""Flight, charge and field (docs/numerics.md 3, cases 16, 28, 29, 30)."""

from __future__ import annotations

import math
from importlib.util import find_spec
from typing import Any

import numpy as np

from ..constants import VACUUM_PERMITTIVITY as EPS0
from ..fields import Grid
from ..fields.base import ElectricField, circle
from ..materials import Material
from ..scene import Air, Collect, Corona, Drum, Electrode, Scene
from ..scene.shapes import Flake
from ..simulation import Simulation
from .rows import Case, Rows, Size, at_most, equal, relative
from .scenes import GRAVITY, OPEN, Array, bare, set_on_drum, sphere_mass
from .watch import Watch

VISCOSITY, AIR = 1.81e-5, 1.204  # Pa s, kg/m3
ABS_DENSITY, ABS_PERMITTIVITY = 1050.0, 2.87
SPEED = 44.8 * math.pi / 30.0  # rad/s, of the reference drum
FLAKE = Flake(width=4.0)
ANGLES = np.linspace(0.0, 2.0 * math.pi, 721)  # rad, of points around a circle
GRIP: dict[str, Any] = {"friction": 1000.0, "rolling_friction": 1000.0}  # a grain is carried like part of the drum


# ---- the field's edges (16) ------------------------------------------------------------------------------------------


def singular(size: Size) -> Rows:
    """The field on, inside and far from the cylinders; grains that touch the drum, its rim, the electrode's place."""
    model = machine(-35e3).electric_field()
    ring = circle(1.0, ANGLES)
    where = math.radians(30.0)
    axis = 0.267 * np.array([math.cos(where), math.sin(where), 0.0])
    points = np.vstack([0.160 * ring, axis + 0.019 * ring, 1e3 * ring, np.zeros((1, 3)), [axis]])
    field = model(points)
    yield equal(
        "points on, inside and 1 km from the cylinders: values that are not finite", int((~np.isfinite(field)).sum()), 0
    )
    on_drum = field[:721]
    across = np.abs(on_drum[:, 0] * ring[:, 1] - on_drum[:, 1] * ring[:, 0]) / np.linalg.norm(on_drum, axis=1)
    yield at_most("on the drum: field along the metal, of the whole", across.max(), 1e-12)
    far = np.linalg.norm(field[2 * 721 : 3 * 721], axis=1).max()
    yield at_most("1 km away: field", float(far), 1.0, "V/m")
    watch = Watch(momentum=False)
    scene = machine(-35e3)
    sim = Simulation(scene, threads=1)
    half = 0.5 * scene.drum.length if scene.drum else 0.0
    corner = 0.160 + 0.3e-3
    x, y, _ = axis.tolist()
    sim.add(
        [(0.0, corner, half), (corner, 0.0, -half - 0.2e-3), (x, y, 0.0), (0.0, 0.1601, 0.0)],
        material=["copper", "ABS", "ABS", "copper"],
        diameter=1e-3,
        charge=[0.0, -1e-12, -1e-12, 0.0],
    )
    watch.step(sim, 50)
    yield at_most(
        "grains at rim, cap, electrode's axis and inside the drum: fastest", np.abs(sim.velocity).max(), 20.0, "m/s"
    )
    yield from singular_models(watch)
    yield watch.row()


def singular_models(watch: Watch) -> Rows:
    """The same places in a machine with a wire in a grounded box: exactly, on a grid that ends within, by elements."""
    wire = Electrode(kind="corona", radius=1e-4, distance=0.21, angle=1.2, voltage=-30e3)
    box = {"lower": (-0.45, -0.4), "upper": (0.5, 0.55)}
    scene = machine(-35e3, electrodes=[wire], field={"kind": "conductors", "enclosure": box})
    boxed = scene.electric_field()
    grid = Grid.sample(boxed, (-0.3, -0.3), (0.4, 0.4), (71, 71))
    on_grid = machine(-35e3, electrodes=[wire], field=grid)
    (x, y), corner = wire.center(), (0.5, 0.55, 0.0)
    places = np.array([(x, y, 0.0), (x + 1e-4, y, 0.0), (0.0, 0.160, 0.0), corner, (2.0, -3.0, 0.0), (0.0, 0.0, 0.0)])
    models: list[tuple[str, ElectricField, Scene]] = [("conductors", boxed, scene)]
    models.append(("grid", on_grid.electric_field(), on_grid))
    if find_spec("skfem") is not None:  # an extra that not everybody installs
        solved = machine(-35e3, electrodes=[wire], field={"kind": "finite_element", "enclosure": box})
        elements = solved.electric_field()
        on_drum = circle(0.160, ANGLES)
        off = np.linalg.norm(elements(on_drum) - boxed(on_drum), axis=1).max() / boxed.largest_on_circle(0.160)[0]
        yield at_most("finite_element: field on the drum, off that of conductors, of its largest", off, 1e-2)
        models.append(("finite_element", elements, solved))
    for name, model, there in models:
        field = np.vstack([model(places), model.potential(places)[:, None].repeat(3, axis=1)])
        yield equal(
            f"{name}: wire's axis and surface, drum, corner, outside: values not finite",
            int((~np.isfinite(field)).sum()),
            0,
        )
        sim = Simulation(there, threads=1)
        sim.add(places, material="ABS", diameter=1e-3, charge=-1e-12)
        watch.step(sim, 50)
        yield at_most(f"{name}: grains put there, the fastest after 50 ms", np.abs(sim.velocity).max(), 20.0, "m/s")
    at_axis, at_surface = np.linalg.norm(boxed(places[:2]), axis=1).tolist()
    yield at_most("conductors: field at the wire's axis, to that of its surface", relative(at_axis, at_surface), 1e-9)
    flags = [
        *(model.inside_conductors(places)[0] for name, model, _ in models if name != "grid"),
        grid.outside(places)[4],
    ]
    yield equal("points inside a conductor and beyond a grid that are not flagged", flags.count(False), 0)


def machine(voltage: float | None, **parts: Any) -> Scene:
    """The reference drum with an electrode, in vacuum unless named."""
    electrode = None if voltage is None else Electrode(voltage=voltage)
    return Scene(**{"drum": Drum(**GRIP), "electrode": electrode, "bounds": OPEN, "effects": {"drag": "off"}, **parts})


# ---- drag (28) -------------------------------------------------------------------------------------------------------


def falling(watch: Watch, law: str, step: float, diameter: float, steps: int, flake: bool = False) -> Array:
    """Downward speeds (steps + 1,) of an ABS sphere (or a flake) from rest, kept in its place."""
    scene = bare(air=Air.model_validate({"law": law}), numerics={"step": step}, effects={"drag": "on"})
    if flake:
        scene.shapes = {"flake": FLAKE}
        scene.effects["shape_drag"] = "on"
    sim = Simulation(scene, threads=1)
    sim.add((0.0, 0.0, 0.0), material="ABS", diameter=diameter, shape="flake" if flake else None)
    speeds = [0.0]
    for _ in range(steps):
        sim.position[:] = 0.0
        watch.step(sim)
        speeds.append(-float(sim.velocity[0, 1]))
    return np.array(speeds)


def drag_of(speed: float, diameter: float) -> float:
    """Schiller & Naumann's drag, N."""
    reynolds = AIR * speed * diameter / VISCOSITY
    multiple = 1.0 + 0.15 * reynolds**0.687 if reynolds < 1000.0 else 0.44 / 24.0 * reynolds
    return 3.0 * math.pi * VISCOSITY * diameter * speed * multiple


def terminal(diameter: float) -> float:
    """Speed at which drag balances weight, m/s."""
    from scipy.optimize import brentq

    weight = sphere_mass(ABS_DENSITY, diameter) * GRAVITY
    return float(brentq(lambda v: drag_of(v, diameter) - weight, 1e-12, 50.0, xtol=1e-16, rtol=1e-14))


def terminal_of_flake(diameter: float) -> float:
    """Speed at which the drag by Haider & Levenspiel balances the weight, m/s."""
    from scipy.optimize import brentq

    from ..shapes import template

    psi = template(FLAKE).sphericity
    weight = sphere_mass(ABS_DENSITY, diameter) * GRAVITY
    a, b = math.exp(2.3288 - 6.4581 * psi + 2.4486 * psi**2), 0.0964 + 0.5565 * psi
    c = math.exp(4.905 - 13.8944 * psi + 18.4222 * psi**2 - 10.2599 * psi**3)
    d = math.exp(1.4681 + 12.2584 * psi - 20.7322 * psi**2 + 15.8855 * psi**3)

    def surplus(speed: float) -> float:
        reynolds = AIR * speed * diameter / VISCOSITY
        coefficient = 24.0 / reynolds * (1.0 + a * reynolds**b) + c / (1.0 + d / reynolds)
        return float(coefficient * math.pi / 8.0 * AIR * speed**2 * diameter**2 - weight)

    return float(brentq(surplus, 1e-12, 50.0, xtol=1e-16, rtol=1e-14))


def stiff_drag(size: Size) -> Rows:
    """Fine grains, whose velocities relax within a thousandth of a step."""
    watch = Watch(momentum=False)
    worst = 0.0
    for diameter in (1e-6, 10e-6, 50e-6):
        tau = ABS_DENSITY * diameter**2 / (18.0 * VISCOSITY)
        for ratio in (0.01, 0.1, 1.0, 10.0, 1e3):
            if ratio * tau > 1.0:  # s, the longest step there is
                continue
            speeds = falling(watch, "stokes", ratio * tau, diameter, 40)
            exact = -GRAVITY * tau * np.expm1(-ratio * np.arange(41))
            worst = max(worst, float(np.abs(speeds - exact).max()) / (GRAVITY * tau))
    yield at_most("Stokes, h/τ from 0.01 to 1000: error of v(t)", worst, 1e-12, "of the terminal speed")
    for law, flake in (("Schiller–Naumann", False), ("Haider–Levenspiel, flake", True)):
        back = over = short = 0.0
        for diameter in (1e-6, 10e-6, 50e-6, 1e-3):
            end = terminal_of_flake(diameter) if flake else terminal(diameter)
            tau = ABS_DENSITY * diameter**2 / (18.0 * VISCOSITY)
            for ratio in (0.01, 0.3, 3.0, 100.0, 1e3):
                speeds = falling(watch, "schiller_naumann", min(ratio * tau, 1.0), diameter, 200, flake)
                back, over = max(back, float(-np.diff(speeds).min()) / end), max(over, float(speeds.max()) / end - 1.0)
                short = max(short, abs(speeds[-1] / end - 1.0) if ratio >= 1.0 else 0.0)
        yield at_most(f"{law}, h/τ from 0.01 to 1000: slows down by", back, 1e-12, "of the terminal speed")
        yield at_most(f"{law}: overshoots by", over, 1e-9, "of the terminal speed")
        yield at_most(f"{law}: ends short of the terminal speed by", short, 1e-9)
    diameter = 0.5e-3
    speeds = falling(watch, "schiller_naumann", 1e-3, diameter, 300)
    error = relative(speeds[-1], by_quadrature(diameter, 0.3))
    yield at_most("Schiller–Naumann, 0.5 mm, h = 1 ms, 0.3 s: error of v", error, 1e-3)
    yield watch.row()


def by_quadrature(diameter: float, time: float) -> float:
    """Speed after a fall from rest, by an integrator of high order."""
    from scipy.integrate import solve_ivp

    mass = sphere_mass(ABS_DENSITY, diameter)

    def slope(_: float, v: Array) -> list[float]:
        return [GRAVITY - drag_of(float(v[0]), diameter) / mass if v[0] > 0.0 else GRAVITY]

    return float(solve_ivp(slope, (0.0, time), [0.0], method="DOP853", rtol=1e-12, atol=1e-14).y[0, -1])


# ---- charge (29) -----------------------------------------------------------------------------------------------------


def saturation(diameter: float, field: float) -> float:
    """Pauthenier's charge of an ABS sphere, C."""
    return 3.0 * math.pi * EPS0 * diameter**2 * field * ABS_PERMITTIVITY / (ABS_PERMITTIVITY + 2.0)


def charging(size: Size) -> Rows:
    """Time constants of charging from nothing to a thousand steps; grazing contacts of metals."""
    watch = Watch(momentum=False)
    field, diameter = 413e3, 0.3e-3
    full = -saturation(diameter, field)
    worst = 0.0
    for tau in (0.0, 2e-5, 1e-3, 0.1, 1.0):
        for step in (1e-3, 2.5e-4):
            current = 4.0 * EPS0 * field / tau if tau else None
            corona = Corona(arc=(-0.5, 0.5), field=field, current_density=current)
            sim = Simulation(
                machine(-35e3, corona=corona, drum=Drum(speed=0.0, **GRIP), numerics={"step": step}), threads=1
            )
            set_on_drum(sim, "ABS", diameter)
            watch.step(sim, round(0.02 / step))
            worst = max(worst, relative(float(sim.charge[0]), full * sim.time / (sim.time + tau)))
    yield at_most(
        "Q(t) = Qs t/(t + τ), τ of 0 and from 2e-5 to 1 s, two steps: error",
        worst,
        1e-12,
        "",
        "Pauthenier's law, which is not an exponential",
    )
    yield at_most("decay on the drum, τ from 1e-9 to 1 s, two steps: error of Q(t)", decay_error(watch), 1e-12)
    edge = max(abs(ride(watch, h) - ride(watch, 0.5 * h)) / h for h in (1e-3, 5e-4))
    yield at_most(
        "ions, then decay (τ = 0.1 s): change of Q by halving h", edge, 15.0, "of Qs a second", "of first order in h"
    )
    sim = Simulation(machine(-35e3, drum=Drum(speed=0.0, **GRIP)), threads=1)
    set_on_drum(sim, "copper", 1e-3, angle=1.0)
    sim.position[:, :2] *= 1.0 + 1e-9
    changes, last = 0, float("nan")
    for _ in range(200):
        watch.step(sim)
        now = float(sim.charge[0])
        changes, last = changes + (math.copysign(1.0, now) != math.copysign(1.0, last) and last == last), now
    yield equal("a metal that grazes the drum: its charge changes sign", changes, 0, "times")
    yield watch.row()


def middling(decay_time: float) -> Material:
    """ABS that conducts a little."""
    return Material(kind="middling", density=ABS_DENSITY, permittivity=ABS_PERMITTIVITY, decay_time=decay_time)


def decay_error(watch: Watch) -> float:
    """Of a charge that decays on a drum at rest, worst over decay times and steps, of the charge of contact."""
    worst = 0.0
    for tau in (1e-9, 1e-6, 1e-4, 1e-2, 1.0):
        for step in (1e-3, 2.5e-4):
            scene = machine(-35e3, drum=Drum(speed=0.0, **GRIP), numerics={"step": step})
            scene.materials["it"] = middling(tau)
            normal = float(scene.electric_field()([[0.0, 0.160, 0.0]])[0, 1])
            rest, start = 2.0 / 3.0 * math.pi**3 * EPS0 * 0.25e-6 * normal, -3e-12
            sim = Simulation(scene, threads=1)
            set_on_drum(sim, "it", 1e-3)
            sim.charge[:] = start
            watch.step(sim)  # in which it comes to touch
            for n in (1, 9):
                watch.step(sim, n)
                exact = rest + (start - rest) * math.exp(-(sim.time - step) / tau)
                worst = max(worst, abs(float(sim.charge[0]) - exact) / rest)
    return worst


def ride(watch: Watch, step: float) -> float:
    """Charge over saturation of a grain that rode through the ion flow and decayed on the way behind it."""
    corona = Corona(arc=(math.radians(10.0), math.radians(40.0)), field=413e3, current_density=2e-3)
    scene = machine(-35e3, corona=corona, numerics={"step": step})
    scene.materials["it"] = middling(0.1)
    sim = Simulation(scene, threads=1)
    set_on_drum(sim, "it", 0.5e-3)
    watch.step(sim, round(math.radians(50.0) / SPEED / step))
    return float(sim.charge[0]) / saturation(0.5e-3, 413e3)


# ---- the corona's edge (30) ------------------------------------------------------------------------------------------


def crossing(size: Size) -> Rows:
    """Grains that are carried through the ion flow, whose edges lie inside a step."""
    watch = Watch(momentum=False)
    arc, field, diameter = (math.radians(10.0), math.radians(50.0)), 413e3, 0.3e-3
    density = 1e-3
    time, tau = (arc[1] - arc[0]) / SPEED, 4.0 * EPS0 * field / density
    exact = -saturation(diameter, field) * time / (time + tau)
    for step in (2e-3, 1e-3, 5e-4):
        worst = 0.0
        corona = Corona(arc=arc, field=field, current_density=density)
        for start in np.radians(np.linspace(-1.0, 0.0, 7)):
            sim = Simulation(machine(-35e3, corona=corona, numerics={"step": step}), threads=1)
            set_on_drum(sim, "ABS", diameter, angle=float(start))
            watch.step(sim, round(math.radians(62.0) / SPEED / step))
            worst = max(worst, relative(float(sim.charge[0]), exact))
        bound = 0.1 * (SPEED * step) ** 2  # a step is a chord of the drum
        yield at_most(f"h = {step:.1e} s: error of the charge collected", worst, bound, "", "(ω h)²/10, O(h²)")
    coarse, fine = (under_a_wire(watch, step) for step in (1e-3, 2.5e-4))
    yield at_most(
        "ions of a wire, E and J along the drum: change of Q by h/4",
        relative(coarse, fine),
        5e-6,
        "",
        f"{1e12 * fine:.4g} pC on 0.3 mm; Deutsch's field in a table",
    )
    means = [float(np.mean(landings(watch, step))) for step in (1e-3, 5e-4)]
    spread = float(np.abs(np.sort(landings(watch, 1e-3)) - np.sort(landings(watch, 5e-4))).mean())
    yield at_most(
        "landing with h and h/2: W1 of 40 grains",
        1e3 * spread,
        1.0,
        "mm",
        f"means {1e3 * means[0]:.2f} and {1e3 * means[1]:.2f} mm",
    )
    yield watch.row()


def under_a_wire(watch: Watch, step: float) -> float:
    """Charge in C of a grain that was carried through the ions of a corona wire, which end nowhere."""
    wire = Electrode(kind="corona", radius=1.5e-4, distance=0.23, angle=math.radians(60.0), voltage=-15e3)
    sim = Simulation(machine(None, electrode=wire, corona=Corona(model="deutsch"), numerics={"step": step}), threads=1)
    set_on_drum(sim, "ABS", 0.3e-3)
    watch.step(sim, round(math.radians(62.0) / SPEED / step))
    return float(sim.charge[0])


def landings(watch: Watch, step: float) -> Array:
    """x in m where grains of 0.4 to 1 mm land that the ion flow has charged on their way."""
    scene = machine(
        -35e3,
        corona=Corona(arc=(math.radians(10.0), math.radians(50.0)), current_density=1e-3),
        numerics={"step": step, "grain_contact": False},
        collect=Collect(y=-0.1),
        drum=Drum(friction=0.5, rolling_friction=0.35),
    )
    sim = Simulation(scene, threads=1)
    for diameter in np.linspace(0.4e-3, 1e-3, 40):
        set_on_drum(sim, "ABS", float(diameter), angle=-0.2)
    while len(sim.landings) < 40 and sim.time < 2.0:
        watch.step(sim)
    rows = sim.landings
    return np.asarray(rows["position"][np.argsort(rows["id"]), 0])


CASES = (
    Case(
        "16", "edges of the field", "1/r at the axes, metal on one side", "the field is normal to a conductor", singular
    ),
    Case(
        "28",
        "stiff drag",
        "explicit steps explode beyond h = 2τ",
        "v_t (1 − e^(−t/τ)); Schiller & Naumann 1933; Haider & Levenspiel 1989",
        stiff_drag,
    ),
    Case(
        "29",
        "charging",
        "time constants from nothing to a thousand steps",
        "Pauthenier & Moreau-Hanot, J. Phys. Radium 3 (1932) 590",
        charging,
    ),
    Case(
        "30",
        "the corona's edge",
        "the ion flow begins and ends inside a step",
        "Q(t) over the time in the arc",
        crossing,
    ),
)
