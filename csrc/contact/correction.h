/*
 * contact/correction.h - overlaps are taken back by moving the grains, never through their velocities: a velocity that
 * separates by Phi/h would stay in the motion, and grow as the step shrinks (docs/numerics.md 1).
 */
#ifndef CES_CORRECTION_H
#define CES_CORRECTION_H

#include "../data/machine.h"
#include "../data/particles.h"
#include "islands.h"

/* Separates the overlapping contacts of one island; surfaces are where they are at the end of the step. */
void ces_correct_island(const ces_Island *island, const ces_Islands *islands, const ces_Contacts *contacts,
                        const ces_Surface *surfaces, ces_Particles *particles);

#endif
