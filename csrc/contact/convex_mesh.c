#include "convex_mesh.h"

#include "../base/vec3.h"
#include "mesh_contact.h"

enum { LEGS = 6, GATHERED = 96, LOOKS = 4 };

#define FLAT 1e-6        /* less than 1 by this, the cosine of two normals of one face */
#define SAME_NORMAL 1e-3 /* radians: contacts of one direction */
#define SAME_PLACE 1e-3  /* of the reach: contacts nearer than this to each other are one */
#define MEETING 1e-4     /* of the reach: triangles that come this near to a point meet there, shared corner or not */
#define STANDS_OUT 1e-6  /* radians, beyond rounding: less than this a triangle does not stand out */
#define ALONG 1e-9       /* of its length: a path that runs into a plane by less runs along it */
#define NEAR 0.03        /* of the reach: met at the same moment */

typedef struct Walk {
    const ces_Mesh *mesh;
    const ces_ConvexMeshPath *input;
    ces_Convex body; /* at the start of the piece of the path that is looked at */
    double leg[3];   /* m, the piece */
    int number;      /* of the piece */
    double planes[LEGS][3];
    double first_place[3], first_fraction; /* m: centre of the body where it first hits, and when */
    double until;                          /* fraction of the piece at which it is looked round */
    double obstacle_at, obstacle[3];       /* fraction of the piece, 1: none; normal */
    ces_ConvexMeshPoint list[GATHERED];
    size_t count;
} Walk;

/* A triangle as a convex body about its centroid. */
typedef struct TriangleBody {
    ces_Triangle shape;
    double vertices[9];
    ces_Convex convex;
} TriangleBody;

static void triangle_body(const ces_Mesh *mesh, uint32_t triangle, TriangleBody *body)
{
    static const double unturned[4] = {1.0, 0.0, 0.0, 0.0};
    double centroid[3] = {0.0, 0.0, 0.0};
    body->shape = ces_mesh_triangle(mesh, triangle);
    for (int k = 0; k < 3; k++) {
        ces_add_scaled(centroid, 1.0 / 3.0, body->shape.corner[k]);
    }
    for (int k = 0; k < 3; k++) {
        ces_subtract(body->shape.corner[k], centroid, &body->vertices[3 * k]);
    }
    ces_convex_place(&body->convex, body->vertices, 3, 1.0, 0.0, centroid, unturned);
}

/* ---- does an edge or a corner count ---------------------------------------------------------------------------------- */

typedef enum Sight { SEEN, SEEN_AS_FACE, HIDDEN } Sight;

typedef struct Meeting {
    const ces_Mesh *mesh;
    const TriangleBody *own;
    uint32_t triangle;
    const double *center, *normal; /* of the body, of the contact */
    double point[3], near;         /* m: on the triangle; what counts as meeting */
    Sight sight;
} Meeting;

/* How far a triangle stands out from a plane through a point, m; 0 where it does so by no more than rounding. */
static double stands_out(const ces_Triangle *triangle, const double point[3], const double normal[3])
{
    double most = 0.0;
    for (int k = 0; k < 3; k++) {
        double off[3];
        ces_subtract(triangle->corner[k], point, off);
        most = ces_max(most, ces_dot(normal, off) - STANDS_OUT * ces_norm(off));
    }
    return most;
}

/* A triangle that stands out before the contact is met first. Where the own one falls from it away from the body it lies
 * behind, and is not met at all; where it goes on in its plane, or rises as the far side of a valley, its face is met. */
static void look_at_neighbour(void *context, uint32_t triangle)
{
    Meeting *meeting = context;
    if (meeting->sight == HIDDEN || triangle == meeting->triangle) {
        return;
    }
    const ces_Triangle other = ces_mesh_triangle(meeting->mesh, triangle);
    double nearest[3], off[3], towards[3], away[3];
    ces_triangle_nearest(&other, meeting->point, nearest);
    ces_subtract(nearest, meeting->point, off);
    const double crack = ces_norm(off);
    if (crack > meeting->near || stands_out(&other, meeting->point, meeting->normal) <= 2.0 * crack) {
        return;
    }
    ces_subtract(meeting->center, meeting->point, off);
    const double side = ces_dot(other.normal, off) < 0.0 ? -1.0 : 1.0;
    for (int k = 0; k < 3; k++) {
        towards[k] = side * other.normal[k];
        away[k] = -towards[k];
    }
    const bool rises = stands_out(&meeting->own->shape, meeting->point, towards) > 2.0 * crack;
    const bool falls = stands_out(&meeting->own->shape, meeting->point, away) > 2.0 * crack;
    meeting->sight = falls && !rises ? HIDDEN : SEEN_AS_FACE;
}

