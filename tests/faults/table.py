"""Twenty-odd deliberate faults: small changes to the sources that a test must notice.

A fault replaces text that occurs once in its file. `run.py` applies them one by one to a copy of the tree, builds it,
and runs the test named here: it must fail, and pass without the fault.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]


@dataclass(frozen=True)
class Fault:
    """A change to one file, and the test that notices it."""

    what: str
    file: str
    changes: tuple[tuple[str, str], ...]  # before, after
    test: str

    def applied(self, text: str) -> str:
        """The file's text with the fault in it; an error where the text to be replaced is not there exactly once."""
        for before, after in self.changes:
            if text.count(before) != 1:
                raise ValueError(f"{self.what}: {self.file} has {text.count(before)} times {before!r}")
            text = text.replace(before, after)
        return text


def case(identity: str) -> str:
    """The test of a hard case."""
    return f"tests/stability/test_hard_cases.py::test_a_hard_case_keeps_its_bounds[{identity}]"


PAIRS = "tests/physics/test_pair_coulomb.py::"
PGS, RIGID = "csrc/contact/solver_pgs.c", "csrc/contact/rigid.c"
CANDIDATE, SHAPES = "csrc/contact/candidate.c", "csrc/data/shapes.c"
COMPOSITES = "tests/physics/test_composites.py"

