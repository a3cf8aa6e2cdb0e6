/* scene/step.c - a step: a table of stages, and the loop that runs, times and checks each. */
#include <math.h>
#include <string.h>

#include "../base/parallel.h"
#include "../base/status.h"
#include "../base/vec3.h"
#include "scene.h"

enum { ROW_BLOCK = 256, ISLAND_BLOCK = 32, MOST_BIRTHS = 1 << 20 };
#define MOST_BIRTH_OVERLAP 0.05 /* of a diameter */

/* Up to and with "solve" a stage writes only scratch and rows that are not counted yet, so a failure changes nothing;
 * from "move" on nothing can fail. */
static const struct {
    const char *name;
    ces_Status (*run)(ces_Scene *scene, ces_Error *error);
} stages[CES_STAGE_COUNT] = {
    {"feed", ces_stage_feed},       {"charge", ces_stage_charge}, {"force", ces_stage_force},
    {"detect", ces_stage_detect},   {"solve", ces_stage_solve},   {"move", ces_stage_move},
    {"collect", ces_stage_collect},
};

const char *ces_stage_name(int stage)
{
    return stages[stage].name;
}

ces_Status ces_scene_step(ces_Scene *scene, ces_Error *error)
{
    double (*const clock)(void) = scene->def.clock;
    double before = clock != NULL ? clock() : 0.0;
    for (int stage = 0; stage < CES_STAGE_COUNT; stage++) {
        const ces_Status status = stages[stage].run(scene, error);
        if (status != CES_OK) {
            return status;
        }
        const double now = clock != NULL ? clock() : 0.0;
        scene->stage_seconds[stage] += now - before;
        before = now;
    }
    return CES_OK;
}

/* ---- feed: births are written behind the rows that count --------------------------------------------------------------- */

ces_Status ces_stage_feed(ces_Scene *scene, ces_Error *error)
{
    ces_Particles *particles = &scene->particles;
    const double time = ces_scene_time(scene);
    size_t count = 0;
    if (scene->feeder != NULL) {
        const ces_Status status = ces_feeder_plan(scene->feeder, time, MOST_BIRTHS, &scene->births, &count, error);
        if (status != CES_OK) {
            return status;
        }
    }
    scene->rows = particles->count + count;
    scene->born = count;
    if (!ces_particles_reserve(particles, scene->rows) ||
        !ces_pool_reserve(&scene->start_position, scene->rows, 3 * sizeof(double)) ||
        !ces_pool_reserve(&scene->start_velocity, scene->rows, 3 * sizeof(double)) ||
        !ces_pool_reserve(&scene->gone, scene->rows, 1) ||
        !ces_pool_grow(&scene->landing_pool, scene->landing_count + scene->rows, sizeof(ces_Landing),
                       scene->landing_count * sizeof(ces_Landing))) {
        return ces_fail(error, CES_MEMORY, "no memory for %zu grains", scene->rows);
    }
    for (size_t k = 0; k < count; k++) {
        const ces_Birth *birth = &scene->births[k];
        ces_Newborn grain = {
            .mass = ces_sphere_mass(scene->materials[birth->material].density, birth->diameter),
            .charge = birth->charge,
            .diameter = birth->diameter,
            .birth = birth->time,
            .material = birth->material,
            .shape = birth->shape,
        };
        memcpy(grain.orientation, birth->orientation, sizeof grain.orientation);
        ces_birth_at(birth, scene->def.gravity, time, grain.position, grain.velocity);
        ces_particles_write(particles, particles->count + k, particles->next_id + (int64_t)k, &grain);
    }
    return CES_OK;
}

/* ---- detect ------------------------------------------------------------------------------------------------------------- */

void ces_place_surfaces(ces_Scene *scene, double time, const ces_Motion *to)
{
    for (size_t s = 0; s < scene->def.surface_count; s++) {
        const int32_t part = scene->surfaces[s].def.part;
        if (part < 0) {
            ces_surface_place(&scene->surfaces[s], time, scene->def.step);
        } else {
            ces_surface_follow(&scene->surfaces[s], &scene->mechanism.now[part], &to[part], scene->def.step);
        }
    }
}

