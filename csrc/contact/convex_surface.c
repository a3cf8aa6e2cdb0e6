/*
 * Convex bodies against the parts of the machine. A plane is met by vertices. A box is a convex body itself. A cylinder is
 * three things: its side, which is a line with a rounding; its caps, which are planes; and its rims, for which the general
 * walk goes along the true circle.
 */
#include "../base/vec3.h"
#include "manifold.h"

#define ACROSS 1e-9 /* cosine to the axis: what is square to it */
#define ALONG 1e-6  /* less than 1 by this, the cosine of two normals of one face */

static const double CORNERS[24] = {-1, -1, -1, 1, -1, -1, -1, 1, -1, 1, 1, -1, -1, -1, 1, 1, -1, 1, -1, 1, 1, 1, 1, 1};

static void surface_body(const ces_Surface *surface, ces_Convex *body)
{
    *body = (ces_Convex){.count = 0, .cylinder = {surface->half[0], surface->half[2]}, .scale = 1.0};
    body->reach = hypot(surface->half[0], surface->half[2]);
    for (int row = 0; row < 3; row++) {
        ces_copy(surface->rotation[row], body->rotation[row]);
    }
    ces_copy(surface->center, body->position);
}

static void box_body(const ces_Surface *surface, double vertices[24], ces_Convex *body)
{
    surface_body(surface, body);
    for (int k = 0; k < 24; k++) {
        vertices[k] = CORNERS[k] * surface->half[k % 3];
    }
    body->vertices = vertices;
    body->count = 8;
    body->reach = ces_norm(surface->half);
}

static void vertex_place(const ces_Convex *body, size_t v, const double center[3], double place[3])
{
    for (int k = 0; k < 3; k++) {
        place[k] = center[k] + body->scale * ces_dot(body->rotation[k], &body->vertices[3 * v]);
    }
}

static double plane_distance(const ces_Convex *body, const ces_Surface *surface, const double center[3],
                             double normal[3], double point[3])
{
    double least = HUGE_VAL;
    for (size_t v = 0; v < body->count; v++) {
        double place[3];
        vertex_place(body, v, center, place);
        const double distance = ces_surface_distance(surface, place, normal);
        if (distance < least) {
            least = distance;
            ces_copy(place, point);
        }
    }
    ces_add_scaled(point, -body->rounding, normal);
    return least - body->rounding;
}

/* Against the side: the axis is a hull of two points, swollen by the radius. False when the nearest place is not the side. */
static bool side_distance(const ces_Convex *body, const ces_Surface *surface, const double offset[3], double *distance,
                          double normal[3], double point[3])
{
    const double half = surface->half[2], ends[6] = {0.0, 0.0, -half, 0.0, 0.0, half};
    ces_Convex line;
    double on_side[3], axis[3];
    surface_body(surface, &line);
    line.vertices = ends;
    line.count = 2;
    line.rounding = surface->half[0];
    line.reach = half + line.rounding;
    *distance = ces_convex_distance_at(body, &line, offset, normal, point, on_side);
    for (int k = 0; k < 3; k++) {
        axis[k] = surface->rotation[k][2];
    }
    if (fabs(ces_dot(normal, axis)) > ACROSS || *distance <= -(line.rounding + body->rounding)) {
        return false;
    }
    /* Outside, it is the least distance for being a nearest point; inside, the caps must be farther than the side. */
    return *distance >= 0.0 || fabs(ces_dot(point, axis)) - half <= *distance;
}

/* A cap's plane separates the two by no more than they are apart: gap and normal of the one on the body's side. */
static double cap_distance(const ces_Convex *body, const ces_Surface *surface, const double offset[3], double normal[3])
{
    double place[3], least = HUGE_VAL;
    for (int k = 0; k < 3; k++) {
        normal[k] = surface->rotation[k][2];
    }
    if (ces_dot(normal, offset) < 0.0) {
        for (int k = 0; k < 3; k++) {
            normal[k] = -normal[k];
        }
    }
    for (size_t v = 0; v < body->count; v++) {
        vertex_place(body, v, offset, place);
        least = ces_min(least, ces_dot(normal, place));
    }
    return least - surface->half[2] - body->rounding;
}

static double cylinder_distance(const ces_Convex *body, const ces_Surface *surface, const double center[3],
                                double normal[3], double point[3])
{
    double offset[3], cap[3], distance, on_surface[3];
    ces_subtract(center, surface->center, offset);
    if (!side_distance(body, surface, offset, &distance, normal, point)) {
        ces_Convex cylinder;
        surface_body(surface, &cylinder);
        distance = ces_convex_distance_at(body, &cylinder, offset, normal, point, on_surface);
        const double at_cap = cap_distance(body, surface, offset, cap);
        if (at_cap >= distance - 1e-9 * body->reach) {
            distance = at_cap;
            ces_copy(cap, normal);
        }
    }
    for (int k = 0; k < 3; k++) {
        point[k] += surface->center[k];
    }
    return distance;
}

