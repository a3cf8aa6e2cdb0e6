#include "cone_sweep.h"

#include <math.h>
#include <string.h>

#include "../base/vec3.h"
#include "block.h"

/* The better of two starts by the energy gamma N gamma/2 + (q + shift) gamma, with the shift as it is at the given one. */
void ces_cone_start(const ces_ConeProblem *problem)
{
    double twice = 0.0;
    problem->op.reset(problem->op.self);
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        double *gamma = problem->impulse + block->first, q[CES_BLOCK_ROWS];
        ces_block_project(problem, block, gamma);
        problem->op.slip(problem->op.self, i, q);
        for (uint32_t k = 0; k < block->rows; k++) {
            twice += gamma[k] * q[k];
        }
    }
    ces_cone_load(problem, problem->impulse);
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        const double *gamma = problem->impulse + block->first;
        double u[CES_BLOCK_ROWS];
        problem->op.slip(problem->op.self, i, u);
        for (uint32_t k = 0; k < block->rows; k++) {
            twice += gamma[k] * u[k];
        }
        twice += 2.0 * gamma[0] * ces_block_shift(problem, block, u);
    }
    if (!(twice < 0.0)) {
        for (uint32_t i = 0; i < problem->block_count; i++) {
            const ces_ConeBlock *block = &problem->blocks[i];
            memset(problem->impulse + block->first, 0, block->rows * sizeof(double));
            ces_block_project(problem, block, problem->impulse + block->first); /* bounds may exclude nothing */
        }
        ces_cone_load(problem, problem->impulse);
    }
}

double ces_cone_sweep(const ces_ConeProblem *problem)
{
    double largest = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        double *gamma = problem->impulse + block->first;
        double u[CES_BLOCK_ROWS], change[CES_BLOCK_ROWS], square = 0.0;
        problem->op.slip(problem->op.self, i, u);
        ces_block_solve(problem, block, gamma, u, change);
        for (uint32_t k = 0; k < block->rows; k++) {
            const double solved = change[k];
            change[k] -= gamma[k];
            gamma[k] = solved;
            square += change[k] * change[k];
        }
        if (!(square == 0.0)) {
            problem->op.push(problem->op.self, i, change);
            largest = ces_max(sqrt(square) / ces_block_step(problem, block), largest);
        }
    }
    return largest;
}

void ces_cone_slips(const ces_ConeProblem *problem, double *u)
{
    for (uint32_t i = 0; i < problem->block_count; i++) {
        problem->op.slip(problem->op.self, i, u + problem->blocks[i].first);
    }
}

ces_ConeReport ces_cone_report(const ces_ConeProblem *problem, const char *name, uint32_t iterations)
{
    ces_cone_load(problem, problem->impulse);
    const double residual = ces_cone_residual(problem);
    return (ces_ConeReport){
        .iterations = iterations,
        .residual = residual,
        .converged = residual <= problem->tolerance,
        .name = name,
    };
}
