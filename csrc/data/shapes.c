#include "shapes.h"

#include <string.h>

#include "../base/memory.h"
#include "../base/status.h"

enum { MOST_SHAPES = 4096, MOST_PARTS = 4096, LEAST_VERTICES = 4, MOST_TURNS = 1000 };
#define LEAST_SPHERICITY 1e-3
#define FASTEST 1.0                      /* rad */
#define MOST_REACH 100.0                 /* of d: a needle of that length is no grain any more */
#define SPHERE_MOMENT 0.1                /* 2/5 m r^2 over m d^2 */
#define SPHERE_CHARGE 1.6449340668482264 /* pi^2/6: as in effects/laws.h, which data does not see */
#define SPHERE_FORCE 0.8320841           /* (zeta(3) + 1/6)/(pi^2/6) */

static ces_Status check_numbers(const ces_ShapeDef *def, const char *what, const double *values, size_t count,
                                size_t width, ces_Error *error)
{
    if (values == NULL || count > MOST_PARTS) {
        return ces_fail(error, CES_INPUT, "shape '%s' has %zu %s, outside [1, %d]", def->name, count, what, MOST_PARTS);
    }
    for (size_t k = 0; k < count * width; k++) {
        const bool is_radius = width == 4 && k % 4 == 3;
        if (!(fabs(values[k]) <= MOST_REACH) || (is_radius && !(values[k] > 0.0))) {
            return ces_fail(error, CES_INPUT, "shape '%s': number %zu of %s %zu is %g of d, outside %s%g, %g]",
                            def->name, k % width, what, k / width, values[k], is_radius ? "(" : "[",
                            is_radius ? 0.0 : -MOST_REACH, MOST_REACH);
        }
    }
    return CES_OK;
}

static ces_Status check_electric(const char *name, const double contact_charge[3], const double contact_force[3],
                                 const double semi_axes[3], const double depolarization[3], ces_Error *error)
{
    for (int k = 0; k < 3; k++) {
        if (!(contact_charge[k] >= 0.0 && contact_charge[k] <= 1e3 && contact_force[k] >= 0.0 &&
              contact_force[k] <= 2.0 && semi_axes[k] >= 1e-3 && semi_axes[k] <= MOST_REACH &&
              depolarization[k] >= 0.0 && depolarization[k] <= 1.0)) {
            return ces_fail(error, CES_INPUT,
                            "shape '%s': along axis %d contact_charge is %g, contact_force %g, semi_axes %g, "
                            "depolarization %g, outside [0, 1000], [0, 2], [0.001, %g], [0, 1]",
                            name, k, contact_charge[k], contact_force[k], semi_axes[k], depolarization[k], MOST_REACH);
        }
    }
    return CES_OK;
}

static ces_Status check_sphericity(const char *name, double sphericity, ces_Error *error)
{
    return sphericity >= LEAST_SPHERICITY && sphericity <= 1.0
               ? CES_OK
               : ces_fail(error, CES_INPUT, "shape '%s' has a sphericity of %g, outside [%g, 1]", name, sphericity,
                          LEAST_SPHERICITY);
}

/* The indices of materials are checked by who knows the materials. */
static ces_Status check_composite(const ces_ShapeDef *def, ces_Error *error)
{
    double volume = 0.0, mass = 0.0, offset[3] = {0.0, 0.0, 0.0};
    if (def->kind != CES_CLUSTER) {
        return ces_fail(error, CES_INPUT, "shape '%s' has materials of spheres, and is no cluster", def->name);
    }
    for (int f = 0; f < CES_PHASES; f++) {
        const ces_PhaseDef *phase = &def->phases[f];
        const double *q = phase->orientation;
        if (!(phase->volume >= 0.0 && phase->mass >= 0.0 && (phase->volume > 0.0) == (phase->mass > 0.0))) {
            return ces_fail(error, CES_INPUT, "shape '%s': phase %d has the shares %g of the volume, %g of the mass",
                            def->name, f, phase->volume, phase->mass);
        }
        volume += phase->volume;
        mass += phase->mass;
        if (phase->volume == 0.0) {
            continue;
        }
        ces_add_scaled(offset, phase->mass, phase->center);
        if (!(fabs(sqrt(q[0] * q[0] + ces_dot(&q[1], &q[1])) - 1.0) < 1e-9)) {
            return ces_fail(error, CES_INPUT, "shape '%s': the orientation of phase %d is no unit quaternion",
                            def->name, f);
        }
        ces_Status status = check_sphericity(def->name, phase->sphericity, error);
        status = status != CES_OK ? status
                                  : check_electric(def->name, phase->contact_charge, phase->contact_force,
                                                   phase->semi_axes, phase->depolarization, error);
        if (status != CES_OK) {
            return status;
        }
    }
    if (!(fabs(volume - 1.0) < 1e-9 && fabs(mass - 1.0) < 1e-9 && ces_norm(offset) < 1e-6)) {
        return ces_fail(error, CES_INPUT,
                        "shape '%s': its phases have %.9g of the volume, %.9g of the mass, and their common centre is "
                        "%g d off the grain's; must be 1, 1 and 0",
                        def->name, volume, mass, ces_norm(offset));
    }
    return CES_OK;
}

