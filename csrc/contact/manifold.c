#include "manifold.h"

#include "../base/vec3.h"

#define RISE 0.03      /* of the size: about two degrees of a face */
#define SAME 1e-3      /* of the size: points nearer than this are one */
#define ON_EDGE 1e-9   /* of the size: what counts as inside */
#define LEVEL 1e-6     /* of the size: gaps and distances that differ by less are equal, and the order decides */
#define COLLINEAR 1e-9 /* of the size: a corner flatter than this is none */

double ces_manifold_rise(double size, double margin)
{
    return RISE * size + margin;
}

void ces_contact_plane_look(const double normal[3], ces_ContactPlane *plane)
{
    int least = 0;
    for (int k = 1; k < 3; k++) {
        least = fabs(normal[k]) < fabs(normal[least]) ? k : least;
    }
    double axis[3] = {0.0, 0.0, 0.0};
    axis[least] = 1.0;
    ces_copy(normal, plane->normal);
    ces_cross(normal, axis, plane->first);
    const double norm = ces_norm(plane->first);
    for (int k = 0; k < 3; k++) {
        plane->first[k] /= norm;
    }
    ces_cross(normal, plane->first, plane->second);
}

void ces_contact_plane_point(const ces_ContactPlane *plane, double x, double y, double height, double point[3])
{
    for (int k = 0; k < 3; k++) {
        point[k] = x * plane->first[k] + y * plane->second[k] + height * plane->normal[k];
    }
}

/* ---- features -------------------------------------------------------------------------------------------------------- */

static double turn_of(const ces_Corner *p, const ces_Corner *q, double x, double y)
{
    return (q->x - p->x) * (y - p->y) - (q->y - p->y) * (x - p->x);
}

static void sort_corners(ces_Corner *corner, int count)
{
    for (int k = 1; k < count; k++) {
        const ces_Corner moving = corner[k];
        int place = k;
        for (; place > 0; place--) {
            const ces_Corner *left = &corner[place - 1];
            if (left->x < moving.x || (left->x == moving.x && left->y <= moving.y)) {
                break;
            }
            corner[place] = *left;
        }
        corner[place] = moving;
    }
}

/* Of corners in one place - the two sides of a blade without thickness - the first is kept. */
static int drop_doubles(ces_Corner *corner, int count, double nearest)
{
    int unlike = 0;
    for (int k = 0; k < count; k++) {
        bool seen = false;
        for (int j = 0; j < unlike && !seen; j++) {
            seen = hypot(corner[k].x - corner[j].x, corner[k].y - corner[j].y) <= nearest;
        }
        if (!seen) {
            corner[unlike++] = corner[k];
        }
    }
    return unlike;
}

static void chain(ces_Corner *kept, int *count, int least, double flat, const ces_Corner *next)
{
    while (*count >= least) {
        const ces_Corner *p = &kept[*count - 2], *q = &kept[*count - 1];
        if (turn_of(p, q, next->x, next->y) > flat * hypot(next->x - p->x, next->y - p->y)) {
            break;
        }
        --*count;
    }
    kept[(*count)++] = *next;
}

/* The corners of the hull, counter-clockwise (Andrew's two chains); those inside and on its edges are left out. */
static void keep_hull(ces_Feature *feature)
{
    ces_Corner kept[2 * CES_CONVEX_VERTICES];
    const double flat = COLLINEAR * feature->size;
    feature->count = drop_doubles(feature->corner, feature->count, flat);
    sort_corners(feature->corner, feature->count);
    if (feature->count < 3) {
        return;
    }
    int count = 0;
    for (int k = 0; k < feature->count; k++) {
        chain(kept, &count, 2, flat, &feature->corner[k]);
    }
    const int least = count + 1;
    for (int k = feature->count - 2; k >= 0; k--) {
        chain(kept, &count, least, flat, &feature->corner[k]);
    }
    feature->count = count - 1; /* the first came round again */
    for (int k = 0; k < feature->count; k++) {
        feature->corner[k] = kept[k];
    }
}

/* The plane of a polygon by Newell's sums, of an edge without a slope across; shifted until no corner is inside of it. */
static void lay_plane(ces_Feature *feature, double side)
{
    double n[3] = {0.0, 0.0, 0.0};
    const ces_Corner *corner = feature->corner;
    for (int k = 0; k < feature->count; k++) {
        const ces_Corner *p = &corner[k], *q = &corner[(k + 1) % feature->count];
        n[0] += (p->y - q->y) * (p->height + q->height - 2.0 * corner->height);
        n[1] += (p->height - q->height) * (p->x + q->x - 2.0 * corner->x);
        n[2] += (p->x - q->x) * (p->y + q->y - 2.0 * corner->y);
    }
    if (feature->count == 2) {
        const double x = corner[1].x - corner[0].x, y = corner[1].y - corner[0].y;
        const double rise = (corner[1].height - corner[0].height) / (x * x + y * y);
        feature->slope[0] = rise * x;
        feature->slope[1] = rise * y;
    } else {
        feature->slope[0] = feature->count > 2 ? -n[0] / n[2] : 0.0;
        feature->slope[1] = feature->count > 2 ? -n[1] / n[2] : 0.0;
    }
    feature->height = side * HUGE_VAL;
    for (int k = 0; k < feature->count; k++) {
        const double height = corner[k].height - feature->slope[0] * corner[k].x - feature->slope[1] * corner[k].y;
        feature->height = side > 0.0 ? ces_min(feature->height, height) : ces_max(feature->height, height);
    }
}

