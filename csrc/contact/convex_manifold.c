/*
 * Where convex bodies touch: the features that face each other, seen along the normal, are convex polygons, edges or
 * corners; they touch at the corners of one that the other covers, and where their edges cross.
 */
#include "../base/vec3.h"
#include "manifold.h"
#include "minkowski.h"

#define PARALLEL 1e-3 /* sine: edges under a smaller angle touch along a line */
#define SHRINK 0.1    /* of a body: what it is made smaller by to see which way it lies */
#define ASIDE 1e-5    /* of the size: corners and edges meet in one place if they are no farther off each other */
#define ALIKE 1e-6    /* rad: normals that differ by less are one */

typedef struct Meeting {
    const ces_Convex *b;
    const ces_ContactPlane *plane;
    const ces_Feature *feature_a, *feature_b;
    ces_Candidates *candidates;
} Meeting;

static void add(const Meeting *meeting, double x, double y, double height_a, double height_b, uint32_t sub_a,
                uint32_t sub_b)
{
    ces_ManifoldPoint point = {.gap = height_a - height_b, .sub_a = sub_a, .sub_b = sub_b};
    ces_copy(meeting->plane->normal, point.normal);
    ces_contact_plane_point(meeting->plane, x, y, height_a, point.point);
    for (int k = 0; k < 3; k++) {
        point.point[k] += meeting->b->position[k];
    }
    ces_candidates_add(meeting->candidates, &point);
}

static void add_covered_corners(const Meeting *meeting)
{
    const ces_Feature *a = meeting->feature_a, *b = meeting->feature_b;
    for (int k = 0; k < a->count; k++) {
        const ces_Corner *p = &a->corner[k];
        if (ces_feature_covers(b, p->x, p->y)) {
            add(meeting, p->x, p->y, p->height, ces_feature_height(b, p->x, p->y), ces_feature_vertex(p->vertex),
                CES_FEATURE_FACE);
        }
    }
    for (int k = 0; k < b->count; k++) {
        const ces_Corner *p = &b->corner[k];
        if (ces_feature_covers(a, p->x, p->y)) {
            add(meeting, p->x, p->y, ces_feature_height(a, p->x, p->y), p->height, CES_FEATURE_FACE,
                ces_feature_vertex(p->vertex));
        }
    }
}

static double side_of(const ces_Corner *p, const ces_Corner *q, const ces_Corner *r)
{
    return (q->x - p->x) * (r->y - p->y) - (q->y - p->y) * (r->x - p->x);
}

static int edges_of(const ces_Feature *feature)
{
    return feature->count > 2 ? feature->count : feature->count - 1;
}

static void add_crossings(const Meeting *meeting)
{
    const ces_Feature *a = meeting->feature_a, *b = meeting->feature_b;
    for (int i = 0; i < edges_of(a); i++) {
        const ces_Corner *p = &a->corner[i], *q = &a->corner[(i + 1) % a->count];
        for (int j = 0; j < edges_of(b); j++) {
            const ces_Corner *r = &b->corner[j], *s = &b->corner[(j + 1) % b->count];
            const double from = side_of(r, s, p), to = side_of(r, s, q);
            const double start = side_of(p, q, r), end = side_of(p, q, s);
            if (!(from * to < 0.0 && start * end < 0.0)) {
                continue;
            }
            const double t = from / (from - to), u = start / (start - end);
            add(meeting, p->x + t * (q->x - p->x), p->y + t * (q->y - p->y), p->height + t * (q->height - p->height),
                r->height + u * (s->height - r->height), ces_feature_edge(p->vertex, q->vertex),
                ces_feature_edge(r->vertex, s->vertex));
        }
    }
}

/* Two edges that lie along each other touch where their overlap begins and ends. */
static void add_ends_of_parallel_edges(const Meeting *meeting)
{
    const ces_Feature *both[2] = {meeting->feature_a, meeting->feature_b};
    const ces_Corner *pa = both[0]->corner, *pb = both[1]->corner;
    const double ax = pa[1].x - pa[0].x, ay = pa[1].y - pa[0].y, bx = pb[1].x - pb[0].x, by = pb[1].y - pb[0].y;
    if (fabs(ax * by - ay * bx) > PARALLEL * hypot(ax, ay) * hypot(bx, by)) {
        return;
    }
    for (int own = 0; own < 2; own++) {
        const ces_Corner *r = &both[1 - own]->corner[0], *s = &both[1 - own]->corner[1];
        const double ex = s->x - r->x, ey = s->y - r->y, squared = ex * ex + ey * ey;
        const uint32_t edge = ces_feature_edge(r->vertex, s->vertex);
        for (int k = 0; k < 2; k++) {
            const ces_Corner *p = &both[own]->corner[k];
            const double t = ((p->x - r->x) * ex + (p->y - r->y) * ey) / squared;
            const double aside = fabs(side_of(r, s, p)) / sqrt(squared);
            if (!(t >= 0.0 && t <= 1.0 && aside <= 2.0 * PARALLEL * both[own]->size)) {
                continue;
            }
            const double height = r->height + t * (s->height - r->height);
            const uint32_t corner = ces_feature_vertex(p->vertex);
            add(meeting, p->x, p->y, own == 0 ? p->height : height, own == 0 ? height : p->height,
                own == 0 ? corner : edge, own == 0 ? edge : corner);
        }
    }
}

