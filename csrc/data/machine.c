#include "machine.h"

#include "../base/status.h"
#include "../base/vec3.h"

#define CES_LONGEST 1e3      /* m, of any part of a machine */
#define CES_FASTEST_SPIN 1e4 /* rad/s */
#define CES_FASTEST_BELT 1e2 /* m/s */
#define NO_TURN 1e-13        /* rad: rounding */

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
    *surface = (ces_Surface){.def = *def, .turns = def->shape == CES_MESH && def->angular_speed != 0.0};
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
    if (surface->turns) {
        place_turning_mesh(surface, time, step);
    }
}

/* ---- surfaces of dynamic parts ---------------------------------------------------------------------------------------------- */

ces_Status ces_surface_attach(ces_Surface *surface, const ces_PartDef *part, bool yields, ces_Error *error)
{
    const ces_SurfaceDef *def = &surface->def;
    double back[4] = {part->orientation[0], -part->orientation[1], -part->orientation[2], -part->orientation[3]};
    if (def->shape == CES_PLANE) {
        return ces_fail(error, CES_INPUT, "surface '%s' is a plane, which has no end: it cannot belong to part '%s'",
                        def->name, part->name);
    }
    if (def->angular_speed != 0.0 || ces_norm(def->belt_velocity) > 0.0 || ces_norm(def->vibration) > 0.0) {
        return ces_fail(error, CES_INPUT,
                        "surface '%s' has a motion of its own and belongs to part '%s', which moves it", def->name,
                        part->name);
    }
    ces_subtract(def->position, part->position, surface->carriage.position);
    ces_rotate_back(part->orientation, surface->carriage.position, surface->carriage.position);
    ces_multiply(back, def->orientation, surface->carriage.orientation);
    surface->carriage.yields = yields;
    return CES_OK;
}

static void fill_columns(const double orientation[4], double rotation[3][3])
{
    for (int column = 0; column < 3; column++) {
        double axis[3] = {0.0, 0.0, 0.0}, world[3];
        axis[column] = 1.0;
        ces_rotate(orientation, axis, world);
        for (int row = 0; row < 3; row++) {
            rotation[row][column] = world[row];
        }
    }
}

/* A rotation by share of the turn, times rotation. */
static void turn_columns(const double turn[3], double share, double rotation[3][3], double turned[3][3])
{
    double q[4] = {1.0, 0.0, 0.0, 0.0};
    const double part[3] = {share * turn[0], share * turn[1], share * turn[2]};
    ces_turn(q, part);
    for (int column = 0; column < 3; column++) {
        const double axis[3] = {rotation[0][column], rotation[1][column], rotation[2][column]};
        double world[3];
        ces_rotate(q, axis, world);
        for (int row = 0; row < 3; row++) {
            turned[row][column] = world[row];
        }
    }
}

/* Rotation vector from one orientation to another; of a cylinder only what its axis turns by, for about it it looks the same. */
static void find_turn(const ces_Surface *surface, const double from[4], const double to[4], double turn[3])
{
    const double back[4] = {from[0], -from[1], -from[2], -from[3]};
    double vector[3], w, size;
    if (surface->def.shape == CES_CYLINDER) {
        double old[3], new[3];
        const double axis[3] = {0.0, 0.0, 1.0};
        ces_rotate(from, axis, old);
        ces_rotate(to, axis, new);
        ces_cross(old, new, vector);
        w = ces_dot(old, new);
        size = ces_norm(vector);
        const double angle = atan2(size, w);
        for (int k = 0; k < 3; k++) {
            turn[k] = size > 0.0 ? vector[k] * angle / size : 0.0;
        }
        return;
    }
    double twist[4];
    ces_multiply(to, back, twist);
    w = fabs(twist[0]);
    ces_copy(&twist[1], vector);
    size = ces_norm(vector);
    const double angle = 2.0 * atan2(size, w) * copysign(1.0, twist[0]);
    for (int k = 0; k < 3; k++) {
        turn[k] = size > 0.0 ? vector[k] * angle / size : 0.0;
    }
}

void ces_surface_follow(ces_Surface *surface, const ces_Motion *start, const ces_Motion *end, double step)
{
    ces_Carriage *own = &surface->carriage;
    double from[4], to[4], arm[3], other[3];
    own->start = *start;
    own->end = *end;
    ces_multiply(start->orientation, own->orientation, from);
    ces_multiply(end->orientation, own->orientation, to);
    ces_rotate(start->orientation, own->position, arm);
    ces_rotate(end->orientation, own->position, other);
    for (int k = 0; k < 3; k++) {
        surface->center[k] = start->position[k] + arm[k];
        surface->displacement[k] = end->position[k] + other[k] - surface->center[k];
        surface->velocity[k] = surface->displacement[k] / step;
    }
    find_turn(surface, from, to, own->turn);
    const double angle = ces_norm(own->turn), reach = ces_norm(surface->half);
    surface->turns = angle > NO_TURN;
    fill_columns(from, surface->rotation);
    turn_columns(own->turn, 0.5, surface->rotation, surface->middle);
    turn_columns(own->turn, 1.0, surface->rotation, surface->end);
    for (int row = 0; row < 3; row++) {
        const double *r = surface->rotation[row];
        surface->bounds[row] =
            fabs(r[0]) * surface->half[0] + fabs(r[1]) * surface->half[1] + fabs(r[2]) * surface->half[2];
        surface->spin[row] = own->turn[row] / step;
    }
    surface->travel = ces_norm(surface->displacement) + angle * reach;
    double dv[3], dw[3];
    ces_subtract(end->velocity, start->velocity, dv);
    ces_subtract(end->spin, start->spin, dw);
    own->skin = 0.5 * step * (ces_norm(dv) + ces_norm(dw) * (reach + ces_norm(own->position))) + angle * angle * reach;
}

void ces_surface_path(const ces_Surface *surface, const double point[3], const double path[3], double relative[3])
{
    ces_subtract(path, surface->displacement, relative);
    if (!surface->turns) {
        return;
    }
    double before[3], after[3], local[3];
    ces_subtract(point, surface->center, before);
    for (int k = 0; k < 3; k++) {
        after[k] = before[k] + relative[k];
    }
    for (int k = 0; k < 3; k++) {
        local[k] = surface->end[0][k] * after[0] + surface->end[1][k] * after[1] + surface->end[2][k] * after[2];
    }
    for (int k = 0; k < 3; k++) {
        relative[k] = ces_dot(surface->rotation[k], local) - before[k];
    }
}

void ces_surface_turn(const ces_Surface *surface, double fraction, double direction[3])
{
    if (surface->turns) {
        const double *turn = surface->carriage.turn;
        const double part[3] = {fraction * turn[0], fraction * turn[1], fraction * turn[2]};
        double q[4] = {1.0, 0.0, 0.0, 0.0};
        ces_turn(q, part);
        ces_rotate(q, direction, direction);
    }
}

void ces_matter_velocity(const ces_Motion *part, const double arm[3], double velocity[3])
{
    ces_cross(part->spin, arm, velocity);
    ces_add_scaled(velocity, 1.0, part->velocity);
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
    if (!surface->turns) {
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
