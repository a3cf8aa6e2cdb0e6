/*
 * contact/cone_auto.c - chooses by size and budget, watches, and changes over where the residual stalls. The report names the
 * solver that gave the answer.
 */
#include <math.h>

#include "../base/vec3.h"
#include "block.h"
#include "cone_active.h"
#include "cone_sweep.h"

enum {
    FEW = 12,          /* sweeps of pgs, which momentum cannot make up for */
    PATIENCE = 250,    /* iterations of a method before the first look at its progress */
    DIRECT_ROWS = 900, /* at most: 300 contacts */
    ACTIVE_ROWS = 450, /* at most that act, of a larger island: 3 MB for direct */
    DIRECT_SHARE = 4,  /* of the iterations, its inverse: left for direct */
    MANY = 32,         /* looks, each twice as far off as the one before */
};

static const double PROGRESS = 0.3; /* what a look must find the residual fallen to, since the one before */

static size_t larger(size_t a, size_t b)
{
    return a > b ? a : b;
}

/* What direct may be asked to solve of it. */
static size_t direct_rows(const ces_ConeProblem *problem)
{
    return problem->rows <= DIRECT_ROWS ? problem->rows : ACTIVE_ROWS;
}

static size_t scratch(const ces_ConeProblem *problem)
{
    const size_t gradient = larger(ces_cone_apgs.scratch(problem), ces_cone_apgd.scratch(problem));
    return larger(gradient, ces_cone_active_scratch(problem, &ces_cone_direct, direct_rows(problem)));
}

/* A block alone is solved by its own solution, to the rounding of that. */
static ces_ConeReport solve_one(const ces_ConeProblem *problem)
{
    double u[CES_BLOCK_ROWS], solved[CES_BLOCK_ROWS];
    const ces_ConeBlock *block = &problem->blocks[0];
    ces_cone_load(problem, problem->impulse);
    problem->op.slip(problem->op.self, 0, u);
    ces_block_solve(problem, block, problem->impulse, u, solved);
    for (uint32_t k = 0; k < block->rows; k++) {
        problem->impulse[k] = solved[k];
    }
    return ces_cone_report(problem, "block", 1);
}

/* Goes on with a method while it makes progress, for so many looks and up to so many iterations in all: true when there is no
 * need, or no use, to try another. */
static bool go_on(const ces_ConeProblem *problem, const ces_ConeSolver *method, uint32_t looks, uint32_t budget,
                  ces_ConeReport *report)
{
    ces_ConeProblem part = *problem;
    if (report->iterations >= budget) {
        return report->iterations >= problem->max_iterations;
    }
    for (uint32_t look = PATIENCE;; look *= 2, looks--) {
        const double before = report->residual;
        const uint32_t done = report->iterations, left = budget - done;
        part.max_iterations = look < left ? look : left;
        *report = method->solve(&part);
        report->iterations += done;
        if (report->converged || report->iterations >= problem->max_iterations || !isfinite(report->residual)) {
            return true;
        }
        if (looks <= 1 || report->iterations >= budget || report->residual > PROGRESS * before) {
            return false;
        }
    }
}

static ces_ConeReport solve(const ces_ConeProblem *problem)
{
    ces_ConeProblem part = *problem;
    if (problem->block_count == 1) {
        const ces_ConeReport report = solve_one(problem);
        if (report.converged || problem->max_iterations <= 1) {
            return report;
        }
    }
    part.max_iterations = problem->max_iterations < FEW ? problem->max_iterations : FEW;
    ces_ConeReport report = ces_cone_pgs.solve(&part);
    if (report.converged || problem->max_iterations <= FEW) {
        return report;
    }
    const bool small = problem->rows <= DIRECT_ROWS; /* a body on several points: apgd; a bed: apgs */
    const ces_ConeSolver *first = small ? &ces_cone_apgd : &ces_cone_apgs;
    const ces_ConeSolver *second = small ? &ces_cone_apgs : &ces_cone_apgd;
    const bool direct = ces_cone_few_act(problem, direct_rows(problem));
    /* Slow progress is no reason to keep direct from its turn. */
    const uint32_t budget = problem->max_iterations - (direct ? problem->max_iterations / DIRECT_SHARE : 0);
    if (go_on(problem, first, small ? 1 : MANY, budget, &report) || go_on(problem, second, MANY, budget, &report)) {
        return report;
    }
    if (direct) {
        part.max_iterations = problem->max_iterations - report.iterations;
        const uint32_t done = report.iterations;
        report = ces_cone_solve_active(&part, &ces_cone_direct, direct_rows(problem));
        report.iterations += done;
    }
    if (!report.converged) {
        go_on(problem, &ces_cone_apgd, MANY, problem->max_iterations, &report);
    }
    return report;
}

const ces_ConeSolver ces_cone_auto = {
    .name = "auto",
    .doc =
        "one block by its own solution; else a few sweeps of pgs, then apgs and apgd (the reverse on few blocks, and direct)",
    .scratch = scratch,
    .solve = solve,
};
