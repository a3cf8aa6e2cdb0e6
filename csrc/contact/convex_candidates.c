#include "convex_candidates.h"

#include "../base/vec3.h"
#include "convex_mesh.h"
#include "parts.h"

#define RIDING                                                                                                         \
    0.05 /* of a radius: as near to a surface it touched, a grain rides on it, and is looked at where it is */
#define RESERVE 2.0 /* of the way along the normal: a hit that turns a grain brings its far corners down faster */

/* A part on its way through the step. */
typedef struct Mover {
    ces_Convex body; /* at the start */
    size_t row;
    uint32_t ball;
    bool is_convex;       /* else it is a ball, and turns about itself without coming nearer to anything */
    const double *path;   /* m, of its centre */
    double radius, sweep; /* m: of the ball of equal volume; no point of it turns farther in the step */
} Mover;

static void start(const ces_DetectInput *input, const double path[3], size_t row, uint32_t ball, Mover *mover)
{
    const ces_Shape *shape = &input->shapes[input->particles->shape[row]];
    mover->row = row;
    mover->ball = ball;
    mover->path = path;
    mover->is_convex = shape->def.kind == CES_CONVEX;
    mover->sweep = 0.0;
    ces_part_place(shape, input->particles, row, ball, &mover->body);
    mover->radius = mover->is_convex ? 0.5 * input->particles->diameter[row] : mover->body.rounding;
    if (mover->is_convex) {
        const double *before = &input->particles->orientation[4 * row], *after = &input->free_orientation[4 * row];
        double squared = 0.0;
        for (int k = 0; k < 4; k++) {
            squared += (after[k] - before[k]) * (after[k] - before[k]);
        }
        mover->sweep = 2.0 * mover->body.reach * sqrt(squared);
    }
}

/* The way of a point at the end of an arm: its centre's, and its turn about it, on the chord. */
static void point_path(const ces_DetectInput *input, const Mover *mover, const double arm[3], double path[3])
{
    ces_copy(mover->path, path);
    if (mover->is_convex) {
        double local[3], turned[3];
        ces_rotate_back(&input->particles->orientation[4 * mover->row], arm, local);
        ces_rotate(&input->free_orientation[4 * mover->row], local, turned);
        for (int k = 0; k < 3; k++) {
            path[k] += turned[k] - arm[k];
        }
    }
}

/*
 * A point of contact on its own way. Its gap was taken where the bodies meet or come closest without turning, along a normal
 * that is kept: so along the way it changes in proportion, and what would not meet without turning meets only by turning.
 */
static void set_approach(const ces_ManifoldPoint *point, double fraction, double along, double point_along,
                         ces_Approach *approach)
{
    ces_copy(point->normal, approach->normal);
    approach->start_gap = point->gap - fraction * along;
    approach->least_gap = ces_min(approach->start_gap, approach->start_gap + point_along);
    approach->hit = approach->least_gap <= 0.0;
    approach->fraction = fraction;
    if (approach->start_gap <= 0.0) {
        approach->fraction = 0.0;
    } else if (approach->hit && -point_along > approach->start_gap) {
        approach->fraction = approach->start_gap / -point_along;
    }
    approach->gap = approach->start_gap + approach->fraction * point_along;
}

static void mark(ces_Candidate *candidates)
{
    for (int k = 0; k < CES_CONVEX_PLACES; k++) {
        candidates[k].a = CES_NO_CANDIDATE;
    }
}

/* The part of a in the name of a contact: the ball of a cluster, which has one point; a feature where both have features. */
static uint32_t part_of(const Mover *mover, bool both, uint32_t feature)
{
    return mover->is_convex ? (both ? feature : 0) : mover->ball;
}

/* What both kinds of candidates share. The arm is from a's centre, which follows its own path. */
static void fill(const Mover *a, const double arm[3], uint32_t b, ces_Candidate *candidate)
{
    candidate->a = (uint32_t)a->row;
    candidate->b = b;
    candidate->radius_a = a->radius;
    for (int axis = 0; axis < 3; axis++) {
        candidate->point[axis] = a->body.position[axis] + candidate->approach.fraction * a->path[axis] + arm[axis];
    }
}

