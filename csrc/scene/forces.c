/*
 * scene/forces.c - the stages "charge" and "force": what the active effects make of each grain, and where it would go if
 * nothing were in the way.
 */
#include <math.h>
#include <string.h>

#include "../base/parallel.h"
#include "../base/status.h"
#include "../base/vec3.h"
#include "../effects/laws.h"
#include "scene.h"

enum { ROW_BLOCK = 256 };

static void sample_ground(const ces_Scene *scene, ces_Grain *grain)
{
    const double x = grain->position[0] - scene->def.drum_axis[0], y = grain->position[1] - scene->def.drum_axis[1];
    const double rho = sqrt(x * x + y * y);
    grain->normal[0] = rho > 0.0 ? x / rho : 0.0;
    grain->normal[1] = rho > 0.0 ? y / rho : 1.0;
    grain->normal[2] = 0.0;
    grain->lift = rho - scene->def.drum_radius;
    grain->height = ces_max(grain->lift, grain->radius);
}

static void sample_ground_field(const ces_Scene *scene, ces_Grain *grain)
{
    const double foot[3] = {scene->def.drum_axis[0] + scene->def.drum_radius * grain->normal[0],
                            scene->def.drum_axis[1] + scene->def.drum_radius * grain->normal[1], grain->position[2]};
    double field[3];
    scene->field->field(scene->field_state, foot, field);
    grain->ground_field = ces_dot(field, grain->normal);
}

/* By the field's own formula, or by central differences over a radius: what a grain that does not overlap reaches, too. */
static void sample_square_gradient(const ces_Scene *scene, ces_Grain *grain)
{
    if (scene->field->square_gradient != NULL) {
        scene->field->square_gradient(scene->field_state, grain->position, grain->square_gradient);
        return;
    }
    for (int k = 0; k < 3; k++) {
        double squares[2];
        for (int side = 0; side < 2; side++) {
            double place[3], field[3];
            ces_copy(grain->position, place);
            place[k] += side == 0 ? -grain->radius : grain->radius;
            scene->field->field(scene->field_state, place, field);
            squares[side] = ces_dot(field, field);
        }
        grain->square_gradient[k] = (squares[1] - squares[0]) / (2.0 * grain->radius);
    }
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
    if ((needs & CES_NEEDS_GRADIENT) != 0) {
        sample_square_gradient(scene, grain);
    }
}

static ces_Grain grain_at(const ces_Scene *scene, size_t row, double charge)
{
    const ces_Particles *particles = &scene->particles;
    ces_Grain grain = {
        .orientation = &particles->orientation[4 * row],
        .id = (uint64_t)particles->id[row],
        .radius = 0.5 * particles->diameter[row],
        .mass = particles->mass[row],
        .charge = charge,
        .material = &scene->materials[particles->material[row]],
        .shape = &scene->shapes.list[particles->shape[row]].def,
        .touched = (unsigned)particles->touched[row],
    };
    ces_copy(&particles->position[3 * row], grain.position);
    ces_copy(&particles->velocity[3 * row], grain.velocity);
    ces_copy(grain.velocity, grain.relative_velocity);
    ces_copy(&particles->angular_velocity[3 * row], grain.angular_velocity);
    return grain;
}

/* ---- charge ---------------------------------------------------------------------------------------------------------- */

/* The charge after the step of a grain that is sampled. */
static double charge_after(const ces_Scene *scene, ces_Grain grain)
{
    const ces_Hooks *hooks = &scene->hooks;
    const double step = scene->def.step;
    ces_ChargeFlow flow = {.decay_time = HUGE_VAL};
    for (size_t k = 0; k < hooks->flow_count; k++) {
        hooks->flow[k].effect->flow(hooks->flow[k].state, &grain, &flow);
    }
    grain.charge = ces_charge_after(grain.charge, &flow, step);
    for (size_t k = 0; k < hooks->charge_count; k++) {
        grain.charge = hooks->charge[k].effect->charge(hooks->charge[k].state, &grain, step);
    }
    return grain.charge;
}

/* Whether ions have brought it to the most that air can hold: the limit itself is the ions' (corona_charging). */
static bool reaches_limit(const ces_Grain *grain, double before, double after)
{
    const double most = ces_breakdown_charge(grain->radius) / grain->shape->sphericity * (1.0 - 1e-9);
    return fabs(after) >= most && fabs(before) < most;
}

static void charge_block(void *context, size_t block, size_t first, size_t last)
{
    ces_Scene *scene = context;
    double *charge = scene->charge.data;
    uint32_t limited = 0;
    for (size_t row = first; row < last; row++) {
        ces_Grain grain = grain_at(scene, row, scene->particles.charge[row]);
        sample(scene, scene->hooks.charge_needs, &grain);
        charge[row] = charge_after(scene, grain);
        limited += reaches_limit(&grain, grain.charge, charge[row]);
    }
    ((uint32_t *)scene->limited.data)[block] = limited;
}

/*
 * A mixture (Critelli et al., SIMUL 2014): the weighted average of what the grain would be if all of it conducted and if none
 * of it did. So it has two charges, of which the column "conducted" holds the conductor's with its weight.
 */
typedef struct Face {
    const ces_MaterialDef *material;
    double share;  /* of the whole; the rest's is what is left */
    double charge; /* C, as if all of the grain were of it */
} Face;

static void faces_of(const ces_Scene *scene, size_t row, double charge, double conducted, Face faces[2])
{
    const size_t material = (size_t)scene->particles.material[row];
    const double share = scene->materials[material].conductor_share;
    const ces_MaterialDef *first = &scene->faces[2 * material];
    faces[0] = (Face){first, share, share > 0.0 ? conducted / share : 0.0};
    faces[1] = (Face){first + 1, 1.0 - share, (charge - conducted) / (1.0 - share)};
}