FAULTS = (
    # ---- contact laws
    Fault(
        "friction pushes along the slip",
        PGS,
        (("ces_add_scaled(tangent, -1.0 / visit->w_t, slip);",
          "ces_add_scaled(tangent, 1.0 / visit->w_t, slip);"),),
        case("11"),
    ),
    Fault(
        "friction is not cut to its cone",
        PGS,
        (("    ces_project_disc(tangent, visit->mu * push);\n    return push;", "    return push;"),),
        case("11"),
    ),
    Fault(
        "a grain flies off the drum along its last chord",
        "csrc/scene/move.c",
        (("velocity[k] += 0.5 * (velocity[k] - start[k]);", "velocity[k] += 0.0 * start[k];"),),
        "tests/physics/test_leaving_the_drum.py::test_a_grain_that_leaves_lands_where_it_should_to_second_order[0.0-0.0]",
    ),
    Fault(
        "Newton on a rolling contact stops early",
        "csrc/contact/block.c",
        (("STILL = 1e-9;", "STILL = 1e-3;"),),
        "tests/stability/test_solvers.py::test_a_rolling_contact_alone_is_solved[True-coulomb]",
    ),
    Fault(
        "contacts pull",
        PGS,
        (("    push = ces_max(push, 0.0);\n", ""),),
        case("25"),
    ),
    Fault(
        "De Saxcé's term is forgotten for bodies that are no spheres",
        "csrc/contact/cone_problem.c",
        (("shift += discs[d].limit * ces_disc_length(&discs[d], u);",
          "shift += 0.0 * ces_disc_length(&discs[d], u);"),),
        case("06"),
    ),
    Fault(
        "ccp forgets the weight of the tangential rows",
        PGS,
        (("const double stiffness = visit->w_t / visit->w_n;", "const double stiffness = 1.0;"),),
        case("11"),
    ),
    Fault(
        "the second grain of a pair feels no reaction",
        PGS,
        (("turn_body(visit->b, problem->spin_mobility, -1.0,",
          "turn_body(visit->b, problem->spin_mobility, 0.0,"),),
        case("23"),
    ),
    Fault(
        "arms of contacts have the wrong sign",
        RIGID,
        (("    ces_cross(arm, impulse, turn);\n", "    ces_cross(impulse, arm, turn);\n"),),
        case("15"),
    ),
    Fault(
        "an island that ran out of sweeps says it converged",
        PGS,
        (("report.converged = report.residual <= problem->tolerance;", "report.converged = true;"),),
        case("03"),
    ),
    # ---- bias, restitution, recovery
    Fault(
        "overlap is taken back through the velocity",
        CANDIDATE,
        (("        contact->bias = 0.0;\n", "        contact->bias = approach->start_gap / input->step;\n"),),
        case("21"),
    ),
    Fault(
        "contacts that are only near push",
        CANDIDATE,
        (("        const double gap_at_start = approach->gap - approach->fraction * closing.path;\n",
          "        const double gap_at_start = 0.0 * approach->gap;\n"),),
        case("24"),
    ),
    Fault(
        "the threshold of restitution has a length typed into it",
        CANDIDATE,
        (("IMPACT_SPEED * sqrt(input->gravity * diameter)",
          "IMPACT_SPEED * sqrt(input->gravity * (1e-3 + 0.0 * diameter))"),),
        case("33"),
    ),
    Fault(
        "restitution acts on the speed at the end of the step, not at the touch",
        CANDIDATE,
        (("closing.start + approach->fraction * closing.change;", "closing.start + closing.change;"),),
        case("25"),
    ),
    # ---- finding contacts
    Fault(
        "only the end of a path is searched",
        "csrc/contact/detect.c",
        (("box.lower[k] = ces_min(from, to) - around;", "box.lower[k] = to - around;"),
         ("box.upper[k] = ces_max(from, to) + around;", "box.upper[k] = to + around;")),
        case("23"),
    ),
    Fault(
        "pairs come in the order of the threads",
        "csrc/contact/broad_phase.c",
        ((("    sort_pairs(grid->pairs.data, grid->sorted.data, total, grid->starts.data, count, false);\n"
          "    sort_pairs(grid->sorted.data, grid->pairs.data, total, grid->starts.data, count, true);\n"),
          ("    if (threads == 1) {\n"
          "        sort_pairs(grid->pairs.data, grid->sorted.data, total, grid->starts.data, count, false);\n"
          "        sort_pairs(grid->sorted.data, grid->pairs.data, total, grid->starts.data, count, true);\n"
          "    }\n")),),
        "tests/stability/test_determinism.py::test_bits_do_not_depend_on_threads",
    ),
    Fault(
        "warm starts are off by one contact",
        "csrc/data/contacts.c",
        (("memcpy(contact->impulse, same->impulse, sizeof contact->impulse);",
          "memcpy(contact->impulse, (same + 1 < old_end ? same + 1 : same)->impulse, sizeof contact->impulse);"),),
        "tests/stability/test_contacts.py::test_warm_starting_spares_a_column_most_of_its_sweeps",
    ),
    Fault(
        "corners and parallel edges of convex grains push as rounding says",
        "csrc/contact/convex_manifold.c",
        (("    return angle > ALIKE && ", "    return false && angle > ALIKE && "),),
        case("09"),
    ),
    Fault(
        "overlaps of convex grains get no more sweeps than those of spheres",
        "csrc/contact/correction.c",
        (("CONVEX_SWEEPS = 200", "CONVEX_SWEEPS = 10"),),
        "tests/stability/test_convex_grains.py::test_long_cylinders_that_fall_into_a_pile_hardly_overlap",
    ),
    # ---- rotation
    Fault(
        "quaternions are not normalised",
        "csrc/base/vec3.h",
        (("const double inverse = 1.0 / sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);",
          "const double inverse = 1.0;"),),
        case("41"),
    ),
    Fault(
        "free bodies keep their spin instead of their angular momentum",
        SHAPES,
        (("    if (gyroscopic) {\n", "    if (!gyroscopic) {\n"),),
        case("13"),
    ),
    Fault(
        "a body that was hit takes its new angular velocity along instead of its angular momentum",
        "csrc/scene/move.c",
        (("    if (gyroscopic) {\n        ces_carry_spin", "    if (!gyroscopic) {\n        ces_carry_spin"),),
        "tests/stability/test_rigid_bodies.py::test_a_collision_keeps_the_angular_momentum_whatever_the_step",
    ),
    Fault(
        "fast rotation is not cut into parts",
        SHAPES,
        (("    const int parts = parts_of(moments, step, momentum);\n",
          "    const int parts = parts_of(moments, 0.0 * step, momentum);\n"),),
        case("14"),
    ),
    Fault(
        "the inertia of a body does not turn with it",
        SHAPES,
        (("        ces_rotate(orientation, axis, axes[k]);\n",
          "        (void)orientation;\n        memcpy(axes[k], axis, sizeof axis);\n"),),
        case("11"),
    ),
    # ---- flight and fields
    Fault(
        "drag is stepped explicitly",
        "csrc/scene/forces.c",
        (("        *phi1 = -expm1(-z) / z;\n", "        *phi1 = 1.0 - 0.5 * z;\n"),),
        case("28"),
    ),
    Fault(
        "the force is taken at the start of the path",
        "csrc/scene/forces.c",
        (("    ces_add_scaled(grain->position, 0.5 * h * *phi1, grain->relative_velocity);\n", ""),),
        "tests/physics/test_flight.py::test_the_error_of_the_landing_shrinks_with_the_square_of_the_step",
    ),
    Fault(
        "a composite is looked at as it lay at the start of the step",
        "csrc/scene/forces.c",
        (("    whole.orientation = q;\n", "    whole.orientation = grain->orientation;\n"),),
        f"{COMPOSITES}::test_a_charged_dumbbell_in_the_field_moves_as_two_charges_on_a_rigid_rod",
    ),
    Fault(
        "the metal of a composite charges whatever touches the drum",
        "csrc/scene/composite.h",
        (("(whole->touched >> (CES_PHASE_BITS * (f + 1)))", "whole->touched"),),
        f"{COMPOSITES}::test_metal_that_touches_the_drum_takes_the_charge_of_a_ball_of_its_size_and_no_other_does",
    ),
    Fault(
        "a composite touches with its average material",
        "csrc/contact/candidate.h",
        (("? shape->sphere_materials[part]", "? (size_t)shape->material"),),
        f"{COMPOSITES}::test_the_sphere_that_touches_brings_the_coefficients_of_its_own_material",
    ),
    Fault(
        "the image force falls with the first power of the distance",
        "csrc/effects/image_force.c",
        (("CES_VACUUM_PERMITTIVITY * distance * distance);", "CES_VACUUM_PERMITTIVITY * distance);"),),
        case("17"),
    ),
    Fault(
        "forces of charges are not softened at contact",
        "csrc/field/charge_set.c",
        (("ces_max(distance2, contact * contact)", "ces_max(distance2, 1e-30 * contact * contact)"),),
        case("19"),
    ),
    Fault(
        "of two cells the target is always opened",
        "csrc/field/charge_lists.c",
        (("return a->reach != b->reach ? a->reach > b->reach : pair.target <", "return a->child || pair.target <"),),
        PAIRS + "test_the_tree_is_as_near_as_its_opening_says_and_keeps_the_momentum",
    ),
    Fault(
        "the expansion of cells lacks its highest terms",
        "csrc/field/multipole.c",
        (("sum[lane] += moment[lane]", "sum[lane] += (table->products[k].sum < 20) * moment[lane]"),),
        PAIRS + "test_the_error_of_the_tree_falls_with_the_fourth_power_of_the_opening",
    ),
    Fault(
        "a charge is pushed by its own image, too",
        "csrc/field/charges.c",
        (("ces_pairs_leave_own_image(&work->set, i, force);", "(void)i;"),),
        PAIRS + "test_the_drum_mirrors_every_charge_but_its_own",
    ),
    Fault(
        "forces between grains are taken at the start of their paths",
        "csrc/scene/crowd.c",
        (
            (
                "ces_middle_of_path(scene, row, &position[3 * row]);",
                "memcpy(&position[3 * row], &scene->particles.position[3 * row], 3 * sizeof(double));",
            ),
        ),
        PAIRS + "test_like_charges_from_rest_part_as_the_closed_form_says_at_second_order",
    ),
    Fault(
        "Pauthenier's charge has the wrong factor of permittivity",
        "csrc/effects/corona_charging.c",
        ((("double ces_pauthenier_charge(double radius, double permittivity, double field)\n{\n"
          "    const double k = permittivity / (permittivity + 2.0);"),
          ("double ces_pauthenier_charge(double radius, double permittivity, double field)\n{\n"
          "    const double k = permittivity / (permittivity + 1.0);")),),
        case("29"),
    ),
    Fault(
        "a step that ends in the corona counts in full",
        "csrc/effects/corona_charging.c",
        (("fmin(inside / (most - least), 1.0)", "1.0"),),
        case("30"),
    ),
    # ---- books
    Fault(
        "numbers that are not finite are let through",
        "csrc/scene/forces.c",
        (("if (!(fabs(columns[c].values[k]) <= 1e12)) {", "if (fabs(columns[c].values[k]) < 0.0) {"),),
        case("37"),
    ),
    Fault(
        "what is lost is counted, and not weighed",
        "csrc/scene/collect.c",
        (("            scene->ledger.lost += units;\n", ""),),
        "tests/stability/test_hard_numbers.py::"
        "test_a_grain_at_three_times_the_speed_of_light_leaves_the_bounds_and_is_counted",
    ),
    Fault(
        "the drum turns the other way",
        "cesim/scene/surfaces.py",
        (("role=\"ground\", angular_speed=-drum.speed)", "role=\"ground\", angular_speed=drum.speed)"),),
        case("01"),
    ),
    Fault(
        "intervals take every grain for independent",
        "cesim/statistics.py",
        (("        n_eff = np.minimum(np.where(variance > 0, value * (1 - value) / variance, np.inf), n_kish)\n",
          "        n_eff = n_kish + 0.0 * variance\n"),),
        "tests/unit/test_statistics.py",
    ),
)  # fmt: skip
