/* contact/mechanism_create.c - from definitions to assemblies that can move: all checks, and their memory in one piece. */
#include <math.h>
#include <string.h>

#include "../base/memory.h"
#include "../base/status.h"
#include "../base/vec3.h"
#include "mechanism.h"

enum { MOST_PARTS = 200, ASSEMBLY_ROUNDS = 100 };
#define MET 1e-9     /* of an assembly's size: joints that are this near are together */
#define FITTING 1e-6 /* of the speeds of its parts: what a joint forbids less than that is rounding */
#define HELD 1e-10   /* of what bare parts would yield: a motor that moves less moves nothing */

/* ---- memory: counted once with no place, then handed out --------------------------------------------------------------------- */

typedef struct Place {
    char *base; /* NULL: only counts */
    size_t used;
} Place;

static void *take(Place *place, size_t count, size_t size)
{
    void *here = place->base == NULL ? NULL : place->base + place->used;
    place->used += (count * size + CES_ALIGNMENT - 1) / CES_ALIGNMENT * CES_ALIGNMENT;
    return here;
}

static void place_all(ces_Mechanism *mechanism, size_t law_rows, Place *place, double **laws)
{
    const size_t parts = mechanism->part_count, joints = mechanism->joint_count;
    mechanism->parts = take(place, parts, sizeof *mechanism->parts);
    mechanism->now = take(place, parts, sizeof *mechanism->now);
    mechanism->free = take(place, parts, sizeof *mechanism->free);
    mechanism->next = take(place, parts, sizeof *mechanism->next);
    mechanism->joints = take(place, joints, sizeof *mechanism->joints);
    mechanism->states = take(place, joints, sizeof *mechanism->states);
    mechanism->next_states = take(place, joints, sizeof *mechanism->next_states);
    mechanism->assembly_of = take(place, parts, sizeof *mechanism->assembly_of);
    mechanism->slot = take(place, parts, sizeof *mechanism->slot);
    mechanism->assemblies = take(place, parts, sizeof *mechanism->assemblies);
    mechanism->drives = take(place, 3 * joints, sizeof *mechanism->drives);
    *laws = take(place, 2 * law_rows, sizeof **laws);
}

static void place_assembly(ces_Assembly *assembly, Place *place)
{
    const size_t width = ces_assembly_width(assembly), rows = assembly->rows;
    assembly->inverse_inertia = take(place, 9 * (size_t)assembly->part_count, sizeof(double));
    assembly->jacobian = take(place, rows * width, sizeof(double));
    assembly->response = take(place, rows * width, sizeof(double));
    assembly->factor = take(place, rows * rows, sizeof(double));
    assembly->scale = take(place, rows, sizeof(double));
    assembly->order = take(place, rows, sizeof(uint32_t));
    assembly->mobility = take(place, width * width, sizeof(double));
    assembly->apart = take(place, rows, sizeof(double));
    assembly->impulse = take(place, rows, sizeof(double));
    assembly->more = take(place, rows, sizeof(double));
    assembly->work = take(place, rows, sizeof(double));
    assembly->twist = take(place, width, sizeof(double));
    assembly->push = take(place, width, sizeof(double));
}

/* ---- who hangs together ------------------------------------------------------------------------------------------------------ */

/* Labels the parts by the smallest index that they hang together with. */
static void label(ces_Mechanism *mechanism)
{
    uint32_t *labels = mechanism->assembly_of;
    for (uint32_t p = 0; p < mechanism->part_count; p++) {
        labels[p] = p;
    }
    for (uint32_t j = 0; j < mechanism->joint_count; j++) {
        const ces_JointDef *def = &mechanism->joints[j].def;
        if (def->part_a < 0 || def->part_b < 0 || labels[def->part_a] == labels[def->part_b]) {
            continue;
        }
        const uint32_t one = labels[def->part_a], other = labels[def->part_b];
        for (uint32_t p = 0; p < mechanism->part_count; p++) {
            if (labels[p] == one || labels[p] == other) {
                labels[p] = one < other ? one : other;
            }
        }
    }
}

static uint32_t assembly_of_joint(const ces_Mechanism *mechanism, const ces_Joint *joint)
{
    return mechanism->assembly_of[joint->def.part_a >= 0 ? joint->def.part_a : joint->def.part_b];
}

