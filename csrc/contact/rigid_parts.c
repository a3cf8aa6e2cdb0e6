#include "rigid_parts.h"

void ces_gather_push(const double arm[3], const double impulse[3], const double moment[3], double push[6])
{
    double turn[3];
    ces_cross(arm, impulse, turn);
    for (int k = 0; k < 3; k++) {
        push[k] = impulse[k];
        push[3 + k] = turn[k] + moment[k];
    }
}

void ces_part_respond(const ces_Rigid *rigid, uint32_t part, const double push[6], double twist[6])
{
    const ces_Mechanism *mechanism = rigid->input.mechanism;
    const ces_Assembly *assembly = &mechanism->assemblies[mechanism->assembly_of[part]];
    const uint32_t width = ces_assembly_width(assembly), first = 6 * mechanism->slot[part];
    for (uint32_t k = 0; k < 6; k++) {
        const double *line = &assembly->mobility[(first + k) * width + first];
        twist[k] = 0.0;
        for (uint32_t c = 0; c < 6; c++) {
            twist[k] += line[c] * push[c];
        }
    }
}

void ces_push_part(const ces_Rigid *rigid, uint32_t part, double sign, const double push[6])
{
    const ces_Mechanism *mechanism = rigid->input.mechanism;
    const ces_Assembly *assembly = &mechanism->assemblies[mechanism->assembly_of[part]];
    const uint32_t width = ces_assembly_width(assembly), first = 6 * mechanism->slot[part];
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        ces_RigidBody *body = &rigid->bodies[rigid->input.rows + assembly->parts[slot]];
        for (uint32_t k = 0; k < 6; k++) {
            const double *line = &assembly->mobility[(6 * slot + k) * width + first];
            double change = 0.0;
            for (uint32_t c = 0; c < 6; c++) {
                change += line[c] * push[c];
            }
            *(k < 3 ? &body->v[k] : &body->w[k - 3]) += sign * change;
        }
    }
}

void ces_push_drive(const ces_Rigid *rigid, const ces_Drive *drive, double change)
{
    const ces_Assembly *assembly = &rigid->input.mechanism->assemblies[drive->assembly];
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        ces_RigidBody *body = &rigid->bodies[rigid->input.rows + assembly->parts[slot]];
        ces_add_scaled(body->v, change, &drive->response[6 * slot]);
        ces_add_scaled(body->w, change, &drive->response[6 * slot + 3]);
    }
}

double ces_slip_drive(const ces_Rigid *rigid, const ces_Drive *drive)
{
    const ces_Assembly *assembly = &rigid->input.mechanism->assemblies[drive->assembly];
    double u = drive->offset;
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        const ces_RigidBody *body = &rigid->bodies[rigid->input.rows + assembly->parts[slot]];
        u += ces_dot(&drive->jacobian[6 * slot], body->v) + ces_dot(&drive->jacobian[6 * slot + 3], body->w);
    }
    return u;
}
