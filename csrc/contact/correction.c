#include "correction.h"

#include <string.h>

#include "../base/vec3.h"
#include "convex_candidates.h"
#include "convex_mesh.h"
#include "parts.h"

/* A push is passed on from grain to grain, one a sweep. Long grains that turn sink in with their ends, each step anew: there
 * the pushes have to arrive, if not to the last digit. */
enum { SWEEPS = 10, CONVEX_SWEEPS = 200 };
#define ENOUGH 1e-4   /* of a radius: the overlap for which convex grains go on beyond the sweeps of the others */
#define SLOP 1e-6     /* of a radius: the overlap that is left alone */
#define SAME_SIDE 0.5 /* cosine: of normals on one side of a mesh */

/* The ball of a grain that a contact is about, where it is now. */
typedef struct Ball {
    uint32_t row;
    bool turns; /* its grain is no sphere: a push off its centre turns it */
    double center[3], radius;
} Ball;

static Ball ball_of(const ces_CorrectionInput *input, uint32_t row, uint32_t part)
{
    const ces_Particles *particles = input->particles;
    const ces_Shape *shape = &input->shapes[particles->shape[row]];
    const double d = particles->diameter[row];
    Ball ball = {.row = row, .turns = input->rotation && shape->def.kind != CES_SPHERE, .radius = 0.5 * d};
    ces_copy(&particles->position[3 * (size_t)row], ball.center);
    if (shape->def.kind == CES_CLUSTER) {
        const double *sphere = &shape->def.spheres[4 * (size_t)part];
        double place[3];
        ces_rotate(&particles->orientation[4 * (size_t)row], sphere, place);
        ces_add_scaled(ball.center, d, place);
        ball.radius = d * sphere[3];
    }
    return ball;
}

/* How a grain yields to a push at the end of an arm: 1/kg along the normal, and the turn that goes with it. */
typedef struct Yield {
    double mobility;
    double turn[3]; /* 1/(kg m), rotation vector a unit of push */
} Yield;

static Yield yield_at(const ces_CorrectionInput *input, uint32_t row, const double arm[3], const double normal[3])
{
    const ces_Particles *particles = input->particles;
    Yield yield = {.mobility = 1.0 / particles->mass[row]};
    double lever[3], inverse[9];
    ces_cross(arm, normal, lever);
    ces_inverse_inertia(&input->shapes[particles->shape[row]], particles->mass[row], particles->diameter[row],
                        &particles->orientation[4 * (size_t)row], inverse);
    for (int k = 0; k < 3; k++) {
        yield.turn[k] = ces_dot(&inverse[3 * k], lever);
    }
    yield.mobility += ces_dot(lever, yield.turn);
    return yield;
}

static Yield yield_of(const ces_CorrectionInput *input, const Ball *ball, const double normal[3], double side)
{
    const ces_Particles *particles = input->particles;
    if (!ball->turns) {
        return (Yield){.mobility = 1.0 / particles->mass[ball->row]};
    }
    double arm[3];
    ces_subtract(ball->center, &particles->position[3 * (size_t)ball->row], arm);
    ces_add_scaled(arm, -side * ball->radius, normal);
    return yield_at(input, ball->row, arm, normal);
}

static void move(const ces_CorrectionInput *input, uint32_t row, bool turns, const Yield *yield, double push,
                 const double normal[3])
{
    ces_Particles *particles = input->particles;
    ces_add_scaled(&particles->position[3 * (size_t)row], push / particles->mass[row], normal);
    if (turns) {
        const double turn[3] = {push * yield->turn[0], push * yield->turn[1], push * yield->turn[2]};
        ces_turn(&particles->orientation[4 * (size_t)row], turn);
    }
}

/* Both parts give the overlap they found, as a share of the radius. */
static double separate_pair(const ces_CorrectionInput *input, const ces_Contact *contact)
{
    const Ball a = ball_of(input, contact->a, contact->part_a), b = ball_of(input, contact->b, contact->part_b);
    double normal[3];
    ces_subtract(a.center, b.center, normal);
    const double distance = ces_norm(normal);
    const double overlap = a.radius + b.radius - distance;
    const double share = overlap / ces_min(a.radius, b.radius);
    if (share <= SLOP) {
        return share;
    }
    if (distance > 0.0) {
        for (int k = 0; k < 3; k++) {
            normal[k] /= distance;
        }
    } else {
        ces_copy(contact->normal, normal); /* coincident centres keep the normal they were found with */
    }
    const Yield yield_a = yield_of(input, &a, normal, 1.0), yield_b = yield_of(input, &b, normal, -1.0);
    const double push = overlap / (yield_a.mobility + yield_b.mobility);
    move(input, a.row, a.turns, &yield_a, push, normal);
    move(input, b.row, b.turns, &yield_b, -push, normal);
    return share;
}