static void form_assemblies(ces_Mechanism *mechanism, uint32_t *part_list, uint32_t *joint_list)
{
    label(mechanism);
    for (uint32_t p = 0; p < mechanism->part_count; p++) {
        if (mechanism->assembly_of[p] != p) {
            continue;
        }
        ces_Assembly *assembly = &mechanism->assemblies[mechanism->assembly_count];
        *assembly = (ces_Assembly){.parts = part_list, .joints = joint_list, .first_drive = mechanism->drive_count};
        for (uint32_t other = p; other < mechanism->part_count; other++) {
            if (mechanism->assembly_of[other] == p) {
                mechanism->slot[other] = assembly->part_count++;
                *part_list++ = other;
            }
        }
        for (uint32_t j = 0; j < mechanism->joint_count; j++) {
            const ces_Joint *joint = &mechanism->joints[j];
            if (assembly_of_joint(mechanism, joint) != p) {
                continue;
            }
            const bool wanted[] = {[CES_MOTOR] = joint->weak_motor,
                                   [CES_LOWER_STOP] = isfinite(joint->def.least_travel),
                                   [CES_UPPER_STOP] = isfinite(joint->def.most_travel)};
            for (int kind = CES_MOTOR; kind <= CES_UPPER_STOP; kind++) {
                if (wanted[kind]) {
                    mechanism->drives[mechanism->drive_count++] =
                        (ces_Drive){.kind = (ces_DriveKind)kind, .joint = j, .assembly = mechanism->assembly_count};
                    assembly->drive_count++;
                }
            }
            assembly->joint_rows += joint->rows;
            assembly->rows += joint->rows + joint->free_motor;
            assembly->joint_count++;
            *joint_list++ = j;
        }
        mechanism->assembly_count++;
    }
    /* From labels to indices: those of the assemblies are in the order of their first parts. */
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        for (uint32_t slot = 0; slot < mechanism->assemblies[i].part_count; slot++) {
            mechanism->assembly_of[mechanism->assemblies[i].parts[slot]] = i;
        }
    }
}

static void find_size(const ces_Mechanism *mechanism, ces_Assembly *assembly)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        const ces_PartDef *part = &mechanism->parts[assembly->parts[slot]];
        assembly->size = ces_max(assembly->size, sqrt((part->inertia[0] + part->inertia[1]) / part->mass));
    }
    for (uint32_t k = 0; k < assembly->joint_count; k++) {
        const ces_Joint *joint = &mechanism->joints[assembly->joints[k]];
        assembly->size = ces_max(assembly->size, ces_max(ces_norm(joint->anchor_a), ces_norm(joint->anchor_b)));
    }
}

/* ---- whether it can be put together ------------------------------------------------------------------------------------------ */

/* Moves the parts until their joints are together; most are from the start. */
static ces_Status put_together(ces_Mechanism *mechanism, ces_Assembly *assembly, ces_Error *error)
{
    const uint32_t width = ces_assembly_width(assembly);
    double worst = 0.0;
    uint32_t joint = 0;
    for (int round = 0; round < ASSEMBLY_ROUNDS; round++) {
        worst = ces_assembly_apart(mechanism, assembly, mechanism->now, assembly->apart, &joint);
        if (worst <= 1e-14 * assembly->size || !isfinite(worst)) {
            break;
        }
        ces_assembly_linearise(mechanism, assembly, mechanism->now);
        ces_assembly_factorise(assembly, assembly->joint_rows);
        ces_assembly_solve(assembly, assembly->apart, assembly->more);
        memset(assembly->twist, 0, width * sizeof *assembly->twist);
        ces_assembly_push(assembly, assembly->more, assembly->twist);
        for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
            ces_Motion *motion = &mechanism->now[assembly->parts[slot]];
            double turn[3];
            ces_add_scaled(motion->position, -1.0, &assembly->twist[6 * slot]);
            for (int k = 0; k < 3; k++) {
                turn[k] = -assembly->twist[6 * slot + 3 + (uint32_t)k];
            }
            ces_turn(motion->orientation, turn);
        }
    }
    if (!(worst <= MET * assembly->size)) {
        return ces_fail(
            error, CES_INPUT,
            "joint '%s' cannot be met: the machine cannot be put together, its anchors or axes stay apart by "
            "%g m",
            mechanism->joints[joint].def.name, worst);
    }
    return CES_OK;
}

