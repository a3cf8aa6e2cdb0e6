/*
 * contact/broad_phase.h - which boxes overlap: a uniform grid of hashed cells, by counting sort.
 *
 * A box is entered in every cell it meets, so the sizes may differ without limit. A pair is reported in the one cell that
 * holds the lower corner of the boxes' intersection, so it is reported once.
 */
#ifndef CES_BROAD_PHASE_H
#define CES_BROAD_PHASE_H

#include "../base/memory.h"

typedef struct ces_Box {
    double lower[3], upper[3]; /* m */
} ces_Box;

typedef struct ces_Pair {
    uint32_t a, b; /* a < b */
} ces_Pair;

typedef struct ces_Grid {
    ces_Pool entries, starts, block_pairs, block_counts, pairs, sorted;
    size_t bucket_count;
    double cell; /* m */
} ces_Grid;

/* Pairs of overlapping boxes, sorted by (a, b): they come in *pairs, good until the next call. False: out of memory. */
bool ces_grid_pairs(ces_Grid *grid, const ces_Box *boxes, size_t count, int threads, const ces_Pair **pairs,
                    size_t *pair_count);
void ces_grid_free(ces_Grid *grid);

#endif
