"""The solvers of the contact problem: against closed forms and each other, and where they must say that they failed.

What an answer must fulfil is written down in contact_problems.py, independently of the engine.
"""

import typing

import numpy as np
import pytest
import scenes
from contact_problems import (
    LAWS,
    SOLVERS,
    box_stack,
    column,
    flat_fall,
    natural_map,
    project,
    random_problem,
    residual,
    solve,
    solve_blocks,
)
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy import sparse
from scipy.optimize import lsq_linear

import cesim
from cesim import InputError, engine
from cesim.scene import Numerics

ACCELERATED = ("auto", "apgs", "apgd", "direct")


def random_block(rng, rows=3, spread=1.0):
    A = rng.normal(size=(rows, rows + 3)) * 10.0 ** (spread * rng.uniform(-1, 1, (rows, 1)))
    return A @ A.T


# ---- the sets --------------------------------------------------------------------------------------------------------

impulses = arrays(float, 6, elements=st.floats(-1e3, 1e3))
limits = st.floats(0, 10)


def is_inside(friction, spinning, rolling, p, slack=1e-12):
    room = slack * (1 + np.abs(p).max())
    discs = ((friction, p[1:3]), (spinning, p[3:4]), (rolling, p[4:6]))
    return p[0] >= 0 and all(np.linalg.norm(part) <= limit * p[0] + room for limit, part in discs)


@given(limits, limits, limits, impulses, impulses)
@settings(max_examples=300, deadline=None)
def test_the_projection_is_in_the_set_idempotent_and_non_expansive(friction, spinning, rolling, one, other):
    coefficients = (friction, spinning, rolling)
    a, b = engine.project_cone(*coefficients, one), engine.project_cone(*coefficients, other)
    assert is_inside(*coefficients, a)
    assert np.allclose(engine.project_cone(*coefficients, a), a, rtol=0, atol=1e-9)
    assert np.linalg.norm(a - b) <= np.linalg.norm(one - other) * (1 + 1e-12) + 1e-9


@given(limits, limits, limits, impulses, impulses)
@settings(max_examples=300, deadline=None)
def test_no_point_of_the_set_is_nearer_than_the_projection(friction, spinning, rolling, p, other):
    coefficients = (friction, spinning, rolling)
    nearest, inside = engine.project_cone(*coefficients, p), engine.project_cone(*coefficients, other)
    assert (p - nearest) @ (inside - nearest) <= 1e-9 * (1 + np.linalg.norm(p)) * (1 + np.linalg.norm(inside))


@given(limits, arrays(float, 3, elements=st.floats(-1e3, 1e3)))
@settings(max_examples=200, deadline=None)
def test_three_rows_are_projected_by_the_three_cases_of_the_cone(mu, p):
    assert np.allclose(engine.project_cone(mu, 0.0, 0.0, p), project(mu, p), rtol=1e-12, atol=1e-10)


# ---- one contact -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("mu", [0.0, 0.3, 1.0, 10.0])
def test_a_contact_alone_is_solved_to_rounding(law, mu):
    rng = np.random.default_rng(1)
    for _ in range(300):
        W, q = random_block(rng), rng.normal(size=3)
        answer = solve(W, q, mu, law=law, tolerance=1e-11)
        scale = np.abs(q).max() + np.abs(W).max() * np.abs(answer.impulse).max()
        assert answer.solver == "block"
        assert residual(W, q, [mu], law, answer.impulse) < 1e-12 * scale


@pytest.mark.parametrize("law", LAWS)
def test_take_off_stick_and_slide_of_a_diagonal_block(law):
    W, mu = np.diag([1.0, 3.5, 3.5]), 0.5
    assert not solve(W, [2.0, 0.1, 0.0], mu, law=law).impulse.any()
    assert solve(W, [-1.0, 0.7, 0.7], mu, law=law).impulse == pytest.approx([1.0, -0.2, -0.2])
    slides = solve(W, [-1.0, 3.0, 4.0], mu, law=law)
    push = 1.0 if law == "coulomb" else (1.0 + 0.5 * 5.0) / (1 + 0.25 * 3.5)  # projection in the metric of W
    assert slides.impulse == pytest.approx(push * np.array([1.0, -0.3, -0.4]))
    assert slides.velocity[0] == pytest.approx(0.0 if law == "coulomb" else mu * np.hypot(*slides.velocity[1:]))


