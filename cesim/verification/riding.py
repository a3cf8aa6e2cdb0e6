"""Grains that ride on the turning drum (docs/numerics.md 3, cases 01, 12, 17, 18)."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ..constants import VACUUM_PERMITTIVITY as EPS0
from ..scene import Electrode, Scene
from ..simulation import Simulation
from .rows import Case, Rows, Size, at_most, equal
from .scenes import BLOCK, GRAVITY, Array, drum, set_on_drum, sphere_mass
from .watch import Watch

R = 0.160  # m, of the drum
RPM = math.pi / 30.0
ABS_DENSITY = 1050.0


# ---- mass ratio (01) -------------------------------------------------------------------------------------------------


def light_on_drum(size: Size) -> Rows:
    """Two hundred grains of half a microgram rain on a drum of many kilograms and are carried off by it."""
    speed, d = 60.0 * RPM, 0.5e-3
    watch = Watch()
    sim = Simulation(drum(speed, friction=1000.0, rolling_friction=BLOCK), threads=1)
    rng = np.random.default_rng(1)
    angle, z = np.repeat(np.linspace(-0.4, 0.1, 40), 5), np.tile(np.linspace(-0.1, 0.1, 5), 40)
    reach = R + 0.5 * d + rng.uniform(1e-4, 1e-3, 200)
    out, along = (
        np.column_stack([x, y, np.zeros(200)])
        for x, y in ((np.sin(angle), np.cos(angle)), (np.cos(angle), -np.sin(angle)))
    )
    sim.add(reach[:, None] * out + z[:, None] * (0.0, 0.0, 1.0), speed * R * along, "copper", d)
    depth = 0.0
    for _ in range(60):
        watch.step(sim)
        depth = max(depth, float((R + 0.5 * d - np.hypot(*sim.position[:, :2].T)).max()) / d)
    x, y = sim.position[:, :2].T
    turning = (sim.velocity[:, 0] * y - sim.velocity[:, 1] * x) / (x * x + y * y) / speed
    yield at_most(
        "speed of 200 grains that it caught, less the drum's",
        np.abs(turning - 1.0).max(),
        1e-6,
        "",
        "the drum's motion is prescribed: no grain slows it",
    )
    yield at_most("deepest in the drum", depth, 1e-3, "d")
    yield watch.row()


# ---- image force at touch (17) ---------------------------------------------------------------------------------------


def image_scene(speed: float, friction: float, step: float, gravity: bool = True, decay_time: float = 0.0) -> Scene:
    """A drum whose electrode, if there is one, has no voltage: only weight and image act.

    With a decay time ABS is a middling, whose charge decays on the drum to nothing.
    """
    scene = drum(speed, friction=friction, rolling_friction=BLOCK, numerics={"step": step})
    scene.effects = {"drag": "off", "image_force": "on"}
    if decay_time:
        scene.electrode = Electrode(voltage=0.0)
        scene.materials["ABS"] = scene.materials["ABS"].model_copy(update={"decay_time": decay_time})
        scene.effects["charge_decay"] = "on"
    if not gravity:
        scene.gravity = (0.0, 0.0, 0.0)
    return scene


def charge_for(ratio: float, diameter: float) -> float:
    """Charge in C of an ABS sphere whose image at touch pulls with this many times its weight."""
    weight = sphere_mass(ABS_DENSITY, diameter) * GRAVITY
    return -math.sqrt(ratio * weight * 16.0 * math.pi * EPS0) * 0.5 * diameter


def pull(gap: float, diameter: float, charge: float, decay_time: float = 0.0) -> float:
    """Pull of the drum in N on a grain a gap above its top, from the velocity that a very short step gives."""
    step = 1e-9
    sim = Simulation(image_scene(0.0, 0.0, step, gravity=False, decay_time=decay_time), threads=1)
    sim.add((0.0, R + 0.5 * diameter + gap, 0.0), material="ABS", diameter=diameter, charge=charge)
    sim.step()
    push = float(sim.contacts["impulse"][:, 1].sum()) if len(sim.contacts) else 0.0
    return float(sim.mass[0] * -sim.velocity[0, 1] + push) / step


def image_at_touch(size: Size) -> Rows:
    """A 10 um grain that its image pulls with 78 times its weight."""
    watch = Watch(momentum=False)
    d, ratio = 10e-6, 78.0
    charge = charge_for(ratio, d)
    gaps = np.array([-1e-9, 0.0, 1e-12, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4])
    pulls = np.array([pull(float(gap), d, charge) for gap in gaps]) / (sphere_mass(ABS_DENSITY, d) * GRAVITY)
    yield at_most(
        "pull, from overlap to 0.1 mm: greatest rise with the gap",
        np.diff(pulls).max(),
        1e-9 * ratio,
        "m g",
        f"at touch {pulls[1]:.3f} m g",
    )
    exact = ratio / (1.0 + np.maximum(gaps, 0.0) / (0.5 * d)) ** 2
    yield at_most(
        "pull: error", np.abs(pulls / exact - 1.0).max(), 1e-6, "", "κ Q²/16πε0 s², held at touch for overlaps"
    )
    leaky = np.array([pull(float(gap), d, charge, 1.0) for gap in gaps]) / (sphere_mass(ABS_DENSITY, d) * GRAVITY)
    yield at_most("pull on a middling (τ = 1 s): error", np.abs(leaky / exact - 1.0).max(), 1e-6, "", "the same law")
    speed = 60.0 * RPM
    sim = Simulation(image_scene(speed, 0.5, 1e-3), threads=1)
    set_on_drum(sim, "ABS", d, charge=charge)
    watch.step(sim, 1000)
    creep = abs(lag(sim, speed)) / sim.time
    yield at_most(
        "on the drum at 60 rpm for 1 s: creeps",
        creep / chord(speed, 1e-3),
        1.01,
        "ω (ω h)²/3",
        f"a step goes along the tangent: {creep * R / d:.2g} d/s at 1 ms, a hundredth of it at 0.1 ms; "
        "the wish was 1e-3 d/s",
    )
    off = abs(float(np.hypot(*sim.position[0, :2])) - R - 0.5 * d)
    yield at_most(
        "on the drum at 60 rpm for 1 s: off it by",
        off / d,
        0.5 * (speed * R * 1e-3) ** 2 / R / d,
        "d",
        "a step's path along the tangent rises by (v h)²/2R",
    )
    yield watch.row()


def lag(sim: Simulation, speed: float) -> float:
    """Angle in rad by which the first grain is behind the drum, on which it started at the top."""
    x, y = sim.position[0, :2]
    behind = (speed * sim.time - math.atan2(float(x), float(y)) + math.pi) % (2.0 * math.pi) - math.pi
    return float(behind)


def chord(speed: float, step: float) -> float:
    """Lag in rad/s of what follows a circle by steps along its tangents: atan(w h)/h is short of w."""
    return speed * (speed * step) ** 2 / 3.0


# ---- pinned grains (18) ----------------------------------------------------------------------------------------------


def leaving(watch: Watch, ratio: float, step: float, speed: float, d: float, decay_time: float = 0.0) -> float:
    """Angle from the top in rad at which the drum last pressed the grain; NaN if it stays for two turns."""
    sim = Simulation(image_scene(speed, 0.3, step, decay_time=decay_time), threads=1)
    set_on_drum(sim, "ABS", d, charge=charge_for(ratio, d))
    last, since, turned = 0.0, 0.0, 0.0
    while since < 0.02:
        if turned > 4.0 * math.pi:
            return math.nan
        watch.step(sim)
        x, y = sim.position[0, :2]
        if any(np.dot(push["impulse"], push["normal"]) > 0.0 for push in sim.contacts):
            last, since = math.atan2(float(x), float(y)) % (2.0 * math.pi), 0.0
        else:
            since += step
        turned = speed * sim.time
    return last


def balance(ratio: float, mu: float, speed: float, d: float, decay_time: float = math.inf) -> float:
    """The same from the equations of a block: it sticks, slips, sticks again, and leaves where nothing presses it.

    The image falls with the square of the charge.
    """
    from scipy import integrate

    solve_ivp: Any = integrate.solve_ivp  # its stub does not know terminal events with arguments
    reach = R + 0.5 * d
    carried = speed * reach

    def press(t: float, s: Array) -> float:
        image = ratio * math.exp(-2.0 * t / decay_time)
        return GRAVITY * (math.cos(s[0]) + image) - float(s[1]) ** 2 / reach

    def slopes(t: float, s: Array, side: float) -> list[float]:
        if side == 0.0:
            return [s[1] / reach, 0.0]
        return [s[1] / reach, GRAVITY * math.sin(s[0]) - side * mu * press(t, s)]

    def leaves(t: float, s: Array, side: float) -> float:
        return press(t, s)

    def changes(t: float, s: Array, side: float) -> float:
        if side == 0.0:
            return mu * press(t, s) - GRAVITY * abs(math.sin(s[0]))
        return side * (float(s[1]) - carried)

    leaves.terminal, changes.terminal = True, True  # type: ignore[attr-defined]
    leaves.direction, changes.direction = -1, -1  # type: ignore[attr-defined]
    state, side, time = np.array([0.0, carried]), 0.0, 0.0
    for _ in range(20):
        path = solve_ivp(
            slopes,
            (time, time + 4.0 * math.pi / speed),
            state,
            method="DOP853",
            rtol=1e-10,
            atol=1e-13,
            events=(leaves, changes),
            args=(side,),
            max_step=2e-3,
        )
        if len(path.t_events[0]):
            return float(path.y_events[0][0][0]) % (2.0 * math.pi)
        if not len(path.t_events[1]) or path.y[0, -1] > 4.0 * math.pi:
            return math.nan
        time, state = float(path.t_events[1][0]), path.y_events[1][0].copy()
        if side == 0.0:
            side = math.copysign(1.0, math.sin(state[0]))
            state[1] += side * 1e-9
        else:
            side, state[1] = 0.0, carried
    return math.nan


def pinned(size: Size) -> Rows:
    """Images of half to twenty times the weight, on a drum at 60 rpm with friction 0.3."""
    watch = Watch(momentum=False)
    speed, d = 60.0 * RPM, 0.3e-3
    step = 1e-4
    for ratio in (0.5, 1.0, 1.5, 2.0, 4.0, 20.0):
        wanted = balance(ratio, 0.3, speed, d)
        found = leaving(watch, ratio, step, speed, d)
        if math.isnan(wanted):
            yield equal(f"image of {ratio} m g: leaves within two turns", 0 if math.isnan(found) else 1, 0)
        else:
            error = math.degrees(abs((found - wanted + math.pi) % (2.0 * math.pi) - math.pi))
            yield at_most(
                f"image of {ratio} m g: error of the angle where it leaves",
                error,
                0.5,
                "degrees",
                f"{math.degrees(wanted):.2f} degrees from the top",
            )
    for ratio, tau in ((2.0, 0.2), (20.0, 0.4)):
        wanted = balance(ratio, 0.3, speed, d, tau)
        error = math.degrees(abs(leaving(watch, ratio, step, speed, d, tau) - wanted))
        yield at_most(
            f"image of {ratio} m g on a middling (τ = {tau} s): error of the angle where it leaves",
            error,
            0.5,
            "degrees",
            f"{math.degrees(wanted):.2f} degrees from the top, where its charge has decayed",
        )
    sim = Simulation(image_scene(speed, 0.3, 1e-3), threads=1)
    set_on_drum(sim, "ABS", d, charge=charge_for(20.0, d))
    watch.step(sim, 10)
    before = lag(sim, speed)
    watch.step(sim, 2000)
    creep = abs(lag(sim, speed) - before) / 2.0
    yield at_most(
        "image of 20 m g, two turns: creeps in the drum's frame",
        creep / chord(speed, 1e-3),
        1.01,
        "ω (ω h)²/3",
        f"a step goes along the tangent: {creep * R / d:.2g} d/s at 1 ms; the wish was 1e-9 d, which "
        "holds on a drum at rest",
    )
    still = Simulation(image_scene(0.0, 0.3, 1e-3), threads=1)
    set_on_drum(still, "ABS", d, angle=0.3, charge=charge_for(20.0, d))
    watch.step(still, 10)
    place = still.position.copy()
    watch.step(still, 1000)
    yield at_most("image of 20 m g, a drum at rest, 1 s: creeps", np.abs(still.position - place).max() / d, 1e-9, "d")
    yield watch.row()


# ---- statistics of a drum with bouncing grains (12) ------------------------------------------------------------------


def thrown(watch: Watch, step: float, law: str, seed: int, count: int) -> Array:
    """Sorted x in m where grains with e = 0.5 land that fell on the turning drum."""
    material = {"kind": "insulator", "density": 1050.0, "permittivity": 2.87, "friction": 0.2, "restitution": 0.5}
    scene = drum(
        44.8 * RPM,
        friction=0.5,
        rolling_friction=0.3,
        restitution=0.5,
        collect={"y": -0.1},
        numerics={"step": step, "contact_law": law},
        materials={"grain": material},
    )
    sim = Simulation(scene, threads=1)
    rng = np.random.default_rng(seed)
    lines = np.repeat(np.arange(count // 20), 20)
    place = np.column_stack(
        [rng.uniform(-0.05, -0.02, count), 0.18 + 2.5e-3 * lines, np.tile(np.linspace(-0.02, 0.02, 20), count // 20)]
    )
    sim.add(place, material="grain", diameter=rng.uniform(0.5e-3, 1e-3, count), velocity=(0.3, 0.0, 0.0))
    while sim.count and sim.time < 3.0:
        watch.step(sim, 10)
    return np.asarray(np.sort(sim.landings["position"][:, 0]))


def distance(one: Array, other: Array) -> float:
    """Wasserstein's distance of two samples, m."""
    from scipy.stats import wasserstein_distance

    return float(wasserstein_distance(one, other))


