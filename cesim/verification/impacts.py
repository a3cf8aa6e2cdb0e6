"""One grain that slides, strikes and bounces (docs/numerics.md 3, cases 10, 11, 25)."""

from __future__ import annotations

import math

import numpy as np

from .bodies import Body, put, with_bodies
from .rows import Case, Rows, Size, at_most, relative, within
from .scenes import BLOCK, GRAVITY, RADIUS, Array, grain, on_plane, plane
from .watch import Watch

# ---- sliding (10) ----------------------------------------------------------------------------------------------------


def sliding(size: Size) -> Rows:
    """A block at 1 m/s on a plane, by both contact laws."""
    watch = Watch()
    steps = (1e-3, 1e-4, 1e-5) if size == "full" else (1e-3, 1e-4)
    for step in steps:
        gap = miss = 0.0
        for friction in (0.3, 1.0):
            sim = on_plane(plane(friction=friction, rolling_friction=BLOCK, step=step), velocity=(1.0, 0.0, 0.0))
            duration = 1.0 / (friction * GRAVITY)
            for _ in range(round(1.2 * duration / step)):
                watch.step(sim)
                gap = max(gap, abs(float(sim.position[0, 1]) - RADIUS) / RADIUS)
            miss = max(miss, relative(float(sim.position[0, 0]), 0.5 * duration) / (step / duration))
        yield at_most(f"coulomb, h = {step:.0e} s: gap", gap, 1e-9, "r")
        yield within(
            f"coulomb, h = {step:.0e} s: stops short of v²/2µg by",
            miss,
            0.99,
            1.01,
            "h µ g/v",
            "the way of the discrete motion, (v²/2µg)(1 − h µ g/v)",
        )
    for step, bound in zip(steps, (0.07, 0.01, 0.001), strict=False):
        yield at_most(
            f"ccp, h = {step:.0e} s: error of the hop (µ v/(1 + µ²))²/2g",
            hop(watch, step),
            bound,
            "",
            "the wish was 5 %: the first step alone lifts it by h µ v/(1 + µ²), 7 % of the hop at µ = 0.3"
            if step == 1e-3
            else "",
        )
    yield at_most("ccp: error of the steady gap µ v h on an incline", steady_gap(watch), 1e-4)
    yield watch.row()


def hop(watch: Watch, step: float) -> float:
    """Error of the height to which a block hops by ccp, of that of its law; the worse of two coefficients."""
    worst = 0.0
    for friction in (0.3, 1.0):
        scene = plane(friction=friction, rolling_friction=BLOCK, step=step, contact_law="ccp")
        sim = on_plane(scene, velocity=(1.0, 0.0, 0.0))
        wanted = (friction / (1.0 + friction**2)) ** 2 / (2.0 * GRAVITY)
        highest = 0.0
        for _ in range(round(3.0 * math.sqrt(2.0 * wanted / GRAVITY) / step)):
            watch.step(sim)
            highest = max(highest, float(sim.position[0, 1]) - RADIUS)
        worst = max(worst, relative(highest, wanted))
    return worst


def steady_gap(watch: Watch) -> float:
    """Error of the gap at which a block of 0.1 m slides by ccp where gravity balances friction."""
    step, speed, radius, worst = 1e-3, 0.5, 0.05, 0.0
    for friction in (0.3, 1.0):
        gap = friction * speed * step
        scene = plane(math.atan(friction), friction=friction, rolling_friction=BLOCK, contact_law="ccp")
        sim = on_plane(scene, gap, radius, velocity=(speed, 0.0, 0.0))
        for _ in range(400):
            watch.step(sim)
            worst = max(worst, relative(float(sim.position[0, 1]) - radius, gap))
    return worst


# ---- oblique impact (11) ---------------------------------------------------------------------------------------------

# radius [m], speed [m/s], friction, restitution: Chung & Ooi, tests 3-8
IMPACTS = ((2.5e-3, 3.9, 0.092, 0.98), (0.1, 0.2, 0.4, 0.5))
ANGLES = (5, 15, 30, 45, 60, 75, 85)  # degrees from the normal


