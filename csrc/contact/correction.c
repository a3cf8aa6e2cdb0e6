#include "correction.h"

#include <string.h>

#include "../base/vec3.h"

enum { SWEEPS = 10 };
#define SLOP 1e-6 /* of a radius: the overlap that is left alone */

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

static Yield yield_of(const ces_CorrectionInput *input, const Ball *ball, const double normal[3], double side)
{
    const ces_Particles *particles = input->particles;
    Yield yield = {.mobility = 1.0 / particles->mass[ball->row]};
    if (ball->turns) {
        double arm[3], lever[3], inverse[9];
        ces_subtract(ball->center, &particles->position[3 * (size_t)ball->row], arm);
        ces_add_scaled(arm, -side * ball->radius, normal);
        ces_cross(arm, normal, lever);
        ces_inverse_inertia(&input->shapes[particles->shape[ball->row]], particles->mass[ball->row],
                            particles->diameter[ball->row], &particles->orientation[4 * (size_t)ball->row], inverse);
        for (int k = 0; k < 3; k++) {
            yield.turn[k] = ces_dot(&inverse[3 * k], lever);
        }
        yield.mobility += ces_dot(lever, yield.turn);
    }
    return yield;
}

static void move(const ces_CorrectionInput *input, const Ball *ball, const Yield *yield, double push,
                 const double normal[3])
{
    ces_Particles *particles = input->particles;
    ces_add_scaled(&particles->position[3 * (size_t)ball->row], push / particles->mass[ball->row], normal);
    if (ball->turns) {
        const double turn[3] = {push * yield->turn[0], push * yield->turn[1], push * yield->turn[2]};
        ces_turn(&particles->orientation[4 * (size_t)ball->row], turn);
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
    move(input, &a, &yield_a, push, normal);
    move(input, &b, &yield_b, -push, normal);
    return share;
}

/* Of the ball's centre from a surface, m. A mesh counts by the triangle that was met, from the side on which it was met. */
static double distance_of(const ces_Surface *surface, const ces_Contact *contact, const double center[3],
                          double normal[3])
{
    static const double still[3] = {0.0, 0.0, 0.0};
    if (surface->mesh == NULL) {
        return ces_surface_distance(surface, center, normal);
    }
    double local[3], path[3], direction[3];
    const ces_Triangle triangle = ces_mesh_triangle(surface->mesh, contact->part_b);
    ces_surface_to_mesh(surface, center, still, local, path);
    const double distance = ces_triangle_distance(&triangle, local, direction);
    for (int k = 0; k < 3; k++) {
        normal[k] = ces_dot(surface->rotation[k], direction);
    }
    if (ces_dot(normal, contact->normal) >= 0.0) {
        return distance;
    }
    for (int k = 0; k < 3; k++) {
        normal[k] = -normal[k];
    }
    return -distance;
}

static double separate_surface(const ces_CorrectionInput *input, const ces_Contact *contact)
{
    const Ball ball = ball_of(input, contact->a, contact->part_a);
    double normal[3];
    const double overlap = ball.radius - distance_of(&input->surfaces[contact->b], contact, ball.center, normal);
    const double share = overlap / ball.radius;
    if (share > SLOP) {
        const Yield yield = yield_of(input, &ball, normal, 1.0);
        move(input, &ball, &yield, overlap / yield.mobility, normal);
    }
    return share;
}

void ces_correct_island(const ces_CorrectionInput *input, const ces_Island *island)
{
    const ces_Contact *contacts = input->contacts->list;
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double worst = 0.0;
        for (uint32_t k = island->pair_first; k < island->pair_last; k++) {
            worst = ces_max(worst, separate_pair(input, &contacts[input->islands->pair_order[k]]));
        }
        /* From the last to the first: where surfaces disagree the machine's first one, the drum, has the last word. */
        for (uint32_t k = island->surface_last; k-- > island->surface_first;) {
            worst = ces_max(worst, separate_surface(input, &contacts[input->islands->surface_order[k]]));
        }
        if (worst <= SLOP) {
            return;
        }
    }
}
