#include "mechanism.h"

#include <math.h>
#include <string.h>

#include "../base/status.h"
#include "../base/vec3.h"
#include "../data/shapes.h"

enum { ROUNDS = 60 };
/* Shares of an assembly's size, by which its joints may be apart: aimed at, put up with where rounding allows no better, and
 * too far. */
#define CLOSE 1e-15
#define ROUNDING 1e-12
#define BROKEN 1e-9

/* Twists and poses of an assembly's parts. */
static void gather(const ces_Assembly *assembly, const ces_Motion *motions, double *twist)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        ces_copy(motions[assembly->parts[slot]].velocity, &twist[6 * slot]);
        ces_copy(motions[assembly->parts[slot]].spin, &twist[6 * slot + 3]);
    }
}

static void scatter(const ces_Assembly *assembly, const double *twist, ces_Motion *motions)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        ces_copy(&twist[6 * slot], motions[assembly->parts[slot]].velocity);
        ces_copy(&twist[6 * slot + 3], motions[assembly->parts[slot]].spin);
    }
}

static void displace(const ces_Assembly *assembly, double factor, const double *twist, ces_Motion *motions)
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

static void fall(const ces_Mechanism *mechanism, const ces_Assembly *assembly, double time, double *twist)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        ces_add_scaled(&twist[6 * slot], time, mechanism->gravity);
    }
}

/* ---- what the joints give: their impulses of this step, added up --------------------------------------------------------- */

/* A row's impulse as a force and moment on a, about the anchor, added to the joint's. */
static void add_reaction(const ces_Joint *joint, const ces_Motion *a, const double row[CES_JOINT_WIDTH], double impulse,
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
static void note_impulses(ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Motion *poses,
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
            add_reaction(joint, a, &rows[r * CES_JOINT_WIDTH], impulse[row], state);
        }
        if (joint->free_motor) {
            double old = 0.0, new = 0.0;
            ces_joint_drive(joint, a, b, rows, NULL);
            add_reaction(joint, a, rows, impulse[motor], state);
            for (uint32_t c = 0; c < width; c++) {
                old += assembly->jacobian[motor * width + c] * before[c];
                new += assembly->jacobian[motor * width + c] * after[c];
            }
            add_effort(joint, impulse[motor], old, new, state);
            motor++;
        }
    }
}

/* Motors with a limit go on with the impulse of the step before, half of it at each end of the free motion: so their steady
 * effort is as accurate as weight. The contact problem finds what is to be changed of it. */
static double given_effort(const ces_Mechanism *mechanism, const ces_Drive *drive)
{
    return drive->kind == CES_MOTOR ? mechanism->states[drive->joint].motor : 0.0;
}

static void push_motors(const ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Motion *poses,
                        double *twist)
{
    for (uint32_t d = assembly->first_drive; d < assembly->first_drive + assembly->drive_count; d++) {
        const ces_Drive *drive = &mechanism->drives[d];
        const ces_Joint *joint = &mechanism->joints[drive->joint];
        double row[CES_JOINT_WIDTH];
        if (drive->kind != CES_MOTOR) {
            continue;
        }
        ces_joint_drive(joint, ces_motion_of(poses, joint->def.part_a), ces_motion_of(poses, joint->def.part_b), row,
                        NULL);
        ces_assembly_spread(mechanism, assembly, joint, row, drive->jacobian);
        ces_assembly_free_response(mechanism, assembly, drive->jacobian, drive->response);
        for (uint32_t k = 0; k < ces_assembly_width(assembly); k++) {
            twist[k] += 0.5 * given_effort(mechanism, drive) * drive->response[k];
        }
    }
}

static double along(const ces_Drive *drive, const double *twist, uint32_t width)
{
    double sum = 0.0;
    for (uint32_t k = 0; k < width; k++) {
        sum += drive->jacobian[k] * twist[k];
    }
    return sum;
}

