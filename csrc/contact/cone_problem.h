/*
 * contact/cone_problem.h - the cone problem, as every solver of cone_solver.h sees it.
 *
 * Impulses gamma stand in blocks of rows, one block a contact or a joint; each block has a convex set that its impulse must lie
 * in. All rows are impulses in N s against velocities in m/s: a moment is taken as moment over a length of the contact.
 *
 *     u = N gamma + q,   u^ = u + shift,   set_i  contains  gamma_i,   u^_i gamma_i minimal over set_i
 *
 *     contact  3 rows (N, T1, T2)              |T| <= friction N
 *     rolling  6 rows (N, T1, T2, S, R1, R2)   and |S| <= spinning N, |R| <= rolling N
 *     joint    1..6 rows                       least <= impulse <= most, row by row
 *
 * The shift (De Saxce & Feng, Math. Comput. Model. 28 (1998) 225) stands on the normal row:
 *
 *     coulomb  friction |u_T| + spinning |u_S| + rolling |u_R|
 *     ccp                       spinning |u_S| + rolling |u_R|      (friction convex: Anitescu & Tasora 2010)
 *
 * N is never formed. Whoever states the problem gives an operator: the engine keeps the velocities of its bodies, a problem
 * given as a matrix keeps u itself (given_problem.h).
 */
#ifndef CES_CONE_PROBLEM_H
#define CES_CONE_PROBLEM_H

#include "../cesim.h"

enum { CES_BLOCK_ROWS = 6 }; /* at most */

typedef enum ces_BlockKind {
    CES_CONTACT_BLOCK, /* 3 rows */
    CES_ROLLING_BLOCK, /* 6 rows */
    CES_JOINT_BLOCK,   /* 1..6 rows */
} ces_BlockKind;

typedef struct ces_ConeBlock {
    ces_BlockKind kind;
    uint32_t rows;
    uint32_t first;                     /* row of the problem that the block begins at */
    size_t diagonal;                    /* where N_ii begins in ces_ConeProblem.diagonal */
    double friction, spinning, rolling; /* what the kind has of them, else 0 */
} ces_ConeBlock;

/* What gamma does to u. Its state is that of all impulses pushed since the last reset. */
typedef struct ces_Operator {
    void *self;
    void (*reset)(void *self);                                      /* no impulses: u = q */
    void (*push)(void *self, uint32_t block, const double *change); /* N s, by the rows of the block */
    void (*slip)(const void *self, uint32_t block, double *u);      /* m/s, u of the block as things are now */
} ces_Operator;

typedef struct ces_ConeProblem {
    const ces_ConeBlock *blocks; /* (block_count), their rows one after the other without a hole */
    uint32_t block_count, rows;
    const double *diagonal;     /* 1/kg: of each block N_ii, (rows, rows) of the block, symmetric, positive trace */
    const double *least, *most; /* (rows) N s, read for joints only; infinite: not bounded; NULL: no joint anywhere */
    ces_Operator op;
    ces_ContactLaw law;
    double tolerance; /* m/s, on ces_cone_residual */
    uint32_t max_iterations;
    double *impulse; /* (rows) N s; start in, answer out; the operator then holds the answer too */
    double *scratch; /* as many doubles as the solver's row asks for */
} ces_ConeProblem;

/* ---- the sets ---------------------------------------------------------------------------------------------------------- */

/* The nearest point of the block's set, Euclidean. p: (rows of the block), in place. */
void ces_block_project(const ces_ConeProblem *problem, const ces_ConeBlock *block, double *p);

/* De Saxce's term of the normal row, m/s, for this velocity of the block. */
double ces_block_shift(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *u);

/* rows / trace N_ii, kg: the step of the block's residual. */
double ces_block_step(const ces_ConeProblem *problem, const ces_ConeBlock *block);

/* |gamma - P(gamma - rho u^)|/rho of one block, m/s, with rho = ces_block_step. */
double ces_block_residual(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *gamma,
                          const double *u);

/* ---- the whole problem ------------------------------------------------------------------------------------------------- */

/* Brings the operator to these impulses, from scratch: no rounding of earlier pushes is left. */
void ces_cone_load(const ces_ConeProblem *problem, const double *impulse);

/* The largest ces_block_residual of problem->impulse, m/s, with u as the operator holds it. Not finite where a number is
 * not. */
double ces_cone_residual(const ces_ConeProblem *problem);

/* gamma N gamma/2 + q gamma of problem->impulse, J: what the convex problem (ccp) makes least. The operator holds the impulses
 * before and after. */
double ces_cone_objective(const ces_ConeProblem *problem);

#endif
