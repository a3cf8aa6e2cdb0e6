#include "mesh_contact.h"

#include <math.h>

#include "../base/vec3.h"

enum { LEGS = 8 }; /* pieces of a path that is turned aside by what it hits */

/* Radians. Rounding turns normals by some 1e-12 (1 m over 0.05 mm); a kink smaller than this is not felt as one. */
#define SAME_DIRECTION 1e-6
/* Radians. A path may end a ten-millionth of a radius short of an edge, which turns the normal by the root of twice that. */
#define SAME_EDGE 1e-3
/* Of a radius: triangles that come this near to a point meet there, shared corner or not. */
#define MEETING 1e-4
/* Of a radius: planes nearer than this to each other are one. */
#define SAME_PLANE 1e-6
/* Of its length: a path that runs into a plane by less runs along it. */
#define ALONG 1e-9

typedef struct Walk {
    const ces_Mesh *mesh;
    const ces_MeshPath *input;
    double from[3], leg[3];    /* m: the piece of the path that is looked at */
    double begin, span;        /* of the path: the fraction before the piece, and its own */
    int number;                /* of the piece */
    double planes[LEGS][3];    /* normals of what was hit so far, one a piece */
    ces_MeshContact *contacts; /* (count) */
    size_t count;
    ces_MeshContact obstacle; /* the first that the piece runs into */
    double obstacle_at;       /* fraction of the piece; 1: none */
} Walk;

/* ---- does an edge or a corner count ---------------------------------------------------------------------------------- */

typedef struct Meeting {
    const ces_Mesh *mesh;
    uint32_t triangle;
    double point[3], center[3]; /* m: of the contact, of the sphere */
    double distance, near;      /* m: of the two, what counts as meeting */
    bool covered;               /* some triangle that meets there has a nearer point */
} Meeting;

static void look_at_neighbour(void *context, uint32_t triangle)
{
    Meeting *meeting = context;
    if (meeting->covered || triangle == meeting->triangle) {
        return;
    }
    const ces_Triangle other = ces_mesh_triangle(meeting->mesh, triangle);
    double nearest[3], off[3];
    ces_triangle_nearest(&other, meeting->point, nearest);
    ces_subtract(nearest, meeting->point, off);
    const double crack = ces_norm(off);
    if (crack > meeting->near) {
        return;
    }
    ces_triangle_nearest(&other, meeting->center, nearest);
    ces_subtract(nearest, meeting->point, off);
    meeting->covered = ces_norm(off) > SAME_DIRECTION * meeting->distance + 2.0 * crack;
}

/* Whether the nearest point of a triangle is the nearest one of all triangles that meet in it. */
static bool is_nearest_of_all(const Walk *walk, uint32_t triangle, const double center[3], ces_TriangleFeature *feature)
{
    const ces_Triangle own = ces_mesh_triangle(walk->mesh, triangle);
    Meeting meeting = {.mesh = walk->mesh, .triangle = triangle, .near = MEETING * walk->input->radius};
    double offset[3], lower[3], upper[3];
    *feature = ces_triangle_nearest(&own, center, meeting.point);
    if (*feature == CES_FACE) {
        return true;
    }
    ces_copy(center, meeting.center);
    ces_subtract(center, meeting.point, offset);
    meeting.distance = ces_norm(offset);
    for (int k = 0; k < 3; k++) {
        lower[k] = meeting.point[k] - meeting.near;
        upper[k] = meeting.point[k] + meeting.near;
    }
    ces_mesh_query(walk->mesh, lower, upper, look_at_neighbour, &meeting);
    return !meeting.covered;
}

/* ---- the list of contacts ------------------------------------------------------------------------------------------------ */

