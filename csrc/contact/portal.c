/*
 * Portal refinement (Snethen, "XenoCollide", Game Programming Gems 7, 2008). Seen along a direction, three points of the
 * difference whose triangle covers the origin are a portal; the point farthest along the portal's normal makes it nearer to
 * the surface, until it is a face. Looking along that face's normal from the origin next finds a face no deeper, and so on
 * to one that has the origin straight below it. Every normal tried has a depth that is an upper bound: the least is kept.
 */
#include "minkowski.h"

#include "../base/vec3.h"

enum { SEARCH_STEPS = 64, REFINE_STEPS = 128, CASTS = 16 };
#define FACE 1e-14    /* of the extent: a support point no farther beyond a portal lies in it */
#define EDGE_ON 1e-12 /* a portal seen under a smaller sine is seen from the side */
#define BESIDE                                                                                                         \
    1e-11 /* of the extent: the line of sight passes the origin by this, so that it meets no edge or corner */
#define SHALLOW 1e-3 /* of the smaller reach: a depth beyond is looked for from all sides */

typedef struct View {
    double along[3], right[3], up[3]; /* unit vectors */
    double x, y;                      /* m, of the line of sight beside the origin */
} View;

typedef struct Best {
    double depth, normal[3];
    ces_Support face[3];
    bool is_face; /* not just the farthest point along the normal */
} Best;

static void look(const double along[3], double extent, View *view)
{
    int least = 0;
    for (int k = 1; k < 3; k++) {
        least = fabs(along[k]) < fabs(along[least]) ? k : least;
    }
    double axis[3] = {0.0, 0.0, 0.0};
    axis[least] = 1.0;
    ces_copy(along, view->along);
    ces_cross(along, axis, view->right);
    const double norm = ces_norm(view->right);
    for (int k = 0; k < 3; k++) {
        view->right[k] /= norm;
    }
    ces_cross(along, view->right, view->up);
    view->x = 0.8314696 * BESIDE * extent;
    view->y = 0.5555702 * BESIDE * extent;
}

static double seen_x(const View *view, const double p[3])
{
    return ces_dot(view->right, p) - view->x;
}

static double seen_y(const View *view, const double p[3])
{
    return ces_dot(view->up, p) - view->y;
}

/* Twice the area of the triangle of the line of sight and two points, as seen. */
static double seen_area(const View *view, const double p[3], const double q[3])
{
    return seen_x(view, p) * seen_y(view, q) - seen_y(view, p) * seen_x(view, q);
}

/* The direction across the line of sight, square to the seen edge from p to q, on the side of the origin. */
static void across_edge(const View *view, const double p[3], const double q[3], double direction[3])
{
    const double x = ces_dot(view->right, q) - ces_dot(view->right, p);
    const double y = ces_dot(view->up, q) - ces_dot(view->up, p);
    const double side = seen_area(view, p, q) >= 0.0 ? 1.0 : -1.0;
    for (int k = 0; k < 3; k++) {
        direction[k] = side * (x * view->up[k] - y * view->right[k]);
    }
}

/* Three support points whose triangle, as seen, has the origin inside; false where there is none. */
static bool find_portal(const ces_Difference *difference, const View *view, ces_Support portal[3])
{
    double direction[3];
    ces_support(difference, view->along, &portal[0]);
    const double x = seen_x(view, portal[0].w), y = seen_y(view, portal[0].w);
    for (int k = 0; k < 3; k++) {
        direction[k] = -x * view->right[k] - y * view->up[k];
    }
    ces_support(difference, direction, &portal[1]);
    if (!(-x * seen_x(view, portal[1].w) - y * seen_y(view, portal[1].w) > 0.0)) {
        return false;
    }
    for (int step = 0; step < SEARCH_STEPS; step++) {
        across_edge(view, portal[0].w, portal[1].w, direction);
        ces_support(difference, direction, &portal[2]);
        const double edge = ces_dot(direction, portal[0].w);
        const double sight = view->x * ces_dot(direction, view->right) + view->y * ces_dot(direction, view->up);
        if (!(ces_dot(direction, portal[2].w) > ces_max(sight, edge))) {
            return false;
        }
        const double turn = seen_area(view, portal[0].w, portal[1].w) >= 0.0 ? 1.0 : -1.0;
        if (turn * seen_area(view, portal[1].w, portal[2].w) < 0.0) {
            portal[0] = portal[2];
        } else if (turn * seen_area(view, portal[2].w, portal[0].w) < 0.0) {
            portal[1] = portal[2];
        } else {
            return true;
        }
    }
    return false;
}

