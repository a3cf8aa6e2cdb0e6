/* scene/scene.c - grains added by hand, and what a scene tells. */
#include <math.h>
#include <string.h>

#include "../base/status.h"
#include "../base/vec3.h"
#include "composite.h"

#define MOST_GRAINS ((size_t)1 << 28)

/* ---- grains by hand ------------------------------------------------------------------------------------------------ */

static ces_Status check_grain(const ces_Scene *scene, const ces_Newborn *grain, size_t index, ces_Error *error)
{
    const struct {
        const char *what;
        const double *value;
        int width;
        double least, most;
        const char *unit;
    } rows[] = {
        {"position", grain->position, 3, -CES_FARTHEST, CES_FARTHEST, "m"},
        {"velocity", grain->velocity, 3, -1e5, 1e5, "m/s"},
        {"angular_velocity", grain->angular_velocity, 3, -1e7, 1e7, "rad/s"},
        {"diameter", &grain->diameter, 1, 1e-9, 10.0, "m"},
        {"charge", &grain->charge, 1, -1.0, 1.0, "C"},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        for (int axis = 0; axis < rows[k].width; axis++) {
            const double value = rows[k].value[axis];
            if (!(value >= rows[k].least && value <= rows[k].most)) {
                return ces_fail(error, CES_INPUT, "%s of grain %zu is %g %s, outside [%g, %g] %s", rows[k].what, index,
                                value, rows[k].unit, rows[k].least, rows[k].most, rows[k].unit);
            }
        }
    }
    if (grain->material < 0 || (size_t)grain->material >= scene->def.material_count) {
        return ces_fail(error, CES_INPUT, "material of grain %zu is %d, outside [0, %zu]", index, (int)grain->material,
                        scene->def.material_count - 1);
    }
    if (grain->shape < 0 || (size_t)grain->shape >= scene->shapes.count) {
        return ces_fail(error, CES_INPUT, "shape of grain %zu is %d, outside [0, %zu]", index, (int)grain->shape,
                        scene->shapes.count - 1);
    }
    const ces_Status fits = ces_check_composite(&scene->shapes, (size_t)grain->shape, (size_t)grain->material,
                                                "a grain that is added", error);
    if (fits != CES_OK) {
        return fits;
    }
    const double norm =
        sqrt(grain->orientation[0] * grain->orientation[0] + ces_dot(&grain->orientation[1], &grain->orientation[1]));
    if (!(fabs(norm - 1.0) < 1e-9)) {
        return ces_fail(error, CES_INPUT, "orientation of grain %zu has the norm %g, must be 1", index, norm);
    }
    return CES_OK;
}

static ces_Newborn gather(const ces_Scene *scene, size_t i, const ces_GrainsDef *grains)
{
    ces_Newborn grain = {
        .charge = grains->charge[i],
        .diameter = grains->diameter[i],
        .birth = ces_scene_time(scene),
        .material = grains->material[i],
        .shape = grains->shape != NULL ? grains->shape[i] : 0,
        .orientation = {1.0, 0.0, 0.0, 0.0},
    };
    ces_copy(&grains->position[3 * i], grain.position);
    ces_copy(&grains->velocity[3 * i], grain.velocity);
    ces_copy(&grains->angular_velocity[3 * i], grain.angular_velocity);
    if (grains->orientation != NULL) {
        memcpy(grain.orientation, &grains->orientation[4 * i], sizeof grain.orientation);
    }
    return grain;
}

ces_Status ces_scene_add(ces_Scene *scene, size_t count, const ces_GrainsDef *grains, int64_t *ids, ces_Error *error)
{
    ces_Particles *particles = &scene->particles;
    if (count > MOST_GRAINS || particles->count + count > MOST_GRAINS) {
        return ces_fail(error, CES_INPUT, "count is %zu grains, about %.3g GB; at most %zu are allowed", count,
                        400e-9 * (double)count, MOST_GRAINS);
    }
    for (size_t i = 0; i < count; i++) {
        const ces_Newborn grain = gather(scene, i, grains);
        const ces_Status status = check_grain(scene, &grain, i, error);
        if (status != CES_OK) {
            return status;
        }
    }
    if (!ces_particles_reserve(particles, particles->count + count)) {
        return ces_fail(error, CES_MEMORY, "no memory for %zu more grains", count);
    }
    for (size_t i = 0; i < count; i++) {
        ces_Newborn grain = gather(scene, i, grains);
        grain.mass = ces_sphere_mass(scene->materials[grain.material].density, grain.diameter);
        ids[i] = particles->next_id++;
        ces_particles_write(particles, particles->count++, ids[i], &grain);
        scene->ledger.fed_count++;
        scene->ledger.fed += ces_mass_units(grain.mass);
    }
    return CES_OK;
}

/* ---- what a scene tells --------------------------------------------------------------------------------------------- */

size_t ces_scene_count(const ces_Scene *scene)
{
    return scene->particles.count;
}

double ces_scene_time_at(const ces_Scene *scene, uint64_t step_index)
{
    return (double)step_index * scene->def.step;
}

double ces_scene_time(const ces_Scene *scene)
{
    return ces_scene_time_at(scene, scene->step_index);
}

uint64_t ces_scene_step_index(const ces_Scene *scene)
{
    return scene->step_index;
}

double ces_scene_step_size(const ces_Scene *scene)
{
    return scene->def.step;
}

double ces_scene_tolerance(const ces_Scene *scene)
{
    return scene->tolerance;
}

