#include "outlet.h"

#include <math.h>
#include <stdio.h>

#include "../base/status.h"
#include "../base/vec3.h"

static ces_Status check_vector(const double vector[3], double most, const char *what, const char *unit,
                               ces_Error *error)
{
    ces_Status status = CES_OK;
    for (int k = 0; k < 3 && status == CES_OK; k++) {
        char name[64];
        snprintf(name, sizeof name, "%s.%c", what, "xyz"[k]);
        status = ces_check_range(error, name, vector[k], -most, most, unit);
    }
    return status;
}

ces_Status ces_outlet_start(const ces_FeedDef *def, const double gravity[3], ces_Outlet *outlet, ces_Error *error)
{
    ces_Status status = check_vector(def->center, 1e6, "feed.center", "m", error);
    status = status != CES_OK ? status : check_vector(def->edge_u, 1e3, "feed.edge_u", "m", error);
    status = status != CES_OK ? status : check_vector(def->edge_v, 1e3, "feed.edge_v", "m", error);
    status = status != CES_OK ? status : check_vector(def->velocity, 1e3, "feed.velocity", "m/s", error);
    status = status != CES_OK ? status : check_vector(gravity, 1e6, "gravity", "m/s2", error);
    if (status != CES_OK) {
        return status;
    }
    *outlet = (ces_Outlet){0};
    ces_copy(def->center, outlet->center);
    ces_copy(def->velocity, outlet->velocity);
    ces_copy(gravity, outlet->gravity);
    const double *edges[2] = {def->edge_u, def->edge_v};
    for (int k = 0; k < 2; k++) {
        outlet->edge[k] = ces_norm(edges[k]);
        if (!(outlet->edge[k] > 0.0)) {
            return ces_fail(error, CES_INPUT, "feed.edge_%c is 0 m long, outside (0, 1000] m", "uv"[k]);
        }
        ces_add_scaled(outlet->axis[k], 1.0 / outlet->edge[k], edges[k]);
    }
    const double cosine = ces_dot(outlet->axis[0], outlet->axis[1]);
    if (fabs(cosine) > 1e-9) {
        return ces_fail(error, CES_INPUT,
                        "feed.edge_u and feed.edge_v are not at right angles: the cosine of their angle is %g, outside "
                        "[-1e-09, 1e-09]",
                        cosine);
    }
    ces_cross(outlet->axis[0], outlet->axis[1], outlet->axis[2]);
    return CES_OK;
}

void ces_outlet_point(const ces_Outlet *outlet, double diameter, double u, double v, double position[3])
{
    ces_copy(outlet->center, position);
    ces_add_scaled(position, (u - 0.5) * (outlet->edge[0] - diameter), outlet->axis[0]);
    ces_add_scaled(position, (v - 0.5) * (outlet->edge[1] - diameter), outlet->axis[1]);
}

bool ces_outlet_contains(const ces_Outlet *outlet, const double position[3])
{
    double offset[3];
    ces_subtract(position, outlet->center, offset);
    return fabs(ces_dot(offset, outlet->axis[0])) <= 0.5 * outlet->edge[0] &&
           fabs(ces_dot(offset, outlet->axis[1])) <= 0.5 * outlet->edge[1];
}

void ces_outlet_flight(const ces_Outlet *outlet, double age, double moved[3])
{
    for (int k = 0; k < 3; k++) {
        moved[k] = age * (outlet->velocity[k] + 0.5 * age * outlet->gravity[k]);
    }
}

/* The last time t >= 0 at which |v t + g t^2/2| <= distance; infinity: always. */
static double last_time_within(double velocity, double gravity, double distance)
{
    const double along = gravity < 0.0 ? -velocity : velocity;
    const double pull = fabs(gravity);
    if (pull == 0.0) {
        return distance / fabs(velocity);
    }
    const double root = sqrt(along * along + 2.0 * pull * distance);
    return along > 0.0 ? 2.0 * distance / (along + root) : (root - along) / pull;
}

/* The first time at which |v t + g t^2/2| = distance; infinity: never. */
static double first_time_at(double velocity, double gravity, double distance)
{
    const double along = gravity < 0.0 ? -velocity : velocity;
    const double rest = along * along - 2.0 * fabs(gravity) * distance;
    if (along < 0.0 && rest >= 0.0) { /* thrown against gravity, and farther than that */
        return 2.0 * distance / (sqrt(rest) - along);
    }
    return last_time_within(velocity, gravity, distance);
}

/* By the axis along which it is over soonest. Centres of grains that leave are less than an edge apart. */
static double clear_time(const ces_Outlet *outlet, double diameter, double (*time)(double, double, double))
{
    const double across =
        time(ces_dot(outlet->axis[2], outlet->velocity), ces_dot(outlet->axis[2], outlet->gravity), diameter);
    const double along_u = time(ces_dot(outlet->axis[0], outlet->velocity), ces_dot(outlet->axis[0], outlet->gravity),
                                outlet->edge[0] + diameter);
    const double along_v = time(ces_dot(outlet->axis[1], outlet->velocity), ces_dot(outlet->axis[1], outlet->gravity),
                                outlet->edge[1] + diameter);
    return fmin(across, fmin(along_u, along_v));
}

double ces_outlet_first_clear(const ces_Outlet *outlet, double diameter)
{
    return clear_time(outlet, diameter, first_time_at);
}

double ces_outlet_last_clear(const ces_Outlet *outlet, double diameter)
{
    return clear_time(outlet, diameter, last_time_within);
}
