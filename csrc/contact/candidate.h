/*
 * contact/candidate.h - what may become a contact of the step, and how it is described for the contact problem.
 */
#ifndef CES_CANDIDATE_H
#define CES_CANDIDATE_H

#include "../data/contacts.h"
#include "../data/machine.h"
#include "balls.h"
#include "narrow_phase.h"

/* Coefficients of every pair: grain-grain (materials, materials), grain-surface (surfaces, materials). */
typedef struct ces_PairTable {
    size_t material_count;
    const double *grain_friction, *grain_restitution, *grain_rolling, *grain_spinning;
    const double *surface_friction, *surface_restitution, *surface_rolling, *surface_spinning;
} ces_PairTable;

typedef struct ces_DetectInput {
    const ces_Particles *particles;
    size_t count; /* rows, those of this step's births too */
    const ces_Shape *shapes;
    bool only_spheres;
    bool composites;                /* some shape is of several materials */
    const double *displacement;     /* m, (count, 3): in the step, if nothing is in the way */
    const double *free_velocity;    /* m/s, (count, 3): at the end of the step, if nothing is in the way */
    const double *free_spin;        /* rad/s, (count, 3): the same of the angular velocity; NULL: it does not change */
    const double *free_orientation; /* (count, 4): the same of the orientation; NULL where there are spheres only */
    const ces_Surface *surfaces;
    size_t surface_count;
    const ces_PairTable *table;
    double step;             /* s */
    double gravity;          /* m/s2 */
    double most_restitution; /* of all pairs */
    bool grain_contact;
    int threads;
} ces_DetectInput;

typedef struct ces_Candidate {
    uint32_t a, b;             /* rows; b = index of the surface */
    uint32_t part_a, part_b;   /* see ces_Contact */
    double radius_a, radius_b; /* m, of the balls that meet; radius_b is not looked at where b is a surface */
    double path[3];            /* m, of a's part relative to b's, in the step */
    double point[3];           /* m, where they touch or would */
    ces_Approach approach;
} ces_Candidate;

/* The material that a part of a grain touches with: the grain's own, or that of the sphere of a composite. */
static inline size_t ces_touching_material(const ces_DetectInput *input, uint32_t row, uint32_t part)
{
    const ces_ShapeDef *shape = &input->shapes[input->particles->shape[row]].def;
    return shape->sphere_materials != NULL ? shape->sphere_materials[part] : (size_t)input->particles->material[row];
}

/* The contact that a candidate makes between these materials: coefficients, arms, the velocity of the other side, and the bias
 * of its row. */
void ces_describe_pair(const ces_DetectInput *input, const ces_Candidate *candidate, size_t material_a,
                       size_t material_b, ces_Contact *contact);
void ces_describe_surface(const ces_DetectInput *input, const ces_Candidate *candidate, size_t material,
                          ces_Contact *contact);

#endif
