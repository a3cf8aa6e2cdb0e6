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
        const bool sized = def->shape == CES_BOX || def->shape == CES_CYLINDER;
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
    if (def->shape != CES_CYLINDER && def->shape != CES_MESH && def->angular_speed != 0.0) {
        return ces_fail(error, CES_INPUT, "surface '%s': angular_speed is %g rad/s, only a cylinder or a mesh may turn",
                        def->name, def->angular_speed);
    }
    const ces_Status status = ces_check_range(error, "angular speed of a surface", def->angular_speed,
                                              -CES_FASTEST_SPIN, CES_FASTEST_SPIN, "rad/s");
    return status ? status : ces_check_range(error, "frequency of vibration", def->vibration_frequency, 0.0, 1e4, "Hz");
}

/* Half of the edges of the box that holds the shape, in its own frame and round its centre. */
static void find_half(ces_Surface *surface)
{
    const ces_SurfaceDef *def = &surface->def;
    for (int k = 0; k < 3; k++) {
        const bool is_radius = def->shape == CES_CYLINDER && k < 2;
        surface->half[k] = is_radius ? def->size[k] : 0.5 * def->size[k];
    }
    if (surface->mesh != NULL) {
        ces_copy(surface->mesh->half, surface->half);
        if (def->angular_speed != 0.0) {
            surface->half[0] = surface->half[1] = surface->mesh->spread;
        }
    }
}

ces_Status ces_surface_create(const ces_SurfaceDef *def, ces_Surface *surface, ces_Error *error)
{
    ces_Status status = check(def, error);
    if (status != CES_OK) {
        return status;
    }
    *surface = (ces_Surface){.def = *def};
    surface->def.vertices = NULL; /* borrowed; the mesh has its own */
    surface->def.triangles = NULL;
    if (def->shape == CES_MESH) {
        status = ces_mesh_create(def->name, def->vertices, def->vertex_count, def->triangles, def->triangle_count,
                                 &surface->mesh, error);
        if (status != CES_OK) {
            return status;
        }
    }
    for (int column = 0; column < 3; column++) {
        double axis[3] = {0.0, 0.0, 0.0}, world[3];
        axis[column] = 1.0;
        ces_rotate(def->orientation, axis, world);
        for (int row = 0; row < 3; row++) {
            surface->rest[row][column] = surface->rotation[row][column] = world[row];
            surface->middle[row][column] = surface->end[row][column] = world[row];
        }
    }
    find_half(surface);
    for (int row = 0; row < 3; row++) {
        const double *r = surface->rotation[row];
        surface->bounds[row] = def->shape == CES_PLANE ? HUGE_VAL
                                                       : fabs(r[0]) * surface->half[0] + fabs(r[1]) * surface->half[1] +
                                                             fabs(r[2]) * surface->half[2];
        surface->spin[row] = r[2] * def->angular_speed;
    }
    return CES_OK;
}

void ces_surface_free(ces_Surface *surface)
{
    ces_mesh_destroy(surface->mesh);
    surface->mesh = NULL;
}

/* rest, turned by an angle about its own z axis. */
static void turn_about_z(double rest[3][3], double angle, double turned[3][3])
{
    const double c = cos(angle), s = sin(angle);
    for (int row = 0; row < 3; row++) {
        turned[row][0] = c * rest[row][0] + s * rest[row][1];
        turned[row][1] = c * rest[row][1] - s * rest[row][0];
        turned[row][2] = rest[row][2];
    }
}

static void place_turning_mesh(ces_Surface *surface, double time, double step)
{
    const double speed = surface->def.angular_speed;
    turn_about_z(surface->rest, speed * time, surface->rotation);
    turn_about_z(surface->rest, speed * (time + 0.5 * step), surface->middle);
    turn_about_z(surface->rest, speed * (time + step), surface->end);
    /* A point moves by a chord, 2 rho sin(angle/2), across its direction from the axis halfway. */
    const double chord = 2.0 * sin(0.5 * speed * step);
    for (int row = 0; row < 3; row++) {
        surface->spin[row] = surface->rest[row][2] * chord / step;
    }
    surface->travel += fabs(chord) * surface->mesh->spread;
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
    if (surface->mesh != NULL && surface->def.angular_speed != 0.0) {
        place_turning_mesh(surface, time, step);
    }
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

/* Transposed matrix times vector: from the world into a frame. */
static void into(const double rotation[3][3], const double world[3], double local[3])
{
    for (int k = 0; k < 3; k++) {
        local[k] = rotation[0][k] * world[0] + rotation[1][k] * world[1] + rotation[2][k] * world[2];
    }
}

double ces_surface_distance(const ces_Surface *surface, const double point[3], double normal[3])
{
    const double(*r)[3] = surface->rotation;
    double from_center[3], local[3], n[3] = {0.0, 1.0, 0.0};
    ces_subtract(point, surface->center, from_center);
    into(r, from_center, local);
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
    case CES_MESH:
        distance = ces_mesh_distance(surface->mesh, local, HUGE_VAL, n);
        break;
    }
    for (int k = 0; k < 3; k++) {
        normal[k] = ces_dot(r[k], n);
    }
    return distance;
}

void ces_surface_to_mesh(const ces_Surface *surface, const double point[3], const double path[3], double local[3],
                         double local_path[3])
{
    double before[3], after[3], end[3];
    ces_subtract(point, surface->center, before);
    into(surface->rotation, before, local);
    if (surface->def.angular_speed == 0.0) {
        ces_subtract(path, surface->displacement, after);
        into(surface->rotation, after, local_path);
        return;
    }
    for (int k = 0; k < 3; k++) {
        after[k] = before[k] + path[k] - surface->displacement[k];
    }
    into(surface->end, after, end);
    ces_subtract(end, local, local_path);
}

void ces_surface_from_mesh(const ces_Surface *surface, const double direction[3], double world[3])
{
    for (int k = 0; k < 3; k++) {
        world[k] = ces_dot(surface->middle[k], direction);
    }
}

void ces_surface_shape_velocity(const ces_Surface *surface, const double point[3], double velocity[3])
{
    ces_copy(surface->velocity, velocity);
    if (surface->mesh != NULL) {
        double arm[3], turning[3];
        ces_subtract(point, surface->center, arm);
        ces_cross(surface->spin, arm, turning);
        ces_add_scaled(velocity, 1.0, turning);
    }
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
