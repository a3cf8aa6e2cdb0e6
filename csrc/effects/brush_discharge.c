/* What touches the brush loses its charge, whatever it is made of. */
#include "laws.h"

/* The force on the charge that the brush takes away, at the drum: an insulator's pinning, a conductor's lift. */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    (void)parameters;
    if (!scale->has_brush) {
        return 0.0;
    }
    if (scale->material.kind == CES_CONDUCTOR) {
        return 3.0 * CES_SPHERE_K_F * ces_field_over_weight(scale);
    }
    const double k = scale->material.permittivity / (scale->material.permittivity + 2.0);
    return 6.75 * k * k * ces_field_over_weight(scale);
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def, (void)parameters, (void)state, (void)error;
    return CES_OK;
}

static double charge(const void *state, const ces_Grain *grain, double step)
{
    (void)state, (void)step;
    return grain->touched & CES_TOUCHED_BRUSH ? 0.0 : grain->charge;
}

const ces_Effect ces_brush_discharge = {
    .name = "brush_discharge",
    .doc = "a grain that touches the brush loses its charge",
    .source = "Critelli et al., SIMUL 2014",
    .size_formula = "conductor: 3 (zeta(3) + 1/6) eps0 E^2/(r rho g); insulator: 6.75 k^2 eps0 E^2/(r rho g), "
                    "k = eps_r/(eps_r + 2)",
    .size = size,
    .start = start,
    .charge = charge,
};
