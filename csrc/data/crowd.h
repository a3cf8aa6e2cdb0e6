/* data/crowd.h - all grains at once, for what makes the force on one depend on where the others are. */
#ifndef CES_CROWD_H
#define CES_CROWD_H

#include "../base/memory.h"

/* At the middle of their free paths. */
typedef struct ces_Crowd {
    size_t count;
    const double *position; /* m (count, 3) */
    const double *charge;   /* C (count) */
    const double *diameter; /* m (count) */
    uint64_t step;          /* index of the step; it may choose a sample */
    int threads;
} ces_Crowd;

/* What a method left of the exact forces, over a sample of grains: the root of the ratio is its relative error. */
typedef struct ces_CrowdError {
    double defect, force; /* N2, sums of squares */
} ces_CrowdError;

enum { CES_CROWD_POOLS = 16 }; /* of memory that is kept from step to step */

#endif
