/* contact/manifold.h - what the manifolds of bodies and of surfaces share: the contact plane, features, lists of points. */
#ifndef CES_MANIFOLD_H
#define CES_MANIFOLD_H

#include "convex.h"

/* Heights are along the normal, from b's centre; first and second span the plane across it. */
typedef struct ces_ContactPlane {
    double first[3], second[3], normal[3]; /* unit vectors */
} ces_ContactPlane;

typedef struct ces_Corner {
    double x, y, height; /* m */
    uint32_t vertex;     /* index in its body */
} ces_Corner;

/* What of a body faces the other: a corner, an edge or a counter-clockwise convex polygon, and a plane through it. */
typedef struct ces_Feature {
    int count;
    double size;             /* m, what tolerances are shares of */
    double slope[2], height; /* of the plane: height + slope . (x, y), nowhere outside the body */
    ces_Corner corner[CES_CONVEX_VERTICES];
} ces_Feature;

enum { CES_MANIFOLD_CANDIDATES = 4 * CES_CONVEX_VERTICES + 16 };

typedef struct ces_Candidates {
    int count;
    double size;   /* m, of the smaller body */
    double within; /* m, the largest gap of interest */
    ces_ManifoldPoint list[CES_MANIFOLD_CANDIDATES];
} ces_Candidates;

/* How far beyond the outermost vertex others still belong to a feature, and a gap to a contact, m. */
double ces_manifold_rise(double size, double margin);

void ces_contact_plane_look(const double normal[3], ces_ContactPlane *plane);
/* The vertices of a body that are outermost towards side (+1: up the normal, -1: down), to within the rise. */
void ces_feature_find(const ces_Convex *body, const ces_ContactPlane *plane, const double center[3], double side,
                      double rise, double size, ces_Feature *feature);
bool ces_feature_covers(const ces_Feature *feature, double x, double y); /* polygons only */
double ces_feature_height(const ces_Feature *feature, double x, double y);
/* The feature as a whole: a vertex, an edge, or the inside of a face. */
uint32_t ces_feature_name(const ces_Feature *feature);
/* From plane coordinates to a point relative to b's centre. */
void ces_contact_plane_point(const ces_ContactPlane *plane, double x, double y, double height, double point[3]);

/* Adds a point unless its gap is too large or one is there already. */
void ces_candidates_add(ces_Candidates *candidates, const ces_ManifoldPoint *point);
/* Takes the nearest points of the bodies in, unless some point has that gap. */
void ces_candidates_add_nearest(ces_Candidates *candidates, const ces_ManifoldPoint *nearest);
/* The one with the least gap, then those farthest from what is taken, in the order of their features. */
void ces_candidates_reduce(const ces_Candidates *candidates, ces_Manifold *manifold);

#endif