/* impulse: of the motor, at these poses, where its row was last written. */
static void note_motor(ces_Mechanism *mechanism, const ces_Drive *drive, const ces_Motion *poses, double impulse,
                       const double *before, const double *after)
{
    const uint32_t width = ces_assembly_width(&mechanism->assemblies[drive->assembly]);
    const ces_Joint *joint = &mechanism->joints[drive->joint];
    ces_JointState *state = &mechanism->next_states[drive->joint];
    const ces_Motion *a = ces_motion_of(poses, joint->def.part_a), *b = ces_motion_of(poses, joint->def.part_b);
    double row[CES_JOINT_WIDTH];
    ces_joint_drive(joint, a, b, row, NULL);
    add_reaction(joint, a, row, impulse, state);
    add_effort(joint, impulse, along(drive, before, width), along(drive, after, width), state);
}

static void note_motors(ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Motion *poses,
                        const double *before, const double *after)
{
    for (uint32_t d = assembly->first_drive; d < assembly->first_drive + assembly->drive_count; d++) {
        const ces_Drive *drive = &mechanism->drives[d];
        if (drive->kind == CES_MOTOR) {
            note_motor(mechanism, drive, poses, 0.5 * given_effort(mechanism, drive), before, after);
        }
    }
}

/* ---- the free motion ------------------------------------------------------------------------------------------------------- */

/* Half a step's velocities carry the poses through the whole of it; a free body keeps its angular momentum. */
static void drift(const ces_Mechanism *mechanism, const ces_Assembly *assembly, double step, const double *twist)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        const uint32_t part = assembly->parts[slot];
        ces_Motion *to = &mechanism->free[part];
        *to = mechanism->now[part];
        ces_copy(&twist[6 * slot], to->velocity);
        ces_copy(&twist[6 * slot + 3], to->spin);
        ces_add_scaled(to->position, step, to->velocity);
        ces_rotate_freely(mechanism->parts[part].inertia, step, to->orientation, to->spin);
    }
}

/* By how much the rows of motors without a limit miss their law over the step, m. */
static double motor_lag(const ces_Mechanism *mechanism, const ces_Assembly *assembly, double time, double step,
                        const double *twist, double *lag)
{
    const uint32_t width = ces_assembly_width(assembly);
    uint32_t row = assembly->joint_rows;
    double worst = 0.0;
    for (uint32_t k = 0; k < assembly->joint_count; k++) {
        const ces_Joint *joint = &mechanism->joints[assembly->joints[k]];
        if (!joint->free_motor) {
            continue;
        }
        double slip = 0.0;
        for (uint32_t c = 0; c < width; c++) {
            slip += assembly->jacobian[row * width + c] * twist[c];
        }
        lag[row] = step * slip - ces_joint_scale(joint) * ces_law_between(joint, time, time + step);
        worst = ces_max(worst, fabs(lag[row++]));
    }
    return worst;
}

static ces_Status broken(const ces_Mechanism *mechanism, uint32_t joint, double apart, ces_Error *error)
{
    return ces_fail(error, CES_DIVERGED,
                    "joint '%s' comes apart by %g m in a step; the state before the step is kept; a smaller step helps "
                    "where parts turn far in one",
                    mechanism->joints[joint].def.name, apart);
}

/* Joint impulses at the start of the step that bring the joints together at its end. Newton's iteration with the matrix of the
 * start: it gains by the angle that the parts turn in the step. */
