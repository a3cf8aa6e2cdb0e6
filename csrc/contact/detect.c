#include "detect.h"

#include <math.h>
#include <string.h>

#include "../base/parallel.h"
#include "../base/vec3.h"
#include "convex_candidates.h"
#include "mesh_candidate.h"
#include "parts.h"
#include "reach.h"

enum { ROW_BLOCK = 256, PAIR_BLOCK = 512 };

/* What the search looks at beyond the free path, as shares of the radius and of the path: a grain that is hit leaves its path. */
#define MARGIN_RADIUS 0.1
#define MARGIN_PATH 0.25

typedef struct Task {
    ces_Detector *detector;
    const ces_DetectInput *input;
    const ces_Balls *balls;
    const ces_Pair *pairs;
} Task;

/* For a part that may travel farther than its grain: a ball with its own path. */
static double usual_margin(double radius, const double path[3])
{
    return MARGIN_RADIUS * radius + MARGIN_PATH * ces_norm(path);
}

/* How far from its free path a ball is looked for, m: at least as far as the contacts found so far may push its grain. */
static double margin_of(const Task *task, size_t row, size_t ball)
{
    const double usual = usual_margin(0.5 * task->balls->diameter[ball], &task->balls->path[3 * ball]);
    return ces_max(usual, ((const double *)task->detector->reach.data)[row]);
}

static ces_Box box_of(const Task *task, size_t row, size_t ball)
{
    ces_Box box;
    const double around = 0.5 * task->balls->diameter[ball] + margin_of(task, row, ball);
    for (size_t k = 0; k < 3; k++) {
        const double from = task->balls->center[3 * ball + k];
        const double to = from + task->balls->path[3 * ball + k];
        box.lower[k] = ces_min(from, to) - around;
        box.upper[k] = ces_max(from, to) + around;
    }
    return box;
}

static void box_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Task *task = context;
    ces_Box *boxes = task->detector->boxes.data;
    for (size_t row = first; row < last; row++) {
        const size_t ball = ces_first_ball(task->balls, row), end = ces_first_ball(task->balls, row + 1);
        boxes[row] = box_of(task, row, ball);
        for (size_t k = ball + 1; k < end; k++) {
            const ces_Box part = box_of(task, row, k);
            for (int axis = 0; axis < 3; axis++) {
                boxes[row].lower[axis] = ces_min(boxes[row].lower[axis], part.lower[axis]);
                boxes[row].upper[axis] = ces_max(boxes[row].upper[axis], part.upper[axis]);
            }
        }
    }
}

static bool is_convex(const Task *task, size_t row)
{
    return !task->input->only_spheres && ces_is_convex(task->input->shapes, task->input->particles, row);
}

/* ---- pairs of grains ----------------------------------------------------------------------------------------------------- */

static void approach_pair(const Task *task, const ces_Pair *pair, size_t ball_a, size_t ball_b,
                          ces_Candidate *candidate)
{
    const ces_Balls *balls = task->balls;
    double offset[3];
    candidate->a = pair->a;
    candidate->b = pair->b;
    candidate->part_a = (uint32_t)(ball_a - ces_first_ball(balls, pair->a));
    candidate->part_b = (uint32_t)(ball_b - ces_first_ball(balls, pair->b));
    candidate->radius_a = 0.5 * balls->diameter[ball_a];
    candidate->radius_b = 0.5 * balls->diameter[ball_b];
    ces_subtract(&balls->center[3 * ball_a], &balls->center[3 * ball_b], offset);
    ces_subtract(&balls->path[3 * ball_a], &balls->path[3 * ball_b], candidate->path);
    ces_approach_sphere(offset, candidate->path, candidate->radius_a, candidate->radius_b, &candidate->approach);
    ces_copy(&balls->center[3 * ball_a], candidate->point);
    ces_add_scaled(candidate->point, candidate->approach.fraction, &balls->path[3 * ball_a]);
    ces_add_scaled(candidate->point, -candidate->radius_a, candidate->approach.normal);
}

