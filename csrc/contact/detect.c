#include "detect.h"

#include <math.h>
#include <string.h>

#include "../base/parallel.h"
#include "../base/vec3.h"
#include "narrow_phase.h"

enum { ROW_BLOCK = 256, PAIR_BLOCK = 512, REACH_ROUNDS = 3 };

/* What the search looks at beyond the free path, as shares of the radius and of the path: a grain that is hit leaves its path. */
#define MARGIN_RADIUS 0.1
#define MARGIN_PATH 0.25
/* Nearer than this share of a radius counts as touching, whatever the paths. */
#define SKIN 0.01
/* A lasting touch is slower than this share of sqrt(g d), the speed of a fall through a diameter; so is what gathers in two steps. */
#define IMPACT_SPEED 0.1
#define IMPACT_STEPS 2.0

typedef struct Candidate {
    uint32_t a, b;
    ces_Approach approach;
} Candidate;

typedef struct Task {
    ces_Detector *detector;
    const ces_DetectInput *input;
    const ces_Pair *pairs;
} Task;

static double radius_of(const ces_DetectInput *input, size_t row)
{
    return 0.5 * input->particles->diameter[row];
}

static double usual_margin(const ces_DetectInput *input, size_t row)
{
    return MARGIN_RADIUS * radius_of(input, row) + MARGIN_PATH * ces_norm(&input->displacement[3 * row]);
}

/* How far from its free path a grain is looked for, m: at least as far as the contacts found so far may push it. */
static double margin_of(const Task *task, size_t row)
{
    return ces_max(usual_margin(task->input, row), ((const double *)task->detector->reach.data)[row]);
}

static void box_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Task *task = context;
    const ces_DetectInput *input = task->input;
    ces_Box *boxes = task->detector->boxes.data;
    for (size_t row = first; row < last; row++) {
        const double around = radius_of(input, row) + margin_of(task, row);
        for (size_t k = 0; k < 3; k++) {
            const double from = input->particles->position[3 * row + k];
            const double to = from + input->displacement[3 * row + k];
            boxes[row].lower[k] = ces_min(from, to) - around;
            boxes[row].upper[k] = ces_max(from, to) + around;
        }
    }
}

static void pair_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Task *task = context;
    const ces_DetectInput *input = task->input;
    Candidate *candidates = task->detector->pair_candidates.data;
    for (size_t k = first; k < last; k++) {
        const size_t a = task->pairs[k].a, b = task->pairs[k].b;
        double offset[3], path[3];
        ces_subtract(&input->particles->position[3 * a], &input->particles->position[3 * b], offset);
        ces_subtract(&input->displacement[3 * a], &input->displacement[3 * b], path);
        candidates[k].a = (uint32_t)a;
        candidates[k].b = (uint32_t)b;
        ces_approach_sphere(offset, path, radius_of(input, a), radius_of(input, b), &candidates[k].approach);
    }
}

