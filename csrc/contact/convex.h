/*
 * contact/convex.h - convex grains: how far they are apart, along which normal, and at which points they touch.
 *
 * A body is the convex hull of its vertices, swollen by its rounding: a ball is one vertex with a rounding. Everything is
 * worked out for the Minkowski difference B - A seen from the offset of the two centres, so far from the origin nothing is
 * lost, and no length is typed in: the answer scales with the bodies.
 */
#ifndef CES_CONVEX_H
#define CES_CONVEX_H

#include "../data/machine.h"
#include "../data/shapes.h"

enum { CES_MANIFOLD_POINTS = 8 }; /* of a contact, at most */

typedef struct ces_Convex {
    const double *vertices; /* (count, 3), units */
    size_t count;           /* 1 to CES_CONVEX_VERTICES; 0: a solid cylinder about local z instead */
    double cylinder[2];     /* units, radius and half length, when count is 0 */
    double scale;           /* m a unit */
    double rounding;        /* m */
    double reach;           /* m, from the position to the farthest point */
    double rotation[3][3];  /* local to world */
    double position[3];     /* m */
} ces_Convex;

/* orientation: unit quaternion (w, x, y, z). */
void ces_convex_place(ces_Convex *body, const double *vertices, size_t count, double scale, double rounding,
                      const double position[3], const double orientation[4]);

/*
 * Signed distance, m, negative for the depth; normal from b to a; the points are the nearest ones of either surface. Bodies
 * apart are exact to some 1e-15 of their size. The depth of an overlap is that of a face of the difference (to 1e-12 of the
 * size) from which every neighbouring face is deeper. It is the least depth when it is below a thousandth of the smaller
 * reach; deeper ones are searched from fifteen sides, and there it is an upper bound. Never nan; bodies with one centre
 * are pushed apart upwards when all directions are alike.
 */
double ces_convex_distance(const ces_Convex *a, const ces_Convex *b, double normal[3], double point_a[3],
                           double point_b[3]);
/* The same with a's centre at an offset from b's, wherever the two are. The points are relative to the centre of b. */
double ces_convex_distance_at(const ces_Convex *a, const ces_Convex *b, const double offset[3], double normal[3],
                              double point_a[3], double point_b[3]);
/* Signed distance to a surface with the body's centre at a place. Planes, boxes and a cylinder's side and caps are exact. */
double ces_convex_surface_distance(const ces_Convex *body, const ces_Surface *surface, const double center[3],
                                   double normal[3], double point[3]);

/* ---- where they touch: convex_manifold.c, convex_surface.c --------------------------------------------------------- */

/* What of a body takes part: a vertex (v), an edge (v, w), or the inside of a face or a curved side. */
#define CES_FEATURE_FACE 0xFFFFFFFFu
#define CES_FEATURE_BELOW 0xFFFFFFFEu /* what lies below a vertex that is in reserve */
static inline uint32_t ces_feature_vertex(uint32_t v)
{
    return v;
}
static inline uint32_t ces_feature_edge(uint32_t v, uint32_t w)
{
    return v < w ? v | (w + 1) << 16 : w | (v + 1) << 16;
}

typedef struct ces_ManifoldPoint {
    double point[3];       /* m, on a */
    double normal[3];      /* from b to a */
    double gap;            /* m */
    uint32_t sub_a, sub_b; /* features, the same from step to step */
} ces_ManifoldPoint;

typedef struct ces_Manifold {
    int count; /* 1 to CES_MANIFOLD_POINTS, in the order of (sub_a, sub_b) */
    ces_ManifoldPoint points[CES_MANIFOLD_POINTS];
} ces_Manifold;

/* The points whose gap exceeds the least one by no more than the margin, m, and 0.03 of the smaller reach. */
void ces_convex_manifold(const ces_Convex *a, const ces_Convex *b, double margin, ces_Manifold *manifold);
/* The same of two grains: in touch along parallel edges or with corners, they push along the line of their centres. */
void ces_convex_grains_manifold(const ces_Convex *a, const ces_Convex *b, double margin, ces_Manifold *manifold);
/* The same along a normal that is given, from b to a. */
void ces_convex_manifold_along(const ces_Convex *a, const ces_Convex *b, const double normal[3], double margin,
                               ces_Manifold *manifold);
/* Not for meshes: they are no convex bodies, see convex_mesh.h. */
void ces_convex_surface_manifold(const ces_Convex *body, const ces_Surface *surface, double margin,
                                 ces_Manifold *manifold);
/*
 * The vertices over a surface that are farther than any point of contact, to within a height, m, that a fall would bring down:
 * what strikes with a corner turns, and must not turn through. normal: of the contact. May be none.
 */
void ces_convex_surface_reserve(const ces_Convex *body, const ces_Surface *surface, const double normal[3],
                                double height, ces_Manifold *manifold);

#endif