static bool boxes_overlap(const ces_Box *one, const ces_Box *other)
{
    return one->lower[0] <= other->upper[0] && other->lower[0] <= one->upper[0] && one->lower[1] <= other->upper[1] &&
           other->lower[1] <= one->upper[1] && one->lower[2] <= other->upper[2] && other->lower[2] <= one->upper[2];
}

/* The parts of two grains that may meet; candidates may be NULL to count only. */
static size_t meet_pair(const Task *task, const ces_Pair *pair, ces_Candidate *candidates)
{
    const size_t end_a = ces_first_ball(task->balls, (size_t)pair->a + 1);
    const size_t first_b = ces_first_ball(task->balls, pair->b),
                 end_b = ces_first_ball(task->balls, (size_t)pair->b + 1);
    const ces_Box *boxes = task->detector->boxes.data;
    const bool convex = is_convex(task, pair->a) || is_convex(task, pair->b);
    size_t count = 0;
    for (size_t ball_a = ces_first_ball(task->balls, pair->a); ball_a < end_a; ball_a++) {
        const ces_Box box = box_of(task, pair->a, ball_a);
        if (!boxes_overlap(&box, &boxes[pair->b])) {
            continue;
        }
        for (size_t ball_b = first_b; ball_b < end_b; ball_b++) {
            const ces_Box other = box_of(task, pair->b, ball_b);
            if (!boxes_overlap(&box, &other)) {
                continue;
            }
            if (candidates != NULL && convex) {
                const double margin = margin_of(task, pair->a, ball_a) + margin_of(task, pair->b, ball_b);
                ces_convex_pair_candidates(task->input, task->balls, (const uint32_t[2]){pair->a, pair->b},
                                           (const size_t[2]){ball_a, ball_b}, margin, &candidates[count]);
            } else if (candidates != NULL) {
                approach_pair(task, pair, ball_a, ball_b, &candidates[count]);
            }
            count += convex ? CES_CONVEX_PLACES : 1;
        }
    }
    return count;
}

static void count_pair_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Task *task = context;
    uint32_t *counts = task->detector->pair_counts.data;
    for (size_t k = first; k < last; k++) {
        counts[k] = (uint32_t)meet_pair(task, &task->pairs[k], NULL);
    }
}

static void fill_pair_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Task *task = context;
    const uint32_t *starts = task->detector->pair_counts.data;
    ces_Candidate *candidates = task->detector->pair_candidates.data;
    for (size_t k = first; k < last; k++) {
        if (task->input->only_spheres) { /* a pair of boxes is a pair of balls */
            approach_pair(task, &task->pairs[k], task->pairs[k].a, task->pairs[k].b, &candidates[k]);
        } else if (starts[k + 1] > starts[k]) {
            meet_pair(task, &task->pairs[k], &candidates[starts[k]]);
        }
    }
}

/* From counts to starts; gives the sum. */
static size_t sum_up(uint32_t *counts, size_t count)
{
    uint32_t sum = 0;
    for (size_t k = 0; k < count; k++) {
        const uint32_t size = counts[k];
        counts[k] = sum;
        sum += size;
    }
    counts[count] = sum;
    return sum;
}

/* Count, prefix sum, fill: the list does not depend on threads. */
static bool find_pair_candidates(Task *task, size_t *count)
{
    ces_Detector *detector = task->detector;
    const ces_DetectInput *input = task->input;
    *count = 0;
    if (!input->grain_contact || input->count < 2) {
        return true;
    }
    if (!ces_pool_reserve(&detector->boxes, input->count, sizeof(ces_Box))) {
        return false;
    }
    ces_parallel_for(input->count, ROW_BLOCK, input->threads, box_block, task);
    size_t pair_count;
    if (!ces_grid_pairs(&detector->grid, detector->boxes.data, input->count, input->threads, &task->pairs,
                        &pair_count)) {
        return false;
    }
    *count = pair_count;
    if (!input->only_spheres) {
        if (!ces_pool_reserve(&detector->pair_counts, pair_count + 1, sizeof(uint32_t))) {
            return false;
        }
        ces_parallel_for(pair_count, PAIR_BLOCK, input->threads, count_pair_block, task);
        *count = sum_up(detector->pair_counts.data, pair_count);
    }
    if (!ces_pool_reserve(&detector->pair_candidates, *count, sizeof(ces_Candidate))) {
        return false;
    }
    ces_parallel_for(pair_count, PAIR_BLOCK, input->threads, fill_pair_block, task);
    if (!input->only_spheres) {
        *count = ces_squeeze_candidates(detector->pair_candidates.data, *count);
    }
    return true;
}

