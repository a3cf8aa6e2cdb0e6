#include "broad_phase.h"

#include <string.h>

#include "../base/parallel.h"
#include "../base/vec3.h"

enum { BUCKET_BLOCK = 1024 };

typedef struct Entry {
    uint64_t cell; /* its coordinates, 21 bits each */
    uint32_t row, bucket;
} Entry;

/* floor() is a call where the compiler may not assume a rounding instruction. */
static int64_t floor_to_int(double x)
{
    const int64_t cut = (int64_t)x;
    return cut - (x < (double)cut);
}

static uint64_t coordinate(double x, double cell)
{
    return (uint64_t)floor_to_int(x / cell) & 0x1fffff;
}

static uint64_t cell_key(const double corner[3], double cell)
{
    return coordinate(corner[0], cell) | coordinate(corner[1], cell) << 21 | coordinate(corner[2], cell) << 42;
}

/* Finaliser of a 64-bit hash: neighbours in space land far apart. */
static uint32_t bucket_of(uint64_t key, size_t bucket_count)
{
    key ^= key >> 33;
    key *= 0xff51afd7ed558ccdU;
    key ^= key >> 33;
    return (uint32_t)(key & (bucket_count - 1));
}

/* Twice the mean edge keeps entries few; a sixteenth of the longest bounds the cells that one box meets. */
static double choose_cell(const ces_Box *boxes, size_t count)
{
    double sum = 0.0, longest = 0.0;
    for (size_t i = 0; i < count; i++) {
        for (int k = 0; k < 3; k++) {
            const double edge = boxes[i].upper[k] - boxes[i].lower[k];
            sum += edge;
            longest = ces_max(longest, edge);
        }
    }
    return ces_max(2.0 * sum / (3.0 * (double)count), longest / 16.0);
}

static size_t cells_met(const ces_Box *box, double cell, int64_t first[3], int64_t last[3])
{
    size_t cells = 1;
    for (int k = 0; k < 3; k++) {
        first[k] = floor_to_int(box->lower[k] / cell);
        last[k] = floor_to_int(box->upper[k] / cell);
        cells *= (size_t)(last[k] - first[k] + 1);
    }
    return cells;
}

/* Entries in the order of buckets and, inside one, of rows. */
static bool fill(ces_Grid *grid, const ces_Box *boxes, size_t count, size_t *entry_count)
{
    int64_t first[3], last[3];
    size_t total = 0;
    for (size_t i = 0; i < count; i++) {
        total += cells_met(&boxes[i], grid->cell, first, last);
    }
    grid->bucket_count = 64;
    while (grid->bucket_count < total) {
        grid->bucket_count *= 2;
    }
    if (!ces_pool_reserve(&grid->entries, 2 * total, sizeof(Entry)) ||
        !ces_pool_reserve(&grid->starts, grid->bucket_count + 1, sizeof(uint32_t))) {
        return false;
    }
    Entry *loose = (Entry *)grid->entries.data + total;
    Entry *sorted = grid->entries.data;
    uint32_t *starts = grid->starts.data;
    memset(starts, 0, (grid->bucket_count + 1) * sizeof *starts);

    size_t n = 0;
    for (size_t i = 0; i < count; i++) {
        cells_met(&boxes[i], grid->cell, first, last);
        for (int64_t z = first[2]; z <= last[2]; z++) {
            for (int64_t y = first[1]; y <= last[1]; y++) {
                for (int64_t x = first[0]; x <= last[0]; x++) {
                    const uint64_t key =
                        ((uint64_t)x & 0x1fffff) | ((uint64_t)y & 0x1fffff) << 21 | ((uint64_t)z & 0x1fffff) << 42;
                    const uint32_t bucket = bucket_of(key, grid->bucket_count);
                    loose[n++] = (Entry){.cell = key, .row = (uint32_t)i, .bucket = bucket};
                    starts[bucket + 1]++;
                }
            }
        }
    }
    for (size_t bucket = 0; bucket < grid->bucket_count; bucket++) {
        starts[bucket + 1] += starts[bucket];
    }
    /* Filling from the end turns the ends of the buckets into their starts. */
    for (size_t k = total; k-- > 0;) {
        sorted[--starts[loose[k].bucket + 1]] = loose[k];
    }
    for (size_t bucket = 0; bucket < grid->bucket_count; bucket++) {
        starts[bucket] = starts[bucket + 1];
    }
    starts[grid->bucket_count] = (uint32_t)total;
    *entry_count = total;
    return true;
}

typedef struct Search {
    ces_Grid *grid;
    const ces_Box *boxes;
} Search;

static bool overlap(const ces_Box *one, const ces_Box *other)
{
    return one->lower[0] <= other->upper[0] && other->lower[0] <= one->upper[0] && one->lower[1] <= other->upper[1] &&
           other->lower[1] <= one->upper[1] && one->lower[2] <= other->upper[2] && other->lower[2] <= one->upper[2];
}

static bool is_home(const ces_Box *one, const ces_Box *other, uint64_t cell, double size)
{
    const double corner[3] = {ces_max(one->lower[0], other->lower[0]), ces_max(one->lower[1], other->lower[1]),
                              ces_max(one->lower[2], other->lower[2])};
    return cell_key(corner, size) == cell;
}

