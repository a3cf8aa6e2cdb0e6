/*
 * field/charge_tree.h - charges in a tree of boxes: a box of more than a few charges is halved across its longest edge.
 * The order of the charges in it, and the tree, depend on where they are and on nothing else.
 */
#ifndef CES_CHARGE_TREE_H
#define CES_CHARGE_TREE_H

#include "../base/memory.h"

enum { CES_TREE_LEAF = 32 }; /* charges in a box that is not halved, unless they all stand in one point */

typedef struct ces_TreeCell {
    double lower[3], upper[3]; /* m, of the centres of its charges */
    double center[3];          /* m, of the box */
    double reach;              /* m, half the diagonal, and the largest radius of a charge in it */
    uint32_t first, last;      /* charges */
    uint32_t child;            /* it and the next are the children; 0: a leaf */
} ces_TreeCell;

typedef struct ces_ChargeTree {
    ces_TreeCell *cells; /* children behind their parents; the first is the root */
    size_t count;
} ces_ChargeTree;

/* The tree of count > 0 charges at x (3, count) with these radii; order (count) comes as a permutation of 0 .. count - 1
 * and is left in the order of the tree. False: out of memory. */
bool ces_charge_tree_build(ces_ChargeTree *tree, const double *const x[3], const double *radius, size_t count,
                           uint32_t *order, ces_Pool *cells, ces_Pool *scratch);

#endif
