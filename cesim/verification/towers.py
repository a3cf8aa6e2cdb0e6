"""What stands and what falls: a groove, a ladder, arches, towers, cards (docs/numerics.md 3, cases 08, 09)."""

from __future__ import annotations

import math
from itertools import pairwise

import numpy as np

from ..simulation import Simulation
from .arches import spheres, wedges
from .bodies import Body, Plate, put, with_bodies
from .rows import Case, Rows, Size, at_least, at_most, relative
from .scenes import GRAVITY, bare, grain, plane, wall
from .watch import Watch

# ---- a ball that turns in a groove (08) ------------------------------------------------------------------------------


def groove(size: Size) -> Rows:
    """A spinning ball in a right-angled groove: with friction above 1 it climbs out along one side."""
    watch = Watch()
    r, spin, h = 1e-3, 500.0, 1e-5
    for friction in (0.5, 1.0, 1.5):
        half = math.sqrt(0.5)
        sides = [wall((0, 0, 0), (x, half, 0.0), friction=friction) for x in (half, -half)]
        sim = Simulation(bare(walls=sides, materials={"grain": grain()}, numerics={"step": h}), threads=1)
        sim.add((0.0, r * math.sqrt(2.0), 0.0), material="grain", diameter=2.0 * r, angular_velocity=(0.0, 0.0, spin))
        steps = 200
        watch.step(sim, steps)
        if friction <= 1.0:  # both sides rub
            brake = 2.5 * math.sqrt(2.0) * friction / (1.0 + friction**2) * GRAVITY / r
            climb = 0.0
        else:  # one side alone bears it, and drives it up
            brake = 2.5 * friction * GRAVITY * half / r
            climb = (friction - 1.0) * GRAVITY * half * sim.time
        lost = spin - float(sim.angular_velocity[0, 2])
        yield at_most(f"friction {friction}: error of the spin it loses", relative(lost, brake * sim.time), 1e-3)
        error = abs(float(np.linalg.norm(sim.velocity[0])) - climb) / (GRAVITY * sim.time)
        yield at_most(f"friction {friction}: error of how fast it climbs", error, 1e-3, "g t")
    yield from ladder(watch)
    yield from spheres(watch)
    yield from wedges(size, watch)
    yield watch.row()


def ladder(watch: Watch) -> Rows:
    """A plate that leans against a smooth wall stands if the floor's friction is above its analytic value."""
    plate, lean = Plate(np.array([1e-3, 12e-3, 6e-3])), math.radians(30.0)
    thick, long, _ = plate.edges
    # Moments about the foot: the push of the wall against the weight, whose centre is half a thickness behind.
    least = 0.5 * (math.tan(lean) - thick / long)
    x = 0.5 * (thick * math.cos(lean) + long * math.sin(lean))
    y = 0.5 * (thick * math.sin(lean) + long * math.cos(lean))
    for share in (0.99, 1.01):
        walls = [wall((0, 0, 0), (0, 1, 0), friction=share * least), wall((0, 0, 0), (-1, 0, 0), friction=0.0)]
        sim = with_bodies(bare(walls=walls, materials={"grain": grain()}), plate.shape("ladder"))
        put(sim, plate, (-x, y, 0.0), turn=(math.cos(0.5 * lean), 0.0, 0.0, -math.sin(0.5 * lean)))
        start = sim.position.copy()
        watch.step(sim, 1000)
        moved = float(np.abs(sim.position - start).max()) / long
        name = f"plate against a wall, friction {share} of the least: moves in 1 s by"
        yield at_least(name, moved, 0.1, "lengths") if share < 1.0 else at_most(name, moved, 1e-3, "lengths")


# ---- towers (09) -----------------------------------------------------------------------------------------------------


def towers(size: Size) -> Rows:
    """Bars of balls, and plates with sharp edges, laid crosswise, two a storey."""
    watch = Watch()
    x, z = np.meshgrid(2e-3 * (np.arange(6) - 2.5), 2e-3 * (np.arange(2) - 0.5))
    bar = Body.of(np.column_stack([x.ravel(), np.zeros(12), z.ravel()]), 1e-3)
    plate = Plate(np.array([12e-3, 1e-3, 3e-3]))
    seconds = 5.0 if size == "full" else 0.5
    kinds: tuple[tuple[str, Body | Plate, float], ...] = (("bars", bar, 2e-3), ("plates", plate, 1e-3))
    for name, body, high in kinds:
        for storeys in (2, 5):
            sim = with_bodies(plane(friction=0.5, materials={"grain": grain(friction=0.5)}), body.shape(name))
            for storey in range(storeys):
                for side in (-4e-3, 4e-3):
                    y = high * (storey + 0.5)
                    if storey % 2 == 0:
                        put(sim, body, (0.0, y, side))
                    else:
                        put(sim, body, (side, y, 0.0), turn=(math.sqrt(0.5), 0.0, math.sqrt(0.5), 0.0))
            start = sim.position.copy()
            watch.step(sim, round(seconds / sim.step_size))
            moved = float(np.abs(sim.position - start).max()) / high
            told = f"{sim.health.unconverged} of {sim.health.steps} steps say not solved"
            yield at_most(
                f"{name}, {storeys} storeys for {seconds} s: one moves by", moved, 1e-2, "of its height", told
            )
    yield from cards(watch, seconds)
    yield from sharp_cards(size, watch)
    yield watch.row()


