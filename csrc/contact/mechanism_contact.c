/* contact/mechanism_contact.c - what contacts, motors with a limit and stops make of the free motion. */
#include "mechanism_notes.h"

#include <math.h>
#include <string.h>

#include "../base/vec3.h"

/* ---- rows that may give way ------------------------------------------------------------------------------------------------ */

/* Below this share of what the bare parts would yield, the joints hold the row. */
#define HELD 1e-10

static void prepare_drive(ces_Mechanism *mechanism, ces_Drive *drive, double time, double step)
{
    const ces_Joint *joint = &mechanism->joints[drive->joint];
    const ces_JointState *state = &mechanism->states[drive->joint];
    ces_Assembly *assembly = &mechanism->assemblies[drive->assembly];
    const uint32_t width = ces_assembly_width(assembly);
    const double scale = ces_joint_scale(joint);
    double row[CES_JOINT_WIDTH], bare = 0.0;
    ces_joint_drive(joint, ces_motion_of(mechanism->free, joint->def.part_a),
                    ces_motion_of(mechanism->free, joint->def.part_b), row, NULL);
    ces_assembly_spread(mechanism, assembly, joint, row, drive->jacobian);
    ces_assembly_free_response(mechanism, assembly, drive->jacobian, drive->response);
    for (uint32_t k = 0; k < width; k++) {
        bare += drive->jacobian[k] * drive->response[k];
    }
    ces_assembly_constrain(assembly, drive->response, assembly->impulse);
    drive->diagonal = 0.0;
    for (uint32_t k = 0; k < width; k++) {
        drive->diagonal += drive->jacobian[k] * drive->response[k];
    }
    drive->diagonal = drive->diagonal > HELD * bare ? drive->diagonal : 0.0;
    drive->least = drive->kind == CES_LOWER_STOP ? 0.0 : -HUGE_VAL;
    drive->most = drive->kind == CES_UPPER_STOP ? 0.0 : HUGE_VAL;
    switch (drive->kind) {
    case CES_MOTOR:
        drive->offset = -scale * ces_law_at(joint, time + step);
        drive->most = joint->def.limit * step / scale - ces_given_effort(mechanism, drive);
        drive->least = -joint->def.limit * step / scale - ces_given_effort(mechanism, drive);
        drive->impulse = 0.0;
        break;
    case CES_LOWER_STOP: /* it may be closed within the step, and no more */
        drive->offset = scale * (state->travel - joint->def.least_travel) / step;
        drive->impulse = state->lower;
        break;
    case CES_UPPER_STOP:
        drive->offset = scale * (state->travel - joint->def.most_travel) / step;
        drive->impulse = state->upper;
        break;
    }
    if (drive->diagonal == 0.0) {
        drive->impulse = 0.0;
    }
}

void ces_mechanism_prepare(ces_Mechanism *mechanism, double time, double step, const ces_Contacts *contacts)
{
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        mechanism->assemblies[i].by_turns = false;
    }
    mechanism->lag = 0.0;
    for (uint32_t d = 0; d < mechanism->drive_count; d++) {
        prepare_drive(mechanism, &mechanism->drives[d], time, step);
    }
    for (size_t k = contacts->pair_count; mechanism->assembly_count > 0 && k < contacts->count; k++) {
        const uint32_t part = contacts->list[k].carrier;
        if (part != CES_NO_PART) {
            ces_Assembly *assembly = &mechanism->assemblies[mechanism->assembly_of[part]];
            if (!assembly->ready) {
                ces_assembly_fill_mobility(mechanism, assembly);
            }
        }
    }
}

/* ---- the end of the step --------------------------------------------------------------------------------------------------- */

/* What the contacts push the parts by; arms from the centres of mass. */
void ces_gather_contacts(ces_Mechanism *mechanism, const ces_Contacts *contacts, const ces_Surface *surfaces)
{
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        ces_Assembly *assembly = &mechanism->assemblies[i];
        memset(assembly->push, 0, ces_assembly_width(assembly) * sizeof *assembly->push);
    }
    for (size_t k = contacts->pair_count; k < contacts->count; k++) {
        const ces_Contact *contact = &contacts->list[k];
        const int32_t part = surfaces[contact->b].def.part;
        if (part < 0) {
            continue;
        }
        double *push = &mechanism->assemblies[mechanism->assembly_of[part]].push[6 * mechanism->slot[part]];
        double turn[3], roll[3];
        ces_cross(contact->arm_b, contact->impulse, turn);
        ces_cross(contact->normal, contact->roll_impulse, roll);
        for (int axis = 0; axis < 3; axis++) {
            push[axis] -= contact->impulse[axis];
            push[3 + axis] -=
                turn[axis] + contact->rolling_radius * (roll[axis] + contact->spin_impulse * contact->normal[axis]);
        }
    }
}

