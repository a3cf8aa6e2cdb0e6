/* contact/minkowski.h - the difference B - A of two convex bodies, its support points, and simplices of them. */
#ifndef CES_MINKOWSKI_H
#define CES_MINKOWSKI_H

#include "convex.h"

/* A point of B - A, from the origin of the difference; the origin is outside it when the bodies are apart. */
typedef struct ces_Support {
    double w[3]; /* m: b - a - offset */
    double a[3]; /* m, of A's core, from its centre */
    double b[3]; /* m, of B's core, from its centre */
} ces_Support;

typedef struct ces_Difference {
    const ces_Convex *a, *b;
    double offset[3]; /* m, centre of a - centre of b */
    double extent;    /* m, of the whole; tolerances are shares of it */
} ces_Difference;

typedef struct ces_Simplex {
    int count; /* 1 to 4 */
    ces_Support point[4];
    double weight[4]; /* of the point nearest to the origin */
} ces_Simplex;

/* The point of the difference farthest along a direction (any length). */
void ces_support(const ces_Difference *difference, const double direction[3], ces_Support *support);

/* The point of a body's core farthest along a direction, from its centre, m; its index. */
size_t ces_convex_support(const ces_Convex *body, const double direction[3], double point[3]);

/* Cuts a simplex down to the face with its nearest point, gives that point; false when the origin is inside a tetrahedron. */
bool ces_simplex_nearest(ces_Simplex *simplex, double nearest[3]);

/*
 * Portal refinement: the depth of the origin, m (negative when it lies outside, in sight of a face), the outward normal of
 * the face, and a triangle of it with the weights of the point nearest to the origin. start: unit vector to look along first.
 * A difference without an inside has no such face: then the simplex that was handed in stays.
 */
double ces_portal_depth(const ces_Difference *difference, const double start[3], double normal[3], ces_Simplex *face);

#endif
