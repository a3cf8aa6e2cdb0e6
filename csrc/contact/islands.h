/*
 * contact/islands.h - groups of grains that push each other in this step. Surfaces do not join islands: they do not yield.
 */
#ifndef CES_ISLANDS_H
#define CES_ISLANDS_H

#include "../data/contacts.h"

typedef struct ces_Island {
    uint32_t pair_first, pair_last;       /* into pair_order */
    uint32_t surface_first, surface_last; /* into surface_order */
    bool packed; /* solved by the kernel for spheres (problem.h), else as rigid bodies (rigid.h) */
} ces_Island;

typedef struct ces_Islands {
    ces_Pool parents, labels, list_pool, pair_pool, surface_pool;
    ces_Island *list;        /* (count), in the order of their first row */
    uint32_t *pair_order;    /* (pair_count) index of a contact, island by island */
    uint32_t *surface_order; /* (count - pair_count) */
    size_t count;
} ces_Islands;

/* Groups the contacts of grains with rows below row_count. False: out of memory. */
bool ces_islands_find(ces_Islands *islands, const ces_Contacts *contacts, size_t row_count);
void ces_islands_free(ces_Islands *islands);

#endif
