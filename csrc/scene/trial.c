/* scene/trial.c - what solvers would do with the contact problem of the next step: for comparing them on real problems. */
#include "../base/status.h"
#include "../base/vec3.h"
#include "scene.h"

/* The stages that make the problem write scratch only, so a step that is not finished has changed nothing. */
static ces_Status state_problem(ces_Scene *scene, ces_Error *error)
{
    typedef ces_Status Stage(ces_Scene *, ces_Error *);
    static Stage *const stages[] = {ces_stage_feed, ces_stage_charge, ces_stage_force, ces_stage_detect};
    for (size_t k = 0; k < sizeof stages / sizeof stages[0]; k++) {
        const ces_Status status = stages[k](scene, error);
        if (status != CES_OK) {
            return status;
        }
    }
    return CES_OK;
}

static void forget_impulses(ces_Contacts *contacts)
{
    for (size_t k = 0; k < contacts->count; k++) {
        ces_Contact *contact = &contacts->list[k];
        contact->spin_impulse = 0.0;
        for (int axis = 0; axis < 3; axis++) {
            contact->impulse[axis] = contact->roll_impulse[axis] = 0.0;
        }
    }
}

static void solve_all(ces_Scene *scene, ces_Trial *trial)
{
    double (*const clock)(void) = scene->def.clock;
    trial->converged = true;
    for (size_t i = 0; i < scene->islands.count; i++) {
        const double before = clock != NULL ? clock() : 0.0;
        const ces_ConeReport report = ces_rigid_solve(&scene->rigid, i);
        trial->seconds += clock != NULL ? clock() - before : 0.0;
        trial->objective += ces_rigid_objective(&scene->rigid, i);
        trial->iterations = report.iterations > trial->iterations ? report.iterations : trial->iterations;
        trial->residual = report.residual > trial->residual ? report.residual : trial->residual;
        trial->converged = trial->converged && report.converged;
    }
}

ces_Status ces_scene_try_solver(ces_Scene *scene, const char *name, uint32_t max_iterations, double tolerance,
                                bool cold, ces_Trial *trial, ces_Error *error)
{
    const ces_ConeSolver *solver = ces_cone_solver_find(name);
    *trial = (ces_Trial){0};
    if (solver == NULL) {
        return ces_fail(error, CES_INPUT, "solver is '%s', no such solver", name);
    }
    ces_Status status = ces_check_range(error, "tolerance", tolerance, 0.0, 1e2, "m/s");
    if (status == CES_OK) {
        status = ces_check_range(error, "max_iterations", max_iterations, 1.0, 1e9, "");
    }
    if (status == CES_OK) {
        status = state_problem(scene, error);
    }
    if (status != CES_OK) {
        return status;
    }
    if (cold) {
        forget_impulses(&scene->next_contacts);
    }
    ces_RigidInput input = ces_rigid_input(scene);
    input.solver = solver;
    input.tolerance = tolerance;
    input.max_iterations = max_iterations;
    ces_mechanism_prepare(&scene->mechanism, ces_scene_time(scene), scene->def.step, &scene->next_contacts);
    bool enough = ces_islands_find(&scene->islands, &scene->next_contacts, scene->rows, &scene->mechanism);
    for (size_t i = 0; enough && i < scene->islands.count; i++) {
        scene->islands.list[i].packed = false; /* the table of solvers works on rigid bodies */
    }
    if (!enough || !ces_rigid_build(&scene->rigid, &input)) {
        return ces_fail(error, CES_MEMORY, "no memory for the problem of %zu contacts", scene->next_contacts.count);
    }
    trial->contacts = scene->next_contacts.count;
    solve_all(scene, trial);
    return CES_OK;
}
