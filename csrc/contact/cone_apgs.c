/*
 * contact/cone_apgs.c - Nesterov's momentum over exact Gauss-Seidel sweeps.
 *
 * y_k = gamma_k + beta_k (gamma_k - gamma_k-1), gamma_k+1 = sweep(y_k). Forward sweeps only. There is no proof that this
 * converges, so it is watched: momentum that points against the last change starts anew (O'Donoghue & Candes, Found. Comput.
 * Math. 15 (2015) 715), and where the energy of ccp rises, the step is taken back and a plain sweep made instead. Coulomb and
 * rolling have no energy that a sweep must lower, since De Saxce's shift changes under way: there momentum starts anew where
 * the energy rises while the sweeps have ceased to do less and less; without that it may circle for ever.
 */
#include <math.h>

#include "../base/vec3.h"
#include "cone_gradient.h"

enum { VECTORS = 5 };

enum { STALE = 3 }; /* sweeps in a row that did not change less than the least of those before */

static const double RISE = 1e-12; /* of the energy, which is what rounding may make of it */

static size_t scratch(const ces_ConeProblem *problem)
{
    return VECTORS * (size_t)problem->rows;
}

typedef struct State {
    double *old, *y, *u, *q, *best; /* gamma_k, y_k; u and impulse are those of gamma_k+1 */
    double energy, residual, best_residual;
    double least;   /* J, the least change by a sweep */
    uint32_t stale; /* sweeps since */
    bool shifts;    /* there is a shift of De Saxce's */
} State;

/* gamma N gamma/2 + (q + shift) gamma and the residual, of problem->impulse. */
static void measure(const ces_ConeProblem *problem, State *s)
{
    ces_cone_slips(problem, s->u);
    s->energy = 0.5 * (ces_rows_dot(problem, problem->impulse, s->u) + ces_rows_dot(problem, problem->impulse, s->q));
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        s->energy += problem->impulse[block->first] * ces_block_shift(problem, block, s->u + block->first);
    }
    s->residual = ces_rows_residual(problem, problem->impulse, s->u);
    if (s->residual < s->best_residual) {
        s->best_residual = s->residual;
        ces_rows_copy(problem, problem->impulse, s->best);
    }
}

/* Moves to y = gamma + beta (gamma - old), and remembers gamma and y. */
static void extrapolate(const ces_ConeProblem *problem, State *s, double beta)
{
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        double change[CES_BLOCK_ROWS];
        for (uint32_t k = 0; k < block->rows; k++) {
            const uint32_t row = block->first + k;
            const double gamma = problem->impulse[row];
            change[k] = beta * (gamma - s->old[row]);
            s->old[row] = gamma;
            s->y[row] = problem->impulse[row] = gamma + change[k];
        }
        if (beta > 0.0) {
            problem->op.push(problem->op.self, i, change);
        }
    }
}

/* (y - gamma_k+1) (gamma_k+1 - gamma_k), scaled: above 0 where the momentum leads uphill. */
static double uphill(const ces_ConeProblem *problem, const State *s)
{
    double sum = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        double part = 0.0;
        for (uint32_t row = block->first; row < block->first + block->rows; row++) {
            part += (s->y[row] - problem->impulse[row]) * (problem->impulse[row] - s->old[row]);
        }
        sum += part / ces_block_step(problem, block);
    }
    return sum;
}

static bool has_shift(const ces_ConeProblem *problem)
{
    bool rolling = false;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        rolling = rolling || problem->blocks[i].kind == CES_ROLLING_BLOCK;
    }
    return rolling || problem->law == CES_COULOMB;
}

/* Looks whether momentum did harm, the energy before having been so much: true where it must start anew. */
static bool went_astray(const ces_ConeProblem *problem, State *s, double before)
{
    const bool rises = s->energy > before + RISE * fabs(before);
    if (!s->shifts) {
        if (rises) {
            ces_rows_copy(problem, s->old, problem->impulse);
            ces_cone_load(problem, problem->impulse);
            ces_cone_sweep(problem);
            measure(problem, s);
        }
        return rises;
    }
    const double change = ces_rows_distance(problem, s->y, problem->impulse);
    s->stale = change < s->least ? 0 : s->stale + 1;
    s->least = ces_min(change, s->least);
    if (rises && s->stale >= STALE) {
        s->least = change;
        s->stale = 0;
        return true;
    }
    return false;
}

static ces_ConeReport solve(const ces_ConeProblem *problem)
{
    const size_t n = problem->rows;
    double *free = problem->scratch;
    State s = {.old = ces_take(&free, n),
               .y = ces_take(&free, n),
               .u = ces_take(&free, n),
               .q = ces_take(&free, n),
               .best = ces_take(&free, n),
               .best_residual = HUGE_VAL,
               .least = HUGE_VAL};
    ces_cone_start(problem);
    ces_rows_copy(problem, problem->impulse, s.old);
    problem->op.reset(problem->op.self);
    ces_cone_slips(problem, s.q);
    ces_cone_load(problem, problem->impulse);
    measure(problem, &s);
    s.shifts = has_shift(problem);
    double theta = 1.0, beta = 0.0;
    uint32_t k = 0;
    while (k < problem->max_iterations && s.best_residual > problem->tolerance) {
        k++;
        const double energy = s.energy;
        extrapolate(problem, &s, beta);
        ces_cone_sweep(problem);
        measure(problem, &s);
        if (went_astray(problem, &s, energy) || uphill(problem, &s) > 0.0) {
            theta = 1.0;
            beta = 0.0;
            continue;
        }
        const double theta_next = 0.5 * theta * (sqrt(theta * theta + 4.0) - theta);
        beta = theta * (1.0 - theta) / (theta * theta + theta_next);
        theta = theta_next;
    }
    ces_rows_copy(problem, s.best, problem->impulse);
    return ces_cone_report(problem, ces_cone_apgs.name, k);
}

const ces_ConeSolver ces_cone_apgs = {
    .name = "apgs",
    .doc = "Nesterov's momentum over exact Gauss-Seidel sweeps, with restart",
    .scratch = scratch,
    .solve = solve,
};
