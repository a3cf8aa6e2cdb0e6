/*
 * base/parallel.h - a loop over blocks, the only parallelism in the tree.
 *
 * The borders of the blocks depend on count alone, and a block writes only what is its own: so the bits of a result do not
 * depend on the number of threads. In a child of fork the loop is serial (libgomp hangs there): the same bits again.
 */
#ifndef CES_PARALLEL_H
#define CES_PARALLEL_H

#include <stddef.h>

/* Works on [first, last), the block with this number. */
typedef void ces_Span(void *context, size_t block, size_t first, size_t last);

size_t ces_block_count(size_t count, size_t block_size);
void ces_parallel_for(size_t count, size_t block_size, int threads, ces_Span *span, void *context);

int ces_processor_count(void); /* 1 where the engine was built without OpenMP */
int ces_openmp_version(void);  /* 0 without */

#endif
