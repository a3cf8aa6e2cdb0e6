#include "narrow_phase.h"

#include "../base/vec3.h"

enum { NEWTON_STEPS = 30 }; /* quadratic convergence: three or four are used, grazing paths take more */
#define TOUCH 1e-7          /* of a radius: nearer than this is touching */
#define RIDING 0.05 /* of a radius: a grain that touched the surface before and is nearer than this rides on it */

/* Distance and normal of a point of the path. */
typedef double Distance(const void *shape, const double point[3], double normal[3]);

/* A grain that rides on a drum would meet it at another fraction every step, and normals that alternate make its normal force
 * chatter: there the gap at the start of the path serves for all of it. */
static void approach(Distance *distance, const void *shape, const double start[3], const double path[3], double radius,
                     double smaller_radius, bool touched, ces_Approach *result)
{
    const double tolerance = TOUCH * smaller_radius;
    double fraction = 0.0;
    result->hit = false;
    for (int step = 0; step < NEWTON_STEPS; step++) {
        const double point[3] = {start[0] + fraction * path[0], start[1] + fraction * path[1],
                                 start[2] + fraction * path[2]};
        result->gap = distance(shape, point, result->normal) - radius;
        result->fraction = result->seen = fraction;
        if (step == 0) {
            result->start_gap = result->gap;
        }
        const double slope = ces_dot(result->normal, path);
        result->least_gap = ces_min(result->start_gap, result->gap + (1.0 - fraction) * slope);
        result->hit = result->gap <= tolerance;
        if (result->hit || slope >= 0.0) {
            return;
        }
        fraction -= result->gap / slope;
        if (fraction >= 1.0) {
            return;
        }
        if (touched && result->gap <= RIDING * smaller_radius) {
            result->gap = 0.0;
            result->fraction = fraction;
            result->hit = true;
            return;
        }
    }
}

static double point_distance(const void *shape, const double point[3], double normal[3])
{
    (void)shape;
    const double distance = ces_norm(point);
    if (distance > 0.0) {
        for (int k = 0; k < 3; k++) {
            normal[k] = point[k] / distance;
        }
    } else {
        /* Coincident centres: any direction separates them; up is as good as another, and always the same. */
        normal[0] = normal[2] = 0.0;
        normal[1] = 1.0;
    }
    return distance;
}

void ces_approach_sphere(const double offset[3], const double path[3], double radius_a, double radius_b,
                         ces_Approach *result)
{
    approach(point_distance, NULL, offset, path, radius_a + radius_b, ces_min(radius_a, radius_b), false, result);
}

static double surface_distance(const void *shape, const double point[3], double normal[3])
{
    return ces_surface_distance(shape, point, normal);
}

void ces_approach_surface(const ces_Surface *surface, const double center[3], const double path[3], double radius,
                          bool touched, ces_Approach *result)
{
    approach(surface_distance, surface, center, path, radius, radius, touched, result);
}

typedef struct ConvexPair {
    const ces_Convex *a, *b;
} ConvexPair;

static double convex_distance(const void *shape, const double offset[3], double normal[3])
{
    const ConvexPair *pair = shape;
    double point_a[3], point_b[3];
    return ces_convex_distance_at(pair->a, pair->b, offset, normal, point_a, point_b);
}

void ces_approach_convex(const ces_Convex *a, const ces_Convex *b, const double path[3], ces_Approach *result)
{
    const ConvexPair pair = {a, b};
    double offset[3];
    ces_subtract(a->position, b->position, offset);
    approach(convex_distance, &pair, offset, path, 0.0, ces_min(a->reach, b->reach), false, result);
}

typedef struct ConvexOnSurface {
    const ces_Convex *body;
    const ces_Surface *surface;
} ConvexOnSurface;

static double convex_surface_distance(const void *shape, const double center[3], double normal[3])
{
    const ConvexOnSurface *pair = shape;
    double point[3];
    return ces_convex_surface_distance(pair->body, pair->surface, center, normal, point);
}

void ces_approach_convex_surface(const ces_Convex *body, const ces_Surface *surface, const double path[3], bool touched,
                                 ces_Approach *result)
{
    const ConvexOnSurface pair = {body, surface};
    approach(convex_surface_distance, &pair, body->position, path, 0.0, body->reach, touched, result);
}

static double triangle_distance(const void *shape, const double point[3], double normal[3])
{
    return ces_triangle_distance(shape, point, normal);
}

void ces_approach_triangle(const ces_Triangle *triangle, const double center[3], const double path[3], double radius,
                           bool touched, ces_Approach *result)
{
    approach(triangle_distance, triangle, center, path, radius, radius, touched, result);
}
