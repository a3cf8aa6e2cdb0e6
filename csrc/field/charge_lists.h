/*
 * field/charge_lists.h - which cells of two trees act on each other one by one, and which by expansions.
 *
 * One walk over pairs of cells, from both roots down: a pair that is far enough apart is far, two leaves that are not are
 * near, else the larger one is opened. The rule does not ask which of the two is the target: so of one tree with itself
 * both (A, B) and (B, A) come, and forces stay equal and opposite.
 */
#ifndef CES_CHARGE_LISTS_H
#define CES_CHARGE_LISTS_H

#include "charge_tree.h"

/* Sources by target: those of target t are source[start[t] .. start[t + 1]). */
typedef struct ces_CellList {
    uint32_t *start, *source;
} ces_CellList;

enum { CES_LIST_POOLS = 7 };

/* What makes a pair far (by expansions), and what leaves it out. */
typedef struct ces_FarRule {
    double opening; /* far: sum of the reaches below opening times distance; 0: none */
    double cutoff;  /* m, left out: boxes farther apart than this */
} ces_FarRule;

/* The lists of one tree's cells under another's, good until the next call with the same pools. False: out of memory. */
bool ces_cell_lists(const ces_ChargeTree *targets, const ces_ChargeTree *sources, ces_FarRule rule, ces_Pool *pools,
                    ces_CellList *near, ces_CellList *far);

#endif