def test_coulomb_slides_against_its_slip_without_lifting_off():
    rng, sliding = np.random.default_rng(2), 0
    for _ in range(300):
        W, q, mu = random_block(rng), rng.normal(size=3), 0.2
        answer = solve(W, q, mu)
        u, gamma = answer.velocity, answer.impulse
        if gamma[0] > 0 and np.hypot(*u[1:]) > 1e-6:
            sliding += 1
            assert abs(u[0]) < 1e-9 * np.abs(q).max()
            assert np.hypot(*gamma[1:]) == pytest.approx(mu * gamma[0])
            assert gamma[1] * u[2] == pytest.approx(gamma[2] * u[1], abs=1e-9 * np.abs(gamma).max())
            assert gamma[1:] @ u[1:] < 0
    assert sliding > 50


def test_no_impulse_of_the_cone_has_less_energy_by_ccp():
    rng = np.random.default_rng(3)
    height, angle = np.meshgrid(np.linspace(0, 5, 80), np.linspace(0, 2 * np.pi, 73))
    for _ in range(30):
        W, q, mu = random_block(rng), rng.normal(size=3), 0.4
        answer = solve(W, q, mu, law="ccp")
        for share in (0.0, 0.5, 1.0):
            length = share * mu * height
            tries = np.stack([height, length * np.cos(angle), length * np.sin(angle)], -1).reshape(-1, 3)
            energy = 0.5 * np.einsum("ij,jk,ik->i", tries, W, tries) + tries @ q
            assert answer.objective <= energy.min() + 1e-12


# ---- many contacts ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("law", LAWS)
def test_every_solver_finds_the_answer_of_the_direct_one(solver, law):
    rng = np.random.default_rng(4)
    for _ in range(5):
        W, q, mu = random_problem(rng, contacts=12, bodies=20)
        answer = solve(W, q, mu, law=law, solver=solver, tolerance=1e-9, max_iterations=50_000)
        exact = solve(W, q, mu, law=law, solver="direct", tolerance=1e-13)
        assert answer.converged
        assert exact.converged
        assert residual(W, q, mu, law, answer.impulse) == pytest.approx(answer.residual, rel=1e-3, abs=1e-13)
        assert np.abs(answer.impulse - exact.impulse).max() < 1e-6
        assert answer.natural_map == pytest.approx(natural_map(W, q, mu, law, answer.impulse), rel=1e-3, abs=1e-13)
        assert np.allclose(answer.velocity, W @ answer.impulse + q, rtol=0, atol=1e-12)


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_convex_objective_is_one(solver):
    W, q, mu = random_problem(np.random.default_rng(9), 12, 8)
    best = solve(W, q, mu, law="ccp", solver="apgd", tolerance=1e-11, max_iterations=200_000)
    answer = solve(W, q, mu, law="ccp", solver=solver, tolerance=1e-8, max_iterations=400_000)
    assert best.converged
    assert answer.objective == pytest.approx(best.objective, rel=1e-6)


@pytest.mark.parametrize("solver", SOLVERS)
def test_dense_and_sparse_are_the_same_problem(solver):
    W, q, mu = random_problem(np.random.default_rng(5), contacts=8, bodies=10)
    dense = solve(W, q, mu, solver=solver, tolerance=1e-6)
    again = solve(sparse.csc_matrix(W), list(q), 0.3, solver=solver, tolerance=1e-6)
    assert np.array_equal(dense.impulse, again.impulse)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("solver", ACCELERATED)
def test_a_hyperstatic_stack_at_rest_stays(solver, law):
    W, q, mu = box_stack(5)
    assert np.linalg.matrix_rank(W) == 30  # of 60
    answer = solve(W, q, mu, law=law, solver=solver)
    assert answer.converged
    assert np.abs(answer.velocity).max() < 1e-8
    # which corner carries how much is not determined; what each face carries is
    assert answer.impulse[::3].reshape(5, 4).sum(axis=1) == pytest.approx(9.81e-3 * np.arange(5, 0, -1), rel=1e-5)