static Sight sight_of(const Walk *walk, const TriangleBody *own, uint32_t triangle, const double center[3],
                      const double point[3], const double normal[3])
{
    if (fabs(ces_dot(own->shape.normal, normal)) >= 1.0 - FLAT) {
        return SEEN;
    }
    Meeting meeting = {.mesh = walk->mesh,
                       .own = own,
                       .triangle = triangle,
                       .center = center,
                       .normal = normal,
                       .near = MEETING * walk->body.reach,
                       .sight = SEEN};
    double lower[3], upper[3];
    ces_copy(point, meeting.point);
    for (int k = 0; k < 3; k++) {
        lower[k] = point[k] - meeting.near;
        upper[k] = point[k] + meeting.near;
    }
    ces_mesh_query(walk->mesh, lower, upper, look_at_neighbour, &meeting);
    return meeting.sight;
}

/* Turns a normal at an edge into that of the face, on the side of the body. */
static void face_normal(const TriangleBody *own, const double center[3], double normal[3])
{
    double off[3];
    ces_subtract(center, own->convex.position, off);
    const double side = ces_dot(own->shape.normal, off) < 0.0 ? -1.0 : 1.0;
    for (int k = 0; k < 3; k++) {
        normal[k] = side * own->shape.normal[k];
    }
}

/* ---- the list of points ------------------------------------------------------------------------------------------------ */

static double apart(const double p[3], const double q[3])
{
    double off[3];
    ces_subtract(p, q, off);
    return ces_norm(off);
}

static void keep(Walk *walk, const ces_ConvexMeshPoint *point)
{
    for (size_t k = 0; k < walk->count; k++) {
        ces_ConvexMeshPoint *kept = &walk->list[k];
        if (apart(kept->normal, point->normal) <= SAME_NORMAL &&
            apart(kept->arm, point->arm) <= SAME_PLACE * walk->body.reach) {
            if (kept->held == point->held ? point->gap < kept->gap : kept->held) {
                *kept = *point;
            }
            return;
        }
    }
    if (walk->count < GATHERED) {
        walk->list[walk->count++] = *point;
    }
}

static bool is_before(const ces_ConvexMeshPoint *one, const ces_ConvexMeshPoint *other)
{
    return one->part_body != other->part_body ? one->part_body < other->part_body : one->part_mesh < other->part_mesh;
}

/* The tightest one first, then those that differ most in place and direction from what is taken. */
static size_t reduce(const Walk *walk, ces_ConvexMeshPoint points[CES_CONVEX_MESH_POINTS])
{
    double far[GATHERED];
    size_t taken = 0, next = 0;
    for (size_t k = 0; k < walk->count; k++) {
        far[k] = HUGE_VAL;
        next = walk->list[k].gap < walk->list[next].gap ? k : next;
    }
    while (taken < CES_CONVEX_MESH_POINTS && taken < walk->count) {
        const ces_ConvexMeshPoint *point = &walk->list[next];
        size_t place = taken++;
        for (; place > 0 && is_before(point, &points[place - 1]); place--) {
            points[place] = points[place - 1];
        }
        points[place] = *point;
        far[next] = -1.0;
        const size_t last = next;
        double most = -1.0;
        for (size_t k = 0; k < walk->count; k++) {
            if (far[k] >= 0.0) {
                const double off = apart(walk->list[k].arm, walk->list[last].arm) +
                                   walk->body.reach * apart(walk->list[k].normal, walk->list[last].normal);
                far[k] = ces_min(far[k], off);
                if (far[k] > most) {
                    most = far[k];
                    next = k;
                }
            }
        }
        if (most < 0.0) {
            break;
        }
    }
    return taken;
}

/* ---- one piece of the path ----------------------------------------------------------------------------------------------- */

/* Which corner, edge or face of a triangle; 0 to 6. */
static uint32_t triangle_feature(uint32_t name)
{
    if (name == CES_FEATURE_FACE) {
        return 0;
    }
    const uint32_t first = name & 0xFFFFu, second = name >> 16;
    return second == 0 ? 1 + first : 3 + first + (second - 1); /* edges 01, 02, 12: 4, 5, 6 */
}

static void place_at(const Walk *walk, double fraction, ces_Convex *body)
{
    *body = walk->body;
    ces_add_scaled(body->position, fraction, walk->leg);
}

