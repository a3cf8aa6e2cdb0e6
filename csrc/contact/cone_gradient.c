#include "cone_gradient.h"

#include <math.h>
#include <string.h>

#include "../base/vec3.h"

double *ces_take(double **scratch, size_t count)
{
    double *vector = *scratch;
    *scratch += count;
    return vector;
}

double ces_rows_dot(const ces_ConeProblem *problem, const double *a, const double *b)
{
    double sum = 0.0;
    for (uint32_t k = 0; k < problem->rows; k++) {
        sum += a[k] * b[k];
    }
    return sum;
}

void ces_rows_copy(const ces_ConeProblem *problem, const double *from, double *to)
{
    memcpy(to, from, problem->rows * sizeof *to);
}

double ces_rows_distance(const ces_ConeProblem *problem, const double *a, const double *b)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        double square = 0.0;
        for (uint32_t k = block->first; k < block->first + block->rows; k++) {
            square += (a[k] - b[k]) * (a[k] - b[k]);
        }
        sum += square / ces_block_step(problem, block);
    }
    return sum;
}

void ces_rows_slip(const ces_ConeProblem *problem, const double *gamma, double *u)
{
    ces_cone_load(problem, gamma);
    ces_cone_slips(problem, u);
}

void ces_blocks_shift(const ces_ConeProblem *problem, const double *u, double *shift)
{
    for (uint32_t i = 0; i < problem->block_count; i++) {
        shift[i] = ces_block_shift(problem, &problem->blocks[i], u + problem->blocks[i].first);
    }
}

void ces_rows_gradient(const ces_ConeProblem *problem, const double *u, const double *shift, double *g)
{
    ces_rows_copy(problem, u, g);
    for (uint32_t i = 0; i < problem->block_count; i++) {
        g[problem->blocks[i].first] += shift[i];
    }
}

void ces_rows_step(const ces_ConeProblem *problem, const double *gamma, double t, const double *g, double *moved)
{
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        const double step = t * ces_block_step(problem, block);
        for (uint32_t k = block->first; k < block->first + block->rows; k++) {
            moved[k] = gamma[k] - step * g[k];
        }
        ces_block_project(problem, block, moved + block->first);
    }
}

double ces_rows_residual(const ces_ConeProblem *problem, const double *gamma, const double *u)
{
    double worst = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        const double residual = ces_block_residual(problem, block, gamma + block->first, u + block->first);
        if (isnan(residual)) {
            return residual;
        }
        worst = ces_max(worst, residual);
    }
    return worst;
}

double ces_rows_held_residual(const ces_ConeProblem *problem, const double *gamma, const double *g)
{
    double worst = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        const double rho = ces_block_step(problem, block);
        double moved[CES_BLOCK_ROWS], square = 0.0;
        for (uint32_t k = 0; k < block->rows; k++) {
            moved[k] = gamma[block->first + k] - rho * g[block->first + k];
        }
        ces_block_project(problem, block, moved);
        for (uint32_t k = 0; k < block->rows; k++) {
            const double difference = gamma[block->first + k] - moved[k];
            square += difference * difference;
        }
        worst = ces_max(worst, sqrt(square) / rho);
    }
    return worst;
}