void ces_feature_find(const ces_Convex *body, const ces_ContactPlane *plane, const double center[3], double side,
                      double rise, double size, ces_Feature *feature)
{
    ces_Corner all[CES_CONVEX_VERTICES];
    double outermost = -HUGE_VAL;
    feature->count = 0;
    feature->size = size;
    for (size_t v = 0; v < body->count; v++) {
        double point[3];
        for (int k = 0; k < 3; k++) {
            point[k] = center[k] + body->scale * ces_dot(body->rotation[k], &body->vertices[3 * v]);
        }
        all[v] = (ces_Corner){.x = ces_dot(plane->first, point),
                              .y = ces_dot(plane->second, point),
                              .height = ces_dot(plane->normal, point) + side * body->rounding,
                              .vertex = (uint32_t)v};
        outermost = ces_max(outermost, side * all[v].height);
    }
    for (size_t v = 0; v < body->count; v++) {
        if (side * all[v].height >= outermost - rise) {
            feature->corner[feature->count++] = all[v];
        }
    }
    keep_hull(feature);
    lay_plane(feature, side);
}

bool ces_feature_covers(const ces_Feature *feature, double x, double y)
{
    for (int k = 0; k < feature->count; k++) {
        const ces_Corner *p = &feature->corner[k], *q = &feature->corner[(k + 1) % feature->count];
        if (turn_of(p, q, x, y) < -ON_EDGE * feature->size * hypot(q->x - p->x, q->y - p->y)) {
            return false;
        }
    }
    return feature->count > 2;
}

double ces_feature_height(const ces_Feature *feature, double x, double y)
{
    return feature->height + feature->slope[0] * x + feature->slope[1] * y;
}

uint32_t ces_feature_name(const ces_Feature *feature)
{
    const ces_Corner *corner = feature->corner;
    return feature->count == 1   ? ces_feature_vertex(corner[0].vertex)
           : feature->count == 2 ? ces_feature_edge(corner[0].vertex, corner[1].vertex)
                                 : CES_FEATURE_FACE;
}

/* ---- lists of points --------------------------------------------------------------------------------------------------- */

static double apart(const ces_ManifoldPoint *p, const ces_ManifoldPoint *q)
{
    double offset[3];
    ces_subtract(p->point, q->point, offset);
    return ces_norm(offset);
}

void ces_candidates_add(ces_Candidates *candidates, const ces_ManifoldPoint *point)
{
    if (!(point->gap <= candidates->within) || candidates->count == CES_MANIFOLD_CANDIDATES) {
        return;
    }
    for (int k = 0; k < candidates->count; k++) {
        if (apart(&candidates->list[k], point) <= SAME * candidates->size) {
            return;
        }
    }
    candidates->list[candidates->count++] = *point;
}

void ces_candidates_add_nearest(ces_Candidates *candidates, const ces_ManifoldPoint *nearest)
{
    for (int k = 0; k < candidates->count; k++) {
        if (candidates->list[k].gap <= nearest->gap + LEVEL * candidates->size) {
            return;
        }
    }
    /* Nothing is as near: whatever stands in its place makes room. */
    int kept = 0;
    for (int k = 0; k < candidates->count; k++) {
        const ces_ManifoldPoint *point = &candidates->list[k];
        const bool same_name = point->sub_a == nearest->sub_a && point->sub_b == nearest->sub_b;
        if (!same_name && apart(point, nearest) > SAME * candidates->size) {
            candidates->list[kept++] = *point;
        }
    }
    candidates->list[kept] = *nearest;
    candidates->count = kept + 1;
}

static bool is_before(const ces_ManifoldPoint *p, const ces_ManifoldPoint *q)
{
    return p->sub_a < q->sub_a || (p->sub_a == q->sub_a && p->sub_b < q->sub_b);
}

static void insert(ces_Manifold *manifold, const ces_ManifoldPoint *point)
{
    int place = manifold->count++;
    for (; place > 0 && is_before(point, &manifold->points[place - 1]); place--) {
        manifold->points[place] = manifold->points[place - 1];
    }
    manifold->points[place] = *point;
}

void ces_candidates_reduce(const ces_Candidates *candidates, ces_Manifold *manifold)
{
    double distance[CES_MANIFOLD_CANDIDATES]; /* m, to the nearest point taken; -1: taken itself */
    const double level = LEVEL * candidates->size;
    int next = 0;
    for (int k = 0; k < candidates->count; k++) {
        distance[k] = HUGE_VAL;
        if (candidates->list[k].gap < candidates->list[next].gap - level) {
            next = k;
        }
    }
    manifold->count = 0;
    while (manifold->count < CES_MANIFOLD_POINTS && manifold->count < candidates->count) {
        const ces_ManifoldPoint *taken = &candidates->list[next];
        insert(manifold, taken);
        distance[next] = -1.0;
        int farthest = -1;
        for (int k = 0; k < candidates->count; k++) {
            if (distance[k] >= 0.0) {
                distance[k] = ces_min(distance[k], apart(&candidates->list[k], taken));
                if (farthest < 0 || distance[k] > distance[farthest] + level) {
                    farthest = k;
                }
            }
        }
        if (farthest < 0) {
            return;
        }
        next = farthest;
    }
}
