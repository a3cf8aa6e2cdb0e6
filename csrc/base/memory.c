#include "memory.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

struct ces_Buffer {
    atomic_size_t holders;
    void *data;
};

void *ces_alloc(size_t count, size_t size)
{
    if (size > 0 && count > (SIZE_MAX - CES_ALIGNMENT) / size) {
        return NULL;
    }
    /* aligned_alloc wants a multiple of the alignment, and never nothing. */
    const size_t bytes = (count * size / CES_ALIGNMENT + 1) * CES_ALIGNMENT;
    void *data = aligned_alloc(CES_ALIGNMENT, bytes);
    if (data != NULL) {
        memset(data, 0, bytes);
    }
    return data;
}

void ces_free(void *data)
{
    free(data);
}

ces_Buffer *ces_buffer_create(size_t count, size_t size)
{
    ces_Buffer *buffer = ces_alloc(1, sizeof *buffer);
    if (buffer == NULL) {
        return NULL;
    }
    buffer->data = ces_alloc(count, size);
    if (buffer->data == NULL) {
        ces_free(buffer);
        return NULL;
    }
    atomic_init(&buffer->holders, 1);
    return buffer;
}

void *ces_buffer_data(const ces_Buffer *buffer)
{
    return buffer->data;
}

void ces_buffer_retain(ces_Buffer *buffer)
{
    atomic_fetch_add(&buffer->holders, 1);
}

void ces_buffer_release(ces_Buffer *buffer)
{
    if (buffer != NULL && atomic_fetch_sub(&buffer->holders, 1) == 1) {
        ces_free(buffer->data);
        ces_free(buffer);
    }
}

bool ces_pool_grow(ces_Pool *pool, size_t count, size_t size, size_t kept)
{
    if (size > 0 && count > SIZE_MAX / 2 / size) {
        return false;
    }
    const size_t bytes = count * size;
    if (bytes <= pool->bytes && pool->data != NULL) {
        return true;
    }
    const size_t grown = bytes + bytes / 2;
    void *data = ces_alloc(grown, 1);
    if (data == NULL) {
        return false;
    }
    if (kept > 0) {
        memcpy(data, pool->data, kept);
    }
    ces_free(pool->data);
    *pool = (ces_Pool){.data = data, .bytes = grown};
    return true;
}

bool ces_pool_reserve(ces_Pool *pool, size_t count, size_t size)
{
    return ces_pool_grow(pool, count, size, 0);
}

void ces_pool_free(ces_Pool *pool)
{
    ces_free(pool->data);
    *pool = (ces_Pool){0};
}
