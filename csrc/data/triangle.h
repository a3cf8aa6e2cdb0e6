/* data/triangle.h - one triangle of a mesh: the nearest of its points, and which kind of feature that lies on. */
#ifndef CES_TRIANGLE_H
#define CES_TRIANGLE_H

typedef enum ces_TriangleFeature { CES_FACE, CES_EDGE, CES_CORNER } ces_TriangleFeature;

typedef struct ces_Triangle {
    double corner[3][3]; /* m */
    double normal[3];    /* of its plane; which of the two does not matter */
} ces_Triangle;

/* The point of the triangle that is nearest to a point, m, and what it lies on. */
ces_TriangleFeature ces_triangle_nearest(const ces_Triangle *triangle, const double point[3], double nearest[3]);

/* Distance of a point from the triangle, m, and the direction from the triangle to it. Convex along any line, since the
 * triangle is; a point in the triangle takes the triangle's own normal. */
double ces_triangle_distance(const ces_Triangle *triangle, const double point[3], double normal[3]);

#endif