/* Where the body touches a triangle first on the piece, if that counts: fraction and normal. */
static bool meet(const Walk *walk, const TriangleBody *own, uint32_t triangle, ces_Approach *approach, Sight *sight)
{
    ces_approach_convex(&walk->body, &own->convex, walk->leg, approach);
    if (!approach->hit && approach->least_gap > walk->input->margin + walk->input->sweep) {
        return false;
    }
    ces_Convex body;
    double normal[3], on_body[3], on_triangle[3];
    place_at(walk, approach->fraction, &body);
    ces_convex_distance(&body, &own->convex, normal, on_body, on_triangle);
    *sight = sight_of(walk, own, triangle, body.position, on_triangle, normal);
    if (*sight == SEEN_AS_FACE) {
        face_normal(own, walk->input->body.position, approach->normal);
    }
    return *sight != HIDDEN;
}

static void find_obstacle(void *context, uint32_t triangle)
{
    Walk *walk = context;
    TriangleBody own;
    ces_Approach approach;
    Sight sight;
    triangle_body(walk->mesh, triangle, &own);
    if (!meet(walk, &own, triangle, &approach, &sight) || !approach.hit || approach.fraction >= walk->obstacle_at ||
        ces_dot(approach.normal, walk->leg) >= -ALONG * ces_norm(walk->leg)) {
        return;
    }
    walk->obstacle_at = approach.fraction;
    ces_copy(approach.normal, walk->obstacle);
}

/* Takes the points of a triangle in, seen from where the body first hits something, or from where it comes nearest. */
static void gather(void *context, uint32_t triangle)
{
    Walk *walk = context;
    TriangleBody own;
    ces_Approach approach;
    ces_Convex body;
    ces_Manifold manifold;
    Sight sight;
    triangle_body(walk->mesh, triangle, &own);
    const bool behind = walk->number > 0;
    if (!meet(walk, &own, triangle, &approach, &sight) || (behind && !approach.hit)) {
        return;
    }
    const double fraction = ces_min(approach.fraction, walk->until);
    place_at(walk, fraction, &body);
    if (sight == SEEN_AS_FACE) {
        if (!approach.hit) {
            return;
        }
        ces_convex_manifold_along(&body, &own.convex, approach.normal, walk->input->sweep, &manifold);
    } else {
        ces_convex_manifold(&body, &own.convex, walk->input->sweep, &manifold);
    }
    double slid[3];
    ces_subtract(body.position, walk->first_place, slid);
    for (int k = 0; k < manifold.count; k++) {
        const ces_ManifoldPoint *found = &manifold.points[k];
        double on_triangle[3];
        ces_copy(found->point, on_triangle);
        ces_add_scaled(on_triangle, -found->gap, found->normal);
        if (sight == SEEN && sight_of(walk, &own, triangle, body.position, on_triangle, found->normal) != SEEN) {
            continue;
        }
        ces_ConvexMeshPoint point = {
            .gap = found->gap,
            .fraction = behind ? walk->first_fraction : fraction,
            .held = behind || (walk->obstacle_at < 1.0 && fraction >= walk->until && found->gap > NEAR * body.reach),
            .part_body = found->sub_a,
            .part_mesh = CES_MESH_PARTS * triangle + triangle_feature(found->sub_b)};
        ces_subtract(found->point, body.position, point.arm);
        ces_copy(found->normal, point.normal);
        if (behind) {
            point.gap = ces_max(0.0, point.gap - ces_dot(point.normal, slid));
        }
        keep(walk, &point);
    }
}

static void search(Walk *walk, double around, ces_MeshVisit *visit)
{
    double lower[3], upper[3];
    for (int k = 0; k < 3; k++) {
        const double from = walk->body.position[k], to = from + walk->leg[k];
        lower[k] = ces_min(from, to) - around;
        upper[k] = ces_max(from, to) + around;
    }
    ces_mesh_query(walk->mesh, lower, upper, visit, walk);
}

/* What strikes with a corner turns: its other vertices come down, to the first face below each, and no farther. */
typedef struct Fall {
    const Walk *walk;
    double vertex[3], least; /* m: the vertex, to the nearest face below */
    double normal[3], foot[3];
    uint32_t triangle;
} Fall;

static void look_below(void *context, uint32_t triangle)
{
    Fall *fall = context;
    const ces_Triangle below = ces_mesh_triangle(fall->walk->mesh, triangle);
    double nearest[3], off[3];
    if (ces_triangle_nearest(&below, fall->vertex, nearest) != CES_FACE) {
        return;
    }
    ces_subtract(fall->vertex, nearest, off);
    const double gap = ces_norm(off);
    if (gap > NEAR * fall->walk->body.reach && gap < fall->least &&
        ces_dot(off, fall->walk->planes[fall->walk->number]) > 0.0) {
        fall->least = gap;
        fall->triangle = triangle;
        ces_copy(nearest, fall->foot);
        for (int k = 0; k < 3; k++) {
            fall->normal[k] = off[k] / gap;
        }
    }
}

