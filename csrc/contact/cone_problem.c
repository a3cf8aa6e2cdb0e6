#include "cone_problem.h"

#include <math.h>

#include "../base/vec3.h"
#include "block.h"

size_t ces_block_discs(const ces_ConeBlock *block, ces_Disc discs[CES_BLOCK_DISCS])
{
    if (block->kind == CES_JOINT_BLOCK) {
        return 0;
    }
    discs[0] = (ces_Disc){.first = 1, .rows = 2, .limit = block->friction};
    discs[1] = (ces_Disc){.first = 3, .rows = 1, .limit = block->spinning};
    discs[2] = (ces_Disc){.first = 4, .rows = 2, .limit = block->rolling};
    return block->kind == CES_ROLLING_BLOCK ? 3 : 1;
}

double ces_disc_length(const ces_Disc *disc, const double *v)
{
    const double *part = v + disc->first;
    return disc->rows == 1 ? fabs(part[0]) : sqrt(part[0] * part[0] + part[1] * part[1]);
}

/* Shortens the disc's part of v to this length at most. */
void ces_disc_cut(const ces_Disc *disc, double radius, double *v)
{
    const double length = ces_disc_length(disc, v);
    if (length > radius) {
        for (uint32_t k = 0; k < disc->rows; k++) {
            v[disc->first + k] *= radius > 0.0 ? radius / length : 0.0;
        }
    }
}

static void project_box(const ces_ConeProblem *problem, const ces_ConeBlock *block, double *p)
{
    for (uint32_t k = 0; k < block->rows; k++) {
        p[k] = ces_min(ces_max(p[k], problem->least[block->first + k]), problem->most[block->first + k]);
    }
}

/*
 * With the normal impulse N held, each disc is cut to limit N: what remains is the least of
 * (N - p_N)^2 + sum max(0, |p_d| - limit_d N)^2, convex and piecewise quadratic in N. Its slope is concave, so Newton's
 * iteration from N = 0 climbs from piece to piece and is exact when it meets no further corner.
 */
void ces_block_project(const ces_ConeProblem *problem, const ces_ConeBlock *block, double *p)
{
    if (block->kind == CES_JOINT_BLOCK) {
        project_box(problem, block, p);
        return;
    }
    ces_Disc discs[CES_BLOCK_DISCS];
    double length[CES_BLOCK_DISCS];
    const size_t count = ces_block_discs(block, discs);
    for (size_t d = 0; d < count; d++) {
        length[d] = ces_disc_length(&discs[d], p);
    }
    double push = 0.0;
    for (size_t round = 0; round <= count; round++) {
        double top = p[0], bottom = 1.0;
        for (size_t d = 0; d < count; d++) {
            const double limit = discs[d].limit;
            if (length[d] > limit * push) {
                top += limit * length[d];
                bottom += limit * limit;
            }
        }
        push = ces_max(push, top / bottom);
    }
    p[0] = push;
    for (size_t d = 0; d < count; d++) {
        ces_disc_cut(&discs[d], discs[d].limit * push, p);
    }
}

double ces_block_shift(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *u)
{
    ces_Disc discs[CES_BLOCK_DISCS];
    const size_t count = ces_block_discs(block, discs);
    double shift = 0.0;
    for (size_t d = problem->law == CES_CCP ? 1 : 0; d < count; d++) {
        shift += discs[d].limit * ces_disc_length(&discs[d], u);
    }
    return shift;
}

double ces_block_step(const ces_ConeProblem *problem, const ces_ConeBlock *block)
{
    const double *matrix = problem->diagonal + block->diagonal;
    double trace = 0.0;
    for (uint32_t k = 0; k < block->rows; k++) {
        trace += matrix[k * (block->rows + 1)];
    }
    return block->rows / trace;
}

double ces_block_residual(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *gamma,
                          const double *u)
{
    const double rho = ces_block_step(problem, block);
    double moved[CES_BLOCK_ROWS] = {0.0};
    for (uint32_t k = 0; k < block->rows; k++) {
        moved[k] = gamma[k] - rho * u[k];
    }
    moved[0] -= rho * ces_block_shift(problem, block, u);
    ces_block_project(problem, block, moved);
    double sum = 0.0;
    for (uint32_t k = 0; k < block->rows; k++) {
        sum += (gamma[k] - moved[k]) * (gamma[k] - moved[k]);
    }
    return sqrt(sum) / rho;
}

void ces_cone_load(const ces_ConeProblem *problem, const double *impulse)
{
    problem->op.reset(problem->op.self);
    for (uint32_t i = 0; i < problem->block_count; i++) {
        problem->op.push(problem->op.self, i, impulse + problem->blocks[i].first);
    }
}

double ces_cone_residual(const ces_ConeProblem *problem)
{
    double worst = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        double u[CES_BLOCK_ROWS];
        problem->op.slip(problem->op.self, i, u);
        const double residual = ces_block_residual(problem, block, problem->impulse + block->first, u);
        if (isnan(residual)) {
            return residual;
        }
        worst = ces_max(worst, residual);
    }
    return worst;
}

/* The sum over rows of gamma u, with u as the operator holds it. */
static double work_of(const ces_ConeProblem *problem)
{
    double work = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        double u[CES_BLOCK_ROWS];
        problem->op.slip(problem->op.self, i, u);
        for (uint32_t k = 0; k < block->rows; k++) {
            work += problem->impulse[block->first + k] * u[k];
        }
    }
    return work;
}

double ces_cone_objective(const ces_ConeProblem *problem)
{
    const double after = work_of(problem); /* gamma (N gamma + q) */
    problem->op.reset(problem->op.self);
    const double before = work_of(problem); /* gamma q */
    ces_cone_load(problem, problem->impulse);
    return 0.5 * (after + before);
}
