/* data/machine.h - the parts of the machine: analytic surfaces with a prescribed motion, and what they are made of. */
#ifndef CES_MACHINE_H
#define CES_MACHINE_H

#include "../cesim.h"
#include "mesh.h"

typedef struct ces_Surface {
    ces_SurfaceDef def;
    double rotation[3][3]; /* local to world, now; row k is world axis k */
    double half[3];   /* m: box half edges; cylinder (radius, radius, half length); mesh: of the box round its origin */
    double bounds[3]; /* m, half edges of its box in the world; unused for a plane */
    double center[3]; /* m, now */
    double displacement[3]; /* m, of the shape in the coming step */
    double velocity[3];     /* m/s, of the shape, its mean in the coming step */
    double travel;          /* m, no point of it moves farther in the coming step */
    double spin[3];         /* rad/s, world; of a mesh the mean in the coming step: a chord, not an arc */
    ces_Mesh *mesh;         /* NULL unless the shape is a mesh */
    double rest[3][3];      /* of a mesh that turns: its rotation at time 0, */
    double middle[3][3];    /* halfway through the coming step, */
    double end[3][3];       /* and at its end */
} ces_Surface;

ces_Status ces_surface_create(const ces_SurfaceDef *def, ces_Surface *surface, ces_Error *error);
void ces_surface_free(ces_Surface *surface);

/* Puts the surface where it is at time, ready for a step of this size. */
void ces_surface_place(ces_Surface *surface, double time, double step);

/* Signed distance of a point, m, and the outward normal there. Outside it is exact, so it is convex along any line;
 * that of a mesh is neither signed nor convex. */
double ces_surface_distance(const ces_Surface *surface, const double point[3], double normal[3]);

/* Into the frame of a mesh and out of it. The path is that of a point that moves by path in the world while the mesh moves. */
void ces_surface_to_mesh(const ces_Surface *surface, const double point[3], const double path[3], double local[3],
                         double local_path[3]);
/* A direction in the mesh, as it points in the world halfway through the step. */
void ces_surface_from_mesh(const ces_Surface *surface, const double direction[3], double world[3]);

/* Velocity of the shape at a point of it, m/s: what a surface that moves in itself does not have. Mean in the coming step. */
void ces_surface_shape_velocity(const ces_Surface *surface, const double point[3], double velocity[3]);

/* Velocity of the surface's matter at a point of it, m/s. */
void ces_surface_velocity(const ces_Surface *surface, const double point[3], double velocity[3]);

/* False when no part of the surface is within reach of the point (a cheap test; true promises nothing). */
static inline bool ces_surface_within(const ces_Surface *surface, const double point[3], double reach)
{
    if (surface->def.shape == CES_PLANE) {
        const double(*r)[3] = surface->rotation; /* the normal is its column 1 */
        const double *c = surface->center;
        return r[0][1] * (point[0] - c[0]) + r[1][1] * (point[1] - c[1]) + r[2][1] * (point[2] - c[2]) <= reach;
    }
    for (int k = 0; k < 3; k++) {
        const double off = point[k] - surface->center[k];
        if (off > surface->bounds[k] + reach || -off > surface->bounds[k] + reach) {
            return false;
        }
    }
    return true;
}

#endif