double ces_convex_surface_distance(const ces_Convex *body, const ces_Surface *surface, const double center[3],
                                   double normal[3], double point[3])
{
    switch (surface->def.shape) {
    case CES_PLANE:
        return plane_distance(body, surface, center, normal, point);
    case CES_CYLINDER:
        return cylinder_distance(body, surface, center, normal, point);
    case CES_BOX:
    case CES_MESH: /* refused with convex grains when a scene is made */
        break;
    }
    ces_Convex box;
    double vertices[24], offset[3], on_box[3];
    box_body(surface, vertices, &box);
    ces_subtract(center, surface->center, offset);
    const double gap = ces_convex_distance_at(body, &box, offset, normal, point, on_box);
    for (int k = 0; k < 3; k++) {
        point[k] += surface->center[k];
    }
    return gap;
}

/* ---- points -------------------------------------------------------------------------------------------------------- */

/* A point of the body with its own gap and normal; rounding is added here. */
static void add_point(const ces_Convex *body, const ces_Surface *surface, const double place[3], uint32_t sub_a,
                      uint32_t sub_b, ces_Candidates *candidates)
{
    ces_ManifoldPoint point = {.sub_a = sub_a, .sub_b = sub_b};
    point.gap = ces_surface_distance(surface, place, point.normal) - body->rounding;
    ces_copy(place, point.point);
    ces_add_scaled(point.point, -body->rounding, point.normal);
    ces_candidates_add(candidates, &point);
}

static void add_vertices(const ces_Convex *body, const ces_Surface *surface, ces_Candidates *candidates)
{
    for (size_t v = 0; v < body->count; v++) {
        double place[3];
        vertex_place(body, v, body->position, place);
        add_point(body, surface, place, ces_feature_vertex((uint32_t)v), CES_FEATURE_FACE, candidates);
    }
}

/* A line of points in the contact plane, as x cos + y sin = distance. */
static double off_line(const double across[2], const double through[2], double x, double y)
{
    return (x - through[0]) * across[0] + (y - through[1]) * across[1];
}

/* Where the line of the side that lies nearest runs under a face: it enters and leaves across the face's edges, or it ends
 * under the face at a rim. */
static void add_side(const ces_Convex *body, const ces_Surface *surface, const ces_ContactPlane *plane,
                     const ces_Feature *feature, const double nearest[3], ces_Candidates *candidates)
{
    double axis[3], place[3];
    for (int k = 0; k < 3; k++) {
        axis[k] = surface->rotation[k][2];
        place[k] = nearest[k] - surface->center[k];
    }
    const double along[2] = {ces_dot(axis, plane->first), ces_dot(axis, plane->second)};
    const double across[2] = {-along[1], along[0]};
    const double through[2] = {ces_dot(place, plane->first), ces_dot(place, plane->second)};
    for (int k = 0; k < (feature->count > 2 ? feature->count : feature->count - 1); k++) {
        const ces_Corner *p = &feature->corner[k], *q = &feature->corner[(k + 1) % feature->count];
        const double from = off_line(across, through, p->x, p->y), to = off_line(across, through, q->x, q->y);
        if (from * to < 0.0) {
            const double t = from / (from - to);
            ces_contact_plane_point(plane, p->x + t * (q->x - p->x), p->y + t * (q->y - p->y),
                                    p->height + t * (q->height - p->height), place);
            ces_add_scaled(place, 1.0, surface->center);
            add_point(body, surface, place, ces_feature_edge(p->vertex, q->vertex), CES_FEATURE_FACE, candidates);
        }
    }
    for (int end = 0; end < 2; end++) {
        const double shift =
            (end == 0 ? -1.0 : 1.0) * surface->half[2] - ces_dot(axis, nearest) + ces_dot(axis, surface->center);
        const double x = through[0] + shift * along[0], y = through[1] + shift * along[1];
        if (ces_feature_covers(feature, x, y)) {
            ces_contact_plane_point(plane, x, y, ces_feature_height(feature, x, y), place);
            ces_add_scaled(place, 1.0, surface->center);
            add_point(body, surface, place, CES_FEATURE_FACE, ces_feature_vertex((uint32_t)end), candidates);
        }
    }
}

