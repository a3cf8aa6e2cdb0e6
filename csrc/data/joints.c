#include "joints.h"

#include <string.h>

#include "../base/status.h"
#include "../base/vec3.h"

#define FARTHEST 1e3 /* m, of anything of a machine */

const ces_Motion ces_ground = {.orientation = {1.0, 0.0, 0.0, 0.0}};

/* ---- checks -------------------------------------------------------------------------------------------------------------- */

ces_Status ces_part_check(const ces_PartDef *def, ces_Error *error)
{
    if (!(def->mass >= 1e-12 && def->mass <= 1e6)) {
        return ces_fail(error, CES_INPUT, "part '%s': its mass is %g kg, outside [1e-12, 1e6] kg", def->name,
                        def->mass);
    }
    for (int k = 0; k < 3; k++) {
        const double others = def->inertia[(k + 1) % 3] + def->inertia[(k + 2) % 3];
        if (!(def->inertia[k] > 0.0 && def->inertia[k] <= 1e9 && def->inertia[k] <= others * (1.0 + 1e-9))) {
            return ces_fail(error, CES_INPUT,
                            "part '%s': its moments of inertia are (%g, %g, %g) kg m2, must be positive and none more "
                            "than the sum of the others",
                            def->name, def->inertia[0], def->inertia[1], def->inertia[2]);
        }
        if (!(fabs(def->position[k]) <= FARTHEST && fabs(def->velocity[k]) <= 1e3 &&
              fabs(def->angular_velocity[k]) <= 1e4)) {
            return ces_fail(error, CES_INPUT,
                            "part '%s': number %d of its position, velocity or angular velocity is outside +-1e3 m, "
                            "+-1e3 m/s or +-1e4 rad/s",
                            def->name, k);
        }
    }
    const double norm =
        sqrt(def->orientation[0] * def->orientation[0] + ces_dot(&def->orientation[1], &def->orientation[1]));
    if (!(fabs(norm - 1.0) < 1e-9)) {
        return ces_fail(error, CES_INPUT, "part '%s': the norm of its orientation is %g, must be 1", def->name, norm);
    }
    return CES_OK;
}

static ces_Status check_law(const ces_JointDef *def, ces_Error *error)
{
    for (size_t k = 0; k < def->law_count; k++) {
        const double time = def->law[2 * k], speed = def->law[2 * k + 1];
        if (!(fabs(time) <= 1e9 && fabs(speed) <= 1e4) || (k > 0 && !(time > def->law[2 * k - 2]))) {
            return ces_fail(error, CES_INPUT,
                            "joint '%s': row %zu of its motor's law is (%g s, %g), times must rise and speeds lie "
                            "inside +-1e4",
                            def->name, k, time, speed);
        }
    }
    return CES_OK;
}

static ces_Status check_joint(const ces_JointDef *def, size_t part_count, ces_Error *error)
{
    const bool moves = def->kind == CES_REVOLUTE || def->kind == CES_PRISMATIC;
    const double least = def->least_travel, most = def->most_travel;
    const int32_t ends[2] = {def->part_a, def->part_b};
    for (int k = 0; k < 2; k++) {
        if (ends[k] < -1 || ends[k] >= (int64_t)part_count) {
            return ces_fail(error, CES_INPUT, "joint '%s': part %d is no part of the machine", def->name, (int)ends[k]);
        }
    }
    if (def->part_a == def->part_b) {
        return ces_fail(error, CES_INPUT, "joint '%s' holds %s to itself", def->name,
                        def->part_a < 0 ? "the ground" : "a part");
    }
    for (int k = 0; k < 3; k++) {
        if (!(fabs(def->anchor_a[k]) <= FARTHEST && fabs(def->anchor_b[k]) <= FARTHEST)) {
            return ces_fail(error, CES_INPUT, "joint '%s': its anchor is at %g m, outside [%g, %g] m", def->name,
                            def->anchor_a[k], -FARTHEST, FARTHEST);
        }
    }
    if (moves && !(ces_norm(def->axis) > 1e-9 && ces_norm(def->axis) < 1e9)) {
        return ces_fail(error, CES_INPUT, "joint '%s': its axis has the length %g, no direction", def->name,
                        ces_norm(def->axis));
    }
    if (!moves && (def->law_count > 0 || isfinite(least) || isfinite(most))) {
        return ces_fail(error, CES_INPUT, "joint '%s' has a motor or stops: only a revolute or prismatic joint may",
                        def->name);
    }
    if (!(least < most) || !(least <= 0.0) || !(most >= 0.0)) {
        return ces_fail(error, CES_INPUT,
                        "joint '%s': its stops are at %g and %g, must rise and have the start, 0, between them",
                        def->name, least, most);
    }
    if (def->law_count > 0 && !(def->limit > 0.0)) {
        return ces_fail(error, CES_INPUT, "joint '%s': its motor's limit is %g, must be positive", def->name,
                        def->limit);
    }
    if (def->law_count > 0 && !isfinite(def->limit) && (isfinite(least) || isfinite(most))) {
        return ces_fail(error, CES_INPUT, "joint '%s' has stops and a motor without a limit, which nothing can stop",
                        def->name);
    }
    return check_law(def, error);
}

