/* contact/mechanism_notes.h - what the files of the mechanism share: twists as lists, and what the joints gave in the step. */
#ifndef CES_MECHANISM_NOTES_H
#define CES_MECHANISM_NOTES_H

#include "mechanism.h"

enum { CES_MECHANISM_ROUNDS = 60 };
/* Shares of an assembly's size by which its joints may be apart: aimed at, put up with where rounding allows no better, and
 * too far. */
#define CES_JOINT_CLOSE 1e-15
#define CES_JOINT_ROUNDING 1e-12
#define CES_JOINT_BROKEN 1e-9

/* Velocities of an assembly's parts, and poses, as one list and back. */
void ces_gather_twists(const ces_Assembly *assembly, const ces_Motion *motions, double *twist);
void ces_scatter_twists(const ces_Assembly *assembly, const double *twist, ces_Motion *motions);
/* Moves and turns its parts by factor times a twist. */
void ces_displace(const ces_Assembly *assembly, double factor, const double *twist, ces_Motion *motions);
/* CES_DIVERGED: the joint is apart. */
ces_Status ces_joint_broken(const ces_Mechanism *mechanism, uint32_t joint, double apart, ces_Error *error);
/* A row's impulse as a force and moment on a, about the anchor, added to the joint's. */
void ces_note_reaction(const ces_Joint *joint, const ces_Motion *a, const double row[CES_JOINT_WIDTH], double impulse,
                       ces_JointState *state);
/* impulse (rows): those of the rows as last linearised, at these poses; before and after: the parts' twists. */
void ces_note_impulses(ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Motion *poses,
                       const double *impulse, const double *before, const double *after);
/* The impulse of a motor with a limit at these poses, where its row was last written. */
void ces_note_motor(ces_Mechanism *mechanism, const ces_Drive *drive, const ces_Motion *poses, double impulse,
                    const double *before, const double *after);
/* m/s, of the row alone. */
double ces_drive_slip(const ces_Drive *drive, const double *twist, uint32_t width);
/* N s, what a motor with a limit goes on with; 0 for stops. */
double ces_given_effort(const ces_Mechanism *mechanism, const ces_Drive *drive);

/* What the contacts push the parts by, into push of the assemblies; arms from the centres of mass. */
void ces_gather_contacts(ces_Mechanism *mechanism, const ces_Contacts *contacts, const ces_Surface *surfaces);

#endif
