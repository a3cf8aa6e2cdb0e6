#include "mechanism_notes.h"

#include <math.h>

#include "../base/status.h"
#include "../base/vec3.h"

/* Twists and poses of an assembly's parts. */
void ces_gather_twists(const ces_Assembly *assembly, const ces_Motion *motions, double *twist)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        ces_copy(motions[assembly->parts[slot]].velocity, &twist[6 * slot]);
        ces_copy(motions[assembly->parts[slot]].spin, &twist[6 * slot + 3]);
    }
}

void ces_scatter_twists(const ces_Assembly *assembly, const double *twist, ces_Motion *motions)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        ces_copy(&twist[6 * slot], motions[assembly->parts[slot]].velocity);
        ces_copy(&twist[6 * slot + 3], motions[assembly->parts[slot]].spin);
    }
}

void ces_displace(const ces_Assembly *assembly, double factor, const double *twist, ces_Motion *motions)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        ces_Motion *motion = &motions[assembly->parts[slot]];
        double turn[3];
        ces_add_scaled(motion->position, factor, &twist[6 * slot]);
        for (int k = 0; k < 3; k++) {
            turn[k] = factor * twist[6 * slot + 3 + (uint32_t)k];
        }
        ces_turn(motion->orientation, turn);
    }
}

ces_Status ces_joint_broken(const ces_Mechanism *mechanism, uint32_t joint, double apart, ces_Error *error)
{
    return ces_fail(error, CES_DIVERGED,
                    "joint '%s' comes apart by %g m in a step; the state before the step is kept; a smaller step helps "
                    "where parts turn far in one",
                    mechanism->joints[joint].def.name, apart);
}

double ces_given_effort(const ces_Mechanism *mechanism, const ces_Drive *drive)
{
    return drive->kind == CES_MOTOR ? mechanism->states[drive->joint].motor : 0.0;
}

/* ---- what the joints give: their impulses of this step, added up --------------------------------------------------------- */

/* A row's impulse as a force and moment on a, about the anchor, added to the joint's. */
void ces_note_reaction(const ces_Joint *joint, const ces_Motion *a, const double row[CES_JOINT_WIDTH], double impulse,
                       ces_JointState *state)
{
    double anchor[3], arm[3], lever[3];
    ces_joint_anchor(joint, a, anchor);
    ces_subtract(anchor, a->position, arm);
    ces_cross(arm, row, lever);
    for (int k = 0; k < 3; k++) {
        state->force[k] += impulse * row[k];
        state->moment[k] += impulse * (row[3 + k] - lever[k]);
    }
}

/* A motor's row: its effort, and its work, since an impulse does the mean of its slip before and after. */
static void add_effort(const ces_Joint *joint, double impulse, double before, double after, ces_JointState *state)
{
    state->effort += impulse * ces_joint_scale(joint);
    state->work += 0.5 * impulse * (before + after);
}

/* impulse (rows): those of the rows as last linearised, at these poses. */
void ces_note_impulses(ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Motion *poses,
                       const double *impulse, const double *before, const double *after)
{
    const uint32_t width = ces_assembly_width(assembly);
    uint32_t row = 0, motor = assembly->joint_rows;
    for (uint32_t k = 0; k < assembly->joint_count; k++) {
        const ces_Joint *joint = &mechanism->joints[assembly->joints[k]];
        ces_JointState *state = &mechanism->next_states[assembly->joints[k]];
        const ces_Motion *a = ces_motion_of(poses, joint->def.part_a), *b = ces_motion_of(poses, joint->def.part_b);
        double rows[CES_JOINT_ROWS * CES_JOINT_WIDTH];
        ces_joint_rows(joint, a, b, NULL, rows);
        for (uint32_t r = 0; r < joint->rows; r++, row++) {
            ces_note_reaction(joint, a, &rows[r * CES_JOINT_WIDTH], impulse[row], state);
        }
        if (joint->free_motor) {
            double old = 0.0, new = 0.0;
            ces_joint_drive(joint, a, b, rows, NULL);
            ces_note_reaction(joint, a, rows, impulse[motor], state);
            for (uint32_t c = 0; c < width; c++) {
                old += assembly->jacobian[motor * width + c] * before[c];
                new += assembly->jacobian[motor * width + c] * after[c];
            }
            add_effort(joint, impulse[motor], old, new, state);
            motor++;
        }
    }
}

double ces_drive_slip(const ces_Drive *drive, const double *twist, uint32_t width)
{
    double sum = 0.0;
    for (uint32_t k = 0; k < width; k++) {
        sum += drive->jacobian[k] * twist[k];
    }
    return sum;
}

/* impulse: of the motor, at these poses, where its row was last written. */
void ces_note_motor(ces_Mechanism *mechanism, const ces_Drive *drive, const ces_Motion *poses, double impulse,
                    const double *before, const double *after)
{
    const uint32_t width = ces_assembly_width(&mechanism->assemblies[drive->assembly]);
    const ces_Joint *joint = &mechanism->joints[drive->joint];
    ces_JointState *state = &mechanism->next_states[drive->joint];
    const ces_Motion *a = ces_motion_of(poses, joint->def.part_a), *b = ces_motion_of(poses, joint->def.part_b);
    double row[CES_JOINT_WIDTH];
    ces_joint_drive(joint, a, b, row, NULL);
    ces_note_reaction(joint, a, row, impulse, state);
    add_effort(joint, impulse, ces_drive_slip(drive, before, width), ces_drive_slip(drive, after, width), state);
}
