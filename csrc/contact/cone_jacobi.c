/*
 * contact/cone_jacobi.c - projected Jacobi: all blocks move at once, gamma = P(gamma - omega rho u^), and none sees the others'
 * step. The relaxation omega is the largest that no step so far has shown to be too long: f falls as long as
 * omega d N d <= |d|^2 for the step d.
 */
#include "../base/vec3.h"
#include "cone_gradient.h"

enum { VECTORS = 4, TRIALS = 60 };

static size_t scratch(const ces_ConeProblem *problem)
{
    return VECTORS * (size_t)problem->rows + problem->block_count;
}

static ces_ConeReport solve(const ces_ConeProblem *problem)
{
    const size_t n = problem->rows;
    double *free = problem->scratch, omega = 1.0;
    double *gamma = problem->impulse;
    double *moved = ces_take(&free, n), *u = ces_take(&free, n), *u_moved = ces_take(&free, n);
    double *g = ces_take(&free, n), *shift = ces_take(&free, problem->block_count);
    ces_cone_start(problem);
    ces_cone_slips(problem, u);
    double residual = ces_rows_residual(problem, gamma, u);
    uint32_t k = 0;
    while (k < problem->max_iterations && residual > problem->tolerance) {
        k++;
        ces_blocks_shift(problem, u, shift);
        ces_rows_gradient(problem, u, shift, g);
        for (int trial = 0; trial < TRIALS; trial++) {
            ces_rows_step(problem, gamma, omega, g, moved);
            ces_rows_slip(problem, moved, u_moved);
            double curvature = 0.0;
            for (size_t row = 0; row < n; row++) {
                curvature += (moved[row] - gamma[row]) * (u_moved[row] - u[row]);
            }
            const double distance = ces_rows_distance(problem, moved, gamma);
            if (!(omega * curvature > distance)) {
                break;
            }
            omega = ces_min(0.9 * omega, distance / curvature);
        }
        ces_rows_copy(problem, moved, gamma);
        ces_rows_copy(problem, u_moved, u);
        residual = ces_rows_residual(problem, gamma, u);
    }
    return ces_cone_report(problem, ces_cone_jacobi.name, k);
}

const ces_ConeSolver ces_cone_jacobi = {
    .name = "jacobi",
    .doc = "projected Jacobi, relaxed as far as its steps show it must be",
    .scratch = scratch,
    .solve = solve,
};
