/*
 * scene/forces.c - the stages "charge" and "force": what the active effects make of each grain, and where it would go if
 * nothing were in the way.
 */
#include <math.h>
#include <string.h>

#include "../base/parallel.h"
#include "../base/status.h"
#include "../base/vec3.h"
#include "scene.h"

enum { ROW_BLOCK = 256 };

static void sample_ground(const ces_Scene *scene, ces_Grain *grain)
{
    const double x = grain->position[0] - scene->def.drum_axis[0], y = grain->position[1] - scene->def.drum_axis[1];
    const double rho = sqrt(x * x + y * y);
    grain->normal[0] = rho > 0.0 ? x / rho : 0.0;
    grain->normal[1] = rho > 0.0 ? y / rho : 1.0;
    grain->normal[2] = 0.0;
    grain->height = ces_max(rho - scene->def.drum_radius, grain->radius);
}

static void sample_ground_field(const ces_Scene *scene, ces_Grain *grain)
{
    const double foot[3] = {scene->def.drum_axis[0] + scene->def.drum_radius * grain->normal[0],
                            scene->def.drum_axis[1] + scene->def.drum_radius * grain->normal[1], grain->position[2]};
    double field[3];
    scene->field->field(scene->field_state, foot, field);
    grain->ground_field = ces_dot(field, grain->normal);
}

/* Only what some active effect asks for. */
static void sample(const ces_Scene *scene, unsigned needs, ces_Grain *grain)
{
    if ((needs & CES_NEEDS_FIELD) != 0) {
        scene->field->field(scene->field_state, grain->position, grain->field);
    }
    if ((needs & (CES_NEEDS_GROUND | CES_NEEDS_GROUND_FIELD)) != 0) {
        sample_ground(scene, grain);
    }
    if ((needs & CES_NEEDS_GROUND_FIELD) != 0) {
        sample_ground_field(scene, grain);
    }
}

static ces_Grain grain_at(const ces_Scene *scene, size_t row, double charge)
{
    const ces_Particles *particles = &scene->particles;
    ces_Grain grain = {
        .radius = 0.5 * particles->diameter[row],
        .mass = particles->mass[row],
        .charge = charge,
        .material = &scene->materials[particles->material[row]],
        .shape = &scene->shapes.list[particles->shape[row]].def,
        .touched = (unsigned)particles->touched[row],
    };
    ces_copy(&particles->position[3 * row], grain.position);
    ces_copy(&particles->velocity[3 * row], grain.velocity);
    ces_copy(&particles->angular_velocity[3 * row], grain.angular_velocity);
    return grain;
}

/* ---- charge ---------------------------------------------------------------------------------------------------------- */

static void charge_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    ces_Scene *scene = context;
    const ces_Hooks *hooks = &scene->hooks;
    double *charge = scene->charge.data;
    for (size_t row = first; row < last; row++) {
        ces_Grain grain = grain_at(scene, row, scene->particles.charge[row]);
        sample(scene, hooks->charge_needs, &grain);
        for (size_t k = 0; k < hooks->charge_count; k++) {
            grain.charge = hooks->charge[k].effect->charge(hooks->charge[k].state, &grain, scene->def.step);
        }
        charge[row] = grain.charge;
    }
}

ces_Status ces_stage_charge(ces_Scene *scene, ces_Error *error)
{
    if (scene->hooks.charge_count == 0) {
        return CES_OK;
    }
    if (!ces_pool_reserve(&scene->charge, scene->rows, sizeof(double))) {
        return ces_fail(error, CES_MEMORY, "no memory for the charges of %zu grains", scene->rows);
    }
    ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, charge_block, scene);
    return CES_OK;
}

/* ---- force ----------------------------------------------------------------------------------------------------------- */

/* (1 - e^-z)/z and (1 - that)/z, by their series where the quotients lose digits. */
static void relaxation(double z, double *phi1, double *phi2)
{
    if (z < 0.02) {
        /* Six terms leave 2e-15 of phi2; they are also cheaper than the exponential. */
        *phi2 =
            1.0 / 2.0 - z * (1.0 / 6.0 - z * (1.0 / 24.0 - z * (1.0 / 120.0 - z * (1.0 / 720.0 - z * (1.0 / 5040.0)))));
        *phi1 = 1.0 - z * *phi2;
    } else {
        *phi1 = -expm1(-z) / z;
        *phi2 = (1.0 - *phi1) / z;
    }
}

static double damping_rate(const ces_Hooks *hooks, const ces_Grain *grain)
{
    double rate = 0.0;
    for (size_t k = 0; k < hooks->damping_count; k++) {
        rate += hooks->damping[k].effect->damping(hooks->damping[k].state, grain);
    }
    return rate;
}

/* Acceleration at the grain's position, damping apart. */
static void acceleration(const ces_Scene *scene, ces_Grain *grain, double a[3])
{
    const ces_Hooks *hooks = &scene->hooks;
    double force[3] = {0.0, 0.0, 0.0};
    sample(scene, hooks->force_needs, grain);
    for (size_t k = 0; k < hooks->force_count; k++) {
        hooks->force[k].effect->force(hooks->force[k].state, grain, force);
    }
    for (int k = 0; k < 3; k++) {
        a[k] = force[k] / grain->mass;
    }
}

/*
 * Free flight over the step, second order: the force at the middle of the path, the damping rate at the velocity there, and
 * v' = a - rate v solved exactly with both. So gravity and linear drag are exact at any step, and stiff drag is stable.
 */