/* Where the edges of a face cross the rim of a cap, and eight places of the rim that lie under the face. */
static void add_cap(const ces_Convex *body, const ces_Surface *surface, const ces_ContactPlane *plane,
                    const ces_Feature *feature, ces_Candidates *candidates)
{
    const double radius = surface->half[0];
    double place[3];
    for (int k = 0; k < (feature->count > 2 ? feature->count : feature->count - 1); k++) {
        const ces_Corner *p = &feature->corner[k], *q = &feature->corner[(k + 1) % feature->count];
        const double ex = q->x - p->x, ey = q->y - p->y, squared = ex * ex + ey * ey;
        const double half = (p->x * ex + p->y * ey) / squared;
        const double inside = half * half - (p->x * p->x + p->y * p->y - radius * radius) / squared;
        for (int sign = -1; inside > 0.0 && sign < 2; sign += 2) {
            const double t = sign * sqrt(inside) - half;
            if (t > 0.0 && t < 1.0) {
                ces_contact_plane_point(plane, p->x + t * ex, p->y + t * ey, p->height + t * (q->height - p->height),
                                        place);
                ces_add_scaled(place, 1.0, surface->center);
                add_point(body, surface, place, ces_feature_edge(p->vertex, q->vertex),
                          ces_feature_vertex(sign < 0 ? 0u : 1u), candidates);
            }
        }
    }
    for (uint32_t k = 0; k < 8; k++) {
        const double angle = 0.25 * CES_PI * k;
        const double x = radius * cos(angle), y = radius * sin(angle);
        if (ces_feature_covers(feature, x, y)) {
            ces_contact_plane_point(plane, x, y, ces_feature_height(feature, x, y), place);
            ces_add_scaled(place, 1.0, surface->center);
            add_point(body, surface, place, CES_FEATURE_FACE, ces_feature_vertex(2 + k), candidates);
        }
    }
}

void ces_convex_surface_manifold(const ces_Convex *body, const ces_Surface *surface, double margin,
                                 ces_Manifold *manifold)
{
    if (surface->def.shape == CES_BOX) {
        ces_Convex box;
        double vertices[24];
        box_body(surface, vertices, &box);
        ces_convex_manifold(body, &box, margin, manifold);
        return;
    }
    const double rise = ces_manifold_rise(body->reach, margin);
    ces_ManifoldPoint nearest = {.sub_a = CES_FEATURE_FACE, .sub_b = CES_FEATURE_FACE};
    ces_Candidates candidates;
    nearest.gap = ces_convex_surface_distance(body, surface, body->position, nearest.normal, nearest.point);
    candidates.count = 0;
    candidates.size = body->reach;
    candidates.within = nearest.gap + rise;
    if (surface->def.shape == CES_CYLINDER) {
        ces_ContactPlane plane;
        ces_Feature feature;
        ces_Convex core = *body; /* the rounding is added point by point */
        double offset[3], axis[3];
        core.rounding = 0.0;
        for (int k = 0; k < 3; k++) {
            axis[k] = surface->rotation[k][2];
        }
        ces_subtract(body->position, surface->center, offset);
        ces_contact_plane_look(nearest.normal, &plane);
        ces_feature_find(&core, &plane, offset, -1.0, rise, body->reach, &feature);
        nearest.sub_a = ces_feature_name(&feature);
        const double slant = fabs(ces_dot(axis, nearest.normal));
        if (slant <= 1e-6) {
            add_side(body, surface, &plane, &feature, nearest.point, &candidates);
        } else if (slant >= 1.0 - 1e-9) {
            add_cap(body, surface, &plane, &feature, &candidates);
        }
    }
    add_vertices(body, surface, &candidates);
    ces_candidates_add_nearest(&candidates, &nearest);
    ces_candidates_reduce(&candidates, manifold);
}

void ces_convex_surface_reserve(const ces_Convex *body, const ces_Surface *surface, const double normal[3],
                                double height, ces_Manifold *manifold)
{
    ces_Candidates candidates;
    candidates.count = 0;
    candidates.size = body->reach;
    candidates.within = height;
    for (size_t v = 0; v < body->count; v++) {
        double place[3], own[3];
        vertex_place(body, v, body->position, place);
        const double gap = ces_surface_distance(surface, place, own);
        /* Beside a box a vertex may pass. */
        const bool over = surface->def.shape != CES_BOX || ces_dot(own, normal) > 1.0 - ALONG;
        if (gap > ces_manifold_rise(body->reach, 0.0) && over) {
            add_point(body, surface, place, ces_feature_vertex((uint32_t)v), CES_FEATURE_BELOW, &candidates);
        }
    }
    ces_candidates_reduce(&candidates, manifold);
}
