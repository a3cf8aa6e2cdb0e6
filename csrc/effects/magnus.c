/*
 * Lift on a spinning sphere. The velocity and the spin are those of the start of the step: the force is small and turns the
 * path at a rate of 0.75 rho_air/rho omega, some 1/s, so that first order is enough.
 */
#include "air.h"
#include "laws.h"

#include "../base/vec3.h"

double ces_spin_lift_factor(double reynolds, double spin)
{
    return 1.0 - (0.675 + 0.15 * (1.0 + tanh(0.28 * (spin - 2.0)))) * tanh(0.18 * sqrt(reynolds));
}

static double factor(const ces_Air *air, double radius, double speed, double spin)
{
    if (air->low || !(speed > 0.0)) {
        return 1.0;
    }
    return ces_spin_lift_factor(ces_reynolds(air, speed, radius), spin * 2.0 * radius / speed);
}

/* Of a sphere that leaves the drum rolling; an eighth of it at the end of the flight, as for the drag. */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    const ces_Air air = ces_air(parameters);
    const double spin = scale->rolling_speed / scale->radius, speed = scale->speed;
    if (!(spin > 0.0 && speed > 0.0) || air.density == 0.0) {
        return 0.0;
    }
    if (scale->gravity == 0.0) {
        return HUGE_VAL;
    }
    return factor(&air, scale->radius, speed, spin) * 0.125 * 0.75 * air.density / scale->material.density * spin *
           speed / scale->gravity;
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def;
    return ces_air_start(parameters, "magnus", "0 (Loth) or 1 (Rubinow & Keller)", state, error);
}

static void force(const void *state, const ces_Grain *grain, double out[3])
{
    if (grain->shape->kind != CES_SPHERE) {
        return; /* no law is known for tumbling flakes and rods */
    }
    const ces_Air *air = state;
    const double r = grain->radius;
    double lift[3];
    ces_cross(grain->angular_velocity, grain->relative_velocity, lift);
    const double scale = factor(air, r, ces_norm(grain->relative_velocity), ces_norm(grain->angular_velocity));
    ces_add_scaled(out, scale * CES_PI * r * r * r * air->density, lift);
}

/* clang-format off */
const ces_Effect ces_magnus = {
    .name = "magnus",
    .doc = "lift of the air on a spinning sphere",
    .source = "Rubinow & Keller, J. Fluid Mech. 11 (1961) 447: pi r^3 rho_air omega x v, at low Re; at any Re with the "
              "factor of Loth, AIAA J. 46 (2008) 801",
    .parameters = {
        {"law", "1", CES_AIR_GENERAL_LAW, 0.0, 1.0, "0 Loth, 1 Rubinow & Keller (three times too large above Re = 30)"},
        CES_AIR_PARAMETERS,
    },
    .size_formula = "1/8 C*(Re) 3/4 rho_air/rho omega v/g, omega that of a sphere that rolls off the drum",
    .size = size,
    .state_size = sizeof(ces_Air),
    .start = start,
    .force = force,
};
/* clang-format on */