def struck(watch: Watch, law: str, impact: tuple[float, ...], velocity: tuple[float, float], turn: float) -> Array:
    """(v_x, v_y, R w) of a sphere after it hit a plane within a step, without gravity, from a velocity and a spin."""
    radius, _, friction, restitution = impact
    scene = plane(friction=friction, restitution=restitution, contact_law=law)
    scene.gravity = (0.0, 0.0, 0.0)
    height = -0.4 * velocity[1] * scene.numerics.step
    sim = on_plane(scene, height, radius, velocity=(*velocity, 0.0), angular_velocity=(0.0, 0.0, turn))
    watch.step(sim)
    return np.array([*sim.velocity[0, :2], radius * sim.angular_velocity[0, 2]])


def rebound(law: str, impact: tuple[float, ...], velocity: tuple[float, float], turn: float) -> Array:
    """The same in closed form: coulomb slides or rolls; ccp projects what would stick on its cone."""
    radius, _, friction, restitution = impact
    slip = velocity[0] + radius * turn
    push, drag = -(1.0 + restitution) * velocity[1], abs(slip) / 3.5
    if law == "coulomb":
        drag = min(drag, friction * push)
    elif drag > friction * push:
        push = (push + 3.5 * friction * drag) / (1.0 + 3.5 * friction**2)
        drag = friction * push
    drag = math.copysign(drag, slip)
    return np.array([velocity[0] - drag, velocity[1] + push, radius * turn - 2.5 * drag])


def oblique(size: Size) -> Rows:
    """Tests 3 to 8 of Chung & Ooi by both laws."""
    watch = Watch()
    for law in ("coulomb", "ccp"):
        worst = 0.0
        for impact in IMPACTS:
            for degrees in ANGLES:
                way = impact[1] * math.sin(math.radians(degrees)), -impact[1] * math.cos(math.radians(degrees))
                found, wanted = (
                    f(*arguments)
                    for f, arguments in ((struck, (watch, law, impact, way, 0.0)), (rebound, (law, impact, way, 0.0)))
                )
                worst = max(worst, float(np.abs(found - wanted).max()) / impact[1])
        yield at_most(f"{law}: error of the rebound, 5 to 85 degrees", worst, 1e-9, "of the speed")
    worst = 0.0
    for impact in IMPACTS:
        for share in (0.2, 0.9, 1.1, 5.0):  # of the spin at which it begins to slide
            turn = -share * 3.5 * impact[2] * (1.0 + impact[3]) * impact[1] / impact[0]
            found = struck(watch, "coulomb", impact, (0.0, -impact[1]), turn)
            wanted = rebound("coulomb", impact, (0.0, -impact[1]), turn)
            worst = max(worst, float(np.abs(found - wanted).max()) / impact[1])
    yield at_most(
        "coulomb: error of the rebound of a spinning sphere",
        worst,
        1e-9,
        "of the speed",
        "rigid closed forms: measured rebounds of the rolling branch show micro-slip, which rigid spheres lack",
    )
    yield at_most("a slanted rod that lands on its end: error of the rebound", slanted(watch), 1e-9, "of the speed")
    yield watch.row()


