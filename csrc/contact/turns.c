#include "turns.h"

#include <math.h>
#include <string.h>

#include "../base/vec3.h"
#include "mechanism_notes.h"

enum { DRIVE_ROUNDS = 200 };
#define LIGHT 0.1 /* velocity that all grains lend an assembly, over their own: below it they are light */

/* 1/kg: by how much a part yields at the end of an arm, over the three directions. */
static double yield_at(const ces_Mechanism *mechanism, uint32_t part, const double arm[3])
{
    const ces_Assembly *assembly = &mechanism->assemblies[mechanism->assembly_of[part]];
    const uint32_t width = ces_assembly_width(assembly), first = 6 * mechanism->slot[part];
    double sum = 0.0;
    for (uint32_t axis = 0; axis < 3; axis++) {
        double push[6] = {0.0}, direction[3] = {0.0, 0.0, 0.0};
        direction[axis] = 1.0;
        push[axis] = 1.0;
        ces_cross(arm, direction, &push[3]);
        for (uint32_t row = 0; row < 6; row++) {
            for (uint32_t column = 0; column < 6; column++) {
                sum += push[row] * assembly->mobility[(first + row) * width + first + column] * push[column];
            }
        }
    }
    return sum;
}

/* kg: no less than all grains that touch anything, for each counts as often as it does. */
static double mass_in_contact(const ces_Contacts *contacts, const ces_Particles *particles)
{
    double mass = 0.0;
    for (size_t k = 0; k < contacts->count; k++) {
        mass += particles->mass[contacts->list[k].a];
        mass += k < contacts->pair_count ? particles->mass[contacts->list[k].b] : 0.0;
    }
    return mass;
}

void ces_turns_start(ces_Mechanism *mechanism, ces_Contacts *contacts, const ces_Surface *surfaces,
                     const ces_Particles *particles)
{
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        mechanism->assemblies[i].by_turns = mechanism->assemblies[i].yields;
    }
    if (mechanism->assembly_count == 0) {
        return;
    }
    const double mass = mass_in_contact(contacts, particles);
    for (size_t k = contacts->pair_count; k < contacts->count; k++) {
        const ces_Contact *contact = &contacts->list[k];
        if (contact->carrier != CES_NO_PART &&
            !(mass * yield_at(mechanism, contact->carrier, contact->arm_b) < LIGHT)) {
            mechanism->assemblies[mechanism->assembly_of[contact->carrier]].by_turns = false;
        }
    }
    for (size_t k = contacts->pair_count; k < contacts->count; k++) {
        ces_Contact *contact = &contacts->list[k];
        if (contact->carrier != CES_NO_PART &&
            mechanism->assemblies[mechanism->assembly_of[contact->carrier]].by_turns) {
            contact->carrier = CES_NO_PART;
            ces_matter_velocity(&surfaces[contact->b].carriage.end, contact->arm_b, contact->surface);
        }
    }
}

/* Each drive in its bounds, with the others as they are, until none changes. twist: what the parts' velocities have come to. */
static void solve_drives(ces_Mechanism *mechanism, const ces_Assembly *assembly, double *twist)
{
    const uint32_t width = ces_assembly_width(assembly);
    const uint32_t first = assembly->first_drive, end = first + assembly->drive_count;
    for (uint32_t d = first; d < end; d++) {
        const ces_Drive *drive = &mechanism->drives[d];
        for (uint32_t k = 0; k < width; k++) {
            twist[k] += drive->impulse * drive->response[k];
        }
    }
    for (int round = 0; round < DRIVE_ROUNDS; round++) {
        bool changed = false;
        for (uint32_t d = first; d < end; d++) {
            ces_Drive *drive = &mechanism->drives[d];
            if (drive->diagonal == 0.0) {
                continue;
            }
            const double u = drive->offset + ces_drive_slip(drive, twist, width);
            const double impulse = ces_min(ces_max(drive->impulse - u / drive->diagonal, drive->least), drive->most);
            const double change = impulse - drive->impulse;
            drive->impulse = impulse;
            changed = changed || fabs(change) > 1e-15 * fabs(impulse);
            for (uint32_t k = 0; k < width; k++) {
                twist[k] += change * drive->response[k];
            }
        }
        if (!changed) {
            return;
        }
    }
}

double ces_turns_follow(ces_Mechanism *mechanism, ces_Contacts *contacts, const ces_Surface *surfaces)
{
    bool any = false;
    if (mechanism->assembly_count == 0) {
        return 0.0;
    }
    ces_gather_contacts(mechanism, contacts, surfaces);
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        ces_Assembly *assembly = &mechanism->assemblies[i];
        if (!assembly->by_turns) {
            continue;
        }
        double *twist = assembly->twist, *start = assembly->push;
        ces_assembly_free_response(mechanism, assembly, assembly->push, twist);
        ces_assembly_constrain(assembly, twist, assembly->impulse);
        ces_gather_twists(assembly, mechanism->free, start);
        for (uint32_t k = 0; k < ces_assembly_width(assembly); k++) {
            twist[k] += start[k];
        }
        solve_drives(mechanism, assembly, twist);
        ces_scatter_twists(assembly, twist, mechanism->next); /* which is not yet anything else */
        any = true;
    }
    double largest = 0.0;
    for (size_t k = contacts->pair_count; any && k < contacts->count; k++) {
        ces_Contact *contact = &contacts->list[k];
        const int32_t part = surfaces[contact->b].def.part;
        if (part < 0 || !mechanism->assemblies[mechanism->assembly_of[part]].by_turns) {
            continue;
        }
        const ces_Motion *motion = &mechanism->next[part];
        double matter[3], spin[3], change[3];
        ces_matter_velocity(motion, contact->arm_b, matter);
        ces_subtract(matter, contact->surface, change);
        ces_copy(matter, contact->surface);
        for (int axis = 0; axis < 3; axis++) {
            spin[axis] = contact->rolling_radius * motion->spin[axis];
        }
        ces_cross(spin, contact->normal, contact->surface_roll);
        contact->surface_spin = ces_dot(spin, contact->normal);
        largest = ces_max(largest, ces_norm(change));
    }
    return largest;
}