/* Unit normal of the portal towards the viewer's far side; false when the portal is seen edge-on, or is none. */
static bool portal_normal(const View *view, const ces_Support portal[3], double normal[3])
{
    double first[3], second[3];
    ces_subtract(portal[1].w, portal[0].w, first);
    ces_subtract(portal[2].w, portal[0].w, second);
    ces_cross(first, second, normal);
    const double norm = ces_norm(normal), along = ces_dot(normal, view->along);
    if (!(norm > 0.0) || fabs(along) <= EDGE_ON * norm) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        normal[k] = along > 0.0 ? normal[k] / norm : -normal[k] / norm;
    }
    return true;
}

/* One corner of the portal gives way to a point beyond it: the corner without which the origin stays inside; where that
 * leaves a choice, the one that brings the portal farthest out. */
static void narrow(const View *view, ces_Support portal[3], const ces_Support *beyond)
{
    int chosen = 0;
    double best_inside = -HUGE_VAL, best_height = -HUGE_VAL;
    for (int out = 0; out < 3; out++) {
        ces_Support trial[3] = {portal[0], portal[1], portal[2]};
        trial[out] = *beyond;
        double normal[3], inside = HUGE_VAL;
        if (!portal_normal(view, trial, normal)) {
            continue;
        }
        double turn = 0.0;
        for (int k = 0; k < 3; k++) {
            turn += seen_area(view, trial[k].w, trial[(k + 1) % 3].w);
        }
        for (int k = 0; k < 3; k++) {
            inside = ces_min(inside, copysign(1.0, turn) * seen_area(view, trial[k].w, trial[(k + 1) % 3].w));
        }
        inside = ces_min(inside, 0.0);
        const double height = ces_dot(normal, beyond->w) / ces_dot(normal, view->along);
        if (inside > best_inside || (inside == best_inside && height > best_height)) {
            chosen = out;
            best_inside = inside;
            best_height = height;
        }
    }
    portal[chosen] = *beyond;
}

/* Follows one line of sight to the face where it leaves the difference. True when that made the depth less. */
static bool cast(const ces_Difference *difference, const double along[3], Best *best)
{
    const double tolerance = FACE * difference->extent, before = best->depth;
    View view;
    ces_Support portal[3];
    look(along, difference->extent, &view);
    if (!find_portal(difference, &view, portal)) {
        return false;
    }
    for (int step = 0; step < REFINE_STEPS; step++) {
        double normal[3];
        ces_Support beyond;
        if (!portal_normal(&view, portal, normal)) {
            break;
        }
        ces_support(difference, normal, &beyond);
        const double depth = ces_dot(normal, beyond.w);
        const bool is_face = depth - ces_dot(normal, portal[0].w) <= tolerance;
        if (depth < best->depth || (is_face && depth <= best->depth + tolerance)) {
            best->depth = depth;
            best->is_face = is_face;
            ces_copy(normal, best->normal);
            for (int k = 0; k < 3; k++) {
                best->face[k] = portal[k];
            }
        }
        if (is_face) {
            break;
        }
        narrow(&view, portal, &beyond);
    }
    return best->depth < before - tolerance;
}

static void cast_to_the_end(const ces_Difference *difference, const double along[3], Best *best)
{
    double direction[3];
    ces_copy(along, direction);
    for (int k = 0; k < CASTS && cast(difference, direction, best); k++) {
        ces_copy(best->normal, direction);
    }
}