/* Of a ball's centre from a mesh, m. The triangle that was met says on which side the ball belongs; from there it may have
 * come to lie on another one. */
static double mesh_distance(const ces_Surface *surface, const ces_Contact *contact, const Ball *ball, double normal[3])
{
    static const double still[3] = {0.0, 0.0, 0.0};
    const ces_Triangle met = ces_mesh_triangle(surface->mesh, contact->part_b);
    double local[3], path[3], direction[3], side[3];
    ces_surface_to_mesh(surface, ball->center, still, local, path);
    double distance = ces_triangle_distance(&met, local, direction);
    for (int k = 0; k < 3; k++) {
        side[k] = surface->rotation[0][k] * contact->normal[0] + surface->rotation[1][k] * contact->normal[1] +
                  surface->rotation[2][k] * contact->normal[2];
    }
    if (ces_dot(side, direction) < 0.0) {
        distance = -distance;
        for (int k = 0; k < 3; k++) {
            direction[k] = -direction[k];
        }
    } else {
        double other[3];
        const double nearest = ces_mesh_distance(surface->mesh, local, ces_min(distance, ball->radius), other);
        if (nearest < ces_min(distance, ball->radius) && ces_dot(side, other) >= 0.0) {
            distance = nearest;
            ces_copy(other, direction);
        }
    }
    for (int k = 0; k < 3; k++) {
        normal[k] = ces_dot(surface->rotation[k], direction);
    }
    return distance;
}

static double separate_surface(const ces_CorrectionInput *input, const ces_Contact *contact)
{
    const Ball ball = ball_of(input, contact->a, contact->part_a);
    double normal[3];
    const ces_Surface *surface = &input->surfaces[contact->b];
    const double distance = surface->mesh != NULL ? mesh_distance(surface, contact, &ball, normal)
                                                  : ces_surface_distance(surface, ball.center, normal);
    const double overlap = ball.radius - distance;
    const double share = overlap / ball.radius;
    if (share > SLOP) {
        const Yield yield = yield_of(input, &ball, normal, 1.0);
        move(input, ball.row, ball.turns, &yield, overlap / yield.mobility, normal);
    }
    return share;
}

/* ---- convex grains: all points of contact, one after the other ------------------------------------------------------------ */

static bool turns(const ces_CorrectionInput *input, uint32_t row)
{
    return input->rotation && input->shapes[input->particles->shape[row]].def.kind != CES_SPHERE;
}

typedef struct Pose {
    double position[3], orientation[4];
} Pose;

static Pose pose_of(const ces_CorrectionInput *input, uint32_t row)
{
    Pose pose;
    ces_copy(&input->particles->position[3 * (size_t)row], pose.position);
    memcpy(pose.orientation, &input->particles->orientation[4 * (size_t)row], sizeof pose.orientation);
    return pose;
}

/* By how much a point of a grain has come along a normal since a pose, m; the arm of the point now. */
static double come_along(const ces_CorrectionInput *input, uint32_t row, const Pose *before, const double point[3],
                         const double normal[3], double arm[3])
{
    double local[3];
    ces_subtract(point, before->position, arm);
    ces_rotate_back(before->orientation, arm, local);
    ces_rotate(&input->particles->orientation[4 * (size_t)row], local, arm);
    double moved[3];
    for (int k = 0; k < 3; k++) {
        moved[k] = input->particles->position[3 * (size_t)row + (size_t)k] + arm[k] - point[k];
    }
    return ces_dot(normal, moved);
}

/* b is NULL where a touches a surface. */
static double separate_points(const ces_CorrectionInput *input, const ces_ManifoldPoint *points, int count, uint32_t a,
                              const uint32_t *b, double radius)
{
    const Pose before_a = pose_of(input, a), before_b = b != NULL ? pose_of(input, *b) : before_a;
    double worst = 0.0;
    for (int k = 0; k < count; k++) {
        const ces_ManifoldPoint *point = &points[k];
        double arm_a[3], arm_b[3];
        double overlap = -point->gap - come_along(input, a, &before_a, point->point, point->normal, arm_a);
        if (b != NULL) {
            overlap += come_along(input, *b, &before_b, point->point, point->normal, arm_b);
        }
        worst = ces_max(worst, overlap / radius);
        if (overlap <= SLOP * radius) {
            continue;
        }
        const Yield still = {.mobility = 0.0};
        Yield yield_a = {.mobility = 1.0 / input->particles->mass[a]}, yield_b = still;
        if (turns(input, a)) {
            yield_a = yield_at(input, a, arm_a, point->normal);
        }
        if (b != NULL) {
            yield_b.mobility = 1.0 / input->particles->mass[*b];
            if (turns(input, *b)) {
                yield_b = yield_at(input, *b, arm_b, point->normal);
            }
        }
        const double push = overlap / (yield_a.mobility + yield_b.mobility);
        move(input, a, turns(input, a), &yield_a, push, point->normal);
        if (b != NULL) {
            move(input, *b, turns(input, *b), &yield_b, -push, point->normal);
        }
    }
    return worst;
}