/* Brings the joints together by moving the parts, each by its mass; and back to a stop what went beyond it. */
static double gather_joints(ces_Mechanism *mechanism, ces_Assembly *assembly, uint32_t *joint)
{
    const uint32_t width = ces_assembly_width(assembly);
    double *twist = assembly->push, worst = 0.0, last = HUGE_VAL;
    for (int round = 0; round < CES_MECHANISM_ROUNDS; round++) {
        worst = ces_assembly_apart(mechanism, assembly, mechanism->next, assembly->apart, joint);
        memset(twist, 0, width * sizeof *twist);
        for (uint32_t r = assembly->joint_rows; r < assembly->rows; r++) {
            assembly->apart[r] = 0.0;
        }
        double beyond = 0.0;
        for (uint32_t d = assembly->first_drive; d < assembly->first_drive + assembly->drive_count; d++) {
            const ces_Drive *drive = &mechanism->drives[d];
            const ces_Joint *held = &mechanism->joints[drive->joint];
            double travel;
            if (drive->kind == CES_MOTOR || drive->diagonal == 0.0) {
                continue;
            }
            ces_joint_drive(held, ces_motion_of(mechanism->next, held->def.part_a),
                            ces_motion_of(mechanism->next, held->def.part_b), NULL, &travel);
            travel = ces_joint_unwind(held, travel, mechanism->next_states[drive->joint].travel);
            const double past = drive->kind == CES_LOWER_STOP ? ces_min(0.0, travel - held->def.least_travel)
                                                              : ces_max(0.0, travel - held->def.most_travel);
            const double size = ces_joint_scale(held) * past;
            beyond = ces_max(beyond, fabs(size));
            for (uint32_t k = 0; k < width; k++) {
                twist[k] -= size / drive->diagonal * drive->response[k];
            }
        }
        worst = ces_max(worst, beyond);
        const bool resting = !(worst < 0.5 * last) && worst <= CES_JOINT_ROUNDING * assembly->size;
        if (worst <= CES_JOINT_CLOSE * assembly->size || resting || !isfinite(worst)) {
            break;
        }
        last = worst;
        ces_assembly_solve(assembly, assembly->apart, assembly->more);
        for (uint32_t r = 0; r < assembly->rows; r++) {
            assembly->more[r] = -assembly->more[r];
        }
        ces_assembly_push(assembly, assembly->more, twist);
        ces_displace(assembly, 1.0, twist, mechanism->next);
    }
    return worst;
}

static void note_drives(ces_Mechanism *mechanism, const ces_Assembly *assembly, double step, const double *before,
                        const double *after)
{
    for (uint32_t d = assembly->first_drive; d < assembly->first_drive + assembly->drive_count; d++) {
        const ces_Drive *drive = &mechanism->drives[d];
        const ces_Joint *joint = &mechanism->joints[drive->joint];
        ces_JointState *state = &mechanism->next_states[drive->joint];
        if (drive->kind == CES_MOTOR) {
            const double limit = joint->def.limit * step / ces_joint_scale(joint);
            ces_note_motor(mechanism, drive, mechanism->free, drive->impulse, before, after);
            state->motor = drive->diagonal == 0.0 ? 0.0 : ces_given_effort(mechanism, drive) + drive->impulse;
            state->at_limit = fabs(state->motor) >= limit * (1.0 - 1e-12) ? 1.0 : 0.0;
            continue;
        }
        const ces_Motion *a = ces_motion_of(mechanism->free, joint->def.part_a);
        double row[CES_JOINT_WIDTH];
        ces_joint_drive(joint, a, ces_motion_of(mechanism->free, joint->def.part_b), row, NULL);
        ces_note_reaction(joint, a, row, drive->impulse, state);
        *(drive->kind == CES_LOWER_STOP ? &state->lower : &state->upper) = drive->impulse;
    }
}