@pytest.mark.parametrize("solver", ACCELERATED)
def test_a_stack_that_is_pushed_slides_on_the_ground_as_coulomb_says(solver):
    W, q, mu = box_stack(2, push=0.05)
    answer = solve(W, q, 0.4 * mu, solver=solver)  # 0.2: it does not topple
    assert answer.converged
    # friction on the ground, mu g h at most, brakes all of it alike
    assert answer.velocity[2::3][:4] == pytest.approx(0.05 - 0.2 * 9.81e-3, rel=1e-5)
    assert np.abs(answer.velocity[12:]).max() < 1e-7


@pytest.mark.parametrize("ratio", [1.0, 1e3, 1e6])
def test_a_heavy_sphere_on_light_ones_loads_the_ground_with_its_weight(ratio):
    W, q, mu, load = column(10, top_mass=ratio)
    answer = solve(W, q, mu, tolerance=1e-8)
    assert answer.converged
    assert answer.impulse[::3] == pytest.approx(load, rel=1e-3)


@pytest.mark.parametrize("law", LAWS)
def test_contacts_that_open_do_not_keep_a_heavy_sphere_from_its_answer(law):
    """What only a direct method solves, among more contacts than it may be asked to take."""
    W, q, mu, load = column(10, top_mass=1e6, opening=400)
    answer = solve(W, q, mu, law=law, tolerance=1e-8, max_iterations=1000)
    assert answer.converged
    assert answer.solver == "direct"
    assert answer.impulse[::3] == pytest.approx(load, rel=1e-3)


@pytest.mark.parametrize("ratio", [1e3, 1e6])
def test_gauss_seidel_does_not_carry_a_heavy_sphere_and_says_so(ratio):
    W, q, mu, load = column(10, top_mass=ratio)
    answer = solve(W, q, mu, solver="pgs", max_iterations=1000)
    assert not answer.converged
    assert answer.impulse[0] < 0.9 * load[0]


# ---- rolling contacts and joints -------------------------------------------------------------------------------------


def blocks_residual(W, q, sizes, limits, law, impulse, least=None, most=None):
    u, worst, row = W @ impulse + q, 0.0, 0
    for size, (friction, spinning, rolling) in zip(sizes, limits, strict=True):
        part = slice(row, row + abs(size))
        row = part.stop
        rho = abs(size) / np.trace(W[part, part])
        v, gamma = u[part].copy(), impulse[part]
        if size > 0:
            v[0] += friction * np.hypot(*v[1:3]) if law == "coulomb" else 0.0
        if size == 6:
            v[0] += spinning * abs(v[3]) + rolling * np.hypot(*v[4:6])
        moved = gamma - rho * v
        nearest = (
            np.clip(moved, least[part], most[part])
            if size < 0
            else engine.project_cone(friction, spinning, rolling, moved)
        )
        worst = max(worst, np.linalg.norm(gamma - nearest) / rho)
    return worst


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("coupled", [False, True])
def test_a_rolling_contact_alone_is_solved(law, coupled):
    rng = np.random.default_rng(6)
    for _ in range(200):
        A = random_block(rng, 6, spread=0.3)
        A = A if coupled else np.diag(np.diag(A))
        q, limit = rng.normal(size=6), rng.uniform(0, 1, 3)
        q[0] -= 1.0
        answer = solve_blocks(A, q, [6], [limit], law=law, tolerance=1e-9)
        assert answer["converged"]
        assert answer["solver"] == "block"
        assert blocks_residual(A, q, [6], [limit], law, answer["impulse"]) < 1e-9


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("law", LAWS)
def test_every_solver_takes_rolling_contacts_and_joints(solver, law):
    rng = np.random.default_rng(7)
    sizes = [3, 6, -2, 6, -5, 3, -1]
    rows = sum(map(abs, sizes))
    D = rng.normal(size=(rows, 50))
    W, q = D @ D.T, rng.normal(size=rows)
    limits = [rng.uniform(0.1, 0.5, 3) if size > 0 else np.zeros(3) for size in sizes]
    least, most = np.full(rows, -np.inf), np.full(rows, np.inf)
    least[-1], most[-1] = -1e-3, 1e-3  # a motor at its limit
    answer = solve_blocks(W, q, sizes, limits, law, solver, least, most, tolerance=1e-7)
    assert answer["converged"]
    assert blocks_residual(W, q, sizes, limits, law, answer["impulse"], least, most) <= 1.001e-7
    assert abs(answer["impulse"][-1]) <= 1e-3


