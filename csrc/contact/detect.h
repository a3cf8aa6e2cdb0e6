/*
 * contact/detect.h - from where the grains are and would freely go, to the contacts of the step.
 *
 * A contact is taken in when the free paths meet, or pass nearer than the contacts of this very step may push the grains
 * aside: so nothing passes through, and nothing bounces off air.
 */
#ifndef CES_DETECT_H
#define CES_DETECT_H

#include "../data/contacts.h"
#include "../data/machine.h"
#include "../data/particles.h"
#include "broad_phase.h"

/* Coefficients of every pair: grain-grain (materials, materials), grain-surface (surfaces, materials). */
typedef struct ces_PairTable {
    size_t material_count;
    const double *grain_friction, *grain_restitution, *grain_rolling;
    const double *surface_friction, *surface_restitution, *surface_rolling;
} ces_PairTable;

typedef struct ces_DetectInput {
    const ces_Particles *particles;
    size_t count;                /* rows, those of this step's births too */
    const double *displacement;  /* m, (count, 3): in the step, if nothing is in the way */
    const double *free_velocity; /* m/s, (count, 3): at the end of the step, if nothing is in the way */
    const ces_Surface *surfaces;
    size_t surface_count;
    const ces_PairTable *table;
    double step;             /* s */
    double gravity;          /* m/s2 */
    double most_restitution; /* of all pairs */
    bool grain_contact;
    int threads;
} ces_DetectInput;

typedef struct ces_Detector {
    ces_Grid grid;
    ces_Pool boxes, reach, pair_candidates, surface_counts, surface_candidates;
} ces_Detector;

bool ces_detect(ces_Detector *detector, const ces_DetectInput *input,
                ces_Contacts *contacts); /* false: out of memory */
void ces_detector_free(ces_Detector *detector);

#endif
