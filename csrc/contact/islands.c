#include "islands.h"

#include <string.h>

#define NO_ISLAND UINT32_MAX

static uint32_t root_of(uint32_t *parents, uint32_t row)
{
    while (parents[row] != row) {
        parents[row] = parents[parents[row]];
        row = parents[row];
    }
    return row;
}

/* The smaller row becomes the root, so that the result does not depend on the order of the pairs. */
static void join(uint32_t *parents, uint32_t one, uint32_t other)
{
    one = root_of(parents, one);
    other = root_of(parents, other);
    if (one < other) {
        parents[other] = one;
    } else {
        parents[one] = other;
    }
}

/* Numbers the islands that have contacts, in the order of their roots, and counts the contacts of each. */
static void number(ces_Islands *islands, const ces_Contacts *contacts, size_t row_count)
{
    uint32_t *parents = islands->parents.data;
    uint32_t *labels = islands->labels.data;
    for (size_t row = 0; row < row_count; row++) {
        labels[row] = NO_ISLAND;
    }
    for (size_t k = 0; k < contacts->count; k++) {
        labels[root_of(parents, contacts->list[k].a)] = 0;
    }
    islands->count = 0;
    for (size_t row = 0; row < row_count; row++) {
        if (labels[row] != NO_ISLAND) {
            labels[row] = (uint32_t)islands->count;
            islands->list[islands->count++] = (ces_Island){0};
        }
    }
    for (size_t k = 0; k < contacts->count; k++) {
        ces_Island *island = &islands->list[labels[root_of(parents, contacts->list[k].a)]];
        if (k < contacts->pair_count) {
            island->pair_last++;
        } else {
            island->surface_last++;
        }
    }
}

/* From counts to ranges, then the contacts into their ranges. */
static void fill(ces_Islands *islands, const ces_Contacts *contacts)
{
    uint32_t *parents = islands->parents.data;
    const uint32_t *labels = islands->labels.data;
    uint32_t pairs = 0, surfaces = 0;
    for (size_t i = 0; i < islands->count; i++) {
        ces_Island *island = &islands->list[i];
        const uint32_t pair_count = island->pair_last, surface_count = island->surface_last;
        *island = (ces_Island){pairs, pairs, surfaces, surfaces, true};
        pairs += pair_count;
        surfaces += surface_count;
    }
    for (size_t k = 0; k < contacts->count; k++) {
        ces_Island *island = &islands->list[labels[root_of(parents, contacts->list[k].a)]];
        if (k < contacts->pair_count) {
            islands->pair_order[island->pair_last++] = (uint32_t)k;
        } else {
            islands->surface_order[island->surface_last++] = (uint32_t)k;
        }
    }
}

bool ces_islands_find(ces_Islands *islands, const ces_Contacts *contacts, size_t row_count)
{
    islands->count = 0;
    const size_t surface_count = contacts->count - contacts->pair_count;
    if (!ces_pool_reserve(&islands->parents, row_count, sizeof(uint32_t)) ||
        !ces_pool_reserve(&islands->labels, row_count, sizeof(uint32_t)) ||
        !ces_pool_reserve(&islands->list_pool, contacts->count, sizeof(ces_Island)) ||
        !ces_pool_reserve(&islands->pair_pool, contacts->pair_count, sizeof(uint32_t)) ||
        !ces_pool_reserve(&islands->surface_pool, surface_count, sizeof(uint32_t))) {
        return false;
    }
    islands->list = islands->list_pool.data;
    islands->pair_order = islands->pair_pool.data;
    islands->surface_order = islands->surface_pool.data;
    if (contacts->count == 0) {
        return true;
    }
    uint32_t *parents = islands->parents.data;
    for (size_t row = 0; row < row_count; row++) {
        parents[row] = (uint32_t)row;
    }
    for (size_t k = 0; k < contacts->pair_count; k++) {
        join(parents, contacts->list[k].a, contacts->list[k].b);
    }
    number(islands, contacts, row_count);
    fill(islands, contacts);
    return true;
}

void ces_islands_free(ces_Islands *islands)
{
    ces_Pool *const pools[] = {&islands->parents, &islands->labels, &islands->list_pool, &islands->pair_pool,
                               &islands->surface_pool};
    for (size_t k = 0; k < sizeof pools / sizeof pools[0]; k++) {
        ces_pool_free(pools[k]);
    }
}
