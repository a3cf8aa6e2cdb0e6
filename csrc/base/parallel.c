#include "parallel.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdbool.h>

#ifdef _OPENMP
#include <omp.h>
#endif

/* The one variable of the engine that is not a scene's: whether this process is a forked child is a fact of the process. */
static atomic_bool forked = false;
static pthread_once_t watching = PTHREAD_ONCE_INIT;

static void on_fork_child(void)
{
    atomic_store(&forked, true);
}

static void watch_forks(void)
{
    pthread_atfork(NULL, NULL, on_fork_child);
}

size_t ces_block_count(size_t count, size_t block_size)
{
    return (count + block_size - 1) / block_size;
}

static void run_block(size_t block, size_t count, size_t block_size, ces_Span *span, void *context)
{
    const size_t first = block * block_size;
    const size_t last = first + block_size < count ? first + block_size : count;
    span(context, block, first, last);
}

void ces_parallel_for(size_t count, size_t block_size, int threads, ces_Span *span, void *context)
{
    const size_t blocks = ces_block_count(count, block_size);
    pthread_once(&watching, watch_forks);
    if (threads > 1 && blocks > 1 && !atomic_load(&forked)) {
#ifdef _OPENMP
#pragma omp parallel for num_threads(threads) schedule(dynamic, 1)
        for (size_t block = 0; block < blocks; block++) {
            run_block(block, count, block_size, span, context);
        }
        return;
#endif
    }
    for (size_t block = 0; block < blocks; block++) {
        run_block(block, count, block_size, span, context);
    }
}

int ces_processor_count(void)
{
#ifdef _OPENMP
    return omp_get_num_procs();
#else
    return 1;
#endif
}

int ces_openmp_version(void)
{
#ifdef _OPENMP
    return _OPENMP;
#else
    return 0;
#endif
}