static void fly(const ces_Scene *scene, size_t row, double charge, double displacement[3], double velocity[3])
{
    const double h = scene->def.step;
    const bool damped = scene->hooks.damping_count > 0;
    ces_Grain grain = grain_at(scene, row, charge);
    double v0[3], a[3], phi1 = 1.0, phi2 = 0.5;
    ces_copy(grain.velocity, v0);

    double rate = damped ? damping_rate(&scene->hooks, &grain) : 0.0;
    if (damped) {
        relaxation(0.5 * h * rate, &phi1, &phi2);
    }
    ces_add_scaled(grain.position, 0.5 * h * phi1, v0);
    acceleration(scene, &grain, a);
    if (damped) {
        for (int k = 0; k < 3; k++) {
            grain.velocity[k] = v0[k] + 0.5 * h * phi1 * (a[k] - rate * v0[k]);
        }
        rate = damping_rate(&scene->hooks, &grain);
        relaxation(h * rate, &phi1, &phi2);
    }
    for (int k = 0; k < 3; k++) {
        velocity[k] = v0[k] + h * phi1 * (a[k] - rate * v0[k]);
        displacement[k] = h * (phi1 * v0[k] + h * phi2 * a[k]);
    }
}

static void force_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    ces_Scene *scene = context;
    const double *charge = scene->hooks.charge_count > 0 ? scene->charge.data : scene->particles.charge;
    double *displacement = scene->displacement.data;
    double *velocity = scene->free_velocity.data;
    for (size_t row = first; row < last; row++) {
        fly(scene, row, charge[row], &displacement[3 * row], &velocity[3 * row]);
    }
}

/* ---- rotation: what only grains that are no spheres need -------------------------------------------------------------- */

static void rotate_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    ces_Scene *scene = context;
    const ces_Particles *particles = &scene->particles;
    double *orientation = scene->free_orientation.data, *spin = scene->free_spin.data;
    for (size_t row = first; row < last; row++) {
        const ces_Shape *shape = &scene->shapes.list[particles->shape[row]];
        double *q = &orientation[4 * row], *w = &spin[3 * row];
        memcpy(q, &particles->orientation[4 * row], 4 * sizeof *q);
        ces_copy(&particles->angular_velocity[3 * row], w);
        if (shape->def.kind == CES_SPHERE || !scene->def.rotation) {
            continue; /* a sphere looks the same however it turns; stage "move" turns it */
        }
        if (scene->def.gyroscopic) {
            ces_rotate_freely(shape->def.moments, scene->def.step, q, w);
        } else {
            const double turn[3] = {scene->def.step * w[0], scene->def.step * w[1], scene->def.step * w[2]};
            ces_turn(q, turn);
        }
    }
}

/* A number that is not finite ends the step before anything has changed; it says which, and whose. */
static ces_Status check_finite(const ces_Scene *scene, ces_Error *error)
{
    const ces_Particles *particles = &scene->particles;
    const struct {
        const char *what;
        const double *values;
        size_t width;
    } columns[] = {
        {"position", particles->position, 3},
        {"velocity", particles->velocity, 3},
        {"angular_velocity", particles->angular_velocity, 3},
        {"orientation", particles->orientation, 4},
        {"charge", particles->charge, 1},
        {"displacement", scene->displacement.data, 3},
        {"velocity after the step", scene->free_velocity.data, 3},
    };
    for (size_t c = 0; c < sizeof columns / sizeof columns[0]; c++) {
        for (size_t k = 0; k < scene->rows * columns[c].width; k++) {
            if (!(fabs(columns[c].values[k]) <= 1e12)) {
                const size_t row = k / columns[c].width;
                return ces_fail(error, CES_DIVERGED,
                                "step %llu: %s of grain %lld is %g; the state before the step is kept",
                                (unsigned long long)scene->step_index, columns[c].what, (long long)particles->id[row],
                                columns[c].values[k]);
            }
        }
    }
    for (size_t k = 0; k < 3 * scene->rows; k++) {
        if (fabs(particles->position[k]) > CES_FARTHEST) {
            return ces_fail(error, CES_DIVERGED, "step %llu: position of grain %lld is %g m, outside [%g, %g] m",
                            (unsigned long long)scene->step_index, (long long)particles->id[k / 3],
                            particles->position[k], -CES_FARTHEST, CES_FARTHEST);
        }
    }
    return CES_OK;
}

ces_Status ces_stage_force(ces_Scene *scene, ces_Error *error)
{
    if (!ces_pool_reserve(&scene->displacement, scene->rows, 3 * sizeof(double)) ||
        !ces_pool_reserve(&scene->free_velocity, scene->rows, 3 * sizeof(double))) {
        return ces_fail(error, CES_MEMORY, "no memory for the motion of %zu grains", scene->rows);
    }
    if (!scene->shapes.only_spheres && (!ces_pool_reserve(&scene->free_orientation, scene->rows, 4 * sizeof(double)) ||
                                        !ces_pool_reserve(&scene->free_spin, scene->rows, 3 * sizeof(double)))) {
        return ces_fail(error, CES_MEMORY, "no memory for the rotation of %zu grains", scene->rows);
    }
    ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, force_block, scene);
    if (!scene->shapes.only_spheres) {
        ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, rotate_block, scene);
    }
    const ces_Status status = check_finite(scene, error);
    return status != CES_OK ? status
                            : ces_mechanism_fly(&scene->mechanism, ces_scene_time(scene), scene->def.step, error);
}