static void charge_mixed_block(void *context, size_t block, size_t first, size_t last)
{
    ces_Scene *scene = context;
    double *charge = scene->charge.data, *conducted = charge + scene->rows;
    uint32_t limited = 0;
    for (size_t row = first; row < last; row++) {
        Face faces[2];
        ces_Grain grain = grain_at(scene, row, scene->particles.charge[row]);
        sample(scene, scene->hooks.charge_needs, &grain);
        faces_of(scene, row, grain.charge, scene->particles.conducted[row], faces);
        double parts[2] = {0.0, 0.0};
        for (int f = 0; f < 2; f++) {
            if (faces[f].share > 0.0) {
                grain.material = faces[f].material;
                grain.charge = faces[f].charge;
                const double after = charge_after(scene, grain);
                limited += reaches_limit(&grain, grain.charge, after);
                parts[f] = faces[f].share * after;
            }
        }
        conducted[row] = parts[0];
        charge[row] = parts[0] + parts[1];
    }
    ((uint32_t *)scene->limited.data)[block] = limited;
}

ces_Status ces_stage_charge(ces_Scene *scene, ces_Error *error)
{
    if (!scene->hooks.charges) {
        return CES_OK;
    }
    if (!ces_pool_reserve(&scene->charge, scene->rows, (scene->mixed ? 2 : 1) * sizeof(double)) ||
        !ces_pool_reserve(&scene->limited, ces_block_count(scene->rows, ROW_BLOCK), sizeof(uint32_t))) {
        return ces_fail(error, CES_MEMORY, "no memory for the charges of %zu grains", scene->rows);
    }
    ces_Span *const span = scene->mixed ? charge_mixed_block : charge_block;
    ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, span, scene);
    return CES_OK;
}

/* Nothing is cut off in silence: before the new charges take the old ones' place. */
void ces_count_limited_charges(ces_Scene *scene)
{
    for (size_t k = 0; k < scene->born; k++) {
        scene->health.limited_charges += scene->births[k].limited != 0;
    }
    const uint32_t *limited = scene->limited.data;
    for (size_t block = 0; scene->hooks.charges && block < ces_block_count(scene->rows, ROW_BLOCK); block++) {
        scene->health.limited_charges += limited[block];
    }
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
    Face faces[2];
    faces_of(scene, row, grain->charge, conducted[row], faces);
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

/* Acceleration at the grain's position, damping apart. */
static inline void acceleration(const ces_Scene *scene, size_t row, bool mixed, ces_Grain *grain, double a[3])
{
    double force[3];
    ces_copy(&scene->crowd.given[scene->crowd.stride * row], force);
    sample(scene, scene->hooks.force_needs, grain);
    if ((scene->hooks.force_needs & CES_NEEDS_TOUCH) != 0) {
        ces_copy((const double *)scene->touch.data + 3 * row, grain->touch);
    }
    if (mixed) {
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
    sample(scene, hooks->air_needs, grain);
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
    ces_Grain grain = grain_at(scene, row, ces_charge_of(scene, row));
    double air[3], rate = 0.0, phi1 = 1.0;
    go_half_way(scene, scene->hooks.air_count > 0, &grain, air, &rate, &phi1);
    ces_copy(grain.position, position);
}

/*
 * Free flight over the step, second order: the force at the middle of the path, the damping rate at the velocity there, and
 * v' = a - rate (v - air) solved exactly with both. So gravity and linear drag are exact at any step, and stiff drag is
 * stable. windy and mixed are known when this is compiled.
 */
static inline void fly(const ces_Scene *scene, size_t row, bool windy, bool mixed, double displacement[3],
                       double velocity[3])
{
    const double h = scene->def.step;
    const bool damped = scene->hooks.damping_count > 0;
    ces_Grain grain = grain_at(scene, row, ces_charge_of(scene, row));
    double v0[3], u0[3], air[3], a[3], rate = 0.0, phi1 = 1.0, phi2 = 0.5;

    go_half_way(scene, windy, &grain, air, &rate, &phi1);
    ces_copy(grain.velocity, v0);
    ces_copy(grain.relative_velocity, u0);
    acceleration(scene, row, mixed, &grain, a);
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

static inline void fly_all(const ces_Scene *scene, size_t first, size_t last, bool windy, bool mixed)
{
    double *displacement = scene->displacement.data;
    double *velocity = scene->free_velocity.data;
    for (size_t row = first; row < last; row++) {
        fly(scene, row, windy, mixed, &displacement[3 * row], &velocity[3 * row]);
    }
}

/* A body for each case, so that nobody pays for a wind or for mixtures that there are not. */
static void still_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    fly_all(context, first, last, false, false);
}

static void still_mixed_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    fly_all(context, first, last, false, true);
}

static void windy_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    fly_all(context, first, last, true, false);
}

static void windy_mixed_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    fly_all(context, first, last, true, true);
}

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
        ces_rotate_alone(shape->def.moments, scene->def.gyroscopic, scene->def.step, q, w);
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
    static ces_Span *const spans[2][2] = {{still_block, still_mixed_block}, {windy_block, windy_mixed_block}};
    ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, spans[scene->hooks.air_count > 0][scene->mixed],
                     scene);
    if (!scene->shapes.only_spheres) {
        ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, rotate_block, scene);
    }
    const ces_Status status = check_finite(scene, error);
    return status != CES_OK ? status
                            : ces_mechanism_fly(&scene->mechanism, ces_scene_time(scene), scene->def.step, error);
}