static ces_Status fly_to_end(ces_Mechanism *mechanism, ces_Assembly *assembly, double time, double step,
                             ces_Error *error)
{
    const uint32_t width = ces_assembly_width(assembly);
    double *twist = assembly->twist, *total = assembly->impulse, *before = assembly->push;
    double worst = 0.0, last = HUGE_VAL;
    uint32_t joint = assembly->joint_count > 0 ? assembly->joints[0] : 0;
    gather(assembly, mechanism->now, before);
    memcpy(twist, before, width * sizeof *twist);
    fall(mechanism, assembly, 0.5 * step, twist);
    push_motors(mechanism, assembly, mechanism->now, twist);
    memset(total, 0, assembly->rows * sizeof *total);
    for (int round = 0; round < ROUNDS; round++) {
        drift(mechanism, assembly, step, twist);
        worst = ces_assembly_apart(mechanism, assembly, mechanism->free, assembly->apart, &joint);
        worst = ces_max(worst, motor_lag(mechanism, assembly, time, step, twist, assembly->apart));
        const bool resting = !(worst < 0.5 * last) && worst <= ROUNDING * assembly->size;
        if (worst <= CLOSE * assembly->size || resting || !isfinite(worst)) {
            break;
        }
        last = worst;
        ces_assembly_solve(assembly, assembly->apart, assembly->more);
        for (uint32_t r = 0; r < assembly->rows; r++) {
            assembly->more[r] /= -step;
            total[r] += assembly->more[r];
        }
        ces_assembly_push(assembly, assembly->more, twist);
    }
    if (!(worst <= BROKEN * assembly->size)) {
        return broken(mechanism, joint, worst, error);
    }
    note_impulses(mechanism, assembly, mechanism->now, total, before, twist);
    note_motors(mechanism, assembly, mechanism->now, before, twist);
    return CES_OK;
}

/* Joint impulses at the end of the step that make the velocities fit there, and motors keep their law. */
static void fit_velocities(ces_Mechanism *mechanism, ces_Assembly *assembly, double time, double step)
{
    const uint32_t width = ces_assembly_width(assembly);
    double *twist = assembly->twist, *total = assembly->impulse, *before = assembly->push;
    ces_assembly_linearise(mechanism, assembly, mechanism->free);
    gather(assembly, mechanism->free, before);
    memcpy(twist, before, width * sizeof *twist);
    fall(mechanism, assembly, 0.5 * step, twist);
    push_motors(mechanism, assembly, mechanism->free, twist);
    memset(total, 0, assembly->rows * sizeof *total);
    for (int round = 0; round < 2 && assembly->rows > 0; round++) {
        uint32_t motor = assembly->joint_rows;
        ces_assembly_slip(assembly, twist, assembly->more);
        for (uint32_t k = 0; k < assembly->joint_count; k++) {
            const ces_Joint *joint = &mechanism->joints[assembly->joints[k]];
            if (joint->free_motor) {
                assembly->more[motor++] -= ces_joint_scale(joint) * ces_law_at(joint, time + step);
            }
        }
        ces_assembly_solve(assembly, assembly->more, assembly->more);
        for (uint32_t r = 0; r < assembly->rows; r++) {
            assembly->more[r] = -assembly->more[r];
            total[r] += assembly->more[r];
        }
        ces_assembly_push(assembly, assembly->more, twist);
    }
    note_impulses(mechanism, assembly, mechanism->free, total, before, twist);
    note_motors(mechanism, assembly, mechanism->free, before, twist);
    scatter(assembly, twist, mechanism->free);
}