/* ---- creation ------------------------------------------------------------------------------------------------------------ */

static void into_part(const ces_PartDef *part, const double point[3], double local[3])
{
    double from[3];
    ces_copy(point, from);
    if (part != NULL) {
        ces_subtract(point, part->position, from);
        ces_rotate_back(part->orientation, from, from);
    }
    ces_copy(from, local);
}

static void direction_into_part(const ces_PartDef *part, const double world[3], double local[3])
{
    ces_copy(world, local);
    if (part != NULL) {
        ces_rotate_back(part->orientation, world, local);
    }
}

static void conjugate(const double q[4], double out[4])
{
    out[0] = q[0];
    for (int k = 1; k < 4; k++) {
        out[k] = -q[k];
    }
}

/* Radius of gyration, m. */
static double gyration(const ces_PartDef *part)
{
    return sqrt((part->inertia[0] + part->inertia[1] + part->inertia[2]) / (2.0 * part->mass));
}

ces_Status ces_joint_create(const ces_JointDef *def, const ces_PartDef *parts, size_t part_count, double *law,
                            ces_Joint *joint, ces_Error *error)
{
    static const uint32_t row_counts[] = {
        [CES_REVOLUTE] = 5, [CES_PRISMATIC] = 5, [CES_FIXED] = 6, [CES_SPHERICAL] = 3};
    const ces_Status status = check_joint(def, part_count, error);
    if (status != CES_OK) {
        return status;
    }
    const ces_PartDef *a = def->part_a >= 0 ? &parts[def->part_a] : NULL;
    const ces_PartDef *b = def->part_b >= 0 ? &parts[def->part_b] : NULL;
    *joint = (ces_Joint){.def = *def, .rows = row_counts[def->kind]};
    joint->def.law = law;
    if (def->law_count > 0) {
        memcpy(law, def->law, 2 * def->law_count * sizeof *law);
    }
    joint->length = a == NULL ? gyration(b) : b == NULL ? gyration(a) : ces_min(gyration(a), gyration(b));
    joint->free_motor = def->law_count > 0 && !isfinite(def->limit);
    joint->weak_motor = def->law_count > 0 && isfinite(def->limit);
    into_part(a, def->anchor_a, joint->anchor_a);
    into_part(b, def->anchor_b, joint->anchor_b);

    double axes[3][3] = {{0.0, 0.0, 1.0}};
    if (def->kind == CES_REVOLUTE || def->kind == CES_PRISMATIC) {
        for (int k = 0; k < 3; k++) {
            axes[0][k] = def->axis[k] / ces_norm(def->axis);
        }
    }
    /* Across the axis: away from the coordinate axis that it is nearest to. */
    double other[3] = {0.0, 0.0, 0.0};
    const double x = fabs(axes[0][0]), y = fabs(axes[0][1]), z = fabs(axes[0][2]);
    other[x <= y && x <= z ? 0 : y <= z ? 1 : 2] = 1.0;
    ces_cross(axes[0], other, axes[1]);
    const double size = ces_norm(axes[1]);
    for (int k = 0; k < 3; k++) {
        axes[1][k] /= size;
    }
    ces_cross(axes[0], axes[1], axes[2]);
    direction_into_part(a, axes[0], joint->axis_a);
    for (int k = 0; k < 3; k++) {
        direction_into_part(b, axes[k], joint->axes_b[k]);
    }
    double back[4];
    conjugate(b != NULL ? b->orientation : ces_ground.orientation, back);
    ces_multiply(back, a != NULL ? a->orientation : ces_ground.orientation, joint->relative);
    return CES_OK;
}

/* ---- rows ---------------------------------------------------------------------------------------------------------------- */

static double *push_distance(double *row, const double direction[3], const double arm_a[3], const double arm_b[3])
{
    if (row == NULL) {
        return NULL;
    }
    ces_copy(direction, &row[0]);
    ces_cross(arm_a, direction, &row[3]);
    for (int k = 0; k < 3; k++) {
        row[6 + k] = -direction[k];
    }
    ces_cross(direction, arm_b, &row[9]);
    return row + CES_JOINT_WIDTH;
}

static double *push_angle(double *row, const double direction[3], double length)
{
    if (row == NULL) {
        return NULL;
    }
    for (int k = 0; k < 3; k++) {
        row[k] = row[6 + k] = 0.0;
        row[3 + k] = length * direction[k];
        row[9 + k] = -length * direction[k];
    }
    return row + CES_JOINT_WIDTH;
}

