#include "charges.h"

#include <math.h>
#include <string.h>

#include "../base/parallel.h"
#include "../base/random.h"
#include "../base/vec3.h"
#include "charge_lists.h"
#include "charge_set.h"

enum { TERMS = CES_MULTIPOLE_TERMS, LANES = CES_MULTIPOLE_LANES };
enum { CHARGE_BLOCK = 64, CELL_BLOCK = 16, SAMPLE = 4, SAMPLE_STREAM = 0x43 };
enum { SET, ROWS, SCRATCH, CELLS, IMAGES, IMAGE_ROWS, IMAGE_CELLS, MOMENTS, LOCALS, LISTS };
_Static_assert(LISTS + CES_LIST_POOLS == CES_CROWD_POOLS, "each has its pool");

/* CODATA 2022: 1/(4 pi eps0), N m2/C2. */
static const double coulomb_constant = 1.0 / (4.0 * CES_PI * 8.8541878188e-12);

/* What one call works on. */
typedef struct Work {
    const ces_ChargesDef *def;
    const ces_Crowd *crowd;
    ces_Pool *pools;
    bool has_images;
    ces_ChargeSet set, images; /* the second: for the tree alone */
    ces_ChargeTree tree, image_tree;
    /* Of one tree acting on the other. */
    const ces_ChargeSet *sources;
    const ces_ChargeTree *source_tree;
    ces_CellList near, far;
    double *moments, *locals; /* (cells, TERMS) */
    double *force;            /* N (crowd->count, 3) */
} Work;

static ces_Range of_cell(const ces_TreeCell *cell)
{
    return (ces_Range){cell->first, cell->last};
}

/* ---- every pair by itself ------------------------------------------------------------------------------------------------ */

static void direct_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Work *work = context;
    const ces_Range at = {first, last}, all = {0, work->set.count};
    ces_pairs_all(&work->set, at, &work->set, all);
    if (work->has_images) {
        ces_pairs_near(&work->set, at, all, HUGE_VAL, true);
    }
}

/* ---- up to a cut-off ----------------------------------------------------------------------------------------------------- */

static void near_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Work *work = context;
    for (size_t cell = first; cell < last; cell++) {
        const ces_Range at = of_cell(&work->tree.cells[cell]);
        for (uint32_t k = work->near.start[cell]; k < work->near.start[cell + 1]; k++) {
            const ces_Range of = of_cell(&work->tree.cells[work->near.source[k]]);
            ces_pairs_near(&work->set, at, of, work->def->cutoff, false);
            if (work->has_images) {
                ces_pairs_near(&work->set, at, of, work->def->cutoff, true);
            }
        }
    }
}

/* ---- by the tree --------------------------------------------------------------------------------------------------------- */

static void moments_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Work *work = context;
    for (size_t c = first; c < last; c++) {
        const ces_TreeCell *cell = &work->source_tree->cells[c];
        double *moments = &work->moments[TERMS * c];
        memset(moments, 0, TERMS * sizeof *moments);
        for (uint32_t i = cell->first; cell->child == 0 && i < cell->last; i++) {
            const double offset[3] = {work->sources->x[0][i] - cell->center[0],
                                      work->sources->x[1][i] - cell->center[1],
                                      work->sources->x[2][i] - cell->center[2]};
            ces_multipole_charge(&work->def->table, work->sources->charge[i], offset, moments);
        }
    }
}

/* Leaves in parallel, then upwards in the order of the cells: children stand behind their parents. */
static void find_moments(Work *work)
{
    const ces_ChargeTree *tree = work->source_tree;
    ces_parallel_for(tree->count, CELL_BLOCK, work->crowd->threads, moments_block, work);
    for (size_t c = tree->count; c-- > 0;) {
        const ces_TreeCell *cell = &tree->cells[c];
        for (uint32_t child = cell->child; cell->child > 0 && child < cell->child + 2; child++) {
            double offset[3];
            ces_subtract(tree->cells[child].center, cell->center, offset);
            ces_multipole_shift(&work->def->table, &work->moments[TERMS * (size_t)child], offset,
                                &work->moments[TERMS * c]);
        }
    }
}

