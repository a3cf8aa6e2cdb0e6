/* Drag of the air on a sphere. It is stiff for fine grains, so it is handed over as a rate for an implicit step. */
#include "air.h"
#include "laws.h"

#include "../base/vec3.h"

double ces_drag_multiple_schiller_naumann(double reynolds)
{
    /* Below 1e-6 the correction is under 2e-5 of a drag that is itself nothing: no pow for a grain at rest. */
    if (reynolds < 1e-6) {
        return 1.0;
    }
    return reynolds < 1000.0 ? 1.0 + 0.15 * pow(reynolds, 0.687) : 0.44 / 24.0 * reynolds;
}

double ces_drag_coefficient_stokes(double reynolds)
{
    return 24.0 / reynolds;
}

double ces_drag_coefficient_schiller_naumann(double reynolds)
{
    return 24.0 / reynolds * ces_drag_multiple_schiller_naumann(reynolds);
}

double ces_drag_over_weight(const ces_EffectScale *scale, double coefficient, double air_density)
{
    if (!(scale->speed > 0.0) || air_density == 0.0) {
        return 0.0;
    }
    if (scale->gravity == 0.0) {
        return HUGE_VAL;
    }
    const double drag = 0.75 * coefficient * air_density / scale->material.density * scale->speed * scale->speed /
                        (2.0 * scale->radius);
    /* The speed is that of the end of the flight, which grains reach only there: an eighth stands for the way. */
    return 0.125 * drag / scale->gravity;
}

static double size(const ces_EffectScale *scale, const double *parameters)
{
    const ces_Air air = ces_air(parameters);
    const double reynolds = ces_reynolds(&air, scale->speed, scale->radius);
    return ces_drag_over_weight(
        scale, air.low ? ces_drag_coefficient_stokes(reynolds) : ces_drag_coefficient_schiller_naumann(reynolds),
        air.density);
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def;
    return ces_air_start(parameters, "drag", "0 (Schiller-Naumann) or 1 (Stokes)", state, error);
}

static double damping(const void *state, const ces_Grain *grain)
{
    const ces_Air *air = state;
    const double stokes_rate = 6.0 * CES_PI * air->viscosity * grain->radius / grain->mass;
    if (air->low) {
        return stokes_rate;
    }
    const double reynolds = ces_reynolds(air, ces_norm(grain->relative_velocity), grain->radius);
    return stokes_rate * ces_drag_multiple_schiller_naumann(reynolds);
}

/* clang-format off */
const ces_Effect ces_drag = {
    .name = "drag",
    .doc = "drag of the air on a sphere",
    .source = "Schiller & Naumann, Z. VDI 77 (1933) 318: C_D = 24/Re (1 + 0.15 Re^0.687) for Re < 1000, else 0.44; "
              "or Stokes",
    .parameters = {
        {"law", "1", CES_AIR_GENERAL_LAW, 0.0, 1.0, "0 Schiller-Naumann, 1 Stokes (too small above Re = 0.2)"},
        CES_AIR_PARAMETERS,
    },
    .size_formula = "1/8 C_D(Re) 3/4 rho_air/rho v^2/(g d)",
    .size = size,
    .state_size = sizeof(ces_Air),
    .start = start,
    .damping = damping,
};
/* clang-format on */