static ces_Status check(const ces_ShapeDef *def, ces_Error *error)
{
    const double *moments = def->moments;
    for (int k = 0; k < 3; k++) {
        const double others = moments[(k + 1) % 3] + moments[(k + 2) % 3];
        if (!(moments[k] > 0.0 && moments[k] <= MOST_REACH * MOST_REACH && moments[k] <= others * (1.0 + 1e-9))) {
            return ces_fail(error, CES_INPUT,
                            "shape '%s': its moments of inertia are (%g, %g, %g) m d^2, must be positive and none more "
                            "than the sum of the others",
                            def->name, moments[0], moments[1], moments[2]);
        }
    }
    ces_Status status = check_sphericity(def->name, def->sphericity, error);
    status = status != CES_OK ? status
                              : check_electric(def->name, def->contact_charge, def->contact_force, def->semi_axes,
                                               def->depolarization, error);
    if (status == CES_OK && def->sphere_materials != NULL) {
        status = check_composite(def, error);
    }
    if (status != CES_OK) {
        return status;
    }
    switch (def->kind) {
    case CES_SPHERE:
        return CES_OK;
    case CES_CLUSTER:
        if (def->sphere_count == 0) {
            return ces_fail(error, CES_INPUT, "shape '%s' has 0 spheres, outside [1, %d]", def->name, MOST_PARTS);
        }
        return check_numbers(def, "sphere", def->spheres, def->sphere_count, 4, error);
    case CES_CONVEX:
        if (def->vertex_count < LEAST_VERTICES || def->vertex_count > CES_CONVEX_VERTICES) {
            return ces_fail(error, CES_INPUT, "shape '%s' has %zu vertices, outside [%d, %d]", def->name,
                            def->vertex_count, LEAST_VERTICES, CES_CONVEX_VERTICES);
        }
        return check_numbers(def, "vertex", def->vertices, def->vertex_count, 3, error);
    }
    return ces_fail(error, CES_INPUT, "shape '%s' is of kind %d, no such kind", def->name, (int)def->kind);
}

static double reach_of(const ces_ShapeDef *def)
{
    double reach = def->kind == CES_SPHERE ? 0.5 : 0.0;
    for (size_t k = 0; k < def->sphere_count; k++) {
        reach = ces_max(reach, ces_norm(&def->spheres[4 * k]) + def->spheres[4 * k + 3]);
    }
    for (size_t k = 0; k < def->vertex_count; k++) {
        reach = ces_max(reach, ces_norm(&def->vertices[3 * k]));
    }
    return reach;
}

static double *copy(const double *values, size_t count, double *place)
{
    if (count > 0) {
        memcpy(place, values, count * sizeof *values);
    }
    return place;
}

/*
 * As the effects see a phase: by its own factors. It is no sphere to them even where it is one, so that what they know of
 * lone spheres, such as the lift on spinning ones, is not applied to it.
 */
static void make_phases(ces_Shape *shape)
{
    for (int f = 0; f < CES_PHASES; f++) {
        const ces_PhaseDef *phase = &shape->def.phases[f];
        ces_ShapeDef *seen = &shape->phase_shapes[f];
        *seen = (ces_ShapeDef){.kind = CES_CLUSTER, .sphericity = phase->sphericity};
        ces_copy(phase->contact_charge, seen->contact_charge);
        ces_copy(phase->contact_force, seen->contact_force);
        ces_copy(phase->semi_axes, seen->semi_axes);
        ces_copy(phase->depolarization, seen->depolarization);
    }
}

