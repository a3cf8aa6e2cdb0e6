"""Grains of several spheres: friction of many contacts, inertia, spin (docs/numerics.md 3, cases 06, 07, 13-15)."""

from __future__ import annotations

import math

import numpy as np

from .. import engine
from .bodies import Body, axes, momentum, put, with_bodies
from .rows import Case, Rows, Size, at_least, at_most, equal, relative
from .scenes import GRAVITY, bare, grain, plane
from .watch import Watch

# ---- friction under a torque (06) ------------------------------------------------------------------------------------


def tripod(size: Size) -> Rows:
    """Three balls on a circle of 1.5 m, 3 kg in all, friction 2/3: a torque of 30 N m turns them."""
    watch = Watch(momentum=False)
    ring, ball, mass, h, gravity = 1.5, 0.2, 3.0, 0.01, 10.0
    angle = 2.0 * math.pi / 3.0 * np.arange(3)
    body = Body.of(ring * np.column_stack([np.cos(angle), np.zeros(3), np.sin(angle)]), ball)
    material = grain(mass / (math.pi / 6.0 * body.diameter**3), friction=2.0 / 3.0)
    inertia = mass * float(body.moments[1])
    for torque in (20.0, 40.0):
        scene = plane(friction=2.0 / 3.0, step=h, materials={"grain": material})
        scene.gravity = (0.0, -gravity, 0.0)
        scene.numerics.tolerance = 1e-10
        sim = with_bodies(scene, body.shape("tripod"))
        put(sim, body, (0.0, ball, 0.0))
        for _ in range(100):
            sim.angular_velocity[0, 1] += torque * h / inertia
            watch.step(sim)
        spin, wanted = float(sim.angular_velocity[0, 1]), max(torque - 30.0, 0.0) / inertia * sim.time
        name = f"torque {torque:.0f} N m for 1 s"
        if wanted == 0.0:
            yield at_most(f"{name}: it turns with", abs(spin), 1e-9, "rad/s", "tolerance 1e-10 m/s")
        else:
            yield at_most(f"{name}: error of its spin (40 − 30)/I t", relative(spin, wanted), 1e-3)
    yield watch.row()


# ---- more contacts than it takes (07) --------------------------------------------------------------------------------


def redundant(size: Size) -> Rows:
    """A raft of eight balls on a plane."""
    watch = Watch()
    r = 1e-3
    x, z = np.meshgrid(2.2 * r * (np.arange(4) - 1.5), 2.2 * r * (np.arange(2) - 0.5))
    body = Body.of(np.column_stack([x.ravel(), np.zeros(8), z.ravel()]), r)
    hashes = []
    for _ in range(2):
        scene = plane(friction=0.5, materials={"grain": grain(friction=0.5)})
        scene.numerics.tolerance = 1e-9
        sim = with_bodies(scene, body.shape("raft"))
        put(sim, body, (0.0, r, 0.0))
        watch.step(sim, 200)
        hashes.append(sim.state_hash())
    contacts = sim.contacts
    weight = float(sim.mass[0]) * GRAVITY * sim.step_size
    net = contacts["impulse"].sum(axis=0) / weight - (0.0, 1.0, 0.0)
    yield equal("contacts with the plane", len(contacts), 8)
    yield at_most("error of the net force", np.abs(net).max(), 1e-6, "m g")
    offset = contacts["point"] - sim.position[0]
    torque = np.cross(offset, contacts["impulse"]).sum(axis=0) / (weight * r)
    yield at_most("net torque", np.abs(torque).max(), 1e-6, "m g r")
    pushes = contacts["impulse"][:, 1] / weight
    yield at_most(
        "greatest share of the weight on one ball",
        pushes.max(),
        0.5,
        "m g",
        f"from {pushes.min():.3f} to {pushes.max():.3f}: not unique, only their sum is",
    )
    yield at_most("speed at rest", np.abs(sim.velocity).max(), 1e-9, "m/s")
    yield equal("the same bits when repeated", float(hashes[0] == hashes[1]), 1.0)
    yield watch.row()


# ---- free rotation (13) ----------------------------------------------------------------------------------------------


def tumbling(size: Size) -> Rows:
    """A body that turns about its middle axis flips for ever."""
    watch = Watch()
    steps = 100_000 if size == "full" else 10_000
    moments = np.array([1.0, 14.0, 14.9]) / 149.0
    single = {
        "name": "tumbler",
        "kind": "cluster",
        "moments": tuple(moments),
        "spheres": np.array([[0.0, 0.0, 0.0, 0.5]]),
    }
    body = Body(np.zeros((1, 3)), 0.5e-3, moments * 1e-6, 1e-3)
    for spin in ((0.05, 5.0, 0.05), (50.0, 300.0, 1.0), (500.0, 30.0, 30.0)):
        sim = with_bodies(bare((0.0, 0.0, 0.0), materials={"grain": grain()}), single)
        put(sim, body, (0.0, 0.0, 0.0), spin=spin)
        start = momentum(sim, body.moments)
        energy = float(start @ sim.angular_velocity[0])
        off, drift, flips, side = 0.0, 0.0, 0, 1.0
        for step in range(steps):
            if step % 1000:
                sim.step()
            else:
                watch.step(sim)
            if step % 20 == 0:
                now = momentum(sim, body.moments)
                off = max(off, float(np.linalg.norm(now - start)))
                drift = max(drift, abs(float(now @ sim.angular_velocity[0]) / energy - 1.0))
                along = float(axes(sim)[1] @ start)
                if along * side < 0.0:
                    flips, side = flips + 1, -side
        name = f"ω = {spin} rad/s, {steps} steps"
        yield at_most(f"{name}: kinetic energy off by", drift, 0.02, "", f"{flips} flips")
        rounding = off / float(np.linalg.norm(start)) / steps
        yield at_most(f"{name}: angular momentum off by", rounding, 1e-15, "a step", "rounding of each step")
    yield watch.row()