/* The cells of a list, LANES at a time; empty lanes hold nothing, at a distance of 1. */
static void add_far(const Work *work, size_t cell, double *local)
{
    const double *center = work->tree.cells[cell].center;
    const uint32_t last = work->far.start[cell + 1];
    for (uint32_t k = work->far.start[cell]; k < last; k += LANES) {
        double distance[3][LANES] = {{1.0, 1.0, 1.0, 1.0}}, moments[TERMS][LANES] = {{0.0}};
        for (uint32_t lane = 0; lane < LANES && k + lane < last; lane++) {
            const size_t source = work->far.source[k + lane];
            for (int axis = 0; axis < 3; axis++) {
                distance[axis][lane] = center[axis] - work->source_tree->cells[source].center[axis];
            }
            for (size_t n = 0; n < TERMS; n++) {
                moments[n][lane] = work->moments[TERMS * source + n];
            }
        }
        ces_multipole_interact(&work->def->table, distance, moments, local);
    }
}

static void act_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Work *work = context;
    for (size_t cell = first; cell < last; cell++) {
        add_far(work, cell, &work->locals[TERMS * cell]);
        for (uint32_t k = work->near.start[cell]; k < work->near.start[cell + 1]; k++) {
            ces_pairs_all(&work->set, of_cell(&work->tree.cells[cell]), work->sources,
                          of_cell(&work->source_tree->cells[work->near.source[k]]));
        }
    }
}

static bool act(Work *work, const ces_ChargeSet *sources, const ces_ChargeTree *source_tree)
{
    const ces_FarRule rule = {.opening = work->def->opening, .cutoff = HUGE_VAL};
    work->sources = sources;
    work->source_tree = source_tree;
    if (!ces_cell_lists(&work->tree, source_tree, rule, &work->pools[LISTS], &work->near, &work->far) ||
        !ces_pool_reserve(&work->pools[MOMENTS], source_tree->count, TERMS * sizeof(double))) {
        return false;
    }
    work->moments = work->pools[MOMENTS].data;
    find_moments(work);
    ces_parallel_for(work->tree.count, CELL_BLOCK, work->crowd->threads, act_block, work);
    return true;
}

static void gather_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Work *work = context;
    for (size_t c = first; c < last; c++) {
        const ces_TreeCell *cell = &work->tree.cells[c];
        for (uint32_t i = cell->first; cell->child == 0 && i < cell->last; i++) {
            const double offset[3] = {work->set.x[0][i] - cell->center[0], work->set.x[1][i] - cell->center[1],
                                      work->set.x[2][i] - cell->center[2]};
            double field[3];
            ces_local_field(&work->def->table, &work->locals[TERMS * c], offset, field);
            for (int k = 0; k < 3; k++) {
                work->set.force[k][i] += work->set.charge[i] * field[k];
            }
        }
    }
}

static void hand_down(Work *work)
{
    for (size_t c = 0; c < work->tree.count; c++) {
        const ces_TreeCell *cell = &work->tree.cells[c];
        for (uint32_t child = cell->child; cell->child > 0 && child < cell->child + 2; child++) {
            double offset[3];
            ces_subtract(work->tree.cells[child].center, cell->center, offset);
            ces_local_shift(&work->def->table, &work->locals[TERMS * c], offset, &work->locals[TERMS * (size_t)child]);
        }
    }
    ces_parallel_for(work->tree.count, CELL_BLOCK, work->crowd->threads, gather_block, work);
}

/* ---- the methods --------------------------------------------------------------------------------------------------------- */

static bool plant(ces_ChargeTree *tree, const ces_ChargeSet *set, uint32_t *order, ces_Pool *cells, ces_Pool *scratch)
{
    const double *const x[3] = {set->x[0], set->x[1], set->x[2]};
    for (size_t i = 0; i < set->count; i++) {
        order[i] = (uint32_t)i;
    }
    return ces_charge_tree_build(tree, x, set->radius, set->count, order, cells, scratch);
}

/* The set, its columns now in the order of its tree. */
static bool plant_set(Work *work)
{
    const size_t count = work->set.count;
    if (!ces_pool_reserve(&work->pools[IMAGE_ROWS], 2 * count, sizeof(uint32_t))) {
        return false;
    }
    uint32_t *order = work->pools[IMAGE_ROWS].data, *rows = order + count;
    if (!plant(&work->tree, &work->set, order, &work->pools[CELLS], &work->pools[SCRATCH])) {
        return false;
    }
    memcpy(rows, work->set.row, count * sizeof *rows);
    for (size_t i = 0; i < count; i++) {
        work->set.row[i] = rows[order[i]];
    }
    ces_charge_set_fill(&work->set, work->def, work->crowd);
    return true;
}

