/* contact/solver_pgs.h - the kernel for islands of spheres: projected Gauss-Seidel in closed forms, on packs. */
#ifndef CES_SOLVER_PGS_H
#define CES_SOLVER_PGS_H

#include "problem.h"

typedef struct ces_SolverReport {
    uint32_t iterations;
    double residual; /* m/s */
    bool converged;
    bool exact; /* a lone contact in closed form */
} ces_SolverReport;

/* Solves one island; changes only its own bodies and contacts. */
ces_SolverReport ces_solve_packed(ces_Problem *problem, const ces_Island *island);

#endif