/* The feeder keeps its grains clear of each other; what has piled up under the outlet it does not know. */
static ces_Status check_births(const ces_Scene *scene, ces_Error *error)
{
    const ces_Particles *particles = &scene->particles;
    for (size_t k = 0; k < scene->next_contacts.count; k++) {
        const ces_Contact *contact = &scene->next_contacts.list[k];
        const uint32_t newest =
            k < scene->next_contacts.pair_count && contact->b > contact->a ? contact->b : contact->a;
        if (newest >= particles->count && contact->gap < -MOST_BIRTH_OVERLAP * particles->diameter[newest]) {
            return ces_fail(
                error, CES_FEED,
                "the outlet is blocked: grain %lld would be fed %g m inside %s; feed.rate is more than flows away",
                (long long)particles->id[newest], -contact->gap,
                contact->id_b < 0 ? scene->surfaces[contact->b].def.name : "another grain");
        }
    }
    return CES_OK;
}

/* NULL where no grain's spin changes on its own. */
static const double *free_spin_of(const ces_Scene *scene)
{
    return scene->shapes.only_spheres ? NULL : scene->free_spin.data;
}

ces_Status ces_stage_detect(ces_Scene *scene, ces_Error *error)
{
    const ces_SceneDef *def = &scene->def;
    ces_place_surfaces(scene, ces_scene_time(scene), scene->mechanism.free);
    const ces_DetectInput input = {
        .particles = &scene->particles,
        .count = scene->rows,
        .shapes = scene->shapes.list,
        .only_spheres = scene->shapes.only_spheres,
        .composites = scene->shapes.composites,
        .displacement = scene->displacement.data,
        .free_velocity = scene->free_velocity.data,
        .free_spin = free_spin_of(scene),
        .free_orientation = scene->free_orientation.data,
        .surfaces = scene->surfaces,
        .surface_count = def->surface_count,
        .table = &scene->table,
        .step = def->step,
        .gravity = ces_norm(def->gravity),
        .most_restitution = scene->most_restitution,
        .grain_contact = def->grain_contact,
        .threads = def->threads,
    };
    /* The new list takes the old one's place only when the step succeeds: see ces_stage_move. */
    if (!ces_detect(&scene->detector, &input, &scene->next_contacts)) {
        return ces_fail(error, CES_MEMORY, "no memory for the contacts of %zu grains", scene->rows);
    }
    ces_contacts_inherit(&scene->next_contacts, &scene->contacts);
    return check_births(scene, error);
}

/* ---- solve: island by island --------------------------------------------------------------------------------------------- */

/* The kernel for spheres knows neither other shapes nor spinning friction. */
static void choose_forms(ces_Scene *scene)
{
    const ces_Contacts *contacts = &scene->next_contacts;
    for (size_t i = 0; i < scene->islands.count; i++) {
        ces_Island *island = &scene->islands.list[i];
        island->packed = scene->packs && !scene->spinning && island->assembly_first == island->assembly_last;
        for (uint32_t k = island->pair_first; k < island->pair_last && island->packed; k++) {
            const ces_Contact *contact = &contacts->list[scene->islands.pair_order[k]];
            island->packed = ces_is_sphere(scene, contact->a) && ces_is_sphere(scene, contact->b);
        }
        for (uint32_t k = island->surface_first; k < island->surface_last && island->packed; k++) {
            island->packed = ces_is_sphere(scene, contacts->list[scene->islands.surface_order[k]].a);
        }
    }
}

static uint32_t contacts_of(const ces_Island *island)
{
    return island->pair_last - island->pair_first + island->surface_last - island->surface_first;
}

static double now(const ces_Scene *scene)
{
    return scene->def.clock != NULL ? scene->def.clock() : 0.0;
}

static void solve_packed_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    ces_Scene *scene = context;
    ces_IslandReport *reports = scene->reports.data;
    for (size_t i = first; i < last; i++) {
        const ces_Island *island = &scene->islands.list[i];
        if (!island->packed) {
            continue;
        }
        const bool alone = contacts_of(island) == 1;
        const double before = alone ? 0.0 : now(scene);
        const ces_SolverReport report = ces_solve_packed(&scene->problem, island);
        reports[i] = (ces_IslandReport){.iterations = reports[i].iterations + report.iterations,
                                        .solver = report.exact ? CES_CLOSED_FORM : ces_solver_index("pgs"),
                                        .residual = report.residual,
                                        .seconds = reports[i].seconds + (alone ? 0.0 : now(scene) - before),
                                        .converged = report.converged};
    }
}

static void solve_rigid_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    ces_Scene *scene = context;
    ces_IslandReport *reports = scene->reports.data;
    for (size_t i = first; i < last; i++) {
        if (scene->islands.list[i].packed) {
            continue;
        }
        const double before = now(scene);
        const ces_ConeReport report = ces_rigid_solve(&scene->rigid, i);
        reports[i].iterations += report.iterations;
        reports[i].solver = ces_solver_index(report.name);
        reports[i].residual = report.residual;
        reports[i].converged = report.converged;
        reports[i].seconds += now(scene) - before;
    }
}