/* The parts' arms to the anchor of a (that of b reaches across what the anchors are apart), and that distance. */
static void arms_of(const ces_Joint *joint, const ces_Motion *a, const ces_Motion *b, double arm_a[3], double arm_b[3],
                    double apart[3])
{
    double own_b[3];
    ces_rotate(a->orientation, joint->anchor_a, arm_a);
    ces_rotate(b->orientation, joint->anchor_b, own_b);
    for (int k = 0; k < 3; k++) {
        arm_b[k] = a->position[k] + arm_a[k] - b->position[k];
        apart[k] = arm_b[k] - own_b[k];
    }
}

/* The rotation of a against where it started in b, as a quaternion of the world. */
static void twist_of(const ces_Joint *joint, const ces_Motion *a, const ces_Motion *b, double twist[4])
{
    double start[4], back[4];
    ces_multiply(b->orientation, joint->relative, start);
    conjugate(start, back);
    ces_multiply(a->orientation, back, twist);
}

void ces_joint_rows(const ces_Joint *joint, const ces_Motion *a, const ces_Motion *b, double *apart, double *rows)
{
    const ces_JointKind kind = joint->def.kind;
    double arm_a[3], arm_b[3], distance[3], axes[3][3];
    size_t row = 0;
    arms_of(joint, a, b, arm_a, arm_b, distance);
    for (int k = 0; k < 3; k++) {
        ces_rotate(b->orientation, joint->axes_b[k], axes[k]);
    }
    for (int k = kind == CES_PRISMATIC ? 1 : 0; k < 3; k++) {
        rows = push_distance(rows, axes[k], arm_a, arm_b);
        if (apart != NULL) {
            apart[row++] = ces_dot(axes[k], distance);
        }
    }
    if (kind == CES_REVOLUTE) {
        double axis[3], direction[3];
        ces_rotate(a->orientation, joint->axis_a, axis);
        for (int k = 1; k < 3; k++) {
            ces_cross(axis, axes[k], direction);
            rows = push_angle(rows, direction, joint->length);
            if (apart != NULL) {
                apart[row++] = joint->length * ces_dot(axis, axes[k]);
            }
        }
    }
    if (kind == CES_PRISMATIC || kind == CES_FIXED) {
        double twist[4];
        twist_of(joint, a, b, twist);
        for (int k = 0; k < 3; k++) {
            rows = push_angle(rows, axes[k], joint->length);
            if (apart != NULL) {
                apart[row++] = 2.0 * joint->length * copysign(1.0, twist[0]) * ces_dot(axes[k], &twist[1]);
            }
        }
    }
}

void ces_joint_drive(const ces_Joint *joint, const ces_Motion *a, const ces_Motion *b, double *row, double *travel)
{
    double axis[3];
    ces_rotate(b->orientation, joint->axes_b[0], axis);
    if (joint->def.kind == CES_REVOLUTE) {
        push_angle(row, axis, joint->length);
        if (travel != NULL) {
            double twist[4];
            twist_of(joint, a, b, twist);
            const double sign = copysign(1.0, twist[0]);
            *travel = 2.0 * atan2(sign * ces_dot(axis, &twist[1]), sign * twist[0]);
        }
        return;
    }
    double arm_a[3], arm_b[3], distance[3];
    arms_of(joint, a, b, arm_a, arm_b, distance);
    push_distance(row, axis, arm_a, arm_b);
    if (travel != NULL) {
        *travel = ces_dot(axis, distance);
    }
}

double ces_joint_unwind(const ces_Joint *joint, double seen, double expected)
{
    const double turn = 2.0 * CES_PI;
    return joint->def.kind == CES_REVOLUTE ? seen + turn * round((expected - seen) / turn) : seen;
}

double ces_joint_scale(const ces_Joint *joint)
{
    return joint->def.kind == CES_REVOLUTE ? joint->length : 1.0;
}

void ces_joint_anchor(const ces_Joint *joint, const ces_Motion *a, double anchor[3])
{
    ces_rotate(a->orientation, joint->anchor_a, anchor);
    ces_add_scaled(anchor, 1.0, a->position);
}

/* ---- the law of a motor ---------------------------------------------------------------------------------------------------- */

double ces_law_at(const ces_Joint *joint, double time)
{
    const double *law = joint->def.law;
    const size_t count = joint->def.law_count;
    if (time <= law[0]) {
        return law[1];
    }
    for (size_t k = 1; k < count; k++) {
        const double *from = &law[2 * k - 2], *to = &law[2 * k];
        if (time <= to[0]) {
            return from[1] + (to[1] - from[1]) * (time - from[0]) / (to[0] - from[0]);
        }
    }
    return law[2 * count - 1];
}

double ces_law_between(const ces_Joint *joint, double from, double to)
{
    const double *law = joint->def.law;
    double sum = 0.0, time = from;
    for (size_t k = 0; k < joint->def.law_count && law[2 * k] < to; k++) {
        if (law[2 * k] > time) {
            sum += 0.5 * (law[2 * k] - time) * (ces_law_at(joint, time) + ces_law_at(joint, law[2 * k]));
            time = law[2 * k];
        }
    }
    return sum + 0.5 * (to - time) * (ces_law_at(joint, time) + ces_law_at(joint, to));
}
