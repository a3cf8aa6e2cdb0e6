#include "convex.h"

#include "../base/vec3.h"
#include "minkowski.h"

enum { STEPS = 128 };
#define ROUNDING_ERROR 1e-15 /* of the extent: what a nearest point may be wrong by */
#define TOUCHING                                                                                                       \
    1e-10 /* of the extent: nearer than this the normal comes from faces, not from a difference of points */

void ces_convex_place(ces_Convex *body, const double *vertices, size_t count, double scale, double rounding,
                      const double position[3], const double orientation[4])
{
    double squared = 0.0;
    *body = (ces_Convex){.vertices = vertices, .count = count, .scale = scale, .rounding = rounding};
    for (size_t k = 0; k < count; k++) {
        squared = ces_max(squared, ces_dot(&vertices[3 * k], &vertices[3 * k]));
    }
    body->reach = scale * sqrt(squared) + rounding;
    ces_copy(position, body->position);
    for (int column = 0; column < 3; column++) {
        double axis[3] = {0.0, 0.0, 0.0}, world[3];
        axis[column] = 1.0;
        ces_rotate(orientation, axis, world);
        for (int row = 0; row < 3; row++) {
            body->rotation[row][column] = world[row];
        }
    }
}

static bool has_point(const ces_Simplex *simplex, const double w[3])
{
    for (int k = 0; k < simplex->count; k++) {
        const double *p = simplex->point[k].w;
        if (p[0] == w[0] && p[1] == w[1] && p[2] == w[2]) {
            return true;
        }
    }
    return false;
}

/*
 * Gilbert, Johnson & Keerthi, IEEE J. Robot. Autom. 4 (1988) 193: simplices of support points walk towards the origin. The
 * distance of the difference from the origin and the nearest point; false where they touch or overlap.
 */
static bool walk(const ces_Difference *difference, const double start[3], ces_Simplex *simplex, double nearest[3])
{
    simplex->count = 1;
    simplex->weight[0] = 1.0;
    ces_support(difference, start, &simplex->point[0]);
    ces_copy(simplex->point[0].w, nearest);
    double squared = ces_dot(nearest, nearest), largest = sqrt(squared);
    for (int step = 0; step < STEPS; step++) {
        if (squared <= TOUCHING * TOUCHING * difference->extent * difference->extent) {
            return false;
        }
        const double towards[3] = {-nearest[0], -nearest[1], -nearest[2]};
        ces_Support next;
        ces_support(difference, towards, &next);
        largest = ces_max(largest, ces_norm(next.w));
        const double progress = squared + ces_dot(towards, next.w);
        if (progress <= ROUNDING_ERROR * largest * sqrt(squared) || has_point(simplex, next.w)) {
            return true;
        }
        ces_Simplex trial = *simplex;
        double point[3];
        trial.point[trial.count++] = next;
        if (!ces_simplex_nearest(&trial, point)) {
            return false;
        }
        const double trial_squared = ces_dot(point, point);
        if (!(trial_squared < squared)) {
            return true;
        }
        *simplex = trial;
        squared = trial_squared;
        ces_copy(point, nearest);
    }
    return true;
}

/* From the weights of a simplex to the nearest points of both bodies, from the centre of b. */
static void nearest_points(const ces_Difference *difference, const ces_Simplex *simplex, const double normal[3],
                           double point_a[3], double point_b[3])
{
    for (int k = 0; k < 3; k++) {
        point_a[k] = difference->offset[k] - difference->a->rounding * normal[k];
        point_b[k] = difference->b->rounding * normal[k];
    }
    for (int k = 0; k < simplex->count; k++) {
        ces_add_scaled(point_a, simplex->weight[k], simplex->point[k].a);
        ces_add_scaled(point_b, simplex->weight[k], simplex->point[k].b);
    }
}

double ces_convex_distance_at(const ces_Convex *a, const ces_Convex *b, const double offset[3], double normal[3],
                              double point_a[3], double point_b[3])
{
    const double apart = ces_norm(offset);
    ces_Difference difference = {.a = a, .b = b, .extent = (a->reach - a->rounding) + (b->reach - b->rounding) + apart};
    ces_copy(offset, difference.offset);
    double start[3] = {0.0, 1.0, 0.0}, nearest[3], distance;
    if (apart > 0.0) {
        for (int k = 0; k < 3; k++) {
            start[k] = offset[k] / apart;
        }
    }
    ces_Simplex simplex;
    if (walk(&difference, start, &simplex, nearest)) {
        distance = ces_norm(nearest);
        for (int k = 0; k < 3; k++) {
            normal[k] = -nearest[k] / distance;
        }
    } else {
        distance = -ces_portal_depth(&difference, start, normal, &simplex);
    }
    nearest_points(&difference, &simplex, normal, point_a, point_b);
    return distance - (a->rounding + b->rounding);
}

double ces_convex_distance(const ces_Convex *a, const ces_Convex *b, double normal[3], double point_a[3],
                           double point_b[3])
{
    double offset[3];
    ces_subtract(a->position, b->position, offset);
    const double gap = ces_convex_distance_at(a, b, offset, normal, point_a, point_b);
    for (int k = 0; k < 3; k++) {
        point_a[k] += b->position[k];
        point_b[k] += b->position[k];
    }
    return gap;
}
