/*
 * contact/cone_apgd.c - accelerated projected gradient descent: H. Mazhar, T. Heyn, D. Negrut, A. Tasora, "Using Nesterov's
 * method to accelerate multibody dynamics with friction and contact", ACM Trans. Graph. 34 (2015) 32, algorithm 1, with
 * the diagonal scaling of cone_gradient.h. Letters are theirs: y the extrapolated point, t = 1/L the step, theta and beta the
 * momentum; numbers are the lines of the algorithm.
 */
#include <math.h>

#include "../base/vec3.h"
#include "cone_gradient.h"

enum { VECTORS = 8, BACKTRACKS = 60 };

/* De Saxce's shift is renewed once the problem with it held is solved so much better: renewed in every step it may cycle. */
static const double HELD = 0.5;

static size_t scratch(const ces_ConeProblem *problem)
{
    return VECTORS * (size_t)problem->rows + problem->block_count;
}

typedef struct State {
    double *gamma, *next, *y; /* gamma_k, gamma_k+1, y_k */
    double *u, *u_next, *u_y; /* N gamma + q of the three */
    double *g, *best;
    double *shift; /* (blocks) */
    double lipschitz, best_residual;
} State;

/* Lines 8-15: gamma_k+1 = P(y - t g), halving t until f stays under its model,
 * d N d <= L |d|^2 with d = gamma_k+1 - y. */
static void descend(const ces_ConeProblem *problem, State *s)
{
    for (int trial = 0; trial < BACKTRACKS; trial++) {
        ces_rows_step(problem, s->y, 1.0 / s->lipschitz, s->g, s->next);
        ces_rows_slip(problem, s->next, s->u_next);
        double curvature = 0.0;
        for (uint32_t k = 0; k < problem->rows; k++) {
            curvature += (s->next[k] - s->y[k]) * (s->u_next[k] - s->u_y[k]);
        }
        const double distance = ces_rows_distance(problem, s->next, s->y);
        if (!(curvature > s->lipschitz * distance)) {
            return;
        }
        s->lipschitz = ces_max(2.0 * s->lipschitz, curvature / distance);
    }
}

static ces_ConeReport solve(const ces_ConeProblem *problem)
{
    const size_t n = problem->rows;
    double *free = problem->scratch;
    State s = {.gamma = ces_take(&free, n),
               .next = ces_take(&free, n),
               .y = ces_take(&free, n),
               .u = ces_take(&free, n),
               .u_next = ces_take(&free, n),
               .u_y = ces_take(&free, n),
               .g = ces_take(&free, n),
               .best = ces_take(&free, n),
               .shift = ces_take(&free, problem->block_count),
               .lipschitz = 1.0};
    ces_cone_start(problem);
    ces_rows_copy(problem, problem->impulse, s.gamma);
    ces_cone_slips(problem, s.u);
    ces_rows_copy(problem, s.gamma, s.y);
    ces_rows_copy(problem, s.gamma, s.best);
    ces_rows_copy(problem, s.u, s.u_y);
    ces_blocks_shift(problem, s.u, s.shift);
    s.best_residual = ces_rows_residual(problem, s.gamma, s.u);
    double theta = 1.0;
    uint32_t k = 0;
    while (k < problem->max_iterations && s.best_residual > problem->tolerance) {
        k++;
        ces_rows_gradient(problem, s.u_y, s.shift, s.g);
        descend(problem, &s);
        double along = 0.0;
        for (uint32_t row = 0; row < problem->rows; row++) {
            along += s.g[row] * (s.next[row] - s.gamma[row]);
        }
        const double theta_next = 0.5 * theta * (sqrt(theta * theta + 4.0) - theta); /* 16 */
        double beta = theta * (1.0 - theta) / (theta * theta + theta_next);          /* 17 */
        theta = theta_next;
        if (along > 0.0) { /* 27-30: the momentum leads uphill */
            beta = 0.0;
            theta = 1.0;
        }
        for (uint32_t row = 0; row < problem->rows; row++) { /* 18 */
            s.y[row] = s.next[row] + beta * (s.next[row] - s.gamma[row]);
            s.u_y[row] = s.u_next[row] + beta * (s.u_next[row] - s.u[row]);
            s.gamma[row] = s.next[row];
            s.u[row] = s.u_next[row];
        }
        const double residual = ces_rows_residual(problem, s.gamma, s.u); /* 19 */
        if (residual < s.best_residual) {                                 /* 20-23 */
            s.best_residual = residual;
            ces_rows_copy(problem, s.gamma, s.best);
        }
        ces_rows_gradient(problem, s.u, s.shift, s.g);
        if (ces_rows_held_residual(problem, s.gamma, s.g) < HELD * residual) {
            ces_blocks_shift(problem, s.u, s.shift);
        }
        s.lipschitz *= 0.9; /* 31 */
    }
    ces_rows_copy(problem, s.best, problem->impulse);
    return ces_cone_report(problem, ces_cone_apgd.name, k);
}

const ces_ConeSolver ces_cone_apgd = {
    .name = "apgd",
    .doc = "Nesterov-accelerated projected gradient with backtracking and restart",
    .scratch = scratch,
    .solve = solve,
};
