/*
 * contact/turns.h - assemblies and grains, solved by turns. A drum is heavy against the grains on it: it hardly moves by what they
 * do to it, while through it every grain would be one problem with every other. So where all grains in contact together weigh
 * little against what an assembly yields, its surfaces move as it is known to move, the islands stay as small as on a prescribed
 * machine, and its velocities follow from all their impulses, with its drives solved exactly; and so on until they stay. Each
 * turn gains at least the ratio of the masses. Other assemblies are bodies of their island (rigid_parts.h).
 */
#ifndef CES_TURNS_H
#define CES_TURNS_H

#include "../data/particles.h"
#include "mechanism.h"

enum { CES_MOST_TURNS = 20 };
#define CES_TURN_SHARE 0.1 /* of the tolerance: velocities that change by less stay */

/* Chooses the assemblies for which this holds, and makes their contacts those of surfaces that do not yield. */
void ces_turns_start(ces_Mechanism *mechanism, ces_Contacts *contacts, const ces_Surface *surfaces,
                     const ces_Particles *particles);
/* Velocities of their parts by the impulses of the contacts as they are, and of their surfaces in the contacts; gives the largest
 * change of the latter, m/s. */
double ces_turns_follow(ces_Mechanism *mechanism, ces_Contacts *contacts, const ces_Surface *surfaces);

#endif
