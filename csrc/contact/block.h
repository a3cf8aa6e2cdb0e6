/*
 * contact/block.h - one block of the cone problem by itself: the discs of its set, and its exact solution while all other
 * blocks hold theirs.
 */
#ifndef CES_BLOCK_H
#define CES_BLOCK_H

#include "cone_problem.h"

enum { CES_BLOCK_DISCS = 3 };

/* Rows of a block that lie in a disc (or an interval) of radius limit times the normal impulse. */
typedef struct ces_Disc {
    uint32_t first, rows;
    double limit;
} ces_Disc;

size_t ces_block_discs(const ces_ConeBlock *block, ces_Disc discs[CES_BLOCK_DISCS]); /* how many */
double ces_disc_length(const ces_Disc *disc, const double *v);
void ces_disc_cut(const ces_Disc *disc, double radius, double *v);

/*
 * The impulse that solves the block, given the one it has and the u that it makes with it: to rounding for contacts and
 * joints, for rolling blocks to the last few digits.
 */
void ces_block_solve(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *gamma, const double *u,
                     double *solved);

/* The same for a joint; rows that depend on others keep the impulse they have. */
void ces_joint_solve(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *gamma, const double *u,
                     double *solved);

/* Solves A x = b, A (rows, rows) positive semi-definite, on the rows that are free; rows that depend on earlier ones get 0,
 * and the answer is then false. */
bool ces_solve_free(const double *a, uint32_t rows, const bool *free, const double *b, double *x);

#endif