/* The joints must let the parts move as they are said to start. */
static ces_Status check_start(ces_Mechanism *mechanism, ces_Assembly *assembly, ces_Error *error)
{
    double speed = 0.0, *u = assembly->more;
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        const ces_Motion *motion = &mechanism->now[assembly->parts[slot]];
        ces_copy(motion->velocity, &assembly->twist[6 * slot]);
        ces_copy(motion->spin, &assembly->twist[6 * slot + 3]);
        speed = ces_max(speed, ces_norm(motion->velocity) + assembly->size * ces_norm(motion->spin));
    }
    ces_assembly_slip(assembly, assembly->twist, u);
    uint32_t row = 0;
    for (uint32_t k = 0; k < assembly->joint_count; k++) {
        const ces_Joint *joint = &mechanism->joints[assembly->joints[k]];
        for (uint32_t r = 0; r < joint->rows; r++, row++) {
            if (!(fabs(u[row]) <= FITTING * speed)) {
                return ces_fail(
                    error, CES_INPUT,
                    "joint '%s' does not let its parts start as they are said to: its ends would move apart "
                    "at %g m/s",
                    joint->def.name, fabs(u[row]));
            }
        }
    }
    return CES_OK;
}

static ces_Status nothing_to_move(const ces_Joint *joint, ces_Error *error)
{
    return ces_fail(error, CES_INPUT,
                    "joint '%s': its motor or its stops have nothing to move, other joints or motors hold it",
                    joint->def.name);
}

/* Whether the rows of the joints, and each motor and stop by itself, have something to act on. */
static ces_Status count_rows(ces_Mechanism *mechanism, ces_Assembly *assembly, ces_Error *error)
{
    ces_assembly_linearise(mechanism, assembly, mechanism->now);
    const uint32_t joint_rank = ces_assembly_factorise(assembly, assembly->joint_rows);
    const uint32_t rank = ces_assembly_factorise(assembly, assembly->rows);
    mechanism->redundant_rows += assembly->joint_rows - joint_rank;
    assembly->yields = rank < ces_assembly_width(assembly);
    if (rank < joint_rank + assembly->rows - assembly->joint_rows) {
        for (uint32_t k = assembly->joint_count; k-- > 0;) {
            if (mechanism->joints[assembly->joints[k]].free_motor) {
                return nothing_to_move(&mechanism->joints[assembly->joints[k]], error);
            }
        }
    }
    for (uint32_t d = assembly->first_drive; d < assembly->first_drive + assembly->drive_count; d++) {
        const ces_Joint *joint = &mechanism->joints[mechanism->drives[d].joint];
        double row[CES_JOINT_WIDTH], *wide = assembly->push, *yield = assembly->twist, bare = 0.0, left = 0.0;
        ces_joint_drive(joint, ces_motion_of(mechanism->now, joint->def.part_a),
                        ces_motion_of(mechanism->now, joint->def.part_b), row, NULL);
        ces_assembly_spread(mechanism, assembly, joint, row, wide);
        ces_assembly_free_response(mechanism, assembly, wide, yield);
        for (uint32_t k = 0; k < ces_assembly_width(assembly); k++) {
            bare += wide[k] * yield[k];
        }
        ces_assembly_constrain(assembly, yield, assembly->impulse);
        for (uint32_t k = 0; k < ces_assembly_width(assembly); k++) {
            left += wide[k] * yield[k];
        }
        if (!(left > HELD * bare)) {
            return nothing_to_move(joint, error);
        }
    }
    return CES_OK;
}

static void start_joints(ces_Mechanism *mechanism)
{
    for (uint32_t j = 0; j < mechanism->joint_count; j++) {
        const ces_Joint *joint = &mechanism->joints[j];
        if (joint->def.kind == CES_REVOLUTE || joint->def.kind == CES_PRISMATIC) {
            const ces_Motion *a = ces_motion_of(mechanism->now, joint->def.part_a),
                             *b = ces_motion_of(mechanism->now, joint->def.part_b);
            double row[CES_JOINT_WIDTH];
            ces_joint_drive(joint, a, b, row, &mechanism->states[j].travel);
            mechanism->states[j].speed = (ces_dot(&row[0], a->velocity) + ces_dot(&row[3], a->spin) +
                                          ces_dot(&row[6], b->velocity) + ces_dot(&row[9], b->spin)) /
                                         ces_joint_scale(joint);
        }
    }
}

/* ---- creation ---------------------------------------------------------------------------------------------------------------- */