static bool plant_images(Work *work)
{
    ces_ChargeSet *images = &work->images;
    uint32_t *order = work->pools[IMAGE_ROWS].data;
    if (!ces_charge_set_reserve(images, work->set.count, &work->pools[IMAGES])) {
        return false;
    }
    images->row = order;
    for (size_t i = 0; i < images->count; i++) {
        order[i] = (uint32_t)i;
    }
    ces_charge_set_images(images, &work->set);
    if (!plant(&work->image_tree, images, order, &work->pools[IMAGE_CELLS], &work->pools[SCRATCH])) {
        return false;
    }
    ces_charge_set_images(images, &work->set);
    return true;
}

static bool by_tree(Work *work)
{
    if (!plant_set(work) || (work->has_images && !plant_images(work)) ||
        !ces_pool_reserve(&work->pools[LOCALS], work->tree.count, TERMS * sizeof(double))) {
        return false;
    }
    work->locals = work->pools[LOCALS].data;
    memset(work->locals, 0, work->tree.count * TERMS * sizeof(double));
    if (!act(work, &work->set, &work->tree) || (work->has_images && !act(work, &work->images, &work->image_tree))) {
        return false;
    }
    hand_down(work);
    return true;
}

static bool by_cutoff(Work *work)
{
    const ces_FarRule rule = {.opening = 0.0, .cutoff = work->def->cutoff};
    if (!plant_set(work) ||
        !ces_cell_lists(&work->tree, &work->tree, rule, &work->pools[LISTS], &work->near, &work->far)) {
        return false;
    }
    ces_parallel_for(work->tree.count, CELL_BLOCK, work->crowd->threads, near_block, work);
    return true;
}

static bool directly(Work *work)
{
    ces_parallel_for(work->set.count, CHARGE_BLOCK, work->crowd->threads, direct_block, work);
    return true;
}

static bool (*const methods[CES_CHARGE_METHOD_COUNT])(Work *) = {
    [CES_CHARGES_TREE] = by_tree,
    [CES_CHARGES_CUTOFF] = by_cutoff,
    [CES_CHARGES_DIRECT] = directly,
};

/* ---- what comes of it ---------------------------------------------------------------------------------------------------- */

static void finish_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Work *work = context;
    for (size_t i = first; i < last; i++) {
        double force[3] = {work->set.force[0][i], work->set.force[1][i], work->set.force[2][i]};
        if (work->has_images) {
            ces_pairs_leave_own_image(&work->set, i, force);
        }
        ces_add_scaled(&work->force[3 * (size_t)work->set.row[i]], coulomb_constant, force);
        for (int k = 0; k < 3; k++) {
            work->set.force[k][i] = force[k];
        }
    }
}

/* A few charges once more against all others: the error of a method as it is here and now, which no bound would tell. */
static ces_CrowdError measure(const Work *work)
{
    ces_CrowdError error = {0.0, 0.0};
    const ces_ChargeSet *set = &work->set;
    for (uint32_t s = 0; s < SAMPLE && work->def->method != CES_CHARGES_DIRECT; s++) {
        const double u = ces_random(work->def->seed, SAMPLE_STREAM, work->crowd->step, s);
        const size_t i = (size_t)(u * (double)set->count);
        double exact[3] = {0.0, 0.0, 0.0}, defect[3];
        ces_pairs_on_one(set, i, work->has_images, exact);
        for (int k = 0; k < 3; k++) {
            exact[k] *= coulomb_constant;
            defect[k] = coulomb_constant * set->force[k][i] - exact[k];
        }
        error.defect += ces_dot(defect, defect);
        error.force += ces_dot(exact, exact);
    }
    return error;
}

bool ces_charges_force(const ces_ChargesDef *def, const ces_Crowd *crowd, ces_Pool *pools, double *force,
                       ces_CrowdError *error)
{
    Work work = {.def = def, .crowd = crowd, .pools = pools, .has_images = def->drum_radius > 0.0, .force = force};
    *error = (ces_CrowdError){0.0, 0.0};
    if (!ces_pool_reserve(&pools[ROWS], crowd->count, sizeof(uint32_t))) {
        return false;
    }
    work.set.row = pools[ROWS].data;
    const size_t count = ces_charged_rows(crowd, work.set.row);
    if (count < 2) {
        return true;
    }
    if (!ces_charge_set_reserve(&work.set, count, &pools[SET])) {
        return false;
    }
    ces_charge_set_fill(&work.set, def, crowd);
    if (!methods[def->method](&work)) {
        return false;
    }
    ces_parallel_for(count, CHARGE_BLOCK, crowd->threads, finish_block, &work);
    *error = measure(&work);
    return true;
}
