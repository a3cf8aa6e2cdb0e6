/* The Coulomb force Q E on every charge, at the field of its centre. */
#include "laws.h"

#include <math.h>

double ces_field_over_weight(const ces_EffectScale *scale)
{
    if (scale->voltage == 0.0 || scale->field == 0.0) {
        return 0.0;
    }
    if (scale->gravity == 0.0) {
        return HUGE_VAL;
    }
    return CES_VACUUM_PERMITTIVITY * scale->field * scale->field /
           (scale->radius * scale->material.density * scale->gravity);
}

/* Of the charge that contact or corona gives. A grain may also be given a charge by hand, so no corona is asked for. */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    (void)parameters;
    if (scale->material.kind == CES_CONDUCTOR) {
        return 3.0 * CES_SPHERE_K_Q * ces_field_over_weight(scale);
    } /* a middling may have either charge; this is the larger one from eps_r = 1.6 on */
    const double k = scale->material.permittivity / (scale->material.permittivity + 2.0);
    return 9.0 * k * ces_field_over_weight(scale);
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def, (void)parameters, (void)state, (void)error;
    return CES_OK;
}

static void force(const void *state, const ces_Grain *grain, double out[3])
{
    (void)state;
    out[0] += grain->charge * grain->field[0];
    out[1] += grain->charge * grain->field[1];
    out[2] += grain->charge * grain->field[2];
}

const ces_Effect ces_electric_force = {
    .name = "electric_force",
    .doc = "force Q E of the field on a charge",
    .source = "Coulomb",
    .needs = CES_NEEDS_FIELD,
    .size_formula =
        "conductor: 3 (pi^2/6) eps0 E^2/(r rho g); insulator: 9 k eps0 E^2/(r rho g), k = eps_r/(eps_r + 2)",
    .size = size,
    .start = start,
    .force = force,
};
