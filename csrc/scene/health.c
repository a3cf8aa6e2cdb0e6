/* scene/health.c - how well the contact problems of a step were solved, by which solver. */
#include <math.h>
#include <string.h>

#include "../base/vec3.h"
#include "scene.h"

const char *ces_solver_name(int solver)
{
    return solver == CES_CLOSED_FORM ? "closed form" : ces_cone_solver_at((size_t)solver - 1)->name;
}

int ces_solver_index(const char *name)
{
    for (size_t k = 0; k < ces_cone_solver_count(); k++) {
        if (ces_cone_solver_at(k)->name == name || strcmp(ces_cone_solver_at(k)->name, name) == 0) {
            return (int)k + 1;
        }
    }
    return CES_CLOSED_FORM;
}

static void add_use(ces_SolverUse *use, const ces_IslandReport *report, uint64_t contacts)
{
    use->islands++;
    use->contacts += contacts;
    use->iterations += report->iterations;
    use->unconverged += !report->converged;
    use->residual = ces_max(use->residual, report->residual);
    use->seconds += report->seconds;
}

/* How far the fastest grain turned in the step. A sphere looks the same however it turns; any other is taken in the orientation
 * of the start of its step (docs/numerics.md 2), which beyond a radian is another body. */
static double greatest_turn(const ces_Scene *scene)
{
    const ces_Particles *particles = &scene->particles;
    double square = 0.0;
    if (scene->shapes.only_spheres || !scene->def.rotation) {
        return 0.0;
    }
    for (size_t row = 0; row < particles->count; row++) {
        const double *spin = &particles->angular_velocity[3 * row];
        if (scene->shapes.list[particles->shape[row]].def.kind != CES_SPHERE) {
            square = ces_max(square, ces_dot(spin, spin));
        }
    }
    return scene->def.step * sqrt(square);
}

void ces_note_health(ces_Scene *scene)
{
    ces_Health *health = &scene->health;
    const ces_Contacts *contacts = &scene->contacts;
    const ces_IslandReport *reports = scene->reports.data;
    health->steps++;
    health->contact_rows += contacts->count;
    health->islands += scene->islands.count;
    health->last_contacts = 0;
    health->last_iterations = 0;
    health->last_residual = 0.0;
    health->last_penetration = 0.0;
    bool converged = true;
    for (size_t i = 0; i < scene->islands.count; i++) {
        health->last_iterations =
            reports[i].iterations > health->last_iterations ? reports[i].iterations : health->last_iterations;
        health->last_residual = ces_max(health->last_residual, reports[i].residual);
        converged = converged && reports[i].converged;
        const ces_Island *island = &scene->islands.list[i];
        const uint64_t count = island->pair_last - island->pair_first + island->surface_last - island->surface_first;
        health->visits += reports[i].iterations * count;
        add_use(&health->solvers[reports[i].solver], &reports[i], count);
    }
    for (size_t k = 0; k < contacts->count; k++) {
        const ces_Contact *contact = &contacts->list[k];
        double radius = 0.5 * scene->particles.diameter[contact->a];
        if (k < contacts->pair_count) {
            radius = ces_min(radius, 0.5 * scene->particles.diameter[contact->b]);
        }
        health->last_contacts += ces_contact_push(contact) > 0.0;
        health->last_penetration = ces_max(health->last_penetration, -contact->gap);
        health->penetration_ratio = ces_max(health->penetration_ratio, -contact->gap / radius);
    }
    health->last_residual += scene->mechanism.lag;
    converged = converged && scene->mechanism.lag <= scene->tolerance;
    health->turn = ces_max(health->turn, greatest_turn(scene));
    health->joint_drift = ces_max(health->joint_drift, scene->mechanism.drift);
    health->pair_force += scene->crowd.error.force;
    health->pair_defect += scene->crowd.error.defect;
    health->active_contacts += health->last_contacts;
    health->iterations += health->last_iterations;
    health->unconverged += !converged;
    health->residual = ces_max(health->residual, health->last_residual);
    health->penetration = ces_max(health->penetration, health->last_penetration);
}
