/*
 * scene/grain.h - a grain as the effects see it. In a header, so that what no effect asks for is no call either.
 */
#ifndef CES_GRAIN_H
#define CES_GRAIN_H

#include <math.h>

#include "../base/vec3.h"
#include "scene.h"

static inline void ces_sample_ground(const ces_Scene *scene, ces_Grain *grain)
{
    const double x = grain->position[0] - scene->def.drum_axis[0], y = grain->position[1] - scene->def.drum_axis[1];
    const double rho = sqrt(x * x + y * y);
    grain->normal[0] = rho > 0.0 ? x / rho : 0.0;
    grain->normal[1] = rho > 0.0 ? y / rho : 1.0;
    grain->normal[2] = 0.0;
    grain->lift = rho - scene->def.drum_radius;
    grain->height = ces_max(grain->lift, grain->radius);
}

static inline void ces_sample_ground_field(const ces_Scene *scene, ces_Grain *grain)
{
    const double foot[3] = {scene->def.drum_axis[0] + scene->def.drum_radius * grain->normal[0],
                            scene->def.drum_axis[1] + scene->def.drum_radius * grain->normal[1], grain->position[2]};
    double field[3];
    scene->field->field(scene->field_state, foot, field);
    grain->ground_field = ces_dot(field, grain->normal);
}

/* By the field's own formula, or by central differences over a radius: what a grain that does not overlap reaches, too. */
static inline void ces_sample_square_gradient(const ces_Scene *scene, ces_Grain *grain)
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
static inline void ces_sample(const ces_Scene *scene, unsigned needs, ces_Grain *grain)
{
    if ((needs & CES_NEEDS_FIELD) != 0) {
        scene->field->field(scene->field_state, grain->position, grain->field);
    }
    if ((needs & (CES_NEEDS_GROUND | CES_NEEDS_GROUND_FIELD)) != 0) {
        ces_sample_ground(scene, grain);
    }
    if ((needs & CES_NEEDS_GROUND_FIELD) != 0) {
        ces_sample_ground_field(scene, grain);
    }
    if ((needs & CES_NEEDS_GRADIENT) != 0) {
        ces_sample_square_gradient(scene, grain);
    }
}

static inline ces_Grain ces_grain_at(const ces_Scene *scene, size_t row, double charge)
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

/*
 * A mixture (Critelli et al., SIMUL 2014): the weighted average of what the grain would be if all of it conducted and if none
 * of it did. So it has two charges, of which the column "conducted" holds the conductor's with its weight.
 */
typedef struct ces_Face {
    const ces_MaterialDef *material;
    double share;  /* of the whole; the rest's is what is left */
    double charge; /* C, as if all of the grain were of it */
} ces_Face;

static inline void ces_faces_of(const ces_Scene *scene, size_t row, double charge, double conducted, ces_Face faces[2])
{
    const size_t material = (size_t)scene->particles.material[row];
    const double share = scene->materials[material].conductor_share;
    const ces_MaterialDef *first = &scene->faces[2 * material];
    faces[0] = (ces_Face){first, share, share > 0.0 ? conducted / share : 0.0};
    faces[1] = (ces_Face){first + 1, 1.0 - share, (charge - conducted) / (1.0 - share)};
}

#endif