static void try_normal(const ces_Difference *difference, const double normal[3], Best *best)
{
    ces_Support far;
    ces_support(difference, normal, &far);
    const double depth = ces_dot(normal, far.w);
    if (depth < best->depth) {
        best->depth = depth;
        best->is_face = false;
        ces_copy(normal, best->normal);
        best->face[0] = best->face[1] = best->face[2] = far;
    }
}

/* A difference without an inside - a point, a line, a flat piece - has no portals: its normal is square to what it spans. */
static void try_flat(const ces_Difference *difference, const double start[3], Best *best)
{
    ces_Support ends[6];
    double span[3] = {0.0, 0.0, 0.0}, normal[3] = {0.0, 0.0, 0.0}, longest = 0.0, widest = 0.0;
    for (int k = 0; k < 6; k++) {
        double direction[3] = {0.0, 0.0, 0.0};
        direction[k / 2] = k % 2 == 0 ? 1.0 : -1.0;
        ces_support(difference, direction, &ends[k]);
    }
    for (int k = 1; k < 6; k++) {
        double edge[3];
        ces_subtract(ends[k].w, ends[0].w, edge);
        if (ces_norm(edge) > longest) {
            longest = ces_norm(edge);
            ces_copy(edge, span);
        }
    }
    for (int k = 1; k < 6; k++) {
        double edge[3], square[3];
        ces_subtract(ends[k].w, ends[0].w, edge);
        ces_cross(span, edge, square);
        if (ces_norm(square) > ces_max(widest, 1e-12 * longest * longest)) {
            widest = ces_norm(square);
            ces_copy(square, normal);
        }
    }
    if (widest == 0.0 && longest > 0.0) {
        View view;
        for (int k = 0; k < 3; k++) {
            span[k] /= longest;
        }
        look(span, difference->extent, &view);
        ces_copy(start, normal);
        ces_add_scaled(normal, -ces_dot(start, span), span);
        if (ces_norm(normal) <= 1e-6) {
            ces_copy(view.up, normal);
        }
    } else if (widest == 0.0) {
        ces_copy(start, normal);
    }
    const double norm = ces_dot(normal, start) < 0.0 ? -ces_norm(normal) : ces_norm(normal);
    for (int k = 0; k < 3; k++) {
        normal[k] /= norm;
    }
    try_normal(difference, normal, best);
    for (int k = 0; k < 3; k++) {
        normal[k] = -normal[k];
    }
    try_normal(difference, normal, best);
}

static double smaller_reach(const ces_Difference *difference)
{
    const double a = difference->a->reach, b = difference->b->reach;
    return a < b ? a : b;
}

double ces_portal_depth(const ces_Difference *difference, const double start[3], double normal[3], ces_Simplex *face)
{
    Best best;
    best.depth = HUGE_VAL;
    try_normal(difference, start, &best);
    cast(difference, start, &best);
    if (!best.is_face) {
        try_flat(difference, start, &best);
    }
    double first[3];
    ces_copy(best.normal, first);
    cast_to_the_end(difference, first, &best);
    if (best.depth > SHALLOW * smaller_reach(difference)) {
        for (int k = 0; k < 14; k++) {
            /* From the axes of both bodies and against the start, each to the end: the least of all is kept. */
            const ces_Convex *body = k < 6 ? difference->a : difference->b;
            double direction[3];
            for (int row = 0; row < 3; row++) {
                const double sign = k % 2 == 0 ? 1.0 : -1.0;
                direction[row] = k < 12 ? sign * body->rotation[row][(k / 2) % 3] : sign * start[row];
            }
            Best other;
            other.depth = HUGE_VAL;
            other.is_face = false;
            cast_to_the_end(difference, direction, &other);
            if (other.depth < best.depth - FACE * difference->extent) {
                best = other;
            }
        }
    }
    ces_copy(best.normal, normal);
    if (!best.is_face && face->count < 4) {
        return best.depth;
    }
    /* The point of the face below the origin: nearest to it once the face is moved there. */
    face->count = 3;
    for (int k = 0; k < 3; k++) {
        face->point[k] = best.face[k];
        ces_add_scaled(face->point[k].w, -best.depth, normal);
    }
    double nearest[3];
    ces_simplex_nearest(face, nearest);
    return best.depth;
}