def test_a_joint_with_dependent_rows_is_solved_and_holds_still():
    rng = np.random.default_rng(8)
    D = rng.normal(size=(3, 6))[[0, 1, 2, 0, 1, 2]]  # every row twice
    W, q = D @ D.T, D @ rng.normal(size=6)
    answer = solve_blocks(W, q, [-6], np.zeros((1, 3)))
    assert answer["converged"]
    assert np.abs(answer["velocity"]).max() < 1e-12


def test_a_joint_with_bounds_is_the_bounded_least_squares_problem():
    rng = np.random.default_rng(9)
    for _ in range(200):
        D, v = rng.normal(size=(5, 6)), rng.normal(size=6)
        least, most = -rng.uniform(0, 0.5, 5), rng.uniform(0, 0.5, 5)
        answer = solve_blocks(D @ D.T, D @ v, [-5], np.zeros((1, 3)), least=least, most=most)
        exact = lsq_linear(D.T, -v, (least, most), tol=1e-14)  # |D' gamma + v|^2
        assert answer["converged"]
        assert answer["solver"] == "block"  # by itself, not by going on
        assert answer["objective"] == pytest.approx(exact.cost - 0.5 * v @ v, rel=1e-8, abs=1e-12)


# ---- stopping, starting, units ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("solver", SOLVERS)
def test_running_out_is_reported(solver):
    W, q, mu = box_stack(5)
    answer = solve(W, q, mu, solver=solver, max_iterations=3)
    assert not answer.converged
    assert answer.iterations <= 3
    assert residual(W, q, mu, "coulomb", answer.impulse) == pytest.approx(answer.residual, rel=1e-6)


@pytest.mark.parametrize("solver", SOLVERS)
def test_numbers_beyond_the_largest_are_no_solution(solver):
    W, q, mu = box_stack(2)
    answer = solve(1e300 * W, 1e300 * q, mu, solver=solver, max_iterations=50)
    assert not answer.converged


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("law", LAWS)
def test_other_units_of_mass_and_speed_change_neither_iterations_nor_digits(solver, law):
    W, q, mu = box_stack(3, push=0.02)
    W = 2.0**12 * W  # light bodies: FCLib's error, which counts kg and m/s, asks no more than the residual
    first = solve(W, q, mu, law=law, solver=solver, max_iterations=500, tolerance=1e-6)
    mass, speed = 2.0**-20, 2.0**9
    other = solve(W / mass, speed * q, mu, law=law, solver=solver, max_iterations=500, tolerance=1e-6)
    assert other.iterations == first.iterations
    assert np.array_equal(other.impulse, mass * speed * first.impulse)
    assert other.residual == speed * first.residual


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_answer_as_the_start_is_the_answer(solver):
    W, q, mu = random_problem(np.random.default_rng(10), contacts=12, bodies=20)
    exact = solve(W, q, mu, solver="direct", tolerance=1e-13).impulse
    again = solve(W, q, mu, solver=solver, impulse=exact, tolerance=1e-10)
    assert again.converged
    assert again.iterations <= 2
    assert np.allclose(again.impulse, exact, rtol=0, atol=1e-9)


@pytest.mark.parametrize("solver", [name for name in SOLVERS if name != "direct"])
def test_a_start_that_is_worse_than_nothing_is_left_out(solver):
    W, q, mu = random_problem(np.random.default_rng(11), contacts=12, bodies=20)
    cold = solve(W, q, mu, solver=solver)
    warm = solve(W, q, mu, solver=solver, impulse=np.full(36, 1e3))
    assert np.array_equal(cold.impulse, warm.impulse)