/* Where a vertex is when the piece ends at its obstacle, or will have slid to by a part of what is left of the path. */
static bool finds_face(const Walk *walk, const double arm[3], double part, const double rest[3], double most,
                       Fall *fall)
{
    double lower[3], upper[3];
    fall->walk = walk;
    fall->least = most;
    for (int k = 0; k < 3; k++) {
        fall->vertex[k] = walk->body.position[k] + arm[k] + part * rest[k];
        lower[k] = fall->vertex[k] - most;
        upper[k] = fall->vertex[k] + most;
    }
    ces_mesh_query(walk->mesh, lower, upper, look_below, fall);
    return fall->least < most;
}

/* The vertices over the obstacle, as far up as they may fall or the body reaches; rest: of the path, along the obstacle. */
static void hold_vertices(Walk *walk, const double rest[3])
{
    const double into = -ces_dot(walk->planes[walk->number], walk->input->path) * (1.0 - walk->first_fraction);
    const double most = 2.0 * ces_max(into, walk->number > 0 ? walk->body.reach : 0.0);
    for (size_t v = 0; v < walk->body.count; v++) {
        ces_ConvexMeshPoint point = {.fraction = walk->first_fraction, .held = true, .part_body = (uint32_t)v};
        Fall fall;
        for (int k = 0; k < 3; k++) {
            point.arm[k] = walk->body.scale * ces_dot(walk->body.rotation[k], &walk->body.vertices[3 * v]);
        }
        for (int look = 0; look < LOOKS; look++) {
            if (finds_face(walk, point.arm, (double)look / (LOOKS - 1), rest, most, &fall)) {
                double above[3];
                ces_subtract(walk->first_place, fall.foot, above);
                ces_add_scaled(above, 1.0, point.arm);
                point.gap = ces_max(0.0, ces_dot(fall.normal, above));
                point.part_mesh = CES_MESH_PARTS * fall.triangle + CES_MESH_PARTS - 1;
                ces_copy(fall.normal, point.normal);
                keep(walk, &point);
                break;
            }
        }
    }
}

size_t ces_convex_mesh_points(const ces_Mesh *mesh, const ces_ConvexMeshPath *path,
                              ces_ConvexMeshPoint points[CES_CONVEX_MESH_POINTS])
{
    Walk walk;
    walk.mesh = mesh;
    walk.input = path;
    walk.body = path->body;
    walk.count = 0;
    ces_copy(path->path, walk.leg);
    ces_copy(path->body.position, walk.first_place);
    walk.first_fraction = 0.0;
    const double around = path->body.reach + path->margin + path->sweep;
    for (walk.number = 0; walk.number < LEGS; walk.number++) {
        double rest[3];
        ces_copy(walk.leg, rest);
        walk.obstacle_at = walk.until = 1.0;
        search(&walk, path->body.reach * (1.0 + MEETING), find_obstacle);
        const bool hits = walk.obstacle_at < 1.0;
        walk.until = walk.obstacle_at;
        if (walk.number == 0) {
            walk.first_fraction = hits ? walk.until : 0.0;
            ces_add_scaled(walk.first_place, walk.first_fraction, walk.leg);
        }
        search(&walk, around, gather);
        if (!hits) {
            break;
        }
        for (int k = 0; k < 3; k++) {
            walk.leg[k] = walk.until * rest[k];
            rest[k] -= walk.leg[k];
        }
        ces_add_scaled(walk.body.position, 1.0, walk.leg);
        ces_copy(walk.obstacle, walk.planes[walk.number]);
        const bool goes_on =
            ces_turn_aside(walk.planes[0], walk.number, walk.input->restitution, walk.body.reach, rest);
        hold_vertices(&walk, rest);
        if (!goes_on) {
            break;
        }
        ces_copy(rest, walk.leg);
    }
    return reduce(&walk, points);
}

void ces_convex_triangle_manifold(const ces_Mesh *mesh, uint32_t triangle, const ces_Convex *body,
                                  const double normal[3], ces_Manifold *manifold)
{
    TriangleBody own;
    double away[3], on_body[3], on_triangle[3];
    triangle_body(mesh, triangle, &own);
    manifold->count = 0;
    if (ces_convex_distance(body, &own.convex, away, on_body, on_triangle) < 0.0) {
        ces_convex_manifold_along(body, &own.convex, normal, 0.0, manifold);
    }
}