ces_Status ces_mechanism_fly(ces_Mechanism *mechanism, double time, double step, ces_Error *error)
{
    for (uint32_t j = 0; j < mechanism->joint_count; j++) {
        const ces_JointState *state = &mechanism->states[j];
        mechanism->next_states[j] = (ces_JointState){.travel = state->travel,
                                                     .speed = state->speed,
                                                     .energy = state->energy,
                                                     .motor = state->motor,
                                                     .lower = state->lower,
                                                     .upper = state->upper};
    }
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        ces_Assembly *assembly = &mechanism->assemblies[i];
        ces_assembly_linearise(mechanism, assembly, mechanism->now);
        const ces_Status status = fly_to_end(mechanism, assembly, time, step, error);
        if (status != CES_OK) {
            return status;
        }
        fit_velocities(mechanism, assembly, time, step);
        for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
            const ces_Motion *motion = &mechanism->free[assembly->parts[slot]];
            if (!(ces_norm(motion->position) + ces_norm(motion->velocity) + ces_norm(motion->spin) <= 1e6)) {
                return ces_fail(error, CES_DIVERGED, "part '%s' is lost: it moves at %g m/s",
                                mechanism->parts[assembly->parts[slot]].name, ces_norm(motion->velocity));
            }
        }
    }
    return CES_OK;
}

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
        drive->most = joint->def.limit * step / scale - given_effort(mechanism, drive);
        drive->least = -joint->def.limit * step / scale - given_effort(mechanism, drive);
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
    for (uint32_t d = 0; d < mechanism->drive_count; d++) {
        prepare_drive(mechanism, &mechanism->drives[d], time, step);
    }
    for (size_t k = contacts->pair_count; k < contacts->count; k++) {
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

/* What the contacts push the parts by; arms from the centres of mass. False where none does. */
static bool gather_contacts(ces_Mechanism *mechanism, const ces_Contacts *contacts, const ces_Surface *surfaces)
{
    bool any = false;
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
        any = true;
    }
    return any;
}

/* Brings the joints together by moving the parts, each by its mass; and back to a stop what went beyond it. */
static double gather_joints(ces_Mechanism *mechanism, ces_Assembly *assembly, uint32_t *joint)
{
    const uint32_t width = ces_assembly_width(assembly);
    double *twist = assembly->push, worst = 0.0, last = HUGE_VAL;
    for (int round = 0; round < ROUNDS; round++) {
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
        const bool resting = !(worst < 0.5 * last) && worst <= ROUNDING * assembly->size;
        if (worst <= CLOSE * assembly->size || resting || !isfinite(worst)) {
            break;
        }
        last = worst;
        ces_assembly_solve(assembly, assembly->apart, assembly->more);
        for (uint32_t r = 0; r < assembly->rows; r++) {
            assembly->more[r] = -assembly->more[r];
        }
        ces_assembly_push(assembly, assembly->more, twist);
        displace(assembly, 1.0, twist, mechanism->next);
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
            note_motor(mechanism, drive, mechanism->free, drive->impulse, before, after);
            state->motor = drive->diagonal == 0.0 ? 0.0 : given_effort(mechanism, drive) + drive->impulse;
            state->at_limit = fabs(state->motor) >= limit * (1.0 - 1e-12) ? 1.0 : 0.0;
            continue;
        }
        const ces_Motion *a = ces_motion_of(mechanism->free, joint->def.part_a);
        double row[CES_JOINT_WIDTH];
        ces_joint_drive(joint, a, ces_motion_of(mechanism->free, joint->def.part_b), row, NULL);
        add_reaction(joint, a, row, drive->impulse, state);
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
    }
}

ces_Status ces_mechanism_finish(ces_Mechanism *mechanism, double step, const ces_Contacts *contacts,
                                const ces_Surface *surfaces, ces_Error *error)
{
    gather_contacts(mechanism, contacts, surfaces);
    mechanism->drift = 0.0;
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
        gather(assembly, mechanism->free, before);
        for (uint32_t k = 0; k < width; k++) {
            after[k] = before[k] + change[k];
        }
        note_impulses(mechanism, assembly, mechanism->free, assembly->impulse, before, after);
        note_drives(mechanism, assembly, step, before, after);
        for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
            mechanism->next[assembly->parts[slot]] = mechanism->free[assembly->parts[slot]];
        }
        scatter(assembly, after, mechanism->next);
        displace(assembly, 0.5 * step, change, mechanism->next);
        const double apart = gather_joints(mechanism, assembly, &joint);
        mechanism->drift = ces_max(mechanism->drift, apart);
        if (!(apart <= BROKEN * assembly->size)) {
            return broken(mechanism, joint, apart, error);
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
