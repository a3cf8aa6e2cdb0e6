#include "given_problem.h"

#include <math.h>
#include <string.h>

static void reset(void *self)
{
    ces_GivenProblem *given = self;
    memcpy(given->u, given->q, given->rows * sizeof *given->u);
}

/* W is symmetric: the columns of the block are its rows. */
static void push(void *self, uint32_t index, const double *change)
{
    ces_GivenProblem *given = self;
    const ces_ConeBlock *block = &given->blocks[index];
    for (uint32_t k = 0; k < block->rows; k++) {
        const uint32_t row = block->first + k;
        for (int64_t e = given->row_start[row]; e < given->row_start[row + 1]; e++) {
            given->u[given->column[e]] += given->value[e] * change[k];
        }
    }
}

static void slip(const void *self, uint32_t index, double *u)
{
    const ces_GivenProblem *given = self;
    const ces_ConeBlock *block = &given->blocks[index];
    for (uint32_t k = 0; k < block->rows; k++) {
        u[k] = given->u[block->first + k];
    }
}

ces_Operator ces_given_operator(ces_GivenProblem *given)
{
    return (ces_Operator){.self = given, .reset = reset, .push = push, .slip = slip};
}

void ces_given_diagonal(const ces_GivenProblem *given, uint32_t block_count, double *diagonal)
{
    for (uint32_t i = 0; i < block_count; i++) {
        const ces_ConeBlock *block = &given->blocks[i];
        double *matrix = diagonal + block->diagonal;
        memset(matrix, 0, block->rows * block->rows * sizeof *matrix);
        for (uint32_t k = 0; k < block->rows; k++) {
            const uint32_t row = block->first + k;
            for (int64_t e = given->row_start[row]; e < given->row_start[row + 1]; e++) {
                const uint32_t column = (uint32_t)given->column[e];
                if (column >= block->first && column < block->first + block->rows) {
                    matrix[k * block->rows + column - block->first] = given->value[e];
                }
            }
        }
    }
}

double ces_given_natural_map(const ces_GivenProblem *given, const ces_ConeProblem *problem)
{
    double error = 0.0, size = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        const double *gamma = problem->impulse + block->first, *u = given->u + block->first;
        double moved[CES_BLOCK_ROWS];
        for (uint32_t k = 0; k < block->rows; k++) {
            moved[k] = gamma[k] - u[k];
        }
        moved[0] -= ces_block_shift(problem, block, u);
        ces_block_project(problem, block, moved);
        for (uint32_t k = 0; k < block->rows; k++) {
            error += (gamma[k] - moved[k]) * (gamma[k] - moved[k]);
            size += given->q[block->first + k] * given->q[block->first + k];
        }
    }
    return error > 0.0 ? sqrt(error / size) : 0.0;
}