/* nearest: gap, normal and point of a, from b's centre. */
static void find_points(const ces_Convex *a, const ces_Convex *b, const double offset[3], ces_ManifoldPoint *nearest,
                        double margin, ces_Manifold *manifold)
{
    const double size = ces_min(a->reach, b->reach), rise = ces_manifold_rise(size, margin);
    const double origin[3] = {0.0, 0.0, 0.0};
    ces_ContactPlane plane;
    ces_Feature feature_a, feature_b;
    ces_contact_plane_look(nearest->normal, &plane);
    ces_feature_find(a, &plane, offset, -1.0, rise, size, &feature_a);
    ces_feature_find(b, &plane, origin, 1.0, rise, size, &feature_b);
    ces_add_scaled(nearest->point, 1.0, b->position);
    nearest->sub_a = ces_feature_name(&feature_a);
    nearest->sub_b = ces_feature_name(&feature_b);

    ces_Candidates candidates;
    candidates.count = 0;
    candidates.size = size;
    candidates.within = nearest->gap + rise;
    const Meeting meeting = {
        .b = b, .plane = &plane, .feature_a = &feature_a, .feature_b = &feature_b, .candidates = &candidates};
    if (feature_a.count == 2 && feature_b.count == 2) {
        add_ends_of_parallel_edges(&meeting);
    }
    add_covered_corners(&meeting);
    add_crossings(&meeting);
    ces_candidates_add_nearest(&candidates, nearest);
    ces_candidates_reduce(&candidates, manifold);
}

void ces_convex_manifold(const ces_Convex *a, const ces_Convex *b, double margin, ces_Manifold *manifold)
{
    double offset[3], point_b[3];
    ces_ManifoldPoint nearest;
    ces_subtract(a->position, b->position, offset);
    nearest.gap = ces_convex_distance_at(a, b, offset, nearest.normal, nearest.point, point_b);
    find_points(a, b, offset, &nearest, margin, manifold);
}

void ces_convex_manifold_along(const ces_Convex *a, const ces_Convex *b, const double normal[3], double margin,
                               ces_Manifold *manifold)
{
    const double down[3] = {-normal[0], -normal[1], -normal[2]};
    double offset[3], point_b[3];
    ces_ManifoldPoint nearest;
    ces_subtract(a->position, b->position, offset);
    ces_copy(normal, nearest.normal);
    ces_convex_support(a, down, nearest.point);
    ces_convex_support(b, normal, point_b);
    ces_add_scaled(nearest.point, 1.0, offset);
    ces_add_scaled(nearest.point, -a->rounding, normal);
    nearest.gap = ces_dot(normal, nearest.point) - ces_dot(normal, point_b) - b->rounding;
    find_points(a, b, offset, &nearest, margin, manifold);
}

/*
 * Corners, and edges that are parallel, touch along any normal of a whole cone, and the shortest distance picks one by
 * rounding. Of that cone the line of centres is taken, or what comes nearest to it: bodies that shrink towards their
 * centres part along it, while a face, or edges that cross, keep the one normal they have. False where there is no choice:
 * another normal would see them less far apart by more than the distance ASIDE explains.
 */
static bool choose_normal(const ces_Convex *a, const ces_Convex *b, const double offset[3],
                          const ces_ManifoldPoint *nearest, double normal[3])
{
    const double aside = ASIDE * ces_min(a->reach, b->reach);
    if (a->rounding > 0.0 || b->rounding > 0.0 || nearest->gap > aside) {
        return false;
    }
    ces_Convex small_a = *a, small_b = *b;
    double point[3], point_b[3], turn[3];
    small_a.scale *= 1.0 - SHRINK;
    small_b.scale *= 1.0 - SHRINK;
    if (ces_convex_distance_at(&small_a, &small_b, offset, normal, point, point_b) <= 0.0) {
        return false;
    }
    ces_subtract(normal, nearest->normal, turn);
    const double angle = ces_norm(turn), down[3] = {-normal[0], -normal[1], -normal[2]};
    ces_convex_support(a, down, point);
    ces_convex_support(b, normal, point_b);
    ces_add_scaled(point, 1.0, offset);
    ces_subtract(point, point_b, point);
    return angle > ALIKE && nearest->gap - ces_dot(normal, point) <= aside * angle;
}

void ces_convex_grains_manifold(const ces_Convex *a, const ces_Convex *b, double margin, ces_Manifold *manifold)
{
    double offset[3], point_b[3], normal[3];
    ces_ManifoldPoint nearest;
    ces_subtract(a->position, b->position, offset);
    nearest.gap = ces_convex_distance_at(a, b, offset, nearest.normal, nearest.point, point_b);
    if (choose_normal(a, b, offset, &nearest, normal)) {
        ces_convex_manifold_along(a, b, normal, margin, manifold);
    } else {
        find_points(a, b, offset, &nearest, margin, manifold);
    }
}