# ---- a rod that is spun up (14) --------------------------------------------------------------------------------------


def spun_up(size: Size) -> Rows:
    """Torques in pulses, to ten radians a step."""
    watch = Watch(momentum=False)
    r = 0.1e-3
    body = Body.of(np.column_stack([2.0 * r * (np.arange(10) - 4.5), np.zeros(10), np.zeros(10)]), r)
    sim = with_bodies(bare((0.0, 0.0, 0.0), materials={"grain": grain()}), body.shape("rod"))
    put(sim, body, (0.0, 0.0, 0.0), turn=np.array([1.0, 0.0, 0.01, 0.0]) / math.hypot(1.0, 0.01))
    rng = np.random.default_rng(3)
    work = worst = 0.0
    for step in range(2000):
        if step % 2 == 0:  # a pulse about the z axis of the world, and a small one about any
            frame = axes(sim)
            pulse = float(body.moments[1]) * (np.array([0.0, 0.0, 10.0]) + rng.normal(0.0, 1e-3, 3))
            before = sim.angular_velocity[0].copy()
            sim.angular_velocity[0] += ((frame @ pulse) / body.moments) @ frame
            work += float(pulse @ (before + sim.angular_velocity[0])) / 2.0
        watch.step(sim)
        if step > 20:
            energy = 0.5 * float(momentum(sim, body.moments) @ sim.angular_velocity[0])
            worst = max(worst, abs(energy / work - 1.0))
    turn = float(np.linalg.norm(sim.angular_velocity[0])) * sim.step_size
    yield at_least("turns in a step at the end by", turn, 10.0, "rad")
    told = sim.health.worst_turn
    yield at_least("the health tells of turns by", told, turn, "rad", "a run's table warns beyond 1 rad")
    yield at_most("kinetic energy against the work of the torques, off by", worst, 0.01)
    yield watch.row()


# ---- inertia that is hardly there (15) -------------------------------------------------------------------------------


def degenerate(size: Size) -> Rows:
    """A cluster of one ball, two balls on an axis, two balls in one place, and moments that no body has."""
    watch = Watch()
    r = 1e-3
    falls = []
    one = Body.of(np.zeros((1, 3)), r)
    for index in (0, 1):
        scene = plane(math.radians(20.0), friction=0.5, materials={"grain": grain(friction=0.5)})
        sim = with_bodies(scene, one.shape("one"))
        put(sim, one, (0.0, 1.5 * r, 0.0), shape=index)
        watch.step(sim, 200)
        falls.append(sim.position[0].copy())
    apart = float(np.abs(falls[0] - falls[1]).max()) / r
    yield at_most("a cluster of one ball and a sphere, rolling for 0.2 s: apart by", apart, 1e-9, "r")
    pair = Body.of([(-r, 0.0, 0.0), (r, 0.0, 0.0)], r)
    double = {**one.shape("double"), "spheres": np.repeat(one.shape("")["spheres"], 2, axis=0)}
    for name, body, shape in (
        ("two balls on an axis", pair, pair.shape("pair")),
        ("two balls in one place", one, double),
    ):
        sim = with_bodies(plane(friction=0.5, materials={"grain": grain(friction=0.5)}), shape)
        put(sim, body, (0.0, 1.2 * r, 0.0), spin=(30.0, 0.0, 0.0))
        watch.step(sim, 1000)
        yield at_most(f"{name}: height at rest, off by", abs(float(sim.position[0, 1]) / r - 1.0), 1e-3, "r")
    refused = 0
    wrong = ((0.0, 0.1, 0.1), (0.1, 0.1, 0.3), (math.nan, 0.1, 0.1), (-0.1, 0.1, 0.1))
    for moments in wrong:
        try:
            with_bodies(plane(materials={"grain": grain()}), {**one.shape("wrong"), "moments": moments})
        except engine.InputError:
            refused += 1
    yield equal(
        "moments of zero, below zero, NaN, beyond the triangle: refused", refused, len(wrong), f"of {len(wrong)}"
    )
    yield watch.row()


CASES = (
    Case(
        "06",
        "tripod under torque",
        "three contacts share a torque: sticking is a matter of all of them",
        "µ m g R; (M − µ m g R)/I",
        tripod,
    ),
    Case(
        "07",
        "a raft on eight balls",
        "24 rows of contact for 6 degrees of freedom: a singular matrix",
        "statics",
        redundant,
    ),
    Case(
        "13",
        "tumbling about the middle axis",
        "explicit rotation gains energy until it explodes",
        "Euler: energy and angular momentum",
        tumbling,
    ),
    Case("14", "a rod that is spun up", "more than a turn a step", "energy is work", spun_up),
    Case("15", "inertia that is hardly there", "0/0 in the inverse of the inertia", "a sphere; statics", degenerate),
)