ces_Status ces_shapes_create(ces_Shapes *shapes, const ces_ShapeDef *defs, size_t count, ces_Error *error)
{
    const ces_ShapeDef sphere = {.name = "sphere",
                                 .kind = CES_SPHERE,
                                 .moments = {SPHERE_MOMENT, SPHERE_MOMENT, SPHERE_MOMENT},
                                 .sphericity = 1.0,
                                 .contact_charge = {SPHERE_CHARGE, SPHERE_CHARGE, SPHERE_CHARGE},
                                 .contact_force = {SPHERE_FORCE, SPHERE_FORCE, SPHERE_FORCE},
                                 .semi_axes = {0.5, 0.5, 0.5},
                                 .depolarization = {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0}};
    if (count == 0) {
        defs = &sphere;
        count = 1;
    }
    if (count > MOST_SHAPES || defs[0].kind != CES_SPHERE) {
        return ces_fail(error, CES_INPUT, "shapes has %zu entries, at most %d, and the first must be a sphere", count,
                        MOST_SHAPES);
    }
    size_t numbers = 0, indices = 0;
    for (size_t k = 0; k < count; k++) {
        const ces_Status status = check(&defs[k], error);
        if (status != CES_OK) {
            return status;
        }
        numbers += 4 * defs[k].sphere_count + 3 * defs[k].vertex_count;
        indices += defs[k].sphere_materials != NULL ? defs[k].sphere_count : 0;
    }
    shapes->list = ces_alloc(count, sizeof *shapes->list);
    shapes->numbers = ces_alloc(numbers, sizeof(double));
    shapes->indices = ces_alloc(indices, sizeof *shapes->indices);
    if (shapes->list == NULL || shapes->numbers == NULL || shapes->indices == NULL) {
        ces_shapes_free(shapes);
        return ces_fail(error, CES_MEMORY, "no memory for %zu shapes", count);
    }
    shapes->count = count;
    shapes->only_spheres = true;
    shapes->composites = indices > 0;
    double *place = shapes->numbers;
    uint32_t *next = shapes->indices;
    for (size_t k = 0; k < count; k++) {
        ces_Shape *shape = &shapes->list[k];
        shape->def = defs[k];
        shape->def.spheres = copy(defs[k].spheres, 4 * defs[k].sphere_count, place);
        place += 4 * defs[k].sphere_count;
        shape->def.vertices = copy(defs[k].vertices, 3 * defs[k].vertex_count, place);
        place += 3 * defs[k].vertex_count;
        shape->reach = reach_of(&shape->def);
        if (defs[k].sphere_materials != NULL) {
            memcpy(next, defs[k].sphere_materials, defs[k].sphere_count * sizeof *next);
            shape->def.sphere_materials = next;
            next += defs[k].sphere_count;
            make_phases(shape);
        }
        shapes->only_spheres = shapes->only_spheres && shape->def.kind == CES_SPHERE;
    }
    return CES_OK;
}

void ces_shapes_free(ces_Shapes *shapes)
{
    ces_free(shapes->list);
    ces_free(shapes->numbers);
    ces_free(shapes->indices);
    *shapes = (ces_Shapes){0};
}

void ces_inverse_tensor(const double moments[3], const double orientation[4], double inverse[9])
{
    double axes[3][3]; /* row k: the principal axis k in the world */
    for (int k = 0; k < 3; k++) {
        double axis[3] = {0.0, 0.0, 0.0};
        axis[k] = 1.0;
        ces_rotate(orientation, axis, axes[k]);
    }
    for (int i = 0; i < 3; i++) {
        for (int j = i; j < 3; j++) {
            double sum = 0.0;
            for (int k = 0; k < 3; k++) {
                sum += axes[k][i] * axes[k][j] / moments[k];
            }
            inverse[3 * i + j] = inverse[3 * j + i] = sum;
        }
    }
}