/* Which of two contacts of one direction stands for both: the tighter one; in one plane the one that is hit, and a face. */
static bool is_better(const ces_MeshContact *one, const ces_MeshContact *other, double radius)
{
    const double tighter = other->plane_gap - one->plane_gap;
    if (fabs(tighter) > SAME_PLANE * radius) {
        return tighter > 0.0;
    }
    if (one->approach.hit != other->approach.hit) {
        return one->approach.hit;
    }
    if ((one->feature == CES_FACE) != (other->feature == CES_FACE)) {
        return one->feature == CES_FACE;
    }
    if (one->approach.hit && one->approach.fraction != other->approach.fraction) {
        return one->approach.fraction < other->approach.fraction;
    }
    return one->triangle < other->triangle;
}

/* Where there is no room the one that comes least near gives way. */
static bool is_nearer(const ces_MeshContact *one, const ces_MeshContact *other)
{
    if (one->approach.hit != other->approach.hit) {
        return one->approach.hit;
    }
    return one->approach.least_gap < other->approach.least_gap;
}

static bool same_direction(const ces_MeshContact *one, const ces_MeshContact *other)
{
    const bool faces = one->feature == CES_FACE && other->feature == CES_FACE;
    const double most = faces ? 2.0 * SAME_DIRECTION : SAME_EDGE;
    double off[3];
    ces_subtract(one->approach.normal, other->approach.normal, off);
    return ces_dot(off, off) <= most * most;
}

static void keep(Walk *walk, const ces_MeshContact *contact)
{
    size_t farthest = 0;
    for (size_t k = 0; k < walk->count; k++) {
        ces_MeshContact *kept = &walk->contacts[k];
        if (same_direction(kept, contact)) {
            if (is_better(contact, kept, walk->input->radius)) {
                *kept = *contact;
            }
            return;
        }
        if (kept->triangle == contact->triangle) {
            if (is_nearer(contact, kept)) {
                *kept = *contact;
            }
            return;
        }
        if (is_nearer(&walk->contacts[farthest], kept)) {
            farthest = k;
        }
    }
    if (walk->count < CES_MESH_CONTACTS) {
        walk->contacts[walk->count++] = *contact;
    } else if (is_nearer(contact, &walk->contacts[farthest])) {
        walk->contacts[farthest] = *contact;
    }
}

static void sort(Walk *walk)
{
    for (size_t k = 1; k < walk->count; k++) {
        const ces_MeshContact contact = walk->contacts[k];
        size_t place = k;
        for (; place > 0 && walk->contacts[place - 1].triangle > contact.triangle; place--) {
            walk->contacts[place] = walk->contacts[place - 1];
        }
        walk->contacts[place] = contact;
    }
}

/* ---- one piece of the path ----------------------------------------------------------------------------------------------- */

/* Approaches one triangle along the piece; false where it comes no nearer than the margin, or makes no contact. */
static bool meet(const Walk *walk, uint32_t triangle, double margin, ces_MeshContact *contact)
{
    const ces_MeshPath *input = walk->input;
    const ces_Triangle shape = ces_mesh_triangle(walk->mesh, triangle);
    ces_Approach *approach = &contact->approach;
    ces_approach_triangle(&shape, walk->from, walk->leg, input->radius, input->touched && walk->number == 0, approach);
    if (!approach->hit && approach->least_gap > margin) {
        return false;
    }
    double center[3], nearest[3], offset[3], normal[3];
    ces_copy(walk->from, center);
    ces_add_scaled(center, approach->seen, walk->leg);
    contact->triangle = triangle;
    if (!is_nearest_of_all(walk, triangle, center, &contact->feature)) {
        return false;
    }
    ces_triangle_nearest(&shape, center, nearest);
    ces_subtract(input->center, nearest, offset);
    contact->plane_gap = ces_dot(approach->normal, offset) - input->radius;
    if (walk->number > 0) {
        /* A detour may have begun behind the plane that it meets later; the contact asks for no more than to stay. */
        contact->plane_gap = ces_max(contact->plane_gap, 0.0);
        approach->start_gap = ces_triangle_distance(&shape, input->center, normal) - input->radius;
    }
    return true;
}

/* From a fraction of the piece to one of the whole path, and the gap of the contact's plane there. */
static ces_MeshContact on_whole_path(const Walk *walk, ces_MeshContact contact)
{
    ces_Approach *approach = &contact.approach;
    approach->fraction = walk->begin + walk->span * approach->fraction;
    approach->gap = contact.plane_gap + approach->fraction * ces_dot(approach->normal, walk->input->path);
    return contact;
}