def slanted(watch: Watch) -> float:
    """Error of the rebound of a rod at 40 degrees that lands on its end, without friction, over its speed."""
    r, speed, lean, restitution, step = 1e-3, 1.0, math.radians(40.0), 0.6, 1e-4
    rod = Body.of(np.column_stack([2.0 * r * (np.arange(6) - 2.5), np.zeros(6), np.zeros(6)]), r)
    scene = plane(restitution=restitution, step=step, materials={"grain": grain(restitution=restitution)})
    scene.gravity = (0.0, 0.0, 0.0)
    sim = with_bodies(scene, rod.shape("rod"))
    reach, yaw = 5.0 * r, 0.7
    c, s, cy, sy = math.cos(0.5 * lean), math.sin(0.5 * lean), math.cos(0.5 * yaw), math.sin(0.5 * yaw)
    height = reach * math.sin(lean) + r + 0.4 * speed * step
    put(sim, rod, (0.0, height, 0.0), turn=(cy * c, sy * s, sy * c, cy * s))  # leans about z, then turned about y
    sim.velocity[:] = (0.0, -speed, 0.0)
    watch.step(sim)
    # Of the lower end from the centre of mass, across the blow; the blow is an impulse over the mass.
    foot = -reach * math.cos(lean) * np.array([math.cos(yaw), 0.0, -math.sin(yaw)])
    blow = (1.0 + restitution) * speed / (1.0 + float(foot @ foot) / rod.moments[2])
    spin = np.cross(foot, (0.0, blow, 0.0)) / rod.moments[2]
    error = max(
        abs(float(sim.velocity[0, 1]) - blow + speed), reach * float(np.abs(sim.angular_velocity[0] - spin).max())
    )
    return float(error / speed)


# ---- bouncing (25) ---------------------------------------------------------------------------------------------------


def flight_of(watch: Watch, step: float, duration: float, restitution: float, height: float = 0.01) -> Array:
    """Height and velocity (n, 2) of every step of a drop."""
    sim = on_plane(plane(restitution=restitution, step=step), height)
    rows = np.empty((round(duration / step), 2))
    for row in rows:
        watch.step(sim)
        row[:] = sim.position[0, 1] - RADIUS, sim.velocity[0, 1]
    return rows


def zeno(size: Size) -> Rows:
    """A sphere that bounces for ever in finite time."""
    watch = Watch()
    e, height = 0.9, 0.01
    ends = (1.0 + e) / (1.0 - e) * math.sqrt(2.0 * height / GRAVITY)
    for step in (1e-3, 1e-4):
        y, v = flight_of(watch, step, 1.2, e).T
        moving = np.flatnonzero((np.abs(v) > 1e-9) | (np.abs(y) > 1e-12))
        rest = step * (1 + int(moving.max()))
        least = max(0.1 * math.sqrt(GRAVITY * 2.0 * RADIUS), 2.0 * GRAVITY * step)
        bounces = math.log(least / math.sqrt(2.0 * GRAVITY * height)) / math.log(e)
        left_out = 2.0 * least / (GRAVITY * (1.0 - e))
        yield within(
            f"h = {step:.0e} s: at rest after",
            rest,
            ends - left_out - 2.0 * step * bounces,
            ends + 2.0 * step * bounces,
            "s",
            "bounces slower than 0.1 √(g d), or than the fall of two steps, are left out",
        )
        top = y + v**2 / (2.0 * GRAVITY)  # of the flight it is in, from its energy
        apex = [i for i in range(1, len(y) - 1) if y[i] >= y[i - 1] and y[i] > y[i + 1]]
        wanted = height * e ** (2 * np.arange(1, 7))
        allowed = 0.5 * GRAVITY * step / np.sqrt(2.0 * GRAVITY * wanted)  # half the fall of a step, of the speed
        share = max(relative(top[i], h) / error for i, h, error in zip(apex, wanted, allowed, strict=False))
        yield at_most(f"h = {step:.0e} s: error of the first six heights e²ᵏH", share, 1.0, "g h/2v")
        yield at_most(f"h = {step:.0e} s: sinks in", -y.min() / RADIUS, 1e-9, "r")
    yield watch.row()


CASES = (
    Case(
        "10",
        "sliding dilation",
        "the convex relaxation lifts what slides; its size must not depend on the step",
        "v²/2µg; Anitescu & Tasora, Comput. Optim. Appl. 47 (2010) 207",
        sliding,
    ),
    Case(
        "11",
        "oblique impact",
        "sliding and rolling must be told apart within one step",
        "Chung & Ooi, Granular Matter 13 (2011) 643; Foerster et al., Phys. Fluids 6 (1994) 1108",
        oblique,
    ),
    Case(
        "25",
        "infinitely many bounces",
        "an event-driven engine stalls, a stepped one jitters",
        "(1 + e)/(1 − e) √(2H/g)",
        zeno,
    ),
)
