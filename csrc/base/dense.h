/* base/dense.h - a dense linear system of a few hundred rows, solved plainly. */
#ifndef CES_DENSE_H
#define CES_DENSE_H

#include <stddef.h>

/* Solves A x = b by elimination with row pivots; A (count, count) and b are overwritten, x comes in b. A column without a
 * pivot, which a singular A has, gives x = 0 there. */
void ces_dense_solve(double *a, size_t count, double *b);

#endif
