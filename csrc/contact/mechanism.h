/*
 * contact/mechanism.h - the dynamic parts of the machine and how they move in a step.
 *
 * Their free motion, that without contacts, is RATTLE (H. C. Andersen, J. Comput. Phys. 52 (1983) 24) with the free rotation of
 * data/shapes.h in its middle: second order, and its energy does not drift. Half a step of weight and joint impulses that
 * bring the joints together at the end of the step, the free motion, half a step of weight and joint impulses that make the
 * velocities fit. Contacts, motors with a limit and stops then act on the velocities at the end of the step; the pose follows
 * by half of their change, and the joints are brought together once more by moving, not by velocity.
 */
#ifndef CES_MECHANISM_H
#define CES_MECHANISM_H

#include "../data/contacts.h"
#include "../data/machine.h"
#include "assembly.h"

typedef enum ces_DriveKind { CES_MOTOR, CES_LOWER_STOP, CES_UPPER_STOP } ces_DriveKind;

/* A row of a joint that may give way: one block of the contact problem. */
typedef struct ces_Drive {
    ces_DriveKind kind;
    uint32_t joint, assembly;
    double *jacobian, *response; /* (width of the assembly): J, and A J' */
    double diagonal;             /* J A J', 1/kg; 0 where the joints hold it in this pose: then it is no row */
    double offset;               /* m/s, what its slip has besides the parts' motion */
    double least, most, impulse; /* N s */
} ces_Drive;

struct ces_Mechanism {
    ces_PartDef *parts;
    ces_Motion *now, *free, *next; /* at the start of the step, after the free motion, at the end */
    ces_Joint *joints;
    ces_JointState *states, *next_states;
    uint32_t *assembly_of, *slot; /* of a part: its assembly, and its place there */
    ces_Assembly *assemblies;
    ces_Drive *drives;
    uint32_t part_count, joint_count, assembly_count, drive_count;
    uint32_t redundant_rows;
    double gravity[3];      /* m/s2 */
    double lag;             /* m/s, by which the surfaces of the step still moved when its turns ended: turns.h */
    double drift;           /* m, by how far a joint is apart at the end of the step */
    void *memory, *numbers; /* what all this lives in */
};

typedef struct ces_MechanismDef {
    const ces_PartDef *parts;
    const ces_JointDef *joints;
    size_t part_count, joint_count;
    double gravity[3];
} ces_MechanismDef;

/* All or nothing; no parts: nothing at all. */
ces_Status ces_mechanism_create(ces_Mechanism *mechanism, const ces_MechanismDef *def, ces_Error *error);
void ces_mechanism_free(ces_Mechanism *mechanism);

/* The free motion of a step: now to free. */
ces_Status ces_mechanism_fly(ces_Mechanism *mechanism, double time, double step, ces_Error *error);
/* What the contact problem needs of the assemblies that take part in it. */
void ces_mechanism_prepare(ces_Mechanism *mechanism, double time, double step, const ces_Contacts *contacts);
/* Lets the impulses of contacts and drives act: free to next. */
ces_Status ces_mechanism_finish(ces_Mechanism *mechanism, double step, const ces_Contacts *contacts,
                                const ces_Surface *surfaces, ces_Error *error);
/* next becomes now. */
void ces_mechanism_commit(ces_Mechanism *mechanism);
double ces_mechanism_energy(const ces_Mechanism *mechanism); /* J, kinetic, now */

static inline const ces_Motion *ces_motion_of(const ces_Motion *motions, int32_t part)
{
    return part < 0 ? &ces_ground : &motions[part];
}

#endif
