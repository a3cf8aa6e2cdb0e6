/*
 * scene/composite.h - grains of several materials. A composite is one rigid body for contacts and for the air, and two grains
 * for charges and fields: the phase that conducts and the rest, each a body of its own volume at its own centre of mass, with
 * what it touches and its own charge. In a header, as grain.h is.
 */
#ifndef CES_COMPOSITE_H
#define CES_COMPOSITE_H

#include "grain.h"

static inline bool ces_is_composite(const ces_Scene *scene, size_t row)
{
    return scene->shapes.list[scene->particles.shape[row]].def.sphere_materials != NULL;
}

/* A phase, as the effects see it. */
typedef struct ces_Phase {
    ces_Grain grain;
    double arm[3];   /* m, from the grain's centre of mass to the phase's */
    double frame[4]; /* the orientation that grain points to */
} ces_Phase;

/* False: the grain has no such phase. whole: the grain, with its charge; orientation: where it is looked at. */
static inline bool ces_phase_of(const ces_Scene *scene, size_t row, int f, const ces_Grain *whole,
                                const double orientation[4], double conducted, ces_Phase *phase)
{
    const ces_Shape *shape = &scene->shapes.list[scene->particles.shape[row]];
    const ces_PhaseDef *def = &shape->def.phases[f];
    if (def->volume == 0.0) {
        return false;
    }
    const double d = 2.0 * whole->radius;
    const double center[3] = {d * def->center[0], d * def->center[1], d * def->center[2]};
    const bool alone = shape->def.phases[1 - f].volume == 0.0;
    ces_rotate(orientation, center, phase->arm);
    ces_multiply(orientation, def->orientation, phase->frame);
    phase->grain = *whole;
    phase->grain.orientation = phase->frame;
    phase->grain.radius = whole->radius * cbrt(def->volume);
    phase->grain.mass = whole->mass * def->mass;
    phase->grain.charge = alone ? whole->charge : f == 0 ? conducted : whole->charge - conducted;
    phase->grain.material = &scene->faces[2 * scene->particles.material[row] + f];
    phase->grain.shape = &shape->phase_shapes[f];
    phase->grain.touched = (whole->touched >> (CES_PHASE_BITS * (f + 1))) & ((1u << CES_PHASE_BITS) - 1u);
    ces_add_scaled(phase->grain.position, 1.0, phase->arm);
    return true;
}

/* Refuses shapes whose materials are not there, and grains of a composite's shape and another material. */
ces_Status ces_check_composites(const ces_Scene *scene, ces_Error *error);
ces_Status ces_check_composite(const ces_Shapes *shapes, size_t shape, size_t material, const char *what,
                               ces_Error *error);

/* What the effects push a composite with, halfway; adds to force, N, and gives the moment about its centre of mass, N m. */
void ces_push_composite(const ces_Scene *scene, size_t row, const ces_Grain *whole, double conducted, double force[3],
                        double moment[3]);

/* Free rotation over the step under its moment, of second order: half of the moment before, half after it. */
void ces_rotate_composite(const ces_Scene *scene, size_t row, double orientation[4], double spin[3]);
/* Half of what a moment over the step gives to an angular velocity (world) at an orientation. */
void ces_kick_half(const ces_Scene *scene, size_t row, const double orientation[4], double spin[3]);

/* Which phases the surfaces of the step pressed. */
void ces_note_phase_touches(ces_Scene *scene);

#endif
