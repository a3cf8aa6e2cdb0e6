/*
 * Air that the drum drags along: a turbulent layer, fastest at the drum's surface. The friction is that measured on
 * cylinders that turn in still air; the profile is the law of the wall, down to where it reaches the still air.
 */
#include "laws.h"

#include <math.h>

enum { SPEED, DENSITY, VISCOSITY };

#define LEAST_REYNOLDS 100.0 /* slower drums drag a few mm/s of air, and not by this law */
#define LAYER_SHARE 0.4      /* measured: what a force counts for that acts on the first centimetres of the flight */

typedef struct Wind {
    double surface_speed;     /* m/s, clockwise */
    double friction_velocity; /* m/s, with the sign of the surface's */
    double friction_length;   /* m, nu over the friction velocity */
    double thickness;         /* m, height above which the air stands still */
} Wind;

double ces_rotating_cylinder_friction(double reynolds)
{
    if (!(reynolds >= LEAST_REYNOLDS)) {
        return 0.0;
    }
    /* 1/sqrt(C) = -0.6 + 4.07 log10(Re sqrt(C)); a round leaves at most 0.4 of the error. */
    double x = 10.0;
    for (int k = 0; k < 60; k++) {
        x = -0.6 + 4.07 * log10(reynolds / x);
    }
    return 1.0 / (x * x);
}

double ces_wall_law(double y)
{
    return log1p(0.4 * y) / 0.4 + 7.8 * (1.0 - exp(-y / 11.0) - y / 11.0 * exp(-y / 3.0));
}

/* The drag that a grain at the drum's speed has in still air, and not in air that comes along. */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    const double speed = scale->surface_speed;
    const double reynolds = parameters[DENSITY] * speed * 2.0 * scale->radius / parameters[VISCOSITY];
    if (!(reynolds > 0.0)) {
        return 0.0;
    }
    if (scale->gravity == 0.0) {
        return HUGE_VAL;
    }
    const double drag = 0.75 * ces_drag_coefficient_schiller_naumann(reynolds) * parameters[DENSITY] /
                        scale->material.density * speed * speed / (2.0 * scale->radius);
    return LAYER_SHARE * drag / scale->gravity;
}

/* Speed of the air over that of the surface; falls with the height. */
static double share(const Wind *wind, double height)
{
    return 1.0 - ces_wall_law(height / wind->friction_length) * wind->friction_velocity / wind->surface_speed;
}

static double thickness(const Wind *wind, double radius)
{
    double low = 0.0, high = radius; /* by the law of friction it is some 0.11 of the radius */
    for (int k = 0; k < 60; k++) {
        const double middle = 0.5 * (low + high);
        *(share(wind, middle) > 0.0 ? &low : &high) = middle;
    }
    return low;
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)error;
    const double surface = parameters[SPEED] * def->drum_radius;
    const double reynolds = parameters[DENSITY] * fabs(surface) * def->drum_radius / parameters[VISCOSITY];
    const double friction = surface * sqrt(0.5 * ces_rotating_cylinder_friction(reynolds));
    Wind *wind = state;
    *wind = (Wind){.surface_speed = surface, .friction_velocity = friction};
    if (friction != 0.0) {
        wind->friction_length = parameters[VISCOSITY] / (parameters[DENSITY] * fabs(friction));
        wind->thickness = thickness(wind, def->drum_radius);
    }
    return CES_OK;
}

static void air(const void *state, const ces_Grain *grain, double out[3])
{
    const Wind *wind = state;
    if (grain->height < wind->thickness) {
        const double speed = share(wind, grain->height) * wind->surface_speed;
        out[0] += speed * grain->normal[1];
        out[1] -= speed * grain->normal[0];
    }
}

/* clang-format off */
const ces_Effect ces_wind = {
    .name = "wind",
    .doc = "air that the drum drags along",
    .source = "friction: Theodorsen & Regier, NACA Report 793 (1944); profile: Reichardt, ZAMM 31 (1951) 208",
    .needs = CES_NEEDS_GROUND,
    .parameters = {
        {"speed",     "rad/s", 0.0,    -1e3, 1e3, "of the drum, positive: its top moves to +x"},
        {"density",   "kg/m3", 1.204,   0.0, 1e3, "of the air"},
        {"viscosity", "Pa s",  1.81e-5, 1e-9, 1e3, "dynamic, of the air"},
    },
    .size_formula = "0.4 C_D(Re) 3/4 rho_air/rho u^2/(g d), u the speed of the drum's surface",
    .size = size,
    .state_size = sizeof(Wind),
    .start = start,
    .air = air,
};
/* clang-format on */