def bouncing_drum(size: Size) -> Rows:
    """Where grains land must not depend on the step, beyond the noise of which grains they were."""
    count, seeds = (1000, range(8)) if size == "full" else (300, range(4))
    steps = (2e-3, 1e-3, 2.5e-4) if size == "full" else (1e-3, 5e-4)
    watch = Watch(work=None)
    samples = {step: [thrown(watch, step, "coulomb", seed, count) for seed in seeds] for step in steps}
    finest = samples[steps[-1]]
    noise = [distance(finest[i], finest[j]) for i in seeds for j in seeds if i < j]
    band = float(np.quantile(noise, 0.95)) / math.sqrt(len(seeds))
    pooled = np.concatenate(finest)
    others = f"95 % of repetitions with {len(seeds) * count} other grains are within {1e3 * band:.2f} mm"
    for step in steps[:-1]:
        apart = distance(np.concatenate(samples[step]), pooled) / band
        name = f"coulomb, h = {step:.1e} s against {steps[-1]:.1e} s: W1 of where they land"
        if step > 1e-3:
            note = f"{others}; a grain leaves the drum up to a step late, {1e3 * 44.8 * RPM * R * step:.1f} mm"
            yield at_most(name, apart, 3.0, "noise", note)
        else:
            yield at_most(name, apart, 1.0, "noise", others)
    relaxed = np.concatenate([thrown(watch, steps[-2], "ccp", seed, count) for seed in seeds])
    yield at_most(
        "ccp against coulomb: W1 of where they land",
        1e3 * distance(relaxed, pooled),
        CCP_BIAS,
        "mm",
        "the bias of the relaxation, which no step removes",
    )
    lost = sum(len(seeds) * count - sum(len(s) for s in samples[step]) for step in steps)
    yield equal("grains that did not land", lost, 0)
    yield watch.row()


CCP_BIAS = 3.0  # mm

CASES = (
    Case(
        "01",
        "light grains on a heavy drum",
        "mass ratios stall what iterates",
        "the drum's motion is prescribed",
        light_on_drum,
    ),
    Case("12", "bouncing on the drum", "chaos hides a bias of the scheme", "the same with a finer step", bouncing_drum),
    Case("17", "image force at touch", "1/gap² at a gap of nothing", "method of images", image_at_touch),
    Case(
        "18",
        "grains pinned to the drum",
        "sticking, slipping and leaving under a force of the same size as weight",
        "equations of a block on a drum",
        pinned,
    ),
)
