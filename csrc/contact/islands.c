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

/* The members of islands: grains by their rows, and behind them the assemblies. */
typedef struct Members {
    const ces_Contacts *contacts;
    const ces_Mechanism *mechanism;
    size_t rows, count;
} Members;

static uint32_t assembly_member(const Members *members, uint32_t assembly)
{
    return (uint32_t)members->rows + assembly;
}

/* Numbers the islands that have something to solve, in the order of their roots, and counts what each has. */
static void number(ces_Islands *islands, const Members *members)
{
    const ces_Contacts *contacts = members->contacts;
    const ces_Mechanism *mechanism = members->mechanism;
    uint32_t *parents = islands->parents.data;
    uint32_t *labels = islands->labels.data;
    for (size_t member = 0; member < members->count; member++) {
        labels[member] = NO_ISLAND;
    }
    for (size_t k = 0; k < contacts->count; k++) {
        labels[root_of(parents, contacts->list[k].a)] = 0;
    }
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        if (mechanism->assemblies[i].drive_count > 0 && !mechanism->assemblies[i].by_turns) {
            labels[root_of(parents, assembly_member(members, i))] = 0;
        }
    }
    islands->count = 0;
    for (size_t member = 0; member < members->count; member++) {
        if (labels[member] != NO_ISLAND) {
            labels[member] = (uint32_t)islands->count;
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
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        const uint32_t label = labels[root_of(parents, assembly_member(members, i))];
        if (label != NO_ISLAND) {
            islands->list[label].assembly_last++;
        }
    }
}

/* From counts to ranges, then the contacts and assemblies into their ranges. */
static void fill(ces_Islands *islands, const Members *members)
{
    const ces_Contacts *contacts = members->contacts;
    uint32_t *parents = islands->parents.data;
    const uint32_t *labels = islands->labels.data;
    uint32_t pairs = 0, surfaces = 0, assemblies = 0;
    for (size_t i = 0; i < islands->count; i++) {
        ces_Island *island = &islands->list[i];
        const uint32_t pair_count = island->pair_last, surface_count = island->surface_last;
        const uint32_t assembly_count = island->assembly_last;
        *island = (ces_Island){pairs, pairs, surfaces, surfaces, assemblies, assemblies, assembly_count == 0};
        pairs += pair_count;
        surfaces += surface_count;
        assemblies += assembly_count;
    }
    for (size_t k = 0; k < contacts->count; k++) {
        ces_Island *island = &islands->list[labels[root_of(parents, contacts->list[k].a)]];
        if (k < contacts->pair_count) {
            islands->pair_order[island->pair_last++] = (uint32_t)k;
        } else {
            islands->surface_order[island->surface_last++] = (uint32_t)k;
        }
    }
    for (uint32_t i = 0; i < members->mechanism->assembly_count; i++) {
        const uint32_t label = labels[root_of(parents, assembly_member(members, i))];
        if (label != NO_ISLAND) {
            islands->assembly_order[islands->list[label].assembly_last++] = i;
        }
    }
}

bool ces_islands_find(ces_Islands *islands, const ces_Contacts *contacts, size_t row_count,
                      const ces_Mechanism *mechanism)
{
    const Members members = {contacts, mechanism, row_count, row_count + mechanism->assembly_count};
    islands->count = 0;
    const size_t surface_count = contacts->count - contacts->pair_count;
    if (!ces_pool_reserve(&islands->parents, members.count, sizeof(uint32_t)) ||
        !ces_pool_reserve(&islands->labels, members.count, sizeof(uint32_t)) ||
        !ces_pool_reserve(&islands->list_pool, contacts->count + mechanism->assembly_count, sizeof(ces_Island)) ||
        !ces_pool_reserve(&islands->pair_pool, contacts->pair_count, sizeof(uint32_t)) ||
        !ces_pool_reserve(&islands->surface_pool, surface_count, sizeof(uint32_t)) ||
        !ces_pool_reserve(&islands->assembly_pool, mechanism->assembly_count, sizeof(uint32_t))) {
        return false;
    }
    islands->list = islands->list_pool.data;
    islands->pair_order = islands->pair_pool.data;
    islands->surface_order = islands->surface_pool.data;
    islands->assembly_order = islands->assembly_pool.data;
    if (contacts->count == 0 && mechanism->drive_count == 0) {
        return true;
    }
    uint32_t *parents = islands->parents.data;
    for (size_t member = 0; member < members.count; member++) {
        parents[member] = (uint32_t)member;
    }
    for (size_t k = 0; k < contacts->pair_count; k++) {
        join(parents, contacts->list[k].a, contacts->list[k].b);
    }
    for (size_t k = contacts->pair_count; k < contacts->count; k++) {
        const uint32_t part = contacts->list[k].carrier;
        if (part != CES_NO_PART) {
            join(parents, contacts->list[k].a, assembly_member(&members, mechanism->assembly_of[part]));
        }
    }
    number(islands, &members);
    fill(islands, &members);
    return true;
}

void ces_islands_free(ces_Islands *islands)
{
    ces_Pool *const pools[] = {&islands->parents,   &islands->labels,       &islands->list_pool,
                               &islands->pair_pool, &islands->surface_pool, &islands->assembly_pool};
    for (size_t k = 0; k < sizeof pools / sizeof pools[0]; k++) {
        ces_pool_free(pools[k]);
    }
}