/* The surfaces that a grain may come near, by a cheap test; candidates may be NULL to count only. */
static size_t meet_surfaces(const Task *task, size_t row, Candidate *candidates)
{
    const ces_DetectInput *input = task->input;
    const double *center = &input->particles->position[3 * row], *displacement = &input->displacement[3 * row];
    const double radius = radius_of(input, row);
    const double around = radius + margin_of(task, row) + ces_norm(displacement);
    const bool touched = input->particles->touched[row] != 0;
    size_t count = 0;
    for (size_t s = 0; s < input->surface_count; s++) {
        const ces_Surface *surface = &input->surfaces[s];
        if (!ces_surface_within(surface, center, around + surface->travel)) {
            continue;
        }
        if (candidates != NULL) {
            double path[3];
            ces_subtract(displacement, surface->displacement, path);
            candidates[count].a = (uint32_t)row;
            candidates[count].b = (uint32_t)s;
            ces_approach_surface(surface, center, path, radius, touched, &candidates[count].approach);
        }
        count++;
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
    Candidate *candidates = task->detector->surface_candidates.data;
    for (size_t row = first; row < last; row++) {
        if (starts[row + 1] > starts[row]) {
            meet_surfaces(task, row, &candidates[starts[row]]);
        }
    }
}

/* Count, prefix sum, fill: the list does not depend on threads. */
static bool find_surface_candidates(Task *task, size_t *count)
{
    ces_Detector *detector = task->detector;
    const size_t rows = task->input->count;
    *count = 0;
    if (!ces_pool_reserve(&detector->surface_counts, rows + 1, sizeof(uint32_t))) {
        return false;
    }
    ces_parallel_for(rows, ROW_BLOCK, task->input->threads, count_surface_block, task);
    uint32_t *starts = detector->surface_counts.data;
    uint32_t sum = 0;
    for (size_t row = 0; row < rows; row++) {
        const uint32_t size = starts[row];
        starts[row] = sum;
        sum += size;
    }
    starts[rows] = sum;
    if (!ces_pool_reserve(&detector->surface_candidates, sum, sizeof(Candidate))) {
        return false;
    }
    ces_parallel_for(rows, ROW_BLOCK, task->input->threads, fill_surface_block, task);
    *count = sum;
    return true;
}

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
    if (!ces_grid_pairs(&detector->grid, detector->boxes.data, input->count, input->threads, &task->pairs, count) ||
        !ces_pool_reserve(&detector->pair_candidates, *count, sizeof(Candidate))) {
        return false;
    }
    ces_parallel_for(*count, PAIR_BLOCK, input->threads, pair_block, task);
    return true;
}

/* How far a grain may come off its free path by a hit, m: the part of the path that is cut off, and what bounces back. */
static void raise_reach(const Task *task, const Candidate *candidate, const double path[3], bool is_pair)
{
    if (!candidate->approach.hit) {
        return;
    }
    double *reach = task->detector->reach.data;
    const double cut = -(1.0 + task->input->most_restitution) * ces_dot(candidate->approach.normal, path);
    reach[candidate->a] = ces_max(reach[candidate->a], cut);
    if (is_pair) {
        reach[candidate->b] = ces_max(reach[candidate->b], cut);
    }
}

static double skin_of(const ces_DetectInput *input, size_t row)
{
    double drift = 0.0; /* between the free path and the velocity at its end, which the contact problem sees */
    for (size_t k = 0; k < 3; k++) {
        drift += fabs(input->step * input->free_velocity[3 * row + k] - input->displacement[3 * row + k]);
    }
    return SKIN * radius_of(input, row) + drift;
}

static bool is_near(const ces_DetectInput *input, const double *reach, const Candidate *candidate, bool is_pair)
{
    double near = reach[candidate->a] + skin_of(input, candidate->a);
    if (is_pair) {
        near += reach[candidate->b] + skin_of(input, candidate->b);
    }
    return candidate->approach.hit || candidate->approach.least_gap <= near;
}

/* A push travels from grain to grain within the step; serial, so that its order is one. */
static void spread_reach(const ces_DetectInput *input, double *reach, const Candidate *pairs, size_t count)
{
    for (int round = 0; round < REACH_ROUNDS; round++) {
        bool spread = false;
        for (size_t k = 0; k < count; k++) {
            const uint32_t a = pairs[k].a, b = pairs[k].b;
            if (reach[a] != reach[b] && is_near(input, reach, &pairs[k], true)) {
                reach[a] = reach[b] = ces_max(reach[a], reach[b]);
                spread = true;
            }
        }
        if (!spread) {
            return;
        }
    }
}

/* Normal velocities of a relative to b: at the start of the step, and by how much the free motion changes it. */
typedef struct Closing {
    double start, change; /* m/s */
    double path;          /* m */
} Closing;

static Closing closing_of(const ces_DetectInput *input, const Candidate *candidate, bool is_pair)
{
    const double *n = candidate->approach.normal;
    const double *v0 = input->particles->velocity;
    const size_t a = 3 * (size_t)candidate->a, b = 3 * (size_t)candidate->b;
    Closing closing = {
        .start = ces_dot(n, &v0[a]),
        .change = ces_dot(n, &input->free_velocity[a]),
        .path = ces_dot(n, &input->displacement[a]),
    };
    if (is_pair) {
        closing.start -= ces_dot(n, &v0[b]);
        closing.change -= ces_dot(n, &input->free_velocity[b]);
        closing.path -= ces_dot(n, &input->displacement[b]);
    } else {
        const ces_Surface *surface = &input->surfaces[candidate->b];
        closing.start -= ces_dot(n, surface->velocity);
        closing.change -= ces_dot(n, surface->velocity);
        closing.path -= ces_dot(n, surface->displacement);
    }
    closing.change -= closing.start;
    return closing;
}