/* The pairs of a block of buckets go to a pool of the block's own; (size_t)-1 for a count says that it could not grow. */
static void search_block(void *context, size_t block, size_t first, size_t last)
{
    const Search *search = context;
    const Entry *entries = search->grid->entries.data;
    const uint32_t *starts = search->grid->starts.data;
    ces_Pool *pool = (ces_Pool *)search->grid->block_pairs.data + block;
    size_t *count = (size_t *)search->grid->block_counts.data + block;
    *count = 0;
    for (size_t bucket = first; bucket < last; bucket++) {
        for (size_t i = starts[bucket]; i < starts[bucket + 1]; i++) {
            const ces_Box *box = &search->boxes[entries[i].row];
            for (size_t j = i + 1; j < starts[bucket + 1]; j++) {
                const ces_Box *other = &search->boxes[entries[j].row];
                if (entries[i].cell != entries[j].cell || !overlap(box, other) ||
                    !is_home(box, other, entries[i].cell, search->grid->cell)) {
                    continue;
                }
                if (!ces_pool_grow(pool, *count + 1, sizeof(ces_Pair), *count * sizeof(ces_Pair))) {
                    *count = (size_t)-1;
                    return;
                }
                ((ces_Pair *)pool->data)[(*count)++] = (ces_Pair){.a = entries[i].row, .b = entries[j].row};
            }
        }
    }
}

static bool reserve_blocks(ces_Grid *grid, size_t blocks)
{
    const size_t before = grid->block_pairs.bytes / sizeof(ces_Pool);
    return (blocks <= before || ces_pool_grow(&grid->block_pairs, blocks, sizeof(ces_Pool), grid->block_pairs.bytes)) &&
           ces_pool_reserve(&grid->block_counts, blocks, sizeof(size_t));
}

/* Counting sort by b, then by a: stable, so that the result is in the order of (a, b). */
static void sort_pairs(const ces_Pair *from, ces_Pair *to, size_t pair_count, uint32_t *starts, size_t count, bool by_a)
{
    memset(starts, 0, (count + 1) * sizeof *starts);
    for (size_t k = 0; k < pair_count; k++) {
        starts[by_a ? from[k].a : from[k].b]++;
    }
    uint32_t sum = 0;
    for (size_t i = 0; i < count; i++) {
        const uint32_t size = starts[i];
        starts[i] = sum;
        sum += size;
    }
    for (size_t k = 0; k < pair_count; k++) {
        to[starts[by_a ? from[k].a : from[k].b]++] = from[k];
    }
}

bool ces_grid_pairs(ces_Grid *grid, const ces_Box *boxes, size_t count, int threads, const ces_Pair **pairs,
                    size_t *pair_count)
{
    *pairs = NULL;
    *pair_count = 0;
    if (count < 2) {
        return true;
    }
    size_t entry_count = 0;
    grid->cell = choose_cell(boxes, count);
    if (!fill(grid, boxes, count, &entry_count)) {
        return false;
    }
    const size_t blocks = ces_block_count(grid->bucket_count, BUCKET_BLOCK);
    if (!reserve_blocks(grid, blocks)) {
        return false;
    }
    Search search = {.grid = grid, .boxes = boxes};
    ces_parallel_for(grid->bucket_count, BUCKET_BLOCK, threads, search_block, &search);

    const size_t *counts = grid->block_counts.data;
    size_t total = 0;
    for (size_t block = 0; block < blocks; block++) {
        if (counts[block] == (size_t)-1) {
            return false;
        }
        total += counts[block];
    }
    if (!ces_pool_reserve(&grid->pairs, total, sizeof(ces_Pair)) ||
        !ces_pool_reserve(&grid->sorted, total, sizeof(ces_Pair)) ||
        !ces_pool_reserve(&grid->starts, count + 1, sizeof(uint32_t))) {
        return false;
    }
    ces_Pair *list = grid->pairs.data;
    for (size_t block = 0; block < blocks; block++) {
        const ces_Pool *pool = (const ces_Pool *)grid->block_pairs.data + block;
        if (counts[block] > 0) {
            memcpy(list, pool->data, counts[block] * sizeof(ces_Pair));
            list += counts[block];
        }
    }
    sort_pairs(grid->pairs.data, grid->sorted.data, total, grid->starts.data, count, false);
    sort_pairs(grid->sorted.data, grid->pairs.data, total, grid->starts.data, count, true);
    *pairs = grid->pairs.data;
    *pair_count = total;
    return true;
}

void ces_grid_free(ces_Grid *grid)
{
    const size_t blocks = grid->block_pairs.bytes / sizeof(ces_Pool);
    for (size_t block = 0; block < blocks; block++) {
        ces_pool_free((ces_Pool *)grid->block_pairs.data + block);
    }
    ces_Pool *const pools[] = {&grid->entries,      &grid->starts, &grid->block_pairs,
                               &grid->block_counts, &grid->pairs,  &grid->sorted};
    for (size_t k = 0; k < sizeof pools / sizeof pools[0]; k++) {
        ces_pool_free(pools[k]);
    }
}
