#include "narrow_phase.h"

#include "../base/vec3.h"

enum { NEWTON_STEPS = 30 }; /* quadratic convergence: three or four are used, grazing paths take more */
enum { HALVINGS = 40 };
#define TOUCH 1e-7  /* of a radius: nearer than this is touching */
#define RIDING 0.05 /* of a radius: a grain that touched the surface before and is nearer than this rides on it */

/* Distance and normal of a point of the path. */
typedef double Distance(const void *shape, const double point[3], double normal[3]);

typedef struct Path {
    Distance *distance;
    const void *shape;
    const double *start, *path;
    double radius;
} Path;

/* The gap at a fraction of the path, with its normal; gives its slope. */
static double look(const Path *way, double fraction, ces_Approach *result)
{
    const double point[3] = {way->start[0] + fraction * way->path[0], way->start[1] + fraction * way->path[1],
                             way->start[2] + fraction * way->path[2]};
    result->gap = way->distance(way->shape, point, result->normal) - way->radius;
    result->fraction = result->seen = fraction;
    return ces_dot(result->normal, way->path);
}

/*
 * A path that passes by: Newton's last step has gone from "before" beyond the closest approach. The tangent plane there may have
 * the start of the path on its far side, and would ask of a grain that something else stops to be past it. So back to where both
 * ends are on the near side; halving the bracket gets there, as the slope vanishes at the closest approach and the gap does not.
 */
static void come_back(const Path *way, double before, double slope, double tolerance, ces_Approach *result)
{
    double beyond = result->fraction;
    for (int step = 0; step < HALVINGS && beyond * slope > result->gap; step++) {
        const double middle = 0.5 * (before + beyond);
        const ces_Approach last = *result;
        const double here = look(way, middle, result);
        if (result->gap <= tolerance) {
            result->hit = true;
            return;
        }
        if (here < 0.0) {
            before = middle;
            *result = last;
        } else {
            beyond = middle;
            slope = here;
        }
    }
}

/* A grain that rides on a drum would meet it at another fraction every step, and normals that alternate make its normal force
 * chatter: there the gap at the start of the path serves for all of it. */
static void approach(Distance *distance, const void *shape, const double start[3], const double path[3], double radius,
                     double smaller_radius, bool touched, ces_Approach *result)
{
    const double tolerance = TOUCH * smaller_radius;
    const Path way = {distance, shape, start, path, radius};
    double fraction = 0.0, before = 0.0;
    result->hit = false;
    for (int step = 0; step < NEWTON_STEPS; step++) {
        const double slope = look(&way, fraction, result);
        if (step == 0) {
            result->start_gap = result->gap;
        }
        result->hit = result->gap <= tolerance;
        if (step > 0 && !result->hit && slope >= 0.0) {
            come_back(&way, before, slope, tolerance, result);
        }
        result->least_gap =
            ces_min(result->start_gap, result->gap + (1.0 - result->fraction) * ces_dot(result->normal, path));
        if (result->hit || slope >= 0.0) {
            return;
        }
        before = fraction;
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
