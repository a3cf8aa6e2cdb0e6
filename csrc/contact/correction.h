/*
 * contact/correction.h - overlaps are taken back by moving the grains, never through their velocities: a velocity that
 * separates by Phi/h would stay in the motion, and grow as the step shrinks (docs/numerics.md 1).
 */
#ifndef CES_CORRECTION_H
#define CES_CORRECTION_H

#include "../data/machine.h"
#include "../data/particles.h"
#include "../data/shapes.h"
#include "islands.h"

typedef struct ces_CorrectionInput {
    const ces_Islands *islands;
    const ces_Contacts *contacts;
    const ces_Surface *surfaces; /* where they are at the end of the step */
    const ces_Shape *shapes;
    bool rotation;
    ces_Particles *particles;
    uint32_t *moved_in; /* (rows), scratch: the sweep in which a grain was moved last */
} ces_CorrectionInput;

/* Separates the overlapping contacts of one island. */
void ces_correct_island(const ces_CorrectionInput *input, const ces_Island *island);

#endif