/*
 * The velocity row of a contact, u_N + bias >= 0 (docs/numerics.md 1 in three cases):
 * a collision inside the step leaves with restitution times the speed of approach at the moment of touch;
 * an overlap asks for no approach, position correction does the rest;
 * everything else may close its gap within the step and no more.
 */
static void set_bias(const ces_DetectInput *input, const Candidate *candidate, bool is_pair, double restitution,
                     double diameter, ces_Contact *contact)
{
    const ces_Approach *approach = &candidate->approach;
    const Closing closing = closing_of(input, candidate, is_pair);
    const double at_touch = closing.start + approach->fraction * closing.change;
    const double lasting = ces_max(IMPACT_SPEED * sqrt(input->gravity * diameter), IMPACT_STEPS * fabs(closing.change));
    contact->impact = approach->hit && -at_touch > lasting;
    if (contact->impact) {
        const double after = -restitution * at_touch + (1.0 - approach->fraction) * closing.change;
        contact->bias = -ces_max(after, 0.0);
    } else if (approach->start_gap <= 0.0) {
        contact->bias = 0.0;
    } else {
        /* The gap must stay open along the free path and at the end velocity: the smaller of both counts. */
        const double gap_at_start = approach->gap - approach->fraction * closing.path;
        const double end_speed = closing.start + closing.change;
        contact->bias = gap_at_start / input->step + ces_min(0.0, closing.path / input->step - end_speed);
    }
}

static void set_pair(const ces_DetectInput *input, const Candidate *candidate, ces_Contact *contact)
{
    const ces_Particles *particles = input->particles;
    const size_t a = candidate->a, b = candidate->b;
    const size_t m = (size_t)particles->material[a] * input->table->material_count + (size_t)particles->material[b];
    const double radius_a = radius_of(input, a), radius_b = radius_of(input, b);
    contact->id_b = particles->id[b];
    contact->friction = input->table->grain_friction[m];
    contact->rolling = input->table->grain_rolling[m];
    /* Rolling radius of a pair: r_a r_b / (r_a + r_b), the reduced radius (Ai et al., Powder Technol. 206 (2011) 269). */
    contact->ratio_a = radius_b / (radius_a + radius_b);
    contact->ratio_b = radius_a / (radius_a + radius_b);
    set_bias(input, candidate, true, input->table->grain_restitution[m], 2.0 * ces_min(radius_a, radius_b), contact);
}

static void set_surface(const ces_DetectInput *input, const Candidate *candidate, ces_Contact *contact)
{
    const ces_Particles *particles = input->particles;
    const ces_Surface *surface = &input->surfaces[candidate->b];
    const size_t row = candidate->a;
    const size_t m = (size_t)candidate->b * input->table->material_count + (size_t)particles->material[row];
    const double radius = radius_of(input, row);
    const double *n = candidate->approach.normal;
    contact->id_b = -1 - (int64_t)candidate->b;
    contact->friction = input->table->surface_friction[m];
    contact->rolling = input->table->surface_rolling[m];
    contact->ratio_a = 1.0;
    contact->ratio_b = 0.0;

    double matter[3], spin[3];
    ces_surface_velocity(surface, contact->point, matter);
    /* A surface that moves in itself does so in its tangent plane; along the normal only the shape's own motion counts. */
    const double into = ces_dot(n, matter) - ces_dot(n, surface->velocity);
    for (int k = 0; k < 3; k++) {
        contact->surface[k] = matter[k] - into * n[k];
        spin[k] = radius * surface->spin[k];
    }
    ces_cross(spin, n, contact->surface_roll);
    set_bias(input, candidate, false, input->table->surface_restitution[m], 2.0 * radius, contact);
}