static ces_Status copy_definitions(ces_Mechanism *mechanism, const ces_MechanismDef *def, double *laws,
                                   ces_Error *error)
{
    for (size_t p = 0; p < def->part_count; p++) {
        const ces_PartDef *part = &def->parts[p];
        const ces_Status status = ces_part_check(part, error);
        if (status != CES_OK) {
            return status;
        }
        mechanism->parts[p] = *part;
        memcpy(mechanism->now[p].orientation, part->orientation, sizeof part->orientation);
        ces_copy(part->position, mechanism->now[p].position);
        ces_copy(part->velocity, mechanism->now[p].velocity);
        ces_copy(part->angular_velocity, mechanism->now[p].spin);
    }
    for (size_t j = 0; j < def->joint_count; j++) {
        const ces_Status status =
            ces_joint_create(&def->joints[j], def->parts, def->part_count, laws, &mechanism->joints[j], error);
        if (status != CES_OK) {
            return status;
        }
        laws += 2 * def->joints[j].law_count;
    }
    return CES_OK;
}

static ces_Status start_assemblies(ces_Mechanism *mechanism, ces_Error *error)
{
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        ces_Assembly *assembly = &mechanism->assemblies[i];
        find_size(mechanism, assembly);
        ces_Status status = put_together(mechanism, assembly, error);
        if (status == CES_OK) {
            status = count_rows(mechanism, assembly, error);
        }
        if (status == CES_OK) {
            status = check_start(mechanism, assembly, error);
        }
        if (status != CES_OK) {
            return status;
        }
    }
    start_joints(mechanism);
    return CES_OK;
}

/* What depends on who hangs together: the first pass counts, the second hands out. */
static void place_assemblies(ces_Mechanism *mechanism, Place *place)
{
    for (uint32_t i = 0; i < mechanism->assembly_count; i++) {
        place_assembly(&mechanism->assemblies[i], place);
    }
    for (uint32_t d = 0; d < mechanism->drive_count; d++) {
        ces_Drive *drive = &mechanism->drives[d];
        const size_t width = ces_assembly_width(&mechanism->assemblies[drive->assembly]);
        drive->jacobian = take(place, width, sizeof(double));
        drive->response = take(place, width, sizeof(double));
    }
}

ces_Status ces_mechanism_create(ces_Mechanism *mechanism, const ces_MechanismDef *def, ces_Error *error)
{
    *mechanism = (ces_Mechanism){.part_count = (uint32_t)def->part_count, .joint_count = (uint32_t)def->joint_count};
    ces_copy(def->gravity, mechanism->gravity);
    if (def->part_count > MOST_PARTS || def->joint_count > MOST_PARTS) {
        *mechanism = (ces_Mechanism){0};
        return ces_fail(error, CES_INPUT, "the machine has %zu dynamic parts and %zu joints, at most %d each",
                        def->part_count, def->joint_count, MOST_PARTS);
    }
    size_t law_rows = 0;
    for (size_t j = 0; j < def->joint_count; j++) {
        law_rows += def->joints[j].law_count;
    }
    Place count = {0}, place = {0}, own = {0};
    double *laws;
    place_all(mechanism, law_rows, &count, &laws);
    take(&count, def->part_count + def->joint_count, sizeof(uint32_t));
    mechanism->memory = ces_alloc(1, count.used + 1);
    if (mechanism->memory == NULL) {
        return ces_fail(error, CES_MEMORY, "no memory for %zu parts", def->part_count);
    }
    place.base = mechanism->memory;
    place_all(mechanism, law_rows, &place, &laws);
    uint32_t *lists = take(&place, def->part_count + def->joint_count, sizeof(uint32_t));
    const ces_Status status = copy_definitions(mechanism, def, laws, error);
    if (status != CES_OK) {
        return status;
    }
    form_assemblies(mechanism, lists, lists + def->part_count);
    place_assemblies(mechanism, &own);
    mechanism->numbers = ces_alloc(1, own.used + 1);
    if (mechanism->numbers == NULL) {
        return ces_fail(error, CES_MEMORY, "no memory for %zu parts", def->part_count);
    }
    own = (Place){.base = mechanism->numbers};
    place_assemblies(mechanism, &own);
    return start_assemblies(mechanism, error);
}

void ces_mechanism_free(ces_Mechanism *mechanism)
{
    ces_free(mechanism->memory);
    ces_free(mechanism->numbers);
    *mechanism = (ces_Mechanism){0};
}
