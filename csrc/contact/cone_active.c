#include "cone_active.h"

#include <math.h>
#include <string.h>

#include "../base/vec3.h"
#include "cone_gradient.h"
#include "islands.h"
#include "cone_sweep.h"

enum { LEAST_TURN = 60 }; /* iterations of the method */

/* The blocks that act, as a problem of their own. */
typedef struct Part {
    const ces_ConeProblem *whole;
    uint32_t *index;       /* (its blocks) the block of the whole */
    ces_ConeBlock *blocks; /* the same, with rows counted anew */
    double *least, *most;  /* its bounds; NULL: the whole has none */
    double *impulse, *scratch;
    double *acts; /* (blocks of the whole) above 0: is in the part */
} Part;

static void reset(void *self)
{
    const Part *part = self;
    part->whole->op.reset(part->whole->op.self);
}

static void push(void *self, uint32_t block, const double *change)
{
    const Part *part = self;
    part->whole->op.push(part->whole->op.self, part->index[block], change);
}

static void slip(const void *self, uint32_t block, double *u)
{
    const Part *part = self;
    part->whole->op.slip(part->whole->op.self, part->index[block], u);
}

static double residual_of(const ces_ConeProblem *problem, uint32_t i)
{
    double u[CES_BLOCK_ROWS];
    const ces_ConeBlock *block = &problem->blocks[i];
    problem->op.slip(problem->op.self, i, u);
    return ces_block_residual(problem, block, problem->impulse + block->first, u);
}

/* What opens faster than that, of the fastest velocity of all, is taken to stay open. */
static const double OPENS = 0.05;

static double fastest(const ces_ConeProblem *problem)
{
    double speed = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        double u[CES_BLOCK_ROWS];
        problem->op.slip(problem->op.self, i, u);
        for (uint32_t k = 0; k < problem->blocks[i].rows; k++) {
            speed = ces_max(speed, fabs(u[k]));
        }
    }
    return speed;
}

/* With an impulse, or near to one; joints, and blocks that are few anyway, always. */
static bool acts_now(const ces_ConeProblem *problem, uint32_t i, double speed)
{
    const ces_ConeBlock *block = &problem->blocks[i];
    double u[CES_BLOCK_ROWS];
    problem->op.slip(problem->op.self, i, u);
    bool acts = problem->block_count <= CES_SMALL_ISLAND || block->kind == CES_JOINT_BLOCK || !(u[0] > OPENS * speed);
    for (uint32_t row = block->first; row < block->first + block->rows; row++) {
        acts = acts || problem->impulse[row] != 0.0;
    }
    return acts;
}

bool ces_cone_few_act(const ces_ConeProblem *problem, size_t most_rows)
{
    const double speed = fastest(problem);
    size_t rows = 0;
    for (uint32_t i = 0; i < problem->block_count && rows <= most_rows; i++) {
        rows += acts_now(problem, i, speed) ? problem->blocks[i].rows : 0;
    }
    return rows <= most_rows;
}

static size_t doubles(size_t count, size_t size)
{
    return (count * size + sizeof(double) - 1) / sizeof(double);
}

/* What the method asks for depends on numbers of rows and blocks alone, and grows with both. */
static size_t room_of_method(const ces_ConeProblem *problem, const ces_ConeSolver *method, size_t rows, size_t blocks)
{
    ces_ConeProblem part = *problem;
    part.rows = (uint32_t)rows;
    part.block_count = (uint32_t)blocks;
    return method->scratch(&part);
}

static size_t smaller(size_t a, size_t b)
{
    return a < b ? a : b;
}

size_t ces_cone_active_scratch(const ces_ConeProblem *problem, const ces_ConeSolver *method, size_t most_rows)
{
    const size_t rows = smaller(problem->rows, most_rows), blocks = smaller(problem->block_count, most_rows);
    return problem->rows + problem->block_count + doubles(blocks, sizeof(uint32_t)) +
           doubles(blocks, sizeof(ces_ConeBlock)) + 3 * rows + room_of_method(problem, method, rows, blocks);
}

