/* scene/forces.c - the stage "force": where each grain would go if nothing were in the way. */
#include <math.h>
#include <string.h>

#include "../base/parallel.h"
#include "../base/status.h"
#include "../base/vec3.h"
#include "composite.h"

enum { ROW_BLOCK = 256 };

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

static void add_forces(const ces_Hooks *hooks, const ces_Grain *grain, double force[3])
{
    for (size_t k = 0; k < hooks->force_count; k++) {
        hooks->force[k].effect->force(hooks->force[k].state, grain, force);
    }
}

static void average_forces(const ces_Scene *scene, size_t row, const ces_Grain *grain, double force[3])
{
    const bool charges = scene->hooks.charges;
    const double *conducted = charges ? (double *)scene->charge.data + scene->rows : scene->particles.conducted;
    ces_Face faces[2];
    ces_faces_of(scene, row, grain->charge, conducted[row], faces);
    for (int f = 0; f < 2; f++) {
        ces_Grain face = *grain;
        double part[3] = {0.0, 0.0, 0.0};
        if (faces[f].share > 0.0) {
            face.material = faces[f].material;
            face.charge = faces[f].charge;
            add_forces(&scene->hooks, &face, part);
            ces_add_scaled(force, faces[f].share, part);
        }
    }
}

/* A composite is looked at as it lies halfway; what turns it is kept for its rotation. */
static void push_phases(const ces_Scene *scene, size_t row, const ces_Grain *grain, double force[3])
{
    const ces_Particles *particles = &scene->particles;
    const double *conducted =
        scene->hooks.charges ? (const double *)scene->charge.data + scene->rows : particles->conducted;
    double q[4], spin[3];
    memcpy(q, grain->orientation, sizeof q);
    ces_copy(grain->angular_velocity, spin);
    if (scene->def.rotation) {
        ces_rotate_alone(scene->shapes.list[particles->shape[row]].def.moments, scene->def.gyroscopic,
                         0.5 * scene->def.step, q, spin);
    }
    ces_Grain whole = *grain;
    whole.orientation = q;
    ces_push_composite(scene, row, &whole, conducted[row], force, (double *)scene->moment.data + 3 * row);
}

/* What the forces of a scene ask of its grains. */
typedef enum Content { PURE, MIXTURES, COMPOSITES } Content;

/* Acceleration at the grain's position, damping apart. */
static inline void acceleration(const ces_Scene *scene, size_t row, Content content, ces_Grain *grain, double a[3])
{
    double force[3];
    ces_copy(&scene->crowd.given[scene->crowd.stride * row], force);
    ces_sample(scene, scene->hooks.force_needs, grain);
    if ((scene->hooks.force_needs & CES_NEEDS_TOUCH) != 0) {
        ces_copy((const double *)scene->touch.data + 3 * row, grain->touch);
    }
    if (content == COMPOSITES && ces_is_composite(scene, row)) {
        push_phases(scene, row, grain, force);
    } else if (content != PURE) {
        average_forces(scene, row, grain, force);
    } else {
        add_forces(&scene->hooks, grain, force);
    }
    for (int k = 0; k < 3; k++) {
        a[k] = force[k] / grain->mass;
    }
}

/* Velocity of the air where the grain is, and the grain's through it. */
static void sample_air(const ces_Scene *scene, ces_Grain *grain, double air[3])
{
    const ces_Hooks *hooks = &scene->hooks;
    air[0] = air[1] = air[2] = 0.0;
    ces_sample(scene, hooks->air_needs, grain);
    for (size_t k = 0; k < hooks->air_count; k++) {
        hooks->air[k].effect->air(hooks->air[k].state, grain, air);
    }
    for (int k = 0; k < 3; k++) {
        grain->relative_velocity[k] = grain->velocity[k] - air[k];
    }
}

double ces_charge_of(const ces_Scene *scene, size_t row)
{
    const double *charge = scene->hooks.charges ? scene->charge.data : scene->particles.charge;
    return charge[row];
}

/* Takes a grain to the middle of its path; gives what damps it on the way there. */
static inline void go_half_way(const ces_Scene *scene, bool windy, ces_Grain *grain, double air[3], double *rate,
                               double *phi1)
{
    const double h = scene->def.step;
    double phi2;
    if (windy) {
        sample_air(scene, grain, air);
    }
    if (scene->hooks.damping_count > 0) {
        *rate = damping_rate(&scene->hooks, grain);
        relaxation(0.5 * h * *rate, phi1, &phi2);
    }
    ces_add_scaled(grain->position, 0.5 * h * *phi1, grain->relative_velocity);
    if (windy) {
        ces_add_scaled(grain->position, 0.5 * h, air);
    }
}

void ces_middle_of_path(const ces_Scene *scene, size_t row, double position[3])
{
    ces_Grain grain = ces_grain_at(scene, row, ces_charge_of(scene, row));
    double air[3], rate = 0.0, phi1 = 1.0;
    go_half_way(scene, scene->hooks.air_count > 0, &grain, air, &rate, &phi1);
    ces_copy(grain.position, position);
}

/*
 * Free flight over the step, second order: the force at the middle of the path, the damping rate at the velocity there, and
 * v' = a - rate (v - air) solved exactly with both. So gravity and linear drag are exact at any step, and stiff drag is
 * stable. windy and content are known when this is compiled.
 */