void ces_inverse_inertia(const ces_Shape *shape, double mass, double diameter, const double orientation[4],
                         double inverse[9])
{
    const double scale = 1.0 / (mass * diameter * diameter);
    ces_inverse_tensor(shape->def.moments, orientation, inverse);
    for (int k = 0; k < 9; k++) {
        inverse[k] *= scale;
    }
}

/* A turn of the body about its own axis by an angle, and the momentum (body frame) as it is seen after it. */
static void turn_about(int axis, double angle, double orientation[4], double momentum[3])
{
    const double c = cos(0.5 * angle), s = sin(0.5 * angle);
    double q[4];
    /* q (c + s e_axis) */
    const int next = (axis + 1) % 3, last = (axis + 2) % 3;
    q[0] = c * orientation[0] - s * orientation[1 + axis];
    q[1 + axis] = c * orientation[1 + axis] + s * orientation[0];
    q[1 + next] = c * orientation[1 + next] + s * orientation[1 + last];
    q[1 + last] = c * orientation[1 + last] - s * orientation[1 + next];
    memcpy(orientation, q, sizeof q);
    const double cosine = c * c - s * s, sine = 2.0 * s * c;
    const double a = momentum[next], b = momentum[last];
    momentum[next] = cosine * a + sine * b;
    momentum[last] = cosine * b - sine * a;
}

/*
 * Into how many parts a step is cut: the splitting is of second order, and beyond a radian a part the errors of a slender body
 * feed on each other. Read from the energy, not from the momentary spin: a number that changes while a body tumbles would let
 * its energy drift.
 */
static int parts_of(const double moments[3], double step, const double momentum[3])
{
    double energy = 0.0; /* twice, over m d^2 */
    for (int k = 0; k < 3; k++) {
        energy += momentum[k] * momentum[k] / moments[k];
    }
    const double least = fmin(moments[0], fmin(moments[1], moments[2]));
    const double angle = step * sqrt(energy / least); /* if all of it went into the easiest turn */
    return angle < FASTEST ? 1 : angle < FASTEST * MOST_TURNS ? 1 + (int)(angle / FASTEST) : MOST_TURNS;
}

void ces_rotate_freely(const double moments[3], double step, double orientation[4], double spin[3])
{
    static const struct {
        int axis;
        double part; /* of the step */
    } turns[] = {{0, 0.5}, {1, 0.5}, {2, 1.0}, {1, 0.5}, {0, 0.5}};
    double momentum[3], world[3], seen[3];
    ces_rotate_back(orientation, spin, momentum);
    for (int k = 0; k < 3; k++) {
        momentum[k] *= moments[k];
    }
    ces_rotate(orientation, momentum, world);
    const int parts = parts_of(moments, step, momentum);
    for (int part = 0; part < parts; part++) {
        for (size_t k = 0; k < sizeof turns / sizeof turns[0]; k++) {
            const int axis = turns[k].axis;
            turn_about(axis, turns[k].part * (step / parts) * momentum[axis] / moments[axis], orientation, momentum);
        }
    }
    const double norm = sqrt(orientation[0] * orientation[0] + ces_dot(&orientation[1], &orientation[1]));
    for (int k = 0; k < 4; k++) {
        orientation[k] /= norm;
    }
    /* From the momentum in the world, which is kept to the last bit rather than to rounding of five turns. */
    ces_rotate_back(orientation, world, seen);
    for (int k = 0; k < 3; k++) {
        seen[k] /= moments[k];
    }
    ces_rotate(orientation, seen, spin);
}

void ces_rotate_alone(const double moments[3], bool gyroscopic, double step, double orientation[4], double spin[3])
{
    if (gyroscopic) {
        ces_rotate_freely(moments, step, orientation, spin);
        return;
    }
    const double turn[3] = {step * spin[0], step * spin[1], step * spin[2]};
    ces_turn(orientation, turn);
}

void ces_carry_spin(const double moments[3], const double from[4], const double to[4], double spin[3])
{
    double body[3], momentum[3];
    ces_rotate_back(from, spin, body);
    for (int k = 0; k < 3; k++) {
        body[k] *= moments[k];
    }
    ces_rotate(from, body, momentum);
    ces_rotate_back(to, momentum, body);
    for (int k = 0; k < 3; k++) {
        body[k] /= moments[k];
    }
    ces_rotate(to, body, spin);
}
