/*
 * contact/islands.h - groups of grains that push each other in this step. Surfaces do not join islands, for they do not yield,
 * unless they belong to a dynamic part: an assembly of parts is a member of its island like a grain.
 */
#ifndef CES_ISLANDS_H
#define CES_ISLANDS_H

#include "../data/contacts.h"
#include "mechanism.h"

/* A heavy grain that lands on a light one makes a handful of contacts that converge slowly; so many more iterations over so
 * few contacts cost less than a few over a bed. */
enum { CES_SMALL_ISLAND = 64, CES_SMALL_FACTOR = 10 };

typedef struct ces_Island {
    uint32_t pair_first, pair_last;         /* into pair_order */
    uint32_t surface_first, surface_last;   /* into surface_order */
    uint32_t assembly_first, assembly_last; /* into assembly_order */
    bool packed; /* solved by the kernel for spheres (problem.h), else as rigid bodies (rigid.h) */
} ces_Island;

typedef struct ces_Islands {
    ces_Pool parents, labels, list_pool, pair_pool, surface_pool, assembly_pool;
    ces_Island *list;         /* (count), in the order of their first row */
    uint32_t *pair_order;     /* (pair_count) index of a contact, island by island */
    uint32_t *surface_order;  /* (count - pair_count) */
    uint32_t *assembly_order; /* those that take part in the contact problem */
    size_t count;
} ces_Islands;

/* Groups the contacts of grains with rows below row_count, and the assemblies that have contacts or rows that may give way.
 * False: out of memory. */
bool ces_islands_find(ces_Islands *islands, const ces_Contacts *contacts, size_t row_count,
                      const ces_Mechanism *mechanism);
void ces_islands_free(ces_Islands *islands);

#endif
