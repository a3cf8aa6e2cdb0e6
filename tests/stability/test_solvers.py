"""Every solver of the table, against closed forms and against each other (docs/numerics.md 2)."""

import typing

import contact_problems as problems
import numpy as np
import pytest
import scenes

import cesim
from cesim.scene import Numerics

SOLVERS = [row["name"] for row in cesim.engine.contact_solvers()]
LAWS = ["coulomb", "ccp"]

BLOCK = np.array([[2.0, 0.3, -0.2], [0.3, 3.0, 0.4], [-0.2, 0.4, 2.5]])


def test_the_names_a_scene_takes_are_those_of_the_table():
    hint = typing.get_type_hints(Numerics)["solver"]
    assert set(typing.get_args(hint)) == set(SOLVERS)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize(
    "q", [[0.4, 0.1, -0.2], [-1.0, 0.1, -0.1], [-1.0, 2.0, -1.5]], ids=["parts", "sticks", "slides"]
)
def test_one_contact_meets_its_conditions(solver, law, q):
    mu = 0.4
    answer = cesim.contact.solve(BLOCK, q, mu, law=law, solver=solver, tolerance=1e-11, max_iterations=100_000)
    assert answer.converged
    gamma, u = answer.impulse, BLOCK @ answer.impulse + q
    np.testing.assert_allclose(u, answer.velocity, atol=1e-12)
    if q[0] > 0:
        assert np.abs(gamma).max() < 1e-10
        return
    slip, pull = np.hypot(*u[1:]), np.hypot(*gamma[1:])
    if slip < 1e-9:
        np.testing.assert_allclose(gamma, np.linalg.solve(BLOCK, -np.array(q)), atol=1e-9)
        assert pull <= mu * gamma[0]
        return
    assert pull == pytest.approx(mu * gamma[0], rel=1e-8)
    np.testing.assert_allclose(gamma[1:] / pull, -u[1:] / slip, atol=1e-7)
    assert u[0] == pytest.approx(0.0 if law == "coulomb" else mu * slip, abs=1e-9)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("law", LAWS)
def test_solvers_agree_where_the_answer_is_one(solver, law):
    rng = np.random.default_rng(4)
    for contacts, bodies in ((3, 5), (8, 20), (20, 60)):
        W, q, mu = problems.random_problem(rng, contacts, bodies)
        oracle = cesim.contact.solve(W, q, mu, law=law, solver="direct", tolerance=1e-12)
        answer = cesim.contact.solve(W, q, mu, law=law, solver=solver, tolerance=1e-9, max_iterations=200_000)
        assert oracle.converged
        assert answer.converged or solver == "spg"  # whose steps stall in the last digits
        assert problems.residual(W, q, mu, law, answer.impulse) < 1e-8
        np.testing.assert_allclose(answer.velocity, oracle.velocity, atol=1e-6)


@pytest.mark.parametrize("solver", ["auto", "apgs", "apgd", "direct"])
def test_a_hyperstatic_stack_is_solved(solver):
    """W has half its rank; what is determined is the force through each face."""
    boxes = 4
    W, q, mu = problems.box_stack(boxes)
    answer = cesim.contact.solve(W, q, mu, solver=solver, tolerance=1e-9, max_iterations=100_000)
    assert answer.converged
    through = answer.impulse[0::3].reshape(boxes, 4).sum(axis=1)
    np.testing.assert_allclose(through, 9.81e-3 * np.arange(boxes, 0, -1), rtol=1e-5)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_column_carries_its_weight(solver):
    W, q, mu = problems.column(6)[:3]
    answer = cesim.contact.solve(W, q, mu, solver=solver, tolerance=1e-9, max_iterations=200_000)
    assert answer.converged
    assert answer.impulse[0] == pytest.approx(6 * 9.81e-3, rel=1e-5)


@pytest.mark.parametrize("solver", SOLVERS)
def test_running_out_of_iterations_is_told(solver):
    W, q, mu = problems.column(40)[:3]
    answer = cesim.contact.solve(W, q, mu, solver=solver, tolerance=1e-14, max_iterations=1)
    assert not answer.converged
    assert np.isfinite(answer.residual)
    assert answer.residual > 1e-14


def test_units_do_not_change_the_iterations():
    W, q, mu = problems.box_stack(3)
    ours = cesim.contact.solve(W, q, mu, solver="pgs", tolerance=1e-6)
    grains = cesim.contact.solve(1e6 * W, 1e-2 * q, mu, solver="pgs", tolerance=1e-6)
    assert ours.converged
    assert ours.iterations == grains.iterations
    np.testing.assert_allclose(grains.impulse, 1e-8 * ours.impulse, rtol=1e-9, atol=1e-20)


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_convex_objective_is_one(solver):
    W, q, mu = problems.random_problem(np.random.default_rng(9), 12, 8)
    best = cesim.contact.solve(W, q, mu, law="ccp", solver="apgd", tolerance=1e-11, max_iterations=200_000)
    answer = cesim.contact.solve(W, q, mu, law="ccp", solver=solver, tolerance=1e-8, max_iterations=400_000)
    assert best.converged
    assert answer.objective == pytest.approx(best.objective, rel=1e-6)


WRONG = {
    "shape": (np.eye(4), np.zeros(4), 0.3),
    "lengths": (np.eye(6), np.zeros(3), 0.3),
    "nan": (np.eye(3), [np.nan, 0.0, 0.0], 0.3),
    "asymmetric": (np.eye(3) + np.diag([0.5, 0.0], 1), np.zeros(3), 0.3),
    "friction": (np.eye(3), np.zeros(3), -0.1),
    "diagonal": (np.zeros((3, 3)), np.zeros(3), 0.3),
}


@pytest.mark.parametrize("given", WRONG.values(), ids=WRONG)
def test_what_is_no_problem_is_refused(given):
    with pytest.raises(cesim.InputError):
        cesim.contact.solve(*given)


@pytest.mark.parametrize(
    "options", [{"solver": "magic"}, {"law": "tresca"}, {"tolerance": -1.0}, {"max_iterations": 0}]
)
def test_options_that_do_not_exist_are_refused(options):
    with pytest.raises(cesim.InputError):
        cesim.contact.solve(np.eye(3), np.zeros(3), 0.3, **options)


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
