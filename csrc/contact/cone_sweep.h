/* contact/cone_sweep.h - what the solvers of the cone problem share: start, sweep, report. */
#ifndef CES_CONE_SWEEP_H
#define CES_CONE_SWEEP_H

#include "cone_solver.h"

/* Puts problem->impulse into its sets, or to nothing where that is the better start, and loads the operator with it. */
void ces_cone_start(const ces_ConeProblem *problem);

/* One exact solution of each block after the other; gives the largest velocity that a change of impulse makes, m/s. */
double ces_cone_sweep(const ces_ConeProblem *problem);

/* u of all rows, as the operator holds them. */
void ces_cone_slips(const ces_ConeProblem *problem, double *u);

/* Measures the answer from scratch, without the rounding of the pushes that led to it. */
ces_ConeReport ces_cone_report(const ces_ConeProblem *problem, const char *name, uint32_t iterations);

#endif
