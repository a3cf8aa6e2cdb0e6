/* data/machine.h - the parts of the machine: analytic surfaces with a prescribed motion, and what they are made of. */
#ifndef CES_MACHINE_H
#define CES_MACHINE_H

#include "../cesim.h"

typedef struct ces_Surface {
    ces_SurfaceDef def;
    double rotation[3][3];  /* local to world; row k is world axis k */
    double half[3];         /* m: box half edges; cylinder (radius, radius, half length) */
    double bounds[3];       /* m, half edges of its box in the world; unused for a plane */
    double center[3];       /* m, now */
    double displacement[3]; /* m, of the shape in the coming step */
    double velocity[3];     /* m/s, of the shape, its mean in the coming step */
    double travel;          /* m, length of displacement */
    double spin[3];         /* rad/s, world */
} ces_Surface;

ces_Status ces_surface_create(const ces_SurfaceDef *def, ces_Surface *surface, ces_Error *error);

/* Puts the surface where it is at time, ready for a step of this size. */
void ces_surface_place(ces_Surface *surface, double time, double step);

/* Signed distance of a point, m, and the outward normal there. Outside it is exact, so it is convex along any line. */
double ces_surface_distance(const ces_Surface *surface, const double point[3], double normal[3]);

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
