/* contact/cone_pgs.c - projected Gauss-Seidel: one exact solution of a block after the other, in their order. */
#include "cone_sweep.h"

#include <math.h>

static size_t scratch(const ces_ConeProblem *problem)
{
    (void)problem;
    return 0;
}

static ces_ConeReport solve(const ces_ConeProblem *problem)
{
    ces_cone_start(problem);
    ces_ConeReport report = ces_cone_report(problem, ces_cone_pgs.name, 0);
    for (uint32_t k = 1; k <= problem->max_iterations && !report.converged; k++) {
        const double change = ces_cone_sweep(problem);
        /* The residual costs a sweep: it is asked for when the sweeps have almost come to rest. */
        if (!(change > problem->tolerance) || k == problem->max_iterations) {
            report = ces_cone_report(problem, ces_cone_pgs.name, k);
            if (!isfinite(report.residual)) {
                break;
            }
        }
    }
    return report;
}

const ces_ConeSolver ces_cone_pgs = {
    .name = "pgs",
    .doc = "projected Gauss-Seidel, each visit an exact one-block solve",
    .scratch = scratch,
    .solve = solve,
};
