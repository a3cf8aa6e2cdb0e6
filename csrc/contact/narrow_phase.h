/*
 * contact/narrow_phase.h - where the free path of a sphere or a convex body meets another or a surface, or how
 * near it comes.
 *
 * The gap between convex bodies that do not turn is a convex function of their relative position. So Newton's iteration from
 * the start of the path never overshoots the first touch, and the tangent plane of the gap at any point of the path lies
 * nowhere above it: a contact linearised there stops a body that would hit, and leaves one alone that would pass.
 */
#ifndef CES_NARROW_PHASE_H
#define CES_NARROW_PHASE_H

#include "../data/machine.h"
#include "../data/triangle.h"
#include "convex.h"

typedef struct ces_Approach {
    double normal[3]; /* from b to a */
    double gap;       /* m, at fraction of the path */
    double start_gap; /* m, at its start */
    double least_gap; /* m, no more than the gap at either end of the path */
    double fraction;  /* 0 at the start of the path, below 1 */
    double seen;      /* fraction of the path at which the normal was taken */
    bool hit;         /* they touch at fraction, or overlap at the start */
} ces_Approach;

/* offset = centre a - centre b; path = its change in the step, m. radius: of b. */
void ces_approach_sphere(const double offset[3], const double path[3], double radius_a, double radius_b,
                         ces_Approach *approach);
/* path relative to the surface's shape; touched: the grain was in contact with some surface in the step before */
void ces_approach_surface(const ces_Surface *surface, const double center[3], const double path[3], double radius,
                          bool touched, ces_Approach *approach);
/*
 * The same for convex bodies. They keep the orientation of the start of the path: what turns by an angle in the step may come
 * nearer by up to its reach times that angle, and by half its square when the contact's arms follow the turn.
 */
void ces_approach_convex(const ces_Convex *a, const ces_Convex *b, const double path[3], ces_Approach *approach);
void ces_approach_convex_surface(const ces_Convex *body, const ces_Surface *surface, const double path[3], bool touched,
                                 ces_Approach *approach);
/* The same for one triangle, whose both sides count: the one on which the path starts is the free one. */
void ces_approach_triangle(const ces_Triangle *triangle, const double center[3], const double path[3], double radius,
                           bool touched, ces_Approach *approach);

#endif
