/*
 * contact/cone_gradient.h - what the gradient methods share: they minimise f(gamma) = gamma N gamma/2 + (q + shift) gamma over
 * the sets with De Saxce's shift held (for ccp without moments it is 0), in the scaled norms
 *
 *     |x|^2 = sum_i |x_i|^2/rho_i  of impulses,   rho_i = ces_block_step: N s, so that f, x'u and |x|^2 are all in J
 *
 * and renew the shift as they go.
 */
#ifndef CES_CONE_GRADIENT_H
#define CES_CONE_GRADIENT_H

#include "cone_sweep.h"

/* Vectors of scratch, one after the other. */
double *ces_take(double **scratch, size_t count);

double ces_rows_dot(const ces_ConeProblem *problem, const double *a, const double *b);
void ces_rows_copy(const ces_ConeProblem *problem, const double *from, double *to);

/* sum_i |a_i - b_i|^2/rho_i, J. */
double ces_rows_distance(const ces_ConeProblem *problem, const double *a, const double *b);

/* u of all rows for these impulses; the operator is left with them. */
void ces_rows_slip(const ces_ConeProblem *problem, const double *gamma, double *u);

/* De Saxce's shift of each block for this u; (block_count). */
void ces_blocks_shift(const ces_ConeProblem *problem, const double *u, double *shift);

/* g = u + shift on the normal rows. */
void ces_rows_gradient(const ces_ConeProblem *problem, const double *u, const double *shift, double *g);

/* moved = P(gamma - t rho g), block by block. */
void ces_rows_step(const ces_ConeProblem *problem, const double *gamma, double t, const double *g, double *moved);

/* ces_cone_residual of impulses and velocities at hand; the second with the shift held. */
double ces_rows_residual(const ces_ConeProblem *problem, const double *gamma, const double *u);
double ces_rows_held_residual(const ces_ConeProblem *problem, const double *gamma, const double *g);

#endif
