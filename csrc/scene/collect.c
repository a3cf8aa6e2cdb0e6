/* scene/collect.c - the stage "collect": grains that crossed the landing plane or left the bounds leave the scene, counted. */
#include <math.h>

#include "../base/vec3.h"
#include "scene.h"

/*
 * Where inside the step the centre crosses y = height, as a fraction of it. In free flight the path is the parabola with the
 * velocity at the start: y = y0 + (y1 - y0) s + c s (s - 1); a grain that was pushed goes straight.
 */
static double crossing(double y0, double y1, double bend, double height)
{
    if (y0 <= height) {
        return 1.0; /* it was carried below the plane, and let go in this step */
    }
    /* bend s^2 + (y1 - y0 - bend) s + (y0 - height) = 0, in the form that loses no digits as bend -> 0 */
    const double b = y1 - y0 - bend, c = y0 - height;
    const double discriminant = ces_max(b * b - 4.0 * bend * c, 0.0);
    const double q = -0.5 * (b + copysign(sqrt(discriminant), b));
    const double first = q != 0.0 ? c / q : 0.0;
    const double second = bend != 0.0 ? q / bend : -1.0;
    const double fraction = first >= 0.0 && first <= 1.0 ? first : second;
    return ces_min(ces_max(fraction, 0.0), 1.0);
}

static ces_Landing landing_of(const ces_Scene *scene, size_t row, bool landed)
{
    const ces_Particles *particles = &scene->particles;
    const double h = scene->def.step;
    const double *x0 = &((const double *)scene->start_position.data)[3 * row];
    const double *v0 = &((const double *)scene->start_velocity.data)[3 * row];
    const double *x1 = &particles->position[3 * row], *v1 = &particles->velocity[3 * row];
    ces_Landing landing = {
        .id = particles->id[row],
        .birth = particles->birth[row],
        .charge = particles->charge[row],
        .mass = particles->mass[row],
        .diameter = particles->diameter[row],
        .material = particles->material[row],
        .surface = particles->surface[row],
        .collisions = particles->collisions[row],
        .lost = !landed,
    };
    const double *displacement = &((const double *)scene->displacement.data)[3 * row];
    double off = 0.0; /* how far it came off its free path */
    for (int k = 0; k < 3; k++) {
        off = ces_max(off, fabs(x1[k] - x0[k] - displacement[k]));
    }
    const double free = off <= 1e-9 * particles->diameter[row] ? 1.0 : 0.0;
    const double bend_y = free * (x1[1] - x0[1] - h * v0[1]);
    const double s = landed ? crossing(x0[1], x1[1], bend_y, scene->def.landing_height) : 1.0;
    landing.time = ces_scene_time_at(scene, scene->step_index - 1) + s * h;
    for (int k = 0; k < 3; k++) {
        const double bend = free * (x1[k] - x0[k] - h * v0[k]);
        landing.position[k] = x0[k] + s * (x1[k] - x0[k]) + bend * s * (s - 1.0);
        landing.velocity[k] = v0[k] + s * (v1[k] - v0[k]);
    }
    return landing;
}

static bool is_inside(const ces_Scene *scene, const double x[3])
{
    for (int k = 0; k < 3; k++) {
        if (x[k] < scene->def.lower[k] || x[k] > scene->def.upper[k]) {
            return false;
        }
    }
    return true;
}

/* The landing plane may cut the drum, on which pinned grains travel below it: they land when they have come off by their
 * diameter, not before. */
static bool has_landed(const ces_Scene *scene, size_t row)
{
    const double *x = &scene->particles.position[3 * row];
    if (x[1] > scene->def.landing_height) {
        return false;
    }
    const double dx = x[0] - scene->def.drum_axis[0], dy = x[1] - scene->def.drum_axis[1];
    const double clear =
        scene->def.drum_radius > 0.0 ? scene->def.drum_radius + 1.5 * scene->particles.diameter[row] : 0.0;
    return dx * dx + dy * dy >= clear * clear;
}

ces_Status ces_stage_collect(ces_Scene *scene, ces_Error *error)
{
    (void)error;
    ces_Particles *particles = &scene->particles;
    ces_Landing *landings = scene->landing_pool.data;
    uint8_t *gone = scene->gone.data;
    bool any = false;
    for (size_t row = 0; row < particles->count; row++) {
        const double *x = &particles->position[3 * row];
        const bool landed = has_landed(scene, row);
        gone[row] = landed || !is_inside(scene, x);
        if (gone[row] == 0) {
            continue;
        }
        any = true;
        landings[scene->landing_count++] = landing_of(scene, row, landed);
        const ces_Int128 units = ces_mass_units(particles->mass[row]);
        if (landed) {
            scene->ledger.landed_count++;
            scene->ledger.landed += units;
        } else {
            scene->ledger.lost_count++;
            scene->ledger.lost += units;
        }
    }
    if (any) {
        ces_particles_remove(particles, gone);
    }
    return CES_OK;
}