static inline void fly(const ces_Scene *scene, size_t row, bool windy, Content content, double displacement[3],
                       double velocity[3])
{
    const double h = scene->def.step;
    const bool damped = scene->hooks.damping_count > 0;
    ces_Grain grain = ces_grain_at(scene, row, ces_charge_of(scene, row));
    double v0[3], u0[3], air[3], a[3], rate = 0.0, phi1 = 1.0, phi2 = 0.5;

    go_half_way(scene, windy, &grain, air, &rate, &phi1);
    ces_copy(grain.velocity, v0);
    ces_copy(grain.relative_velocity, u0);
    acceleration(scene, row, content, &grain, a);
    if (damped) {
        for (int k = 0; k < 3; k++) {
            grain.velocity[k] = v0[k] + 0.5 * h * phi1 * (a[k] - rate * u0[k]);
        }
        ces_copy(grain.velocity, grain.relative_velocity);
        if (windy) {
            sample_air(scene, &grain, air);
            ces_subtract(v0, air, u0);
        }
        rate = damping_rate(&scene->hooks, &grain);
        relaxation(h * rate, &phi1, &phi2);
    }
    for (int k = 0; k < 3; k++) {
        velocity[k] = v0[k] + h * phi1 * (a[k] - rate * u0[k]);
        displacement[k] = h * (phi1 * u0[k] + h * phi2 * a[k]);
    }
    if (windy) {
        ces_add_scaled(displacement, h, air);
    }
}

static inline void fly_all(const ces_Scene *scene, size_t first, size_t last, bool windy, Content content)
{
    double *displacement = scene->displacement.data;
    double *velocity = scene->free_velocity.data;
    for (size_t row = first; row < last; row++) {
        fly(scene, row, windy, content, &displacement[3 * row], &velocity[3 * row]);
    }
}

/* A body for each case, so that nobody pays for a wind, mixtures or composites that there are not. */
#define FLY_BLOCK(name, windy, content)                                                                                \
    static void name(void *context, size_t block, size_t first, size_t last)                                           \
    {                                                                                                                  \
        (void)block;                                                                                                   \
        fly_all(context, first, last, windy, content);                                                                 \
    }
FLY_BLOCK(still_pure, false, PURE)
FLY_BLOCK(still_mixtures, false, MIXTURES)
FLY_BLOCK(still_composites, false, COMPOSITES)
FLY_BLOCK(windy_pure, true, PURE)
FLY_BLOCK(windy_mixtures, true, MIXTURES)
FLY_BLOCK(windy_composites, true, COMPOSITES)
#undef FLY_BLOCK

/* ---- touches: what only adhesion needs ------------------------------------------------------------------------------ */

static void add_touch(const ces_Scene *scene, int64_t id, double sign, const double normal[3])
{
    const int64_t *ids = scene->particles.id;
    size_t low = 0, high = scene->particles.count;
    while (low < high) { /* rows are in the order of ids */
        const size_t middle = low + (high - low) / 2;
        *(ids[middle] < id ? &low : &high) = ids[middle] < id ? middle + 1 : middle;
    }
    if (low < scene->particles.count && ids[low] == id) {
        ces_add_scaled((double *)scene->touch.data + 3 * low, sign, normal);
    }
}

/* By id: grains may have gone since the contacts were made. */
static ces_Status gather_touches(ces_Scene *scene, ces_Error *error)
{
    if (!ces_pool_reserve(&scene->touch, scene->rows, 3 * sizeof(double))) {
        return ces_fail(error, CES_MEMORY, "no memory for what %zu grains touch", scene->rows);
    }
    memset(scene->touch.data, 0, 3 * scene->rows * sizeof(double));
    for (size_t k = 0; k < scene->contacts.count; k++) {
        const ces_Contact *contact = &scene->contacts.list[k];
        if (contact->impact || !(ces_contact_push(contact) > 0.0)) {
            continue;
        }
        add_touch(scene, contact->id_a, -1.0, contact->normal);
        if (contact->id_b >= 0) {
            add_touch(scene, contact->id_b, 1.0, contact->normal);
        }
    }
    return CES_OK;
}

/* ---- rotation: what only grains that are no spheres need -------------------------------------------------------------- */

static inline void rotate_rows(ces_Scene *scene, size_t first, size_t last, bool composites)
{
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
        if (composites && ces_is_composite(scene, row)) {
            ces_rotate_composite(scene, row, q, w);
        } else {
            ces_rotate_alone(shape->def.moments, scene->def.gyroscopic, scene->def.step, q, w);
        }
    }
}

static void rotate_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    rotate_rows(context, first, last, false);
}

static void rotate_composites_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    rotate_rows(context, first, last, true);
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
    if (scene->shapes.composites && !ces_pool_reserve(&scene->moment, scene->rows, 3 * sizeof(double))) {
        return ces_fail(error, CES_MEMORY, "no memory for the moments on %zu grains", scene->rows);
    }
    const ces_Status prepared = ces_crowd_prepare(scene, error);
    if (prepared != CES_OK) {
        return prepared;
    }
    if ((scene->hooks.force_needs & CES_NEEDS_TOUCH) != 0) {
        const ces_Status status = gather_touches(scene, error);
        if (status != CES_OK) {
            return status;
        }
    }
    static ces_Span *const spans[2][3] = {{still_pure, still_mixtures, still_composites},
                                          {windy_pure, windy_mixtures, windy_composites}};
    const Content content = scene->shapes.composites ? COMPOSITES : scene->mixed ? MIXTURES : PURE;
    ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, spans[scene->hooks.air_count > 0][content], scene);
    if (!scene->shapes.only_spheres) {
        ces_Span *const rotate = scene->shapes.composites ? rotate_composites_block : rotate_block;
        ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, rotate, scene);
    }
    const ces_Status status = check_finite(scene, error);
    return status != CES_OK ? status
                            : ces_mechanism_fly(&scene->mechanism, ces_scene_time(scene), scene->def.step, error);
}