@pytest.mark.parametrize("solver", SOLVERS)
def test_nothing_to_solve_is_solved(solver):
    empty = solve(np.zeros((0, 0)), [], 0.3, solver=solver)
    assert empty.converged
    resting = solve(np.eye(6), np.zeros(6), 0.3, solver=solver)
    assert resting.converged
    assert not resting.impulse.any()


def test_a_tolerance_bounds_the_error_of_fclib_whatever_the_masses():
    for scale in (1e-4, 1.0, 1e4):
        W, q, mu = random_problem(np.random.default_rng(12), contacts=12, bodies=20)
        answer = solve(scale * W, q, mu, tolerance=1e-5, solver="pgs")
        assert answer.converged
        assert natural_map(scale * W, q, mu, "coulomb", answer.impulse) <= 1e-5


# ---- bad input -------------------------------------------------------------------------------------------------------

EYE, NOTHING = np.eye(3), np.zeros(3)


@pytest.mark.parametrize(
    ("arguments", "options", "path", "words"),
    [
        ((np.eye(4), np.zeros(4), 0.3), {}, "W", "(3n, 3n)"),
        ((np.zeros(9), NOTHING, 0.3), {}, "W", "(3n, 3n)"),
        ((np.eye(3, 6), NOTHING, 0.3), {}, "W", "(3n, 3n)"),
        (("W", NOTHING, 0.3), {}, "W", ""),
        ((1j * EYE, NOTHING, 0.3), {}, "W", "real"),
        ((np.nan * EYE, NOTHING, 0.3), {}, "W", "finite"),
        ((-EYE, NOTHING, 0.3), {}, "W", "above 0"),
        ((np.diag([1.0, 0.0, 1.0]), NOTHING, 0.3), {}, "W", "above 0"),
        ((EYE + np.eye(3, k=1), NOTHING, 0.3), {}, "W", "symmetric"),
        ((EYE, np.zeros(4), 0.3), {}, "q", "(3,)"),
        ((EYE, [0, 0, np.inf], 0.3), {}, "q", "finite"),
        ((EYE, None, 0.3), {}, "q", "real numbers"),
        ((EYE, [True] * 3, 0.3), {}, "q", "real numbers"),
        ((EYE, NOTHING, -0.1), {}, "mu", "below 0"),
        ((EYE, NOTHING, [0.1, 0.1]), {}, "mu", "(1,)"),
        ((EYE, NOTHING, "0.3"), {}, "mu", "real numbers"),
        ((EYE, NOTHING, 0.3), {"law": "columb"}, "law", "did you mean 'coulomb'"),
        ((EYE, NOTHING, 0.3), {"solver": "apg"}, "solver", "did you mean 'apg"),
        ((EYE, NOTHING, 0.3), {"tolerance": -1.0}, "tolerance", "from 0"),
        ((EYE, NOTHING, 0.3), {"tolerance": np.nan}, "tolerance", "from 0"),
        ((EYE, NOTHING, 0.3), {"max_iterations": 0}, "max_iterations", "from 1"),
        ((EYE, NOTHING, 0.3), {"max_iterations": 1.5}, "max_iterations", "from 1"),
        ((EYE, NOTHING, 0.3), {"impulse": np.zeros(6)}, "impulse", "(3,)"),
    ],
)
def test_bad_input_is_refused_by_name(arguments, options, path, words):
    with pytest.raises(InputError) as error:
        solve(*arguments, **options)
    assert error.value.path == path
    assert words in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rows": [4]}, "rows"),
        ({"rows": [3, 3]}, "limits"),
        ({"rows": []}, "limits"),
        ({"q": [0.0, 0.0]}, "q"),
        ({"column": [0, 1, 3]}, "column"),
        ({"column": [0, -1, 2]}, "column"),
        ({"row_start": [0, 2, 1, 3]}, "row_start"),
        ({"row_start": [0, 1, 2, 4]}, "row_start"),
        ({"solver": "none"}, "solver"),
        ({"law": "none"}, "law"),
        ({"value": [0.0, 0.0, 0.0]}, "trace"),
    ],
)
def test_the_engine_itself_refuses_arrays_that_do_not_fit(changes, words):
    good = {
        "row_start": [0, 1, 2, 3],
        "column": [0, 1, 2],
        "value": [1.0, 1.0, 1.0],
        "q": [0.0, 0.0, -1.0],
        "rows": [3],
        "limits": [[0.3, 0.0, 0.0]],
        "least": [-np.inf] * 3,
        "most": [np.inf] * 3,
        "start": [0.0] * 3,
        "law": "coulomb",
        "solver": "pgs",
        "tolerance": 1e-9,
        "max_iterations": 10,
    }
    engine.solve_cone(**good)
    with pytest.raises(engine.InputError, match=words):
        engine.solve_cone(**{**good, **changes})


