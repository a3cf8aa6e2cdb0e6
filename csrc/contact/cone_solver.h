/*
 * contact/cone_solver.h - the table of solvers for the cone problem. They differ in how they get there: problem, residual and
 * stopping rule are one. None allocates, none reads a clock, none is parallel inside: an island is solved by one thread.
 */
#ifndef CES_CONE_SOLVER_H
#define CES_CONE_SOLVER_H

#include "cone_problem.h"

typedef struct ces_ConeReport {
    uint32_t iterations;
    double residual;  /* m/s, ces_cone_residual of the answer */
    bool converged;   /* residual <= tolerance; false as well where a number is not finite */
    const char *name; /* of the solver that gave the answer: auto names the one it chose */
} ces_ConeReport;

typedef struct ces_ConeSolver {
    const char *name, *doc;
    /* Doubles of scratch that it needs. */
    size_t (*scratch)(const ces_ConeProblem *problem);
    /* Starts from problem->impulse or from nothing, whichever is better. */
    ces_ConeReport (*solve)(const ces_ConeProblem *problem);
} ces_ConeSolver;

extern const ces_ConeSolver ces_cone_auto, ces_cone_pgs, ces_cone_apgs, ces_cone_apgd, ces_cone_spg, ces_cone_jacobi,
    ces_cone_direct;

size_t ces_cone_solver_count(void);
const ces_ConeSolver *ces_cone_solver_at(size_t row);
const ces_ConeSolver *ces_cone_solver_find(const char *name); /* NULL: no such row */

#endif
