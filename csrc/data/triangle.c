#include "triangle.h"

#include "../base/vec3.h"

static ces_TriangleFeature at_corner(const double corner[3], double nearest[3])
{
    ces_copy(corner, nearest);
    return CES_CORNER;
}

static ces_TriangleFeature on_edge(const double from[3], const double edge[3], double share, double nearest[3])
{
    ces_copy(from, nearest);
    ces_add_scaled(nearest, share, edge);
    return CES_EDGE;
}

/* By Voronoi regions: Ericson, Real-Time Collision Detection (2005), 5.1.5. */
ces_TriangleFeature ces_triangle_nearest(const ces_Triangle *triangle, const double point[3], double nearest[3])
{
    const double *a = triangle->corner[0], *b = triangle->corner[1], *c = triangle->corner[2];
    double ab[3], ac[3], bc[3], ap[3], bp[3], cp[3];
    ces_subtract(b, a, ab);
    ces_subtract(c, a, ac);
    ces_subtract(c, b, bc);
    ces_subtract(point, a, ap);
    ces_subtract(point, b, bp);
    ces_subtract(point, c, cp);
    const double d1 = ces_dot(ab, ap), d2 = ces_dot(ac, ap);
    const double d3 = ces_dot(ab, bp), d4 = ces_dot(ac, bp);
    const double d5 = ces_dot(ab, cp), d6 = ces_dot(ac, cp);
    if (d1 <= 0.0 && d2 <= 0.0) {
        return at_corner(a, nearest);
    }
    if (d3 >= 0.0 && d4 <= d3) {
        return at_corner(b, nearest);
    }
    if (d6 >= 0.0 && d5 <= d6) {
        return at_corner(c, nearest);
    }
    const double to_ab = d1 * d4 - d3 * d2, to_ac = d5 * d2 - d1 * d6, to_bc = d3 * d6 - d5 * d4;
    if (to_ab <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
        return on_edge(a, ab, d1 / (d1 - d3), nearest);
    }
    if (to_ac <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
        return on_edge(a, ac, d2 / (d2 - d6), nearest);
    }
    if (to_bc <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) {
        return on_edge(b, bc, (d4 - d3) / ((d4 - d3) + (d5 - d6)), nearest);
    }
    ces_copy(point, nearest);
    ces_add_scaled(nearest, -ces_dot(triangle->normal, ap), triangle->normal);
    return CES_FACE;
}

double ces_triangle_distance(const ces_Triangle *triangle, const double point[3], double normal[3])
{
    double nearest[3], offset[3];
    const ces_TriangleFeature feature = ces_triangle_nearest(triangle, point, nearest);
    ces_subtract(point, feature == CES_FACE ? triangle->corner[0] : nearest, offset);
    if (feature == CES_FACE) {
        /* The plane's own normal, so that triangles of one plane do not differ in it. */
        const double height = ces_dot(triangle->normal, offset);
        for (int k = 0; k < 3; k++) {
            normal[k] = height < 0.0 ? -triangle->normal[k] : triangle->normal[k];
        }
        return fabs(height);
    }
    const double distance = ces_norm(offset);
    for (int k = 0; k < 3; k++) {
        normal[k] = distance > 0.0 ? offset[k] / distance : triangle->normal[k];
    }
    return distance;
}