def test_the_table_names_what_it_has():
    assert tuple(sorted(cesim.contact.solvers())) == tuple(sorted(SOLVERS))
    assert all(cesim.contact.solvers().values())


def test_the_names_a_scene_takes_are_those_of_the_table():
    hint = typing.get_type_hints(Numerics)["solver"]
    assert set(typing.get_args(hint)) == set(SOLVERS)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_trial_solves_the_next_step_and_changes_nothing(solver):
    """A heap of spheres with friction, from no impulses; the step that follows is the one that would have been made."""
    scene = scenes.plane_scene(friction=0.4)
    scene.materials["copper"].friction = 0.3
    sim = cesim.Simulation(scene, threads=1)
    rng = np.random.default_rng(2)
    cells = np.indices((3, 3, 3)).reshape(3, -1).T * 1.02e-3 + np.array([0.0, 0.51e-3, 0.0])
    sim.add(cells + rng.uniform(-2e-5, 2e-5, cells.shape), diameter=1e-3)
    sim.step(30)
    before = sim.state_hash()
    trial = sim.engine.try_solver(solver, 100_000, 1e-6, True)
    assert sim.state_hash() == before
    assert trial["contacts"] > 20
    assert trial["converged"]
    assert trial["residual"] <= 1e-6
    few = sim.engine.try_solver(solver, 1, 1e-15, True)
    assert not few["converged"]


@pytest.mark.parametrize("solver", ["auto", "direct"])
def test_a_flake_that_falls_flat_is_solved(solver):
    """More points than bear it, most with hardly any impulse: Newton's steps need to be held back to arrive."""
    W, q, mu = flat_fall()
    answer = cesim.contact.solve(W, q, mu, solver=solver, tolerance=1e-5)
    assert answer.converged
    assert residual(W, q, mu, "coulomb", answer.impulse) < 1.1e-5


def test_a_grain_that_drum_and_brush_draw_in_is_told_at_once():
    """Both turn it down into the nip, whose half angle of 7 degrees friction holds: there is no answer to look for."""
    scene = cesim.scenes.reference_machine("spheres")
    scene.feed = scene.electrode = scene.corona = None
    scene.numerics.step = 1e-3
    sim = cesim.Simulation(scene, threads=1)
    sim.add([[-0.1597, 0.0140, 0.1]], velocity=[[0.0, -0.6, 0.0]], diameter=0.586e-3)
    sim.step(10)
    assert sim.health.unconverged >= 8
    assert sim.health.residual > 1e-3
    assert sim.health.iterations < 4000  # of 12 000
    assert np.abs(sim.contacts["impulse"]).max() < 1e-3  # N s: of a grain of 1e-7 kg
    assert np.hypot(*sim.position[0, :2]) > 0.16  # it has not sunk into the drum


def test_a_grain_that_is_stopped_is_not_asked_to_be_past_its_neighbour():
    """Its free path passes a neighbour by, and a wall stops it before it gets there: the neighbour feels nothing."""
    scene = scenes.plane_scene()
    scene.gravity = (0.0, 0.0, 0.0)
    scene.walls[0].normal = (-1.0, 0.0, 0.0)
    for height in (1.001e-3, 1.02e-3, 1.1e-3):
        sim = cesim.Simulation(scene, threads=1)
        sim.add(
            [[-0.6e-3, 0.0, 0.0], [-0.1e-3, height, 0.0]], velocity=[[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]], diameter=1e-3
        )
        sim.step()
        assert sim.health.converged
        assert abs(sim.velocity[0]).max() < 1e-9
        assert not sim.velocity[1].any()