/* Islands of spheres on which the sweeps that "auto" allows have not arrived go to the table, from where the sweeps ended. */
static void hand_over(ces_Scene *scene)
{
    const ces_IslandReport *reports = scene->reports.data;
    if (scene->problem.max_iterations == scene->def.max_iterations) {
        return; /* the sweeps were all that is allowed */
    }
    for (size_t i = 0; i < scene->islands.count; i++) {
        ces_Island *island = &scene->islands.list[i];
        island->packed = island->packed && reports[i].converged;
    }
}

ces_RigidInput ces_rigid_input(ces_Scene *scene)
{
    const ces_SceneDef *def = &scene->def;
    return (ces_RigidInput){
        .contacts = &scene->next_contacts,
        .islands = &scene->islands,
        .particles = &scene->particles,
        .shapes = scene->shapes.list,
        .mechanism = &scene->mechanism,
        .rows = scene->rows,
        .free_velocity = scene->free_velocity.data,
        .free_spin = free_spin_of(scene),
        .rotation = def->rotation,
        .solver = scene->solver,
        .law = def->contact_law,
        .tolerance = scene->tolerance,
        .max_iterations = def->max_iterations,
    };
}

/* All islands once, from the impulses that their contacts have. False: out of memory. */
static bool solve_islands(ces_Scene *scene)
{
    ces_Contacts *contacts = &scene->next_contacts;
    choose_forms(scene);
    if (!ces_problem_build(&scene->problem, contacts, &scene->islands, &scene->particles, scene->rows,
                           scene->free_velocity.data, scene->rolling)) {
        return false;
    }
    ces_parallel_for(scene->islands.count, ISLAND_BLOCK, scene->def.threads, solve_packed_block, scene);
    ces_problem_finish(&scene->problem, contacts);
    hand_over(scene);
    const ces_RigidInput input = ces_rigid_input(scene);
    if (!ces_rigid_build(&scene->rigid, &input)) {
        return false;
    }
    ces_parallel_for(scene->islands.count, ISLAND_BLOCK, scene->def.threads, solve_rigid_block, scene);
    ces_rigid_finish(&scene->rigid, contacts, scene->problem.bodies);
    return true;
}

/* Once, or by turns with the parts that grains hardly move until these stay. */
static bool solve_problems(ces_Scene *scene)
{
    ces_Mechanism *mechanism = &scene->mechanism;
    ces_Contacts *contacts = &scene->next_contacts;
    ces_mechanism_prepare(mechanism, ces_scene_time(scene), scene->def.step, contacts);
    ces_turns_start(mechanism, contacts, scene->surfaces, &scene->particles);
    if (!ces_islands_find(&scene->islands, contacts, scene->rows, mechanism) ||
        !ces_pool_reserve(&scene->reports, scene->islands.count, sizeof(ces_IslandReport)) ||
        !ces_pool_reserve(&scene->moved_in, scene->rows, sizeof(uint32_t))) {
        return false;
    }
    ces_IslandReport *reports = scene->reports.data;
    for (size_t i = 0; i < scene->islands.count; i++) {
        reports[i] = (ces_IslandReport){0};
    }
    for (int turn = 0; turn <= CES_MOST_TURNS; turn++) {
        mechanism->lag = ces_turns_follow(mechanism, contacts, scene->surfaces);
        if (turn > 0 && (mechanism->lag <= CES_TURN_SHARE * scene->tolerance || turn == CES_MOST_TURNS)) {
            break;
        }
        if (!solve_islands(scene)) {
            return false;
        }
    }
    return true;
}

ces_Status ces_stage_solve(ces_Scene *scene, ces_Error *error)
{
    ces_Contacts *contacts = &scene->next_contacts;
    if (!solve_problems(scene)) {
        return ces_fail(error, CES_MEMORY, "no memory for the problem of %zu contacts", contacts->count);
    }
    ces_problem_mark(&scene->problem, contacts);
    for (size_t k = 0; k < contacts->count; k++) {
        const ces_Body *body = &scene->problem.bodies[contacts->list[k].a];
        if (!isfinite(ces_dot(body->v, body->v) + ces_dot(body->s, body->s))) {
            return ces_fail(error, CES_DIVERGED, "step %llu: velocity of grain %lld is not finite after its contacts",
                            (unsigned long long)scene->step_index, (long long)contacts->list[k].id_a);
        }
    }
    return ces_mechanism_finish(&scene->mechanism, scene->def.step, contacts, scene->surfaces, error);
}