void ces_convex_pair_candidates(const ces_DetectInput *input, const ces_Balls *balls, const uint32_t rows[2],
                                const size_t ball[2], double margin, ces_Candidate *candidates)
{
    Mover a, b;
    ces_Approach approach;
    ces_Manifold manifold;
    double path[3];
    mark(candidates);
    start(input, &balls->path[3 * ball[0]], rows[0], (uint32_t)(ball[0] - ces_first_ball(balls, rows[0])), &a);
    start(input, &balls->path[3 * ball[1]], rows[1], (uint32_t)(ball[1] - ces_first_ball(balls, rows[1])), &b);
    ces_subtract(a.path, b.path, path);
    ces_approach_convex(&a.body, &b.body, path, &approach);
    const double sweep = a.sweep + b.sweep;
    if (approach.least_gap > margin + sweep) {
        return;
    }
    ces_Convex there = a.body;
    ces_add_scaled(there.position, approach.fraction, path);
    ces_convex_grains_manifold(&there, &b.body, sweep, &manifold);
    const bool both = a.is_convex && b.is_convex;
    for (int k = 0; k < manifold.count; k++) {
        const ces_ManifoldPoint *point = &manifold.points[k];
        ces_Candidate *candidate = &candidates[k];
        double arm_a[3], arm_b[3], way_a[3], way_b[3];
        ces_subtract(point->point, there.position, arm_a);
        ces_subtract(point->point, b.body.position, arm_b);
        ces_add_scaled(arm_b, -point->gap, point->normal);
        point_path(input, &a, arm_a, way_a);
        point_path(input, &b, arm_b, way_b);
        ces_subtract(way_a, way_b, candidate->path);
        set_approach(point, approach.fraction, ces_dot(point->normal, path), ces_dot(point->normal, candidate->path),
                     &candidate->approach);
        fill(&a, arm_a, rows[1], candidate);
        candidate->part_a = part_of(&a, both, point->sub_a);
        candidate->part_b = part_of(&b, both, point->sub_b);
        candidate->radius_b = b.radius;
    }
}

/* A vertex in reserve: from the moment of the hit on it may come down to the surface, and no farther. */
static void hold_back(const ces_ManifoldPoint *point, double fraction, ces_Candidate *candidate)
{
    candidate->path[0] = candidate->path[1] = candidate->path[2] = 0.0;
    ces_copy(point->normal, candidate->approach.normal);
    candidate->approach.gap = candidate->approach.start_gap = candidate->approach.least_gap = point->gap;
    candidate->approach.fraction = fraction;
    candidate->approach.hit = false;
}

static bool is_before(const ces_ManifoldPoint *one, const ces_ManifoldPoint *other)
{
    return one->sub_a < other->sub_a || (one->sub_a == other->sub_a && one->sub_b < other->sub_b);
}

