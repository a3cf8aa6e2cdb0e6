/*
 * base/random.h - counter-based random numbers: (seed, stream, id, draw) -> number. There is no state to keep, to share
 * between threads or to save: a number depends on its four names alone.
 *
 * Philox4x32-10 of Salmon, Moraes, Dror & Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC 2011.
 */
#ifndef CES_RANDOM_H
#define CES_RANDOM_H

#include <stdint.h>

/* Encrypts counter (4) with key (2), in place, by ten rounds. */
static inline void ces_philox(uint32_t counter[4], uint32_t key_low, uint32_t key_high)
{
    for (int i = 0; i < 10; i++) {
        const uint64_t product_0 = UINT64_C(0xD2511F53) * counter[0];
        const uint64_t product_1 = UINT64_C(0xCD9E8D57) * counter[2];
        const uint32_t next_0 = (uint32_t)(product_1 >> 32) ^ counter[1] ^ key_low;
        const uint32_t next_2 = (uint32_t)(product_0 >> 32) ^ counter[3] ^ key_high;
        counter[0] = next_0;
        counter[1] = (uint32_t)product_1;
        counter[2] = next_2;
        counter[3] = (uint32_t)product_0;
        key_low += UINT32_C(0x9E3779B9);
        key_high += UINT32_C(0xBB67AE85);
    }
}

/* Uniform in [0, 1), a multiple of 2^-53. The key is the seed, the counter is (draw, stream, low and high half of id). */
static inline double ces_random(uint64_t seed, uint32_t stream, uint64_t id, uint32_t draw)
{
    uint32_t counter[4] = {draw, stream, (uint32_t)id, (uint32_t)(id >> 32)};
    ces_philox(counter, (uint32_t)seed, (uint32_t)(seed >> 32));
    const uint64_t bits = ((uint64_t)counter[0] << 32) | counter[1];
    return (double)(bits >> 11) * 0x1p-53;
}

#endif
