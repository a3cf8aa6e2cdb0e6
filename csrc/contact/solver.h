/* contact/solver.h - the table of solvers. They differ in how they get there; residual and stopping rule are one. */
#ifndef CES_SOLVER_H
#define CES_SOLVER_H

#include "problem.h"

typedef struct ces_SolverReport {
    uint32_t iterations;
    double residual; /* m/s */
} ces_SolverReport;

typedef struct ces_SolverRow {
    const char *name, *doc;
    /* Solves one island; changes only its own bodies and contacts. */
    ces_SolverReport (*solve)(ces_Problem *problem, const ces_Island *island);
} ces_SolverRow;

extern const ces_SolverRow ces_solver_pgs;

const ces_SolverRow *ces_solver_find(const char *name); /* NULL: no such row */

#endif
