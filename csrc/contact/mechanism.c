#include "mechanism_notes.h"

#include <math.h>
#include <string.h>

#include "../base/status.h"
#include "../base/vec3.h"
#include "../data/shapes.h"

static void fall(const ces_Mechanism *mechanism, const ces_Assembly *assembly, double time, double *twist)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        ces_add_scaled(&twist[6 * slot], time, mechanism->gravity);
    }
}

/* Motors with a limit go on with the impulse of the step before, half of it at each end of the free motion: so their steady
 * effort is as accurate as weight. The contact problem finds what is to be changed of it. */
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
            twist[k] += 0.5 * ces_given_effort(mechanism, drive) * drive->response[k];
        }
    }
}

static void note_motors(ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Motion *poses,
                        const double *before, const double *after)
{
    for (uint32_t d = assembly->first_drive; d < assembly->first_drive + assembly->drive_count; d++) {
        const ces_Drive *drive = &mechanism->drives[d];
        if (drive->kind == CES_MOTOR) {
            ces_note_motor(mechanism, drive, poses, 0.5 * ces_given_effort(mechanism, drive), before, after);
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

/* Joint impulses at the start of the step that bring the joints together at its end. Newton's iteration with the matrix of the
 * start: it gains by the angle that the parts turn in the step. */
static ces_Status fly_to_end(ces_Mechanism *mechanism, ces_Assembly *assembly, double time, double step,
                             ces_Error *error)
{
    const uint32_t width = ces_assembly_width(assembly);
    double *twist = assembly->twist, *total = assembly->impulse, *before = assembly->push;
    double worst = 0.0, last = HUGE_VAL;
    uint32_t joint = assembly->joint_count > 0 ? assembly->joints[0] : 0;
    ces_gather_twists(assembly, mechanism->now, before);
    memcpy(twist, before, width * sizeof *twist);
    fall(mechanism, assembly, 0.5 * step, twist);
    push_motors(mechanism, assembly, mechanism->now, twist);
    memset(total, 0, assembly->rows * sizeof *total);
    for (int round = 0; round < CES_MECHANISM_ROUNDS; round++) {
        drift(mechanism, assembly, step, twist);
        worst = ces_assembly_apart(mechanism, assembly, mechanism->free, assembly->apart, &joint);
        worst = ces_max(worst, motor_lag(mechanism, assembly, time, step, twist, assembly->apart));
        const bool resting = !(worst < 0.5 * last) && worst <= CES_JOINT_ROUNDING * assembly->size;
        if (worst <= CES_JOINT_CLOSE * assembly->size || resting || !isfinite(worst)) {
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
    if (!(worst <= CES_JOINT_BROKEN * assembly->size)) {
        return ces_joint_broken(mechanism, joint, worst, error);
    }
    ces_note_impulses(mechanism, assembly, mechanism->now, total, before, twist);
    note_motors(mechanism, assembly, mechanism->now, before, twist);
    return CES_OK;
}

/* Joint impulses at the end of the step that make the velocities fit there, and motors keep their law. */
static void fit_velocities(ces_Mechanism *mechanism, ces_Assembly *assembly, double time, double step)
{
    const uint32_t width = ces_assembly_width(assembly);
    double *twist = assembly->twist, *total = assembly->impulse, *before = assembly->push;
    ces_assembly_linearise(mechanism, assembly, mechanism->free);
    ces_gather_twists(assembly, mechanism->free, before);
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
    ces_note_impulses(mechanism, assembly, mechanism->free, total, before, twist);
    note_motors(mechanism, assembly, mechanism->free, before, twist);
    ces_scatter_twists(assembly, twist, mechanism->free);
}

ces_Status ces_mechanism_fly(ces_Mechanism *mechanism, double time, double step, ces_Error *error)
{
    for (uint32_t j = 0; j < mechanism->joint_count; j++) {
        const ces_JointState *state = &mechanism->states[j];
        mechanism->next_states[j] = (ces_JointState){.travel = state->travel,
                                                     .speed = state->speed,
                                                     .energy = state->energy,
                                                     .impulse = state->impulse,
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