def cards(watch: Watch, seconds: float) -> Rows:
    """Cards of balls that lean on each other stand if the floor's friction is above its analytic value."""
    r, lean, count = 1e-3, math.radians(20.0), 6
    long = 2.0 * r * (count - 1)  # between the balls at its ends
    x, z = np.meshgrid(2.0 * r * (np.arange(count) - 0.5 * (count - 1)), 2.0 * r * (np.arange(2) - 0.5))
    card = Body.of(np.column_stack([x.ravel(), np.zeros(2 * count), z.ravel()]), r)
    high, wide = r + long * math.cos(lean), r + long * math.sin(lean)  # of the balls at the top; of those at the foot
    # Moments about a foot: the push of the other card against the weight.
    least = 0.5 * long * math.sin(lean) / high

    def moved(friction: float, storeys: int, settle: float = 0.0) -> float:
        scene = plane(friction=friction, materials={"grain": grain(friction=friction)})
        sim = with_bodies(scene, card.shape("card"))
        for storey in range(storeys):
            floor, pairs = storey * (high + 3.0 * r), storeys - storey
            middles = 2.0 * (wide + r) * (np.arange(pairs) - 0.5 * (pairs - 1))
            for middle in middles:
                for side in (-1.0, 1.0):
                    place = (middle + 0.5 * side * (r + wide), floor + 0.5 * (r + high), 0.0)
                    turn = 0.5 * (0.5 * math.pi + side * lean)
                    put(sim, card, place, turn=(math.cos(turn), 0.0, 0.0, math.sin(turn)))
            for left, right in pairwise(middles):
                put(sim, card, (0.5 * (left + right), floor + high + 2.0 * r, 0.0))
        watch.step(sim, round(settle / sim.step_size))
        start = sim.position.copy()
        watch.step(sim, round(seconds / sim.step_size))
        return float(np.abs(sim.position - start).max()) / r

    for share in (0.95, 1.05):
        name = f"two cards that lean on each other, friction {share} of the least: one moves by"
        kind, bound = (at_least, 1.0) if share < 1.0 else (at_most, 1e-2)
        yield kind(name, moved(share * least, 1), bound, "radii")
    yield at_most(f"house of two storeys, after 1 s, for {seconds} s: one moves by", moved(0.6, 2, 1.0), 0.05, "radii")


def sharp_cards(size: Size, watch: Watch) -> Rows:
    """Cards whose sharp edges meet, two by the friction that statics asks for, and houses of them."""
    thick, long = 1e-3, 12e-3
    lean, seconds = math.radians(20.0), 0.5 if size == "quick" else 1.0
    least = 0.5 * (math.tan(lean) - thick / long)  # moments about a foot, as of the ladder
    for share in (0.95, 1.05):
        name = f"two plates that lean on each other, friction {share} of the least: one moves by"
        kind, bound = (at_least, 1.0) if share < 1.0 else (at_most, 1e-2)
        sim = house(1, share * least, thick, long, lean)
        yield kind(name, moved_by(sim, watch, seconds) / thick, bound, "thicknesses")
    for storeys in (2,) if size == "quick" else (2, 5):
        sim = house(storeys, 0.6, thick, long, lean)
        moved = moved_by(sim, watch, seconds) / thick
        told = f"{sim.health.unconverged} of {sim.health.steps} steps say not solved"
        yield at_most(
            f"house of {storeys} storeys of plates for {seconds} s: one moves by", moved, 0.1, "thicknesses", told
        )


def house(storeys: int, friction: float, thick: float, long: float, lean: float) -> Simulation:
    """Pairs of plates that lean on each other; roofs from ridge to ridge, feet of the next storey on the ridges."""
    high, aside = thick * math.sin(lean) + long * math.cos(lean), thick * math.cos(lean)
    pitch = 2.0 * (long * math.sin(lean) + aside)
    card, roof = (Plate(np.array([thick, wide, 8e-3])) for wide in (long, pitch))
    scene = plane(friction=friction, materials={"grain": grain(friction=friction)})
    sim = with_bodies(scene, card.shape("card"), roof.shape("roof"))
    flat = (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5))
    for storey in range(storeys):
        floor, pairs = storey * (high + thick), storeys - storey
        middles = pitch * (np.arange(pairs) - 0.5 * (pairs - 1))
        for middle in middles:
            for side in (-1.0, 1.0):
                place = (middle + 0.5 * side * (aside + long * math.sin(lean)), floor + 0.5 * high, 0.0)
                put(sim, card, place, turn=(math.cos(0.5 * lean), 0.0, 0.0, side * math.sin(0.5 * lean)))
        for left, right in pairwise(middles):
            put(sim, roof, (0.5 * (left + right), floor + high + 0.5 * thick, 0.0), turn=flat, shape=2)
    return sim


def moved_by(sim: Simulation, watch: Watch, seconds: float) -> float:
    """How far a centre has come from where it was, at most, m."""
    start = sim.position.copy()
    watch.step(sim, round(seconds / sim.step_size))
    return float(np.abs(sim.position - start).max())


CASES = (
    Case(
        "08",
        "a groove, a ladder and arches",
        "at µ = 1 one side of the groove lets go, above it the ball climbs; a ladder stands by friction alone, an arch "
        "of wedges by its thickness, one of spheres not at all",
        "Newton and Coulomb in closed form; limit analysis of the arches",
        groove,
    ),
    Case(
        "09",
        "towers and a house of cards",
        "every bar stands on eight contacts and bears those above; cards stand by friction alone",
        "statics",
        towers,
    ),
)