/* ---- grains and surfaces -------------------------------------------------------------------------------------------------- */

static bool pressed_a_surface(const ces_Particles *particles, size_t row)
{
    return (particles->touched[row] & ~CES_RODE) != 0;
}

static void approach_surface(const Task *task, size_t row, size_t ball, size_t s, ces_Candidate *candidate)
{
    const ces_Surface *surface = &task->input->surfaces[s];
    const double *center = &task->balls->center[3 * ball], *path = &task->balls->path[3 * ball];
    const bool touched = pressed_a_surface(task->input->particles, row);
    ces_surface_path(surface, center, path, candidate->path);
    ces_approach_surface(surface, center, candidate->path, candidate->radius_a, touched, &candidate->approach);
    ces_surface_turn(surface, candidate->approach.fraction, candidate->approach.normal);
    ces_surface_turn(surface, candidate->approach.fraction, candidate->path);
    ces_copy(center, candidate->point);
    ces_add_scaled(candidate->point, candidate->approach.fraction, path);
    ces_add_scaled(candidate->point, -candidate->radius_a, candidate->approach.normal);
}

/* How far from its centre a ball is looked for in the step, m. */
static double search_radius(const Task *task, size_t row, size_t ball)
{
    const ces_Balls *balls = task->balls;
    return 0.5 * balls->diameter[ball] + margin_of(task, row, ball) + ces_norm(&balls->path[3 * ball]);
}

/* The same of a whole grain. */
static double grain_search_radius(const Task *task, size_t row)
{
    const size_t first = ces_first_ball(task->balls, row), end = ces_first_ball(task->balls, row + 1);
    if (end == first + 1) {
        return search_radius(task, row, first);
    }
    double farthest = 0.0;
    for (size_t ball = first; ball < end; ball++) {
        double place[3];
        ces_subtract(&task->balls->center[3 * ball], &task->input->particles->position[3 * row], place);
        farthest = ces_max(farthest, ces_norm(place) + search_radius(task, row, ball));
    }
    return farthest;
}

/* The contacts that a ball may make with a surface which is near: a mesh has several; candidates may be NULL to count only. */
static size_t meet_surface(const Task *task, size_t row, size_t ball, size_t s, ces_Candidate *candidates)
{
    const ces_DetectInput *input = task->input;
    const ces_Surface *surface = &input->surfaces[s];
    const double radius = 0.5 * task->balls->diameter[ball];
    ces_MeshBall mesh_ball;
    size_t count = 1;
    if (surface->mesh != NULL) {
        const uint32_t part = (uint32_t)(ball - ces_first_ball(task->balls, row));
        const size_t m = s * input->table->material_count + ces_touching_material(input, (uint32_t)row, part);
        mesh_ball = (ces_MeshBall){.center = &task->balls->center[3 * ball],
                                   .path = &task->balls->path[3 * ball],
                                   .margin = margin_of(task, row, ball),
                                   .restitution = input->table->surface_restitution[m],
                                   .touched = pressed_a_surface(input->particles, row)};
        count = ces_mesh_slots(surface, &mesh_ball, radius);
    }
    if (count == 0 || candidates == NULL) {
        return count;
    }
    candidates->a = (uint32_t)row;
    candidates->b = (uint32_t)s;
    candidates->part_a = (uint32_t)(ball - ces_first_ball(task->balls, row));
    candidates->part_b = 0;
    candidates->radius_a = radius;
    candidates->radius_b = HUGE_VAL;
    if (surface->mesh != NULL) {
        ces_meet_mesh(surface, &mesh_ball, count, candidates);
    } else {
        approach_surface(task, row, ball, s, candidates);
    }
    return count;
}

