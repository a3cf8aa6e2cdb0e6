#include "charge_lists.h"

#include <string.h>

#include "../base/vec3.h"

typedef struct Pair {
    uint32_t target, source;
} Pair;

typedef struct Pairs {
    ces_Pool *pool;
    size_t count;
} Pairs;

enum { STACK, NEAR, NEAR_START, NEAR_SOURCE, FAR, FAR_START, FAR_SOURCE };

static bool push(Pairs *pairs, uint32_t target, uint32_t source)
{
    if (!ces_pool_grow(pairs->pool, pairs->count + 1, sizeof(Pair), pairs->count * sizeof(Pair))) {
        return false;
    }
    ((Pair *)pairs->pool->data)[pairs->count++] = (Pair){target, source};
    return true;
}

static double gap2(const ces_TreeCell *a, const ces_TreeCell *b)
{
    double sum = 0.0;
    for (int k = 0; k < 3; k++) {
        const double gap = ces_max(0.0, ces_max(a->lower[k] - b->upper[k], b->lower[k] - a->upper[k]));
        sum += gap * gap;
    }
    return sum;
}

static bool is_far(const ces_TreeCell *a, const ces_TreeCell *b, double opening)
{
    double between[3];
    ces_subtract(a->center, b->center, between);
    const double reach = a->reach + b->reach;
    return reach * reach < opening * opening * ces_dot(between, between);
}

/* Whether the target is the one to open. The rule gives the same cell for (A, B) and (B, A). */
static bool opens_target(const ces_TreeCell *a, const ces_TreeCell *b, Pair pair)
{
    if (a->child == 0 || b->child == 0) {
        return b->child == 0;
    }
    return a->reach != b->reach ? a->reach > b->reach : pair.target < pair.source;
}

static bool open_pair(const ces_TreeCell *a, const ces_TreeCell *b, Pair pair, bool itself, Pairs *stack)
{
    if (itself) {
        return push(stack, a->child, a->child) && push(stack, a->child, a->child + 1) &&
               push(stack, a->child + 1, a->child) && push(stack, a->child + 1, a->child + 1);
    }
    if (opens_target(a, b, pair)) {
        return push(stack, a->child, pair.source) && push(stack, a->child + 1, pair.source);
    }
    return push(stack, pair.target, b->child) && push(stack, pair.target, b->child + 1);
}

static bool walk(const ces_ChargeTree *targets, const ces_ChargeTree *sources, ces_FarRule rule, Pairs *stack,
                 Pairs *near, Pairs *far)
{
    const bool same = targets->cells == sources->cells;
    bool enough = push(stack, 0, 0);
    while (enough && stack->count > 0) {
        const Pair pair = ((const Pair *)stack->pool->data)[--stack->count];
        const ces_TreeCell *a = &targets->cells[pair.target], *b = &sources->cells[pair.source];
        if (gap2(a, b) > rule.cutoff * rule.cutoff) {
            continue;
        }
        if (is_far(a, b, rule.opening)) {
            enough = push(far, pair.target, pair.source);
        } else if (a->child == 0 && b->child == 0) {
            enough = push(near, pair.target, pair.source);
        } else {
            enough = open_pair(a, b, pair, same && pair.target == pair.source, stack);
        }
    }
    return enough;
}

/* By target, the sources of one in the order of the walk. */
static bool sort(const Pairs *pairs, size_t target_count, ces_Pool *starts, ces_Pool *sources, ces_CellList *list)
{
    if (!ces_pool_reserve(starts, target_count + 2, sizeof(uint32_t)) ||
        !ces_pool_reserve(sources, pairs->count, sizeof(uint32_t))) {
        return false;
    }
    *list = (ces_CellList){.start = starts->data, .source = sources->data};
    const Pair *loose = pairs->pool->data;
    uint32_t *next = list->start + 1; /* one ahead while filling, so that what is left are the starts */
    memset(list->start, 0, (target_count + 2) * sizeof *list->start);
    for (size_t k = 0; k < pairs->count; k++) {
        next[loose[k].target + 1]++;
    }
    for (size_t t = 0; t < target_count; t++) {
        next[t + 1] += next[t];
    }
    for (size_t k = 0; k < pairs->count; k++) {
        list->source[next[loose[k].target]++] = loose[k].source;
    }
    return true;
}

bool ces_cell_lists(const ces_ChargeTree *targets, const ces_ChargeTree *sources, ces_FarRule rule, ces_Pool *pools,
                    ces_CellList *near, ces_CellList *far)
{
    Pairs stack = {&pools[STACK], 0}, near_pairs = {&pools[NEAR], 0}, far_pairs = {&pools[FAR], 0};
    return walk(targets, sources, rule, &stack, &near_pairs, &far_pairs) &&
           sort(&near_pairs, targets->count, &pools[NEAR_START], &pools[NEAR_SOURCE], near) &&
           sort(&far_pairs, targets->count, &pools[FAR_START], &pools[FAR_SOURCE], far);
}
