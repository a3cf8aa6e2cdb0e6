/* contact/rigid_parts.h - dynamic parts of the machine as bodies of the cone problem. */
#ifndef CES_RIGID_PARTS_H
#define CES_RIGID_PARTS_H

#include "rigid.h"

/* Impulse and moment at the end of an arm, as one push about the centre of mass. */
void ces_gather_push(const double arm[3], const double impulse[3], const double moment[3], double push[6]);
/* What a push on a part does to its own velocities, as its joints let it. */
void ces_part_respond(const ces_Rigid *rigid, uint32_t part, const double push[6], double twist[6]);
/* A push on a part moves its whole assembly; sign: 1 or -1. */
void ces_push_part(const ces_Rigid *rigid, uint32_t part, double sign, const double push[6]);
void ces_push_drive(const ces_Rigid *rigid, const ces_Drive *drive, double change);
double ces_slip_drive(const ces_Rigid *rigid, const ces_Drive *drive); /* m/s */

#endif
