#include "machine.h"

#include "../base/status.h"
#include "../base/vec3.h"

#define CES_LONGEST 1e3      /* m, of any part of a machine */
#define CES_FASTEST_SPIN 1e4 /* rad/s */
#define CES_FASTEST_BELT 1e2 /* m/s */

static ces_Status check(const ces_SurfaceDef *def, ces_Error *error)
{
    const double norm =
        sqrt(def->orientation[0] * def->orientation[0] + ces_dot(&def->orientation[1], &def->orientation[1]));
    if (!(fabs(norm - 1.0) < 1e-9)) {
        return ces_fail(error, CES_INPUT, "surface '%s': the norm of its orientation is %g, must be 1", def->name,
                        norm);
    }
    for (int k = 0; k < 3; k++) {
        const bool sized = def->shape != CES_PLANE;
        const double least_size = def->shape == CES_CYLINDER ? 1e-6 : 0.0;
        ces_Status status;
        if ((status =
                 ces_check_range(error, "position of a surface", def->position[k], -CES_LONGEST, CES_LONGEST, "m")) ||
            (sized &&
             (status = ces_check_range(error, "size of a surface", def->size[k], least_size, CES_LONGEST, "m"))) ||
            (status = ces_check_range(error, "belt velocity", def->belt_velocity[k], -CES_FASTEST_BELT,
                                      CES_FASTEST_BELT, "m/s")) ||
            (status = ces_check_range(error, "amplitude of vibration", def->vibration[k], -1.0, 1.0, "m"))) {
            return status;
        }
    }
    if (def->shape == CES_CYLINDER && !(def->size[0] == def->size[1])) {
        return ces_fail(error, CES_INPUT,
                        "surface '%s': a cylinder's size is (radius, radius, length), got radii %g and %g m", def->name,
                        def->size[0], def->size[1]);
    }
    if (def->shape != CES_CYLINDER && def->angular_speed != 0.0) {
        return ces_fail(error, CES_INPUT, "surface '%s': angular_speed is %g rad/s, only a cylinder may turn",
                        def->name, def->angular_speed);
    }
    const ces_Status status = ces_check_range(error, "angular speed of a surface", def->angular_speed,
                                              -CES_FASTEST_SPIN, CES_FASTEST_SPIN, "rad/s");
    return status ? status : ces_check_range(error, "frequency of vibration", def->vibration_frequency, 0.0, 1e4, "Hz");
}

ces_Status ces_surface_create(const ces_SurfaceDef *def, ces_Surface *surface, ces_Error *error)
{
    const ces_Status status = check(def, error);
    if (status != CES_OK) {
        return status;
    }
    *surface = (ces_Surface){.def = *def};
    for (int column = 0; column < 3; column++) {
        double axis[3] = {0.0, 0.0, 0.0}, world[3];
        axis[column] = 1.0;
        ces_rotate(def->orientation, axis, world);
        for (int row = 0; row < 3; row++) {
            surface->rotation[row][column] = world[row];
        }
    }
    surface->half[0] = def->shape == CES_CYLINDER ? def->size[0] : 0.5 * def->size[0];
    surface->half[1] = def->shape == CES_CYLINDER ? def->size[1] : 0.5 * def->size[1];
    surface->half[2] = 0.5 * def->size[2];
    for (int row = 0; row < 3; row++) {
        const double *r = surface->rotation[row];
        surface->bounds[row] = def->shape == CES_PLANE ? HUGE_VAL
                                                       : fabs(r[0]) * surface->half[0] + fabs(r[1]) * surface->half[1] +
                                                             fabs(r[2]) * surface->half[2];
        surface->spin[row] = r[2] * def->angular_speed;
    }
    return CES_OK;
}

void ces_surface_place(ces_Surface *surface, double time, double step)
{
    const double omega = 2.0 * CES_PI * surface->def.vibration_frequency;
    const double now = omega > 0.0 ? sin(omega * time) : 0.0;
    const double then = omega > 0.0 ? sin(omega * (time + step)) : 0.0;
    for (int k = 0; k < 3; k++) {
        surface->center[k] = surface->def.position[k] + surface->def.vibration[k] * now;
        surface->displacement[k] = surface->def.vibration[k] * (then - now);
        surface->velocity[k] = surface->displacement[k] / step;
    }
    surface->travel = ces_norm(surface->displacement);
}

static double box_distance(const double half[3], const double p[3], double n[3])
{
    double outside[3], squared = 0.0;
    int nearest = 0;
    double inside = -HUGE_VAL; /* the largest of the negative distances to the faces */
    for (int k = 0; k < 3; k++) {
        const double beyond = fabs(p[k]) - half[k];
        outside[k] = beyond > 0.0 ? copysign(beyond, p[k]) : 0.0;
        squared += outside[k] * outside[k];
        if (beyond > inside) {
            inside = beyond;
            nearest = k;
        }
    }
    if (squared > 0.0) {
        const double distance = sqrt(squared);
        for (int k = 0; k < 3; k++) {
            n[k] = outside[k] / distance;
        }
        return distance;
    }
    n[0] = n[1] = n[2] = 0.0;
    n[nearest] = copysign(1.0, p[nearest]);
    return inside;
}

static double cylinder_distance(const double half[3], const double p[3], double n[3])
{
    const double rho = sqrt(p[0] * p[0] + p[1] * p[1]);
    /* On the axis every direction is as near as any other: take x. */
    const double ex = rho > 0.0 ? p[0] / rho : 1.0;
    const double ey = rho > 0.0 ? p[1] / rho : 0.0;
    const double side = rho - half[0];
    const double cap = fabs(p[2]) - half[2];
    const double up = copysign(1.0, p[2]);
    double radial = 0.0, axial = 0.0, distance;
    if (side > 0.0 && cap > 0.0) {
        distance = hypot(side, cap);
        radial = side / distance;
        axial = cap / distance;
    } else if (side >= cap) {
        distance = side;
        radial = 1.0;
    } else {
        distance = cap;
        axial = 1.0;
    }
    n[0] = radial * ex;
    n[1] = radial * ey;
    n[2] = axial * up;
    return distance;
}

double ces_surface_distance(const ces_Surface *surface, const double point[3], double normal[3])
{
    const double(*r)[3] = surface->rotation;
    double from_center[3], local[3], n[3] = {0.0, 1.0, 0.0};
    ces_subtract(point, surface->center, from_center);
    for (int k = 0; k < 3; k++) {
        local[k] = r[0][k] * from_center[0] + r[1][k] * from_center[1] + r[2][k] * from_center[2];
    }
    double distance = 0.0;
    switch (surface->def.shape) {
    case CES_PLANE:
        distance = local[1];
        break;
    case CES_BOX:
        distance = box_distance(surface->half, local, n);
        break;
    case CES_CYLINDER:
        distance = cylinder_distance(surface->half, local, n);
        break;
    }
    for (int k = 0; k < 3; k++) {
        normal[k] = ces_dot(r[k], n);
    }
    return distance;
}

void ces_surface_velocity(const ces_Surface *surface, const double point[3], double velocity[3])
{
    double arm[3];
    ces_subtract(point, surface->center, arm);
    ces_cross(surface->spin, arm, velocity);
    for (int k = 0; k < 3; k++) {
        velocity[k] += surface->def.belt_velocity[k] + surface->velocity[k];
    }
}
