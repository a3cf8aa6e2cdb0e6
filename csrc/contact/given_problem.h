/*
 * contact/given_problem.h - a cone problem given as W and q: u = W gamma + q.
 *
 * W is symmetric and stands in compressed rows (indices ascending or not, each entry once); the state of the operator is u.
 */
#ifndef CES_GIVEN_PROBLEM_H
#define CES_GIVEN_PROBLEM_H

#include "cone_problem.h"

typedef struct ces_GivenProblem {
    const ces_ConeBlock *blocks;
    uint32_t rows;
    const int64_t *row_start; /* (rows + 1) */
    const int32_t *column;    /* (entries) */
    const double *value;      /* (entries) 1/kg */
    const double *q;          /* (rows) m/s */
    double *u;                /* (rows) m/s */
} ces_GivenProblem;

ces_Operator ces_given_operator(ces_GivenProblem *given);

/* Fills the diagonal blocks N_ii, each where its block says. */
void ces_given_diagonal(const ces_GivenProblem *given, uint32_t block_count, double *diagonal);

/* What the FCLib collection calls the error, a number: |gamma - P(gamma - u^)|/|q|, 2-norms over all rows; 0 for q = 0 and
 * a residual of 0. */
double ces_given_natural_map(const ces_GivenProblem *given, const ces_ConeProblem *problem);

#endif
