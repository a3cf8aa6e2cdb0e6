/*
 * contact/cone_spg.c - spectral projected gradient: E. G. Birgin, J. M. Martinez, M. Raydan, SIAM J. Optim. 10 (2000) 1196, in
 * the form T. Heyn (thesis, Wisconsin 2013) gave it for contact: diagonal scaling, the two Barzilai-Borwein steps by turns,
 * a line search that looks back over some steps, and the best point met as the answer (his fall-back).
 */
#include <math.h>

#include "../base/vec3.h"
#include "cone_gradient.h"

enum { VECTORS = 6, MEMORY = 10 };

static const double LEAST_STEP = 1e-3, MOST_STEP = 1e6; /* of rho: N scaled by it has eigenvalues up to some tens */
static const double DECREASE = 1e-4;                    /* Armijo's share of the slope */
static const double LEAST_SHARE = 0.01;
static const double HELD = 0.5; /* the shift is renewed once the problem with it held is solved so much better */

static size_t scratch(const ces_ConeProblem *problem)
{
    return VECTORS * (size_t)problem->rows + problem->block_count;
}

typedef struct State {
    double *gamma, *moved, *u, *u_moved, *g, *best;
    double *shift;         /* (blocks) */
    double energy[MEMORY]; /* J, f less f at the last renewal, of the steps since */
    uint32_t count;        /* of steps since the renewal */
    double alpha;
} State;

static void renew(const ces_ConeProblem *problem, State *s)
{
    ces_blocks_shift(problem, s->u, s->shift);
    ces_rows_gradient(problem, s->u, s->shift, s->g);
    s->energy[0] = 0.0;
    s->count = 1;
}

/* The share of d = moved - gamma at which f, a parabola along d, is below the worst energy remembered. */
static double search(const State *s, double slope, double curvature)
{
    const double now = s->energy[(s->count - 1) % MEMORY];
    double worst = now;
    for (uint32_t k = 0; k < MEMORY && k < s->count; k++) {
        worst = ces_max(worst, s->energy[k]);
    }
    const double change = slope + 0.5 * curvature;
    /* d is a step of projected gradient, so its slope is negative but for rounding: then there is nothing to search. */
    if (now + change <= worst + DECREASE * slope || !(slope < 0.0)) {
        return 1.0;
    }
    return ces_min(1.0, ces_max(LEAST_SHARE, -slope / curvature));
}

/* One step; alpha is then that of the next (Barzilai & Borwein, IMA J. Numer. Anal. 8 (1988) 141). */
static void step(const ces_ConeProblem *problem, State *s)
{
    ces_rows_step(problem, s->gamma, s->alpha, s->g, s->moved);
    ces_rows_slip(problem, s->moved, s->u_moved);
    double slope = 0.0, curvature = 0.0, square = 0.0; /* d'g, d'N d, N d rho N d */
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        double part = 0.0;
        for (uint32_t k = block->first; k < block->first + block->rows; k++) {
            const double d = s->moved[k] - s->gamma[k], nd = s->u_moved[k] - s->u[k];
            slope += d * s->g[k];
            curvature += d * nd;
            part += nd * nd;
        }
        square += part * ces_block_step(problem, block);
    }
    const double distance = ces_rows_distance(problem, s->moved, s->gamma);
    const double share = search(s, slope, curvature);
    for (uint32_t k = 0; k < problem->rows; k++) {
        s->gamma[k] = share == 1.0 ? s->moved[k] : s->gamma[k] + share * (s->moved[k] - s->gamma[k]);
        s->u[k] = share == 1.0 ? s->u_moved[k] : s->u[k] + share * (s->u_moved[k] - s->u[k]);
    }
    const double energy = s->energy[(s->count - 1) % MEMORY] + share * (slope + 0.5 * share * curvature);
    s->energy[s->count % MEMORY] = energy;
    s->count++;
    const double next = !(curvature > 0.0) ? MOST_STEP : s->count % 2 ? distance / curvature : curvature / square;
    s->alpha = ces_min(ces_max(next, LEAST_STEP), MOST_STEP);
}

static ces_ConeReport solve(const ces_ConeProblem *problem)
{
    const size_t n = problem->rows;
    double *free = problem->scratch;
    State s = {.gamma = ces_take(&free, n),
               .moved = ces_take(&free, n),
               .u = ces_take(&free, n),
               .u_moved = ces_take(&free, n),
               .g = ces_take(&free, n),
               .best = ces_take(&free, n),
               .shift = ces_take(&free, problem->block_count),
               .alpha = 1.0};
    ces_cone_start(problem);
    ces_rows_copy(problem, problem->impulse, s.gamma);
    ces_rows_copy(problem, problem->impulse, s.best);
    ces_cone_slips(problem, s.u);
    renew(problem, &s);
    double best = ces_rows_residual(problem, s.gamma, s.u);
    uint32_t k = 0;
    while (k < problem->max_iterations && best > problem->tolerance) {
        k++;
        step(problem, &s);
        const double residual = ces_rows_residual(problem, s.gamma, s.u);
        if (residual < best) {
            best = residual;
            ces_rows_copy(problem, s.gamma, s.best);
        }
        ces_rows_gradient(problem, s.u, s.shift, s.g);
        if (ces_rows_held_residual(problem, s.gamma, s.g) < HELD * residual) {
            renew(problem, &s);
        }
    }
    ces_rows_copy(problem, s.best, problem->impulse);
    return ces_cone_report(problem, ces_cone_spg.name, k);
}

const ces_ConeSolver ces_cone_spg = {
    .name = "spg",
    .doc = "spectral projected gradient with Barzilai-Borwein steps and a fall-back",
    .scratch = scratch,
    .solve = solve,
};
