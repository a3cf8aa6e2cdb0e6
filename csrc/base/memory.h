/* base/memory.h - the only malloc of the engine. */
#ifndef CES_MEMORY_H
#define CES_MEMORY_H

#include "../cesim.h"

enum { CES_ALIGNMENT = 64 }; /* bytes: a cache line, and the widest vector register */

/* Zeroed and aligned; NULL when there is none or count * size overflows. */
void *ces_alloc(size_t count, size_t size);
void ces_free(void *data);

/* A reference-counted array; the count is atomic because array views may die on any thread. */
ces_Buffer *ces_buffer_create(size_t count, size_t size);

/* An array of which only the size is remembered from step to step: scratch and lists. */
typedef struct ces_Pool {
    void *data;
    size_t bytes;
} ces_Pool;

/* At least count * size bytes, old content lost; grows by halves. False when out of memory: the pool is as it was. */
bool ces_pool_reserve(ces_Pool *pool, size_t count, size_t size);
/* The same, but the first kept bytes stay. */
bool ces_pool_grow(ces_Pool *pool, size_t count, size_t size, size_t kept);
void ces_pool_free(ces_Pool *pool);

#endif