static void append(const ces_DetectInput *input, const Candidate *candidate, bool is_pair, ces_Contacts *contacts)
{
    ces_Contact *contact = &contacts->list[contacts->count++];
    *contact = (ces_Contact){
        .id_a = input->particles->id[candidate->a],
        .a = candidate->a,
        .b = candidate->b,
        .gap = candidate->approach.start_gap,
        .fraction = candidate->approach.fraction,
    };
    ces_copy(candidate->approach.normal, contact->normal);
    ces_copy(&input->particles->position[3 * (size_t)candidate->a], contact->point);
    ces_add_scaled(contact->point, contact->fraction, &input->displacement[3 * (size_t)candidate->a]);
    ces_add_scaled(contact->point, -radius_of(input, candidate->a), contact->normal);
    if (is_pair) {
        set_pair(input, candidate, contact);
    } else {
        set_surface(input, candidate, contact);
    }
}

static void raise_pair_reach(const Task *task, size_t pair_count)
{
    const Candidate *pairs = task->detector->pair_candidates.data;
    for (size_t k = 0; k < pair_count; k++) {
        double path[3];
        ces_subtract(&task->input->displacement[3 * (size_t)pairs[k].a],
                     &task->input->displacement[3 * (size_t)pairs[k].b], path);
        raise_reach(task, &pairs[k], path, true);
    }
    spread_reach(task->input, task->detector->reach.data, pairs, pair_count);
}

static void raise_surface_reach(const Task *task, size_t surface_count)
{
    const Candidate *surfaces = task->detector->surface_candidates.data;
    for (size_t k = 0; k < surface_count; k++) {
        double path[3];
        ces_subtract(&task->input->displacement[3 * (size_t)surfaces[k].a],
                     task->input->surfaces[surfaces[k].b].displacement, path);
        raise_reach(task, &surfaces[k], path, false);
    }
}

/* Whether some grain may be pushed farther from its path than was looked at. */
static bool reaches_beyond(const Task *task)
{
    const double *reach = task->detector->reach.data;
    for (size_t row = 0; row < task->input->count; row++) {
        if (reach[row] > usual_margin(task->input, row)) {
            return true;
        }
    }
    return false;
}

bool ces_detect(ces_Detector *detector, const ces_DetectInput *input, ces_Contacts *contacts)
{
    Task task = {.detector = detector, .input = input};
    size_t pair_count, surface_count;
    contacts->count = contacts->pair_count = 0;
    if (!ces_pool_reserve(&detector->reach, input->count, sizeof(double))) {
        return false;
    }
    double *reach = detector->reach.data;
    memset(reach, 0, input->count * sizeof *reach);
    if (!find_pair_candidates(&task, &pair_count)) {
        return false;
    }
    raise_pair_reach(&task, pair_count);
    if (reaches_beyond(&task)) {
        /* A hit throws a grain farther than it flies: once more, with that in view. */
        if (!find_pair_candidates(&task, &pair_count)) {
            return false;
        }
        raise_pair_reach(&task, pair_count);
    }
    if (!find_surface_candidates(&task, &surface_count) ||
        !ces_contacts_reserve(contacts, pair_count + surface_count)) {
        return false;
    }
    raise_surface_reach(&task, surface_count);
    const Candidate *pairs = detector->pair_candidates.data;
    const Candidate *surfaces = detector->surface_candidates.data;
    spread_reach(input, reach, pairs, pair_count);

    for (size_t k = 0; k < pair_count; k++) {
        if (is_near(input, reach, &pairs[k], true)) {
            append(input, &pairs[k], true, contacts);
        }
    }
    contacts->pair_count = contacts->count;
    for (size_t k = 0; k < surface_count; k++) {
        if (is_near(input, reach, &surfaces[k], false)) {
            append(input, &surfaces[k], false, contacts);
        }
    }
    return true;
}

void ces_detector_free(ces_Detector *detector)
{
    ces_grid_free(&detector->grid);
    ces_Pool *const pools[] = {&detector->boxes, &detector->reach, &detector->pair_candidates,
                               &detector->surface_counts, &detector->surface_candidates};
    for (size_t k = 0; k < sizeof pools / sizeof pools[0]; k++) {
        ces_pool_free(pools[k]);
    }
}