/* The surfaces that a grain may come near, by a cheap test; candidates may be NULL to count only. */
static size_t meet_surfaces(const Task *task, size_t row, ces_Candidate *candidates)
{
    const ces_Balls *balls = task->balls;
    const size_t first = ces_first_ball(balls, row), end = ces_first_ball(balls, row + 1);
    const double *center = &task->input->particles->position[3 * row];
    const double around = grain_search_radius(task, row);
    const bool convex = is_convex(task, row);
    size_t count = 0;
    for (size_t s = 0; s < task->input->surface_count; s++) {
        const ces_Surface *surface = &task->input->surfaces[s];
        if (!ces_surface_within(surface, center, around + surface->travel)) {
            continue;
        }
        for (size_t ball = first; ball < end; ball++) {
            if (end > first + 1 && !ces_surface_within(surface, &balls->center[3 * ball],
                                                       search_radius(task, row, ball) + surface->travel)) {
                continue;
            }
            if (!convex) {
                count += meet_surface(task, row, ball, s, candidates == NULL ? NULL : &candidates[count]);
                continue;
            }
            if (candidates != NULL && surface->mesh != NULL) {
                ces_convex_mesh_candidates(task->input, (uint32_t)row, (uint32_t)s, margin_of(task, row, ball),
                                           &candidates[count]);
            } else if (candidates != NULL) {
                ces_convex_surface_candidates(task->input, (uint32_t)row, (uint32_t)s, margin_of(task, row, ball),
                                              &candidates[count]);
            }
            count += CES_CONVEX_PLACES;
        }
    }
    return count;
}

static void count_surface_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Task *task = context;
    uint32_t *counts = task->detector->surface_counts.data;
    for (size_t row = first; row < last; row++) {
        counts[row] = (uint32_t)meet_surfaces(task, row, NULL);
    }
}

static void fill_surface_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Task *task = context;
    const uint32_t *starts = task->detector->surface_counts.data;
    ces_Candidate *candidates = task->detector->surface_candidates.data;
    for (size_t row = first; row < last; row++) {
        if (starts[row + 1] > starts[row]) {
            meet_surfaces(task, row, &candidates[starts[row]]);
        }
    }
}

static bool find_surface_candidates(Task *task, size_t *count)
{
    ces_Detector *detector = task->detector;
    const size_t rows = task->input->count;
    *count = 0;
    if (!ces_pool_reserve(&detector->surface_counts, rows + 1, sizeof(uint32_t))) {
        return false;
    }
    ces_parallel_for(rows, ROW_BLOCK, task->input->threads, count_surface_block, task);
    *count = sum_up(detector->surface_counts.data, rows);
    if (!ces_pool_reserve(&detector->surface_candidates, *count, sizeof(ces_Candidate))) {
        return false;
    }
    ces_parallel_for(rows, ROW_BLOCK, task->input->threads, fill_surface_block, task);
    if (!task->input->only_spheres) {
        *count = ces_squeeze_candidates(detector->surface_candidates.data, *count);
    }
    return true;
}

/* Whether some grain may be pushed farther from its path than was looked at. */
static bool reaches_beyond(const Task *task)
{
    const double *reach = task->detector->reach.data;
    for (size_t row = 0; row < task->input->count; row++) {
        const size_t end = ces_first_ball(task->balls, row + 1);
        for (size_t ball = ces_first_ball(task->balls, row); ball < end; ball++) {
            if (reach[row] > usual_margin(0.5 * task->balls->diameter[ball], &task->balls->path[3 * ball])) {
                return true;
            }
        }
    }
    return false;
}

