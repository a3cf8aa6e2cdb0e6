#include "charge_tree.h"

#include <string.h>

#include "../base/vec3.h"

/* The box of its charges. */
static void measure(ces_TreeCell *cell, const double *const x[3], const double *radius, const uint32_t *order)
{
    double largest = 0.0, diagonal = 0.0;
    for (int k = 0; k < 3; k++) {
        cell->lower[k] = cell->upper[k] = x[k][order[cell->first]];
    }
    for (uint32_t i = cell->first; i < cell->last; i++) {
        for (int k = 0; k < 3; k++) {
            cell->lower[k] = ces_min(cell->lower[k], x[k][order[i]]);
            cell->upper[k] = ces_max(cell->upper[k], x[k][order[i]]);
        }
        largest = ces_max(largest, radius[order[i]]);
    }
    for (int k = 0; k < 3; k++) {
        cell->center[k] = 0.5 * (cell->lower[k] + cell->upper[k]);
        diagonal += (cell->upper[k] - cell->lower[k]) * (cell->upper[k] - cell->lower[k]);
    }
    cell->reach = 0.5 * sqrt(diagonal) + largest;
}

/* Brings the charges below the middle of the longest edge to the front, both halves in their old order; gives the first of
 * the upper half, or last where there is nothing to halve. */
static uint32_t halve(const ces_TreeCell *cell, const double *const x[3], uint32_t *order, uint32_t *scratch)
{
    int axis = 0;
    for (int k = 1; k < 3; k++) {
        axis = cell->upper[k] - cell->lower[k] > cell->upper[axis] - cell->lower[axis] ? k : axis;
    }
    const double middle = cell->center[axis];
    uint32_t low = cell->first, high = 0;
    if (!(cell->lower[axis] < middle && middle < cell->upper[axis])) {
        return cell->last;
    }
    for (uint32_t i = cell->first; i < cell->last; i++) {
        if (x[axis][order[i]] < middle) {
            order[low++] = order[i];
        } else {
            scratch[high++] = order[i];
        }
    }
    memcpy(&order[low], scratch, high * sizeof *order);
    return low;
}

bool ces_charge_tree_build(ces_ChargeTree *tree, const double *const x[3], const double *radius, size_t count,
                           uint32_t *order, ces_Pool *cells, ces_Pool *scratch)
{
    if (!ces_pool_reserve(cells, 2 * count, sizeof(ces_TreeCell)) ||
        !ces_pool_reserve(scratch, count, sizeof(uint32_t))) {
        return false;
    }
    *tree = (ces_ChargeTree){.cells = cells->data, .count = 1};
    tree->cells[0] = (ces_TreeCell){.first = 0, .last = (uint32_t)count};
    for (size_t c = 0; c < tree->count; c++) {
        ces_TreeCell *cell = &tree->cells[c];
        measure(cell, x, radius, order);
        cell->child = 0;
        const uint32_t middle =
            cell->last - cell->first > CES_TREE_LEAF ? halve(cell, x, order, scratch->data) : cell->last;
        if (middle < cell->last) {
            cell->child = (uint32_t)tree->count;
            tree->cells[tree->count++] = (ces_TreeCell){.first = cell->first, .last = middle};
            tree->cells[tree->count++] = (ces_TreeCell){.first = middle, .last = cell->last};
        }
    }
    return true;
}