/* The problem of the blocks that act, with their impulses; false: more rows than there is room for. */
static bool gather(Part *part, size_t most_rows, ces_ConeProblem *problem)
{
    const ces_ConeProblem *whole = part->whole;
    uint32_t rows = 0, count = 0;
    for (uint32_t i = 0; i < whole->block_count; i++) {
        const ces_ConeBlock *block = &whole->blocks[i];
        if (!(part->acts[i] > 0.0)) {
            continue;
        }
        if (rows + block->rows > most_rows) {
            return false;
        }
        part->index[count] = i;
        part->blocks[count] = *block;
        part->blocks[count].first = rows;
        memcpy(part->impulse + rows, whole->impulse + block->first, block->rows * sizeof(double));
        if (whole->least != NULL) {
            memcpy(part->least + rows, whole->least + block->first, block->rows * sizeof(double));
            memcpy(part->most + rows, whole->most + block->first, block->rows * sizeof(double));
        }
        rows += block->rows;
        count++;
    }
    *problem = *whole;
    problem->blocks = part->blocks;
    problem->block_count = count;
    problem->rows = rows;
    problem->least = whole->least != NULL ? part->least : NULL;
    problem->most = whole->most != NULL ? part->most : NULL;
    problem->op = (ces_Operator){part, reset, push, slip};
    problem->impulse = part->impulse;
    problem->scratch = part->scratch;
    return true;
}

/* Impulses back to the whole, and its velocities; what has come to act joins, and grew is told. The residual of the whole. */
static double scatter(Part *part, const ces_ConeProblem *problem, bool *grew)
{
    const ces_ConeProblem *whole = part->whole;
    for (uint32_t k = 0; k < problem->block_count; k++) {
        const ces_ConeBlock *block = &problem->blocks[k];
        memcpy(whole->impulse + whole->blocks[part->index[k]].first, part->impulse + block->first,
               block->rows * sizeof(double));
    }
    ces_cone_load(whole, whole->impulse);
    double worst = 0.0;
    *grew = false;
    for (uint32_t i = 0; i < whole->block_count; i++) {
        const double residual = residual_of(whole, i);
        if (residual > whole->tolerance && !(part->acts[i] > 0.0)) {
            part->acts[i] = 1.0;
            *grew = true;
        }
        worst = isnan(residual) ? HUGE_VAL : ces_max(worst, residual);
    }
    return worst;
}

/* What an iteration over so few of the blocks counts. */
static double share_of(const ces_ConeProblem *problem, const ces_ConeProblem *whole)
{
    const bool small = problem->block_count <= CES_SMALL_ISLAND && whole->block_count > CES_SMALL_ISLAND;
    return (double)problem->block_count / whole->block_count / (small ? CES_SMALL_FACTOR : 1);
}

static uint32_t turn_of(double iterations)
{
    return iterations < LEAST_TURN ? LEAST_TURN : iterations < UINT32_MAX ? (uint32_t)iterations : UINT32_MAX;
}

ces_ConeReport ces_cone_solve_active(const ces_ConeProblem *problem, const ces_ConeSolver *method, size_t most_rows)
{
    const size_t rows = smaller(problem->rows, most_rows), blocks = smaller(problem->block_count, most_rows);
    double *free = problem->scratch;
    double *best = ces_take(&free, problem->rows);
    Part part = {.whole = problem,
                 .acts = ces_take(&free, problem->block_count),
                 .index = (void *)ces_take(&free, doubles(blocks, sizeof(uint32_t))),
                 .blocks = (void *)ces_take(&free, doubles(blocks, sizeof(ces_ConeBlock))),
                 .least = ces_take(&free, rows),
                 .most = ces_take(&free, rows),
                 .impulse = ces_take(&free, rows)};
    part.scratch = free; /* not in the list above, whose order is the compiler's */
    ces_cone_load(problem, problem->impulse);
    const double speed = fastest(problem);
    for (uint32_t i = 0; i < problem->block_count; i++) {
        part.acts[i] = acts_now(problem, i, speed) ? 1.0 : 0.0;
    }
    ces_rows_copy(problem, problem->impulse, best);
    double used = 0.0, least = ces_cone_residual(problem);
    ces_ConeProblem own;
    /* By halves of what is left, lest the first turn, to which a block may be lacking, takes it all. */
    for (bool useful = true; useful && least > problem->tolerance && used < problem->max_iterations &&
                             gather(&part, most_rows, &own) && own.block_count > 0;) {
        const double share = share_of(&own, problem);
        own.max_iterations = turn_of(0.5 * (problem->max_iterations - used) / share);
        const uint32_t count = method->solve(&own).iterations;
        used += share * count;
        bool grew;
        const double residual = scatter(&part, &own, &grew);
        useful = grew || (residual < least && count == own.max_iterations); /* else the method itself gave up */
        if (residual < least) {
            least = residual;
            ces_rows_copy(problem, problem->impulse, best);
        }
    }
    ces_rows_copy(problem, best, problem->impulse);
    return ces_cone_report(problem, method->name,
                           used < problem->max_iterations ? (uint32_t)used + 1 : problem->max_iterations);
}