/* A grain touches with one material, unless it is a composite: nobody looks for that where there are none. */
static inline void describe_all(const ces_DetectInput *input, const double *reach, const ces_Candidate *pairs,
                                size_t pair_count, const ces_Candidate *surfaces, size_t surface_count, bool composites,
                                ces_Contacts *contacts)
{
    const int32_t *materials = input->particles->material;
    for (size_t k = 0; k < pair_count; k++) {
        const ces_Candidate *pair = &pairs[k];
        if (ces_is_near(input, reach, pair, true)) {
            const size_t a =
                composites ? ces_touching_material(input, pair->a, pair->part_a) : (size_t)materials[pair->a];
            const size_t b =
                composites ? ces_touching_material(input, pair->b, pair->part_b) : (size_t)materials[pair->b];
            ces_describe_pair(input, pair, a, b, &contacts->list[contacts->count++]);
        }
    }
    contacts->pair_count = contacts->count;
    for (size_t k = 0; k < surface_count; k++) {
        const ces_Candidate *one = &surfaces[k];
        if (ces_is_near(input, reach, one, false)) {
            const size_t a = composites ? ces_touching_material(input, one->a, one->part_a) : (size_t)materials[one->a];
            ces_describe_surface(input, one, a, &contacts->list[contacts->count++]);
        }
    }
}

bool ces_detect(ces_Detector *detector, const ces_DetectInput *input, ces_Contacts *contacts)
{
    Task task = {.detector = detector, .input = input, .balls = &detector->balls};
    size_t pair_count, surface_count;
    contacts->count = contacts->pair_count = 0;
    const ces_BallsInput balls = {.particles = input->particles,
                                  .shapes = input->shapes,
                                  .only_spheres = input->only_spheres,
                                  .rows = input->count,
                                  .displacement = input->displacement,
                                  .free_orientation = input->free_orientation,
                                  .threads = input->threads};
    if (!ces_balls_build(&detector->balls, &balls) ||
        !ces_pool_reserve(&detector->reach, input->count, sizeof(double))) {
        return false;
    }
    double *reach = detector->reach.data;
    memset(reach, 0, input->count * sizeof *reach);
    if (!find_pair_candidates(&task, &pair_count)) {
        return false;
    }
    ces_reach_raise(input, reach, detector->pair_candidates.data, pair_count, true);
    ces_reach_spread(input, reach, detector->pair_candidates.data, pair_count);
    if (reaches_beyond(&task)) {
        /* A hit throws a grain farther than it flies: once more, with that in view. */
        if (!find_pair_candidates(&task, &pair_count)) {
            return false;
        }
        ces_reach_raise(input, reach, detector->pair_candidates.data, pair_count, true);
        ces_reach_spread(input, reach, detector->pair_candidates.data, pair_count);
    }
    if (!find_surface_candidates(&task, &surface_count) ||
        !ces_contacts_reserve(contacts, pair_count + surface_count)) {
        return false;
    }
    const ces_Candidate *pairs = detector->pair_candidates.data;
    const ces_Candidate *surfaces = detector->surface_candidates.data;
    ces_reach_raise(input, reach, surfaces, surface_count, false);
    ces_reach_spread(input, reach, pairs, pair_count);

    if (input->composites) {
        describe_all(input, reach, pairs, pair_count, surfaces, surface_count, true, contacts);
    } else {
        describe_all(input, reach, pairs, pair_count, surfaces, surface_count, false, contacts);
    }
    return true;
}

void ces_detector_free(ces_Detector *detector)
{
    ces_grid_free(&detector->grid);
    ces_balls_free(&detector->balls);
    ces_Pool *const pools[] = {&detector->boxes,           &detector->reach,          &detector->pair_counts,
                               &detector->pair_candidates, &detector->surface_counts, &detector->surface_candidates};
    for (size_t k = 0; k < sizeof pools / sizeof pools[0]; k++) {
        ces_pool_free(pools[k]);
    }
}