static void find_obstacle(void *context, uint32_t triangle)
{
    Walk *walk = context;
    ces_MeshContact contact;
    if (!meet(walk, triangle, -HUGE_VAL, &contact) ||
        ces_dot(contact.approach.normal, walk->leg) >= -ALONG * ces_norm(walk->leg)) {
        return;
    }
    const double at = contact.approach.fraction;
    if (at < walk->obstacle_at || (at == walk->obstacle_at && triangle < walk->obstacle.triangle)) {
        walk->obstacle = contact;
        walk->obstacle_at = at;
    }
}

static void gather(void *context, uint32_t triangle)
{
    Walk *walk = context;
    ces_MeshContact contact;
    if (meet(walk, triangle, walk->input->margin, &contact)) {
        contact = on_whole_path(walk, contact);
        keep(walk, &contact);
    }
}

static void search(Walk *walk, double around, ces_MeshVisit *visit)
{
    double lower[3], upper[3];
    for (int k = 0; k < 3; k++) {
        const double to = walk->from[k] + walk->leg[k];
        lower[k] = ces_min(walk->from[k], to) - around;
        upper[k] = ces_max(walk->from[k], to) + around;
    }
    ces_mesh_query(walk->mesh, lower, upper, visit, walk);
}

bool ces_turn_aside(const double *normals, int last, double restitution, double size, double rest[3])
{
    const double *normal = &normals[3 * last];
    const double length = ces_norm(rest);
    ces_add_scaled(rest, -(1.0 + restitution) * ces_dot(rest, normal), normal);
    for (int k = 0; k < last; k++) {
        if (ces_dot(rest, &normals[3 * k]) >= -ALONG * length) {
            continue;
        }
        double crease[3]; /* only along the line of both planes; there is none where they are parallel */
        ces_cross(normal, &normals[3 * k], crease);
        const double squared = ces_dot(crease, crease);
        const double along = squared > 0.0 ? ces_dot(rest, crease) / squared : 0.0;
        for (int axis = 0; axis < 3; axis++) {
            rest[axis] = along * crease[axis];
        }
        for (int other = 0; other < last; other++) {
            if (ces_dot(rest, &normals[3 * other]) < -ALONG * length) {
                return false;
            }
        }
    }
    return ces_norm(rest) > ALONG * size;
}

size_t ces_mesh_contacts(const ces_Mesh *mesh, const ces_MeshPath *path, ces_MeshContact contacts[CES_MESH_CONTACTS])
{
    Walk walk = {.mesh = mesh, .input = path, .contacts = contacts};
    ces_copy(path->center, walk.from);
    ces_copy(path->path, walk.leg);
    for (; walk.number < LEGS; walk.number++) {
        double rest[3];
        ces_copy(walk.leg, rest);
        walk.obstacle_at = 1.0;
        walk.span = 1.0 - walk.begin;
        search(&walk, path->radius * (1.0 + MEETING), find_obstacle);
        const bool hits = walk.obstacle_at < 1.0;
        if (hits) {
            const ces_MeshContact obstacle = on_whole_path(&walk, walk.obstacle);
            keep(&walk, &obstacle);
            walk.span *= walk.obstacle_at;
            for (int k = 0; k < 3; k++) {
                walk.leg[k] = walk.obstacle_at * rest[k];
                rest[k] -= walk.leg[k];
            }
        }
        search(&walk, path->radius + path->margin, gather);
        if (!hits) {
            break;
        }
        walk.begin += walk.span;
        ces_add_scaled(walk.from, 1.0, walk.leg);
        ces_copy(walk.obstacle.approach.normal, walk.planes[walk.number]);
        if (!ces_turn_aside(walk.planes[0], walk.number, path->restitution, path->radius, rest)) {
            break;
        }
        ces_copy(rest, walk.leg);
    }
    sort(&walk);
    return walk.count;
}
