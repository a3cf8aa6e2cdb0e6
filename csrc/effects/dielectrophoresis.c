/* Pull of a field that is not uniform on what it polarises, charged or not: towards where it is stronger. */
#include "laws.h"

#include "../base/vec3.h"

enum { STRENGTH };

typedef struct Dielectrophoresis {
    double strength;
} Dielectrophoresis;

double ces_polarisability(const ces_MaterialDef *material)
{
    return material->kind == CES_CONDUCTOR ? 1.0 : (material->permittivity - 1.0) / (material->permittivity + 2.0);
}

static double size(const ces_EffectScale *scale, const double *parameters)
{
    const double pull = parameters[STRENGTH] * 1.5 * CES_VACUUM_PERMITTIVITY * ces_polarisability(&scale->material) *
                        scale->square_gradient;
    if (pull == 0.0) {
        return 0.0;
    }
    return scale->gravity > 0.0 ? pull / (scale->material.density * scale->gravity) : HUGE_VAL;
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def, (void)error;
    *(Dielectrophoresis *)state = (Dielectrophoresis){.strength = parameters[STRENGTH]};
    return CES_OK;
}

static void force(const void *state, const ces_Grain *grain, double out[3])
{
    const double r = grain->radius, strength = ((const Dielectrophoresis *)state)->strength;
    ces_add_scaled(out,
                   strength * 2.0 * CES_PI * r * r * r * CES_VACUUM_PERMITTIVITY * ces_polarisability(grain->material),
                   grain->square_gradient);
}

const ces_Effect ces_dielectrophoresis = {
    .name = "dielectrophoresis",
    .doc = "pull towards where the field is stronger, 2 pi r^3 eps0 K grad E^2",
    .source = "Pohl, Dielectrophoresis, Cambridge 1978; K = (eps_r - 1)/(eps_r + 2), of a conductor 1",
    .needs = CES_NEEDS_GRADIENT,
    .parameters = {{"strength", "1", 1.0, 0.0, 1e4, "multiple of the law, to ask how landings respond to it"}},
    .size_formula = "1.5 eps0 K |grad E^2|/(rho g)",
    .size = size,
    .state_size = sizeof(Dielectrophoresis),
    .start = start,
    .force = force,
};