static void place_part(const ces_CorrectionInput *input, uint32_t row, uint32_t part, ces_Convex *body)
{
    ces_part_place(&input->shapes[input->particles->shape[row]], input->particles, row, part, body);
}

static double separate_convex_pair(const ces_CorrectionInput *input, const ces_Contact *contact)
{
    ces_Convex a, b;
    ces_Manifold manifold;
    place_part(input, contact->a, contact->part_a, &a);
    place_part(input, contact->b, contact->part_b, &b);
    ces_convex_grains_manifold(&a, &b, 0.0, &manifold);
    const double *d = input->particles->diameter;
    return separate_points(input, manifold.points, manifold.count, contact->a, &contact->b,
                           0.5 * ces_min(d[contact->a], d[contact->b]));
}

static double separate_convex_surface(const ces_CorrectionInput *input, const ces_Contact *contact)
{
    ces_Convex a;
    ces_Manifold manifold;
    place_part(input, contact->a, contact->part_a, &a);
    ces_convex_surface_manifold(&a, &input->surfaces[contact->b], 0.0, &manifold);
    return separate_points(input, manifold.points, manifold.count, contact->a, NULL,
                           0.5 * input->particles->diameter[contact->a]);
}

/* A body in the frame of a mesh, and its points of contact there turned into the world. */
typedef struct MeshFrame {
    const ces_Surface *surface;
    ces_Convex body, local;
} MeshFrame;

static MeshFrame mesh_frame(const ces_CorrectionInput *input, const ces_Contact *contact)
{
    static const double still[3] = {0.0, 0.0, 0.0};
    MeshFrame frame = {.surface = &input->surfaces[contact->b]};
    double moved[3];
    place_part(input, contact->a, contact->part_a, &frame.body);
    ces_convex_in_mesh(frame.surface, &frame.body, still, &frame.local, moved);
    return frame;
}

static void to_world(const MeshFrame *frame, const double arm[3], double point[3])
{
    for (int axis = 0; axis < 3; axis++) {
        point[axis] = frame->body.position[axis] + ces_dot(frame->surface->rotation[axis], arm);
    }
}

/* Along the normal that it was met with: a thin sheet does not say on which side of it a body belongs. */
static double separate_convex_mesh(const ces_CorrectionInput *input, const ces_Contact *contact)
{
    const MeshFrame frame = mesh_frame(input, contact);
    const double(*r)[3] = frame.surface->rotation;
    ces_Manifold manifold;
    double normal[3];
    for (int k = 0; k < 3; k++) {
        normal[k] = r[0][k] * contact->normal[0] + r[1][k] * contact->normal[1] + r[2][k] * contact->normal[2];
    }
    ces_convex_triangle_manifold(frame.surface->mesh, contact->part_b / CES_MESH_PARTS, &frame.local, normal,
                                 &manifold);
    for (int k = 0; k < manifold.count; k++) {
        double arm[3];
        ces_subtract(manifold.points[k].point, frame.local.position, arm);
        to_world(&frame, arm, manifold.points[k].point);
        ces_copy(contact->normal, manifold.points[k].normal);
    }
    return separate_points(input, manifold.points, manifold.count, contact->a, NULL,
                           0.5 * input->particles->diameter[contact->a]);
}

/* From triangles that the body has turned or slid into, on the side on which it met the mesh. */
static double separate_from_others(const ces_CorrectionInput *input, const ces_Contact *contact)
{
    const MeshFrame frame = mesh_frame(input, contact);
    const ces_ConvexMeshPath path = {.body = frame.local};
    ces_ConvexMeshPoint found[CES_CONVEX_MESH_POINTS];
    ces_ManifoldPoint points[CES_CONVEX_MESH_POINTS];
    const size_t most = ces_convex_mesh_points(frame.surface->mesh, &path, found);
    int count = 0;
    for (size_t k = 0; k < most; k++) {
        for (int axis = 0; axis < 3; axis++) {
            points[count].normal[axis] = ces_dot(frame.surface->rotation[axis], found[k].normal);
        }
        if (ces_dot(points[count].normal, contact->normal) >= SAME_SIDE) {
            points[count].gap = found[k].gap;
            to_world(&frame, found[k].arm, points[count].point);
            count++;
        }
    }
    return separate_points(input, points, count, contact->a, NULL, 0.5 * input->particles->diameter[contact->a]);
}