void ces_convex_surface_candidates(const ces_DetectInput *input, uint32_t row, uint32_t s, double margin,
                                   ces_Candidate *candidates)
{
    const ces_Surface *surface = &input->surfaces[s];
    const double *displacement = &input->displacement[3 * (size_t)row];
    Mover a;
    ces_Approach approach;
    ces_Manifold manifold, reserve = {.count = 0};
    double path[3];
    mark(candidates);
    start(input, displacement, row, 0, &a);
    ces_surface_path(surface, a.body.position, displacement, path);
    ces_approach_convex_surface(&a.body, surface, path, false, &approach);
    if (approach.least_gap > margin + a.sweep) {
        return;
    }
    if (input->particles->touched[row] != 0 && approach.start_gap <= RIDING * a.radius) {
        approach.fraction = 0.0;
    }
    ces_Convex there = a.body;
    ces_add_scaled(there.position, approach.fraction, path);
    ces_convex_surface_manifold(&there, surface, a.sweep, &manifold);
    if (approach.hit) {
        const double fall = RESERVE * -ces_dot(approach.normal, path) * (1.0 - approach.fraction);
        ces_convex_surface_reserve(&there, surface, approach.normal, fall, &reserve);
    }
    for (int k = 0, m = 0, r = 0; k < manifold.count + reserve.count; k++) { /* both in the order of names */
        const bool held =
            m == manifold.count || (r < reserve.count && is_before(&reserve.points[r], &manifold.points[m]));
        const ces_ManifoldPoint *point = held ? &reserve.points[r++] : &manifold.points[m++];
        ces_Candidate *candidate = &candidates[k];
        double arm[3];
        ces_subtract(point->point, there.position, arm);
        if (held) {
            hold_back(point, approach.fraction, candidate);
        } else {
            point_path(input, &a, arm, candidate->path);
            ces_surface_path(surface, point->point, candidate->path, candidate->path);
            set_approach(point, approach.fraction, ces_dot(point->normal, path),
                         ces_dot(point->normal, candidate->path), &candidate->approach);
        }
        fill(&a, arm, s, candidate);
        candidate->part_a = point->sub_a;
        candidate->part_b = point->sub_b;
        candidate->radius_b = HUGE_VAL;
    }
}

void ces_convex_in_mesh(const ces_Surface *surface, const ces_Convex *body, const double path[3], ces_Convex *local,
                        double local_path[3])
{
    const double(*r)[3] = surface->rotation;
    *local = *body;
    ces_surface_to_mesh(surface, body->position, path, local->position, local_path);
    for (int row = 0; row < 3; row++) {
        for (int column = 0; column < 3; column++) {
            local->rotation[row][column] = r[0][row] * body->rotation[0][column] +
                                           r[1][row] * body->rotation[1][column] +
                                           r[2][row] * body->rotation[2][column];
        }
    }
}

void ces_convex_mesh_candidates(const ces_DetectInput *input, uint32_t row, uint32_t s, double margin,
                                ces_Candidate *candidates)
{
    const ces_Surface *surface = &input->surfaces[s];
    const size_t m = (size_t)s * input->table->material_count + (size_t)input->particles->material[row];
    Mover a;
    ces_ConvexMeshPath path;
    ces_ConvexMeshPoint points[CES_CONVEX_MESH_POINTS];
    double world_path[3];
    mark(candidates);
    start(input, &input->displacement[3 * (size_t)row], row, 0, &a);
    ces_convex_in_mesh(surface, &a.body, a.path, &path.body, path.path);
    path.margin = margin;
    path.sweep = a.sweep;
    path.restitution = input->table->surface_restitution[m];
    ces_surface_from_mesh(surface, path.path, world_path);
    const size_t count = ces_convex_mesh_points(surface->mesh, &path, points);
    for (size_t k = 0; k < count; k++) {
        ces_Candidate *candidate = &candidates[k];
        ces_ManifoldPoint point = {.gap = points[k].gap};
        double arm[3];
        for (int axis = 0; axis < 3; axis++) {
            arm[axis] = ces_dot(surface->rotation[axis], points[k].arm);
        }
        ces_surface_from_mesh(surface, points[k].normal, point.normal);
        if (points[k].held) {
            hold_back(&point, points[k].fraction, candidate);
        } else {
            point_path(input, &a, arm, candidate->path);
            for (int axis = 0; axis < 3; axis++) {
                candidate->path[axis] += world_path[axis] - a.path[axis];
            }
            set_approach(&point, points[k].fraction, ces_dot(point.normal, world_path),
                         ces_dot(point.normal, candidate->path), &candidate->approach);
        }
        fill(&a, arm, s, candidate);
        candidate->part_a = points[k].part_body;
        candidate->part_b = points[k].part_mesh;
        candidate->radius_b = HUGE_VAL;
    }
}

size_t ces_squeeze_candidates(ces_Candidate *candidates, size_t count)
{
    size_t kept = 0;
    for (size_t k = 0; k < count; k++) {
        if (candidates[k].a != CES_NO_CANDIDATE) {
            candidates[kept++] = candidates[k];
        }
    }
    return kept;
}
