/* contact/mesh_candidate.h - the contacts of a ball with a surface that is a mesh, in the world, for csrc/contact/detect.c. */
#ifndef CES_MESH_CANDIDATE_H
#define CES_MESH_CANDIDATE_H

#include "candidate.h"

typedef struct ces_MeshBall {
    const double *center, *path; /* m (3): at the start of the step, and in it */
    double margin;               /* m, how far from its path it is looked for */
    double restitution;
    bool touched; /* see ces_approach_surface */
} ces_MeshBall;

/* No more contacts than this will there be; cheap. radius: of the ball. */
size_t ces_mesh_slots(const ces_Surface *surface, const ces_MeshBall *ball, double radius);

/* Fills that many candidates, each from what the first says of a, b, part_a and the radii. Where there are fewer contacts
 * the others are out of reach of everything. */
void ces_meet_mesh(const ces_Surface *surface, const ces_MeshBall *ball, size_t slots, ces_Candidate *candidates);

#endif