static bool is_convex(const ces_CorrectionInput *input, uint32_t row)
{
    return ces_is_convex(input->shapes, input->particles, row);
}

/* The points of two convex bodies follow each other, and are all found again with the first. */
static bool is_first_of_its_bodies(const ces_Contact *contacts, const uint32_t *order, uint32_t k, uint32_t first)
{
    return k == first || contacts[order[k]].a != contacts[order[k - 1]].a ||
           contacts[order[k]].id_b != contacts[order[k - 1]].id_b;
}

static double correct_pair(const ces_CorrectionInput *input, const ces_Island *island, uint32_t k)
{
    const ces_Contact *contacts = input->contacts->list;
    const ces_Contact *contact = &contacts[input->islands->pair_order[k]];
    const bool a = is_convex(input, contact->a), b = is_convex(input, contact->b);
    if (!a && !b) {
        return separate_pair(input, contact);
    }
    if (a && b && !is_first_of_its_bodies(contacts, input->islands->pair_order, k, island->pair_first)) {
        return 0.0;
    }
    return separate_convex_pair(input, contact);
}

static double correct_surface(const ces_CorrectionInput *input, const ces_Island *island, uint32_t k)
{
    const ces_Contact *contacts = input->contacts->list;
    const ces_Contact *contact = &contacts[input->islands->surface_order[k]];
    if (!is_convex(input, contact->a)) {
        return separate_surface(input, contact);
    }
    const bool is_first = is_first_of_its_bodies(contacts, input->islands->surface_order, k, island->surface_first);
    if (input->surfaces[contact->b].mesh != NULL) {
        const double others = is_first ? separate_from_others(input, contact) : 0.0;
        return ces_max(others, separate_convex_mesh(input, contact));
    }
    if (!is_first) {
        return 0.0;
    }
    return separate_convex_surface(input, contact);
}

/* No grain of the island has been moved yet. Gives the number of sweeps it may take. */
static uint32_t begin(const ces_CorrectionInput *input, const ces_Island *island)
{
    const ces_Contact *contacts = input->contacts->list;
    bool convex = false;
    for (uint32_t k = island->pair_first; k < island->pair_last; k++) {
        const ces_Contact *contact = &contacts[input->islands->pair_order[k]];
        input->moved_in[contact->a] = input->moved_in[contact->b] = 0;
        convex = convex || is_convex(input, contact->a) || is_convex(input, contact->b);
    }
    for (uint32_t k = island->surface_first; k < island->surface_last; k++) {
        const uint32_t row = contacts[input->islands->surface_order[k]].a;
        input->moved_in[row] = 0;
        convex = convex || is_convex(input, row);
    }
    return convex ? CONVEX_SWEEPS : SWEEPS;
}

/* Since the sweep before this one: else the visit then found what another would find now, and nothing to do. */
static bool has_moved(const ces_CorrectionInput *input, uint32_t row, uint32_t sweep)
{
    return input->moved_in[row] + 1 >= sweep;
}

void ces_correct_island(const ces_CorrectionInput *input, const ces_Island *island)
{
    const ces_Contact *contacts = input->contacts->list;
    const uint32_t sweeps = begin(input, island);
    double worst = HUGE_VAL;
    for (uint32_t sweep = 1; sweep <= sweeps && worst > (sweep <= SWEEPS ? SLOP : ENOUGH); sweep++) {
        worst = 0.0;
        for (uint32_t k = island->pair_first; k < island->pair_last; k++) {
            const ces_Contact *contact = &contacts[input->islands->pair_order[k]];
            if (has_moved(input, contact->a, sweep) || has_moved(input, contact->b, sweep)) {
                const double share = correct_pair(input, island, k);
                if (share > SLOP) {
                    input->moved_in[contact->a] = input->moved_in[contact->b] = sweep;
                }
                worst = ces_max(worst, share);
            }
        }
        /* From the last to the first: where surfaces disagree the machine's first one, the drum, has the last word. */
        for (uint32_t k = island->surface_last; k-- > island->surface_first;) {
            const uint32_t row = contacts[input->islands->surface_order[k]].a;
            if (has_moved(input, row, sweep)) {
                const double share = correct_surface(input, island, k);
                if (share > SLOP) {
                    input->moved_in[row] = sweep;
                }
                worst = ces_max(worst, share);
            }
        }
    }
}
