"""Problems of the Frictional Contact Library, by every solver.

The four files are not part of the project. The environment variable CESIM_FCLIB names their folder; they come from the
test data of Siconos and FCLib (https://github.com/FrictionalContactLibrary/fclib).
"""

import os
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from contact_problems import LAWS, SOLVERS, natural_map

import cesim

FOLDER = os.environ.get("CESIM_FCLIB", "")
pytestmark = pytest.mark.skipif(not FOLDER, reason="CESIM_FCLIB names no folder with FCLib's problems")

STACK, BOXES = "local_problem_test", "Box_Stacks-i0122-82-5"
SPHERES, CUBE = "spheres-in-a-box-98-i10000-256-10", "CubeH8"
ACCELERATED = ("auto", "apgs", "apgd", "direct")
OBJECTIVE = {STACK: -1.44354200517e-6, BOXES: -2.32091820138e-5}  # J, of the convex problem


@cache
def problem(name):
    return cesim.contact.read_fclib(Path(FOLDER, f"{name}.hdf5"))


def solved(name, solver, law="coulomb", **options):
    """The answer; its error is recomputed here, and its tolerance kept if it says so."""
    given = problem(name)
    answer = cesim.contact.solve(given.W, given.q, given.mu, law=law, solver=solver, **options)
    error = natural_map(given.W, given.q, given.mu, law, answer.impulse)
    assert answer.natural_map == pytest.approx(error, rel=1e-3, abs=1e-13)
    assert np.allclose(answer.velocity, given.W @ answer.impulse + given.q, rtol=0, atol=1e-13)
    if answer.converged:
        assert error <= options.get("tolerance", 1e-8)
    return answer


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("solver", ACCELERATED)
@pytest.mark.parametrize("name", [STACK, BOXES, CUBE])
def test_to_1e8(name, solver, law):
    assert solved(name, solver, law).converged


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("solver", sorted(set(SOLVERS) - set(ACCELERATED)))
@pytest.mark.parametrize("name", [BOXES, CUBE])
def test_the_plain_methods_solve_the_easy_ones_to_1e8(name, solver, law):
    assert solved(name, solver, law).converged


@pytest.mark.parametrize(("solver", "reached"), [("pgs", 1e-3), ("jacobi", 1e-3), ("spg", 2e-4)])
def test_the_plain_methods_stall_on_the_hyperstatic_stack_and_say_so(solver, reached):
    answer = solved(STACK, solver)
    assert not answer.converged
    assert answer.natural_map < reached


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("solver", [name for name in SOLVERS if name != "jacobi"])
def test_the_spheres_to_1e4(solver, law):
    assert solved(SPHERES, solver, law, tolerance=1e-4).natural_map <= 1e-4


@pytest.mark.parametrize("law", LAWS)
def test_jacobi_comes_within_2e4_of_the_spheres_and_says_that_it_is_not_there(law):
    answer = solved(SPHERES, "jacobi", law, tolerance=1e-4)
    assert not answer.converged
    assert 1e-4 < answer.natural_map < 2e-4


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("solver", ["auto", "apgs", "direct"])
def test_the_spheres_even_to_1e8(solver, law):
    assert solved(SPHERES, solver, law).converged


@pytest.mark.parametrize("name", [STACK, BOXES])
@pytest.mark.parametrize("solver", ACCELERATED)
def test_the_least_energy_of_the_convex_problem(name, solver):
    assert solved(name, solver, "ccp").objective == pytest.approx(OBJECTIVE[name], rel=1e-6)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", [STACK, BOXES, SPHERES])
def test_the_direct_solver_reaches_1e12(name, law):
    answer = solved(name, "direct", law, tolerance=1e-12, max_iterations=30_000)
    assert answer.converged


@pytest.mark.parametrize(("name", "within"), [(BOXES, 3e-8), (STACK, 3e-7)])
def test_the_velocities_that_the_files_give(name, within):
    """To what the files' own solutions are good for: their velocities fulfil the law to about so much."""
    assert np.abs(solved(name, "direct").velocity - problem(name).velocity).max() < within


def test_a_file_that_is_no_problem_is_refused(tmp_path):
    (tmp_path / "x.hdf5").write_bytes(b"no")
    with pytest.raises(cesim.InputError, match=r"x\.hdf5 is no problem of FCLib"):
        cesim.contact.read_fclib(tmp_path / "x.hdf5")