int ces_scene_threads(const ces_Scene *scene)
{
    return scene->def.threads;
}

ces_Buffer *ces_scene_column(const ces_Scene *scene, ces_ColumnName name)
{
    return scene->particles.columns[name];
}

size_t ces_scene_landing_count(const ces_Scene *scene)
{
    return scene->landing_count;
}

const ces_Landing *ces_scene_landings(const ces_Scene *scene)
{
    return scene->landing_pool.data;
}

size_t ces_scene_contact_count(const ces_Scene *scene)
{
    return scene->contacts.count;
}

void ces_scene_contacts(const ces_Scene *scene, ces_ContactInfo *infos)
{
    for (size_t k = 0; k < scene->contacts.count; k++) {
        const ces_Contact *contact = &scene->contacts.list[k];
        infos[k] = (ces_ContactInfo){.a = contact->id_a,
                                     .b = contact->id_b,
                                     .part_a = (int32_t)contact->part_a,
                                     .part_b = (int32_t)contact->part_b,
                                     .gap = contact->gap};
        ces_copy(contact->point, infos[k].point);
        ces_copy(contact->normal, infos[k].normal);
        ces_copy(contact->impulse, infos[k].impulse);
    }
}

ces_Health ces_scene_health(const ces_Scene *scene)
{
    ces_Health health = scene->health;
    const ces_Particles *particles = &scene->particles;
    health.kinetic_energy = ces_mechanism_energy(&scene->mechanism);
    for (size_t row = 0; row < particles->count; row++) {
        const double *v = &particles->velocity[3 * row], *w = &particles->angular_velocity[3 * row];
        const double *moments = scene->shapes.list[particles->shape[row]].def.moments;
        const double scale = particles->mass[row] * particles->diameter[row] * particles->diameter[row];
        double own[3]; /* in the body's frame */
        ces_rotate_back(&particles->orientation[4 * row], w, own);
        const double turning =
            moments[0] * own[0] * own[0] + moments[1] * own[1] * own[1] + moments[2] * own[2] * own[2];
        health.kinetic_energy += 0.5 * (particles->mass[row] * ces_dot(v, v) + scale * turning);
    }
    return health;
}

/* 2^-100 kg resolves every digit of a mass above 4e-15 kg; 2^27 kg fit. */
ces_Int128 ces_mass_units(double mass)
{
    return (ces_Int128)ldexp(mass, 100);
}

double ces_mass_from_units(ces_Int128 units)
{
    return ldexp((double)units, -100);
}

ces_Balance ces_scene_balance(const ces_Scene *scene)
{
    const ces_Ledger *ledger = &scene->ledger;
    ces_Int128 resident = 0;
    for (size_t row = 0; row < scene->particles.count; row++) {
        resident += ces_mass_units(scene->particles.mass[row]);
    }
    ces_Balance balance = {
        .fed_count = ledger->fed_count,
        .landed_count = ledger->landed_count,
        .resident_count = scene->particles.count,
        .lost_count = ledger->lost_count,
        .landed_mass = ces_mass_from_units(ledger->landed),
        .resident_mass = ces_mass_from_units(resident),
        .lost_mass = ces_mass_from_units(ledger->lost),
        .closed = ledger->fed == ledger->landed + resident + ledger->lost &&
                  ledger->fed_count == ledger->landed_count + scene->particles.count + ledger->lost_count,
    };
    /* The same numbers that are reported, added once: so that the identity holds for who adds them up, too. */
    balance.fed_mass = balance.closed ? balance.landed_mass + balance.resident_mass + balance.lost_mass
                                      : ces_mass_from_units(ledger->fed);
    return balance;
}

double ces_scene_stage_seconds(const ces_Scene *scene, int stage)
{
    return scene->stage_seconds[stage];
}

/* ---- parts and joints ------------------------------------------------------------------------------------------------- */

size_t ces_scene_part_count(const ces_Scene *scene)
{
    return scene->mechanism.part_count;
}

void ces_scene_parts(const ces_Scene *scene, ces_PartInfo *parts)
{
    for (uint32_t p = 0; p < scene->mechanism.part_count; p++) {
        const ces_Motion *motion = &scene->mechanism.now[p];
        memcpy(parts[p].orientation, motion->orientation, sizeof parts[p].orientation);
        ces_copy(motion->position, parts[p].position);
        ces_copy(motion->velocity, parts[p].velocity);
        ces_copy(motion->spin, parts[p].angular_velocity);
    }
}

size_t ces_scene_joint_count(const ces_Scene *scene)
{
    return scene->mechanism.joint_count;
}

void ces_scene_joints(const ces_Scene *scene, ces_JointInfo *joints)
{
    const double h = scene->def.step;
    for (uint32_t j = 0; j < scene->mechanism.joint_count; j++) {
        const ces_JointState *state = &scene->mechanism.states[j];
        joints[j] = (ces_JointInfo){
            .travel = state->travel,
            .speed = state->speed,
            .effort = state->effort / h,
            .power = state->work / h,
            .energy = state->energy,
            .impulse = state->impulse,
            .at_limit = state->at_limit > 0.0,
            .at_stop = state->lower > 0.0   ? -1
                       : state->upper < 0.0 ? 1
                                            : 0,
        };
        for (int k = 0; k < 3; k++) {
            joints[j].force[k] = state->force[k] / h;
            joints[j].moment[k] = state->moment[k] / h;
        }
    }
}