/* Where the joints' free motion is now. */
static void note_travel(ces_Mechanism *mechanism, double step)
{
    for (uint32_t j = 0; j < mechanism->joint_count; j++) {
        const ces_Joint *joint = &mechanism->joints[j];
        ces_JointState *state = &mechanism->next_states[j];
        if (joint->def.kind != CES_REVOLUTE && joint->def.kind != CES_PRISMATIC) {
            continue;
        }
        const ces_Motion *a = ces_motion_of(mechanism->next, joint->def.part_a),
                         *b = ces_motion_of(mechanism->next, joint->def.part_b);
        double row[CES_JOINT_WIDTH], seen, slip;
        ces_joint_drive(joint, a, b, row, &seen);
        slip = ces_dot(&row[0], a->velocity) + ces_dot(&row[3], a->spin) + ces_dot(&row[6], b->velocity) +
               ces_dot(&row[9], b->spin);
        const double speed = slip / ces_joint_scale(joint);
        state->travel = ces_joint_unwind(joint, seen, state->travel + 0.5 * step * (state->speed + speed));
        state->speed = speed;
        state->energy += state->work;
        state->impulse += state->effort;
    }
}

ces_Status ces_mechanism_finish(ces_Mechanism *mechanism, double step, const ces_Contacts *contacts,
                                const ces_Surface *surfaces, ces_Error *error)
{
    mechanism->drift = 0.0;
    if (mechanism->assembly_count == 0) {
        return CES_OK;
    }
    ces_gather_contacts(mechanism, contacts, surfaces);
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        ces_Assembly *assembly = &mechanism->assemblies[i];
        const uint32_t width = ces_assembly_width(assembly);
        double *change = assembly->twist;
        double *before = assembly->mobility; /* it has served: its first rows are room for two twists */
        double *after = before + width;
        uint32_t joint = 0;
        for (uint32_t d = assembly->first_drive; d < assembly->first_drive + assembly->drive_count; d++) {
            const ces_Drive *drive = &mechanism->drives[d];
            for (uint32_t k = 0; k < width; k++) {
                assembly->push[k] += drive->impulse * drive->jacobian[k];
            }
        }
        ces_assembly_free_response(mechanism, assembly, assembly->push, change);
        ces_assembly_constrain(assembly, change, assembly->impulse);
        ces_gather_twists(assembly, mechanism->free, before);
        for (uint32_t k = 0; k < width; k++) {
            after[k] = before[k] + change[k];
        }
        ces_note_impulses(mechanism, assembly, mechanism->free, assembly->impulse, before, after);
        note_drives(mechanism, assembly, step, before, after);
        for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
            mechanism->next[assembly->parts[slot]] = mechanism->free[assembly->parts[slot]];
        }
        ces_scatter_twists(assembly, after, mechanism->next);
        ces_displace(assembly, 0.5 * step, change, mechanism->next);
        const double apart = gather_joints(mechanism, assembly, &joint);
        mechanism->drift = ces_max(mechanism->drift, apart);
        if (!(apart <= CES_JOINT_BROKEN * assembly->size)) {
            return ces_joint_broken(mechanism, joint, apart, error);
        }
    }
    note_travel(mechanism, step);
    return CES_OK;
}

void ces_mechanism_commit(ces_Mechanism *mechanism)
{
    for (uint32_t p = 0; p < mechanism->part_count; p++) {
        mechanism->now[p] = mechanism->next[p];
    }
    for (uint32_t j = 0; j < mechanism->joint_count; j++) {
        mechanism->states[j] = mechanism->next_states[j];
    }
}

double ces_mechanism_energy(const ces_Mechanism *mechanism)
{
    double energy = 0.0;
    for (uint32_t p = 0; p < mechanism->part_count; p++) {
        const ces_Motion *motion = &mechanism->now[p];
        const ces_PartDef *part = &mechanism->parts[p];
        double own[3];
        ces_rotate_back(motion->orientation, motion->spin, own);
        energy += 0.5 * part->mass * ces_dot(motion->velocity, motion->velocity);
        for (int k = 0; k < 3; k++) {
            energy += 0.5 * part->inertia[k] * own[k] * own[k];
        }
    }
    return energy;
}
