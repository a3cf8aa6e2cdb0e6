/*
 * What the drag of a grain that is no sphere has over that of the sphere of equal volume, which the effect drag gives: the
 * two together are the law of Haider & Levenspiel. On a sphere this adds nothing.
 */
#include "air.h"
#include "laws.h"

#include "../base/vec3.h"

/* Letters as in the paper, eq. 10: C_D = 24/Re (1 + A Re^B) + C/(1 + D/Re). */
double ces_drag_multiple_haider_levenspiel(double reynolds, double sphericity)
{
    const double s = sphericity;
    const double A = exp(2.3288 - s * (6.4581 - s * 2.4486));
    const double B = 0.0964 + 0.5565 * s;
    const double C = exp(4.905 - s * (13.8944 - s * (18.4222 - s * 10.2599)));
    const double D = exp(1.4681 + s * (12.2584 - s * (20.7322 - s * 15.8855)));
    return 1.0 + A * pow(reynolds, B) + C / 24.0 * reynolds * reynolds / (reynolds + D);
}

double ces_drag_coefficient_haider_levenspiel(double reynolds, double sphericity)
{
    return 24.0 / reynolds * ces_drag_multiple_haider_levenspiel(reynolds, sphericity);
}

static double sphere_multiple(bool low, double reynolds)
{
    return low ? 1.0 : ces_drag_multiple_schiller_naumann(reynolds);
}

static double size(const ces_EffectScale *scale, const double *parameters)
{
    const ces_Air air = ces_air(parameters);
    const double reynolds = ces_reynolds(&air, scale->speed, scale->radius);
    if (!(scale->sphericity > 0.0 && scale->sphericity < 1.0 && reynolds > 0.0)) {
        return 0.0;
    }
    const double excess =
        ces_drag_multiple_haider_levenspiel(reynolds, scale->sphericity) - sphere_multiple(air.low, reynolds);
    return ces_drag_over_weight(scale, 24.0 / reynolds * fabs(excess), air.density);
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def;
    return ces_air_start(parameters, "shape_drag", "0 (Schiller-Naumann) or 1 (Stokes)", state, error);
}

static double damping(const void *state, const ces_Grain *grain)
{
    if (grain->shape->sphericity >= 1.0) {
        return 0.0;
    }
    const ces_Air *air = state;
    const double stokes_rate = 6.0 * CES_PI * air->viscosity * grain->radius / grain->mass;
    const double reynolds = ces_reynolds(air, ces_norm(grain->relative_velocity), grain->radius);
    return stokes_rate * (ces_drag_multiple_haider_levenspiel(reynolds, grain->shape->sphericity) -
                          sphere_multiple(air->low, reynolds));
}

/* clang-format off */
const ces_Effect ces_shape_drag = {
    .name = "shape_drag",
    .doc = "what the drag of a grain that is no sphere has over a sphere's of equal volume, by its sphericity",
    .source = "Haider & Levenspiel, Powder Technol. 58 (1989) 63, eq. 10",
    .parameters = {
        {"law", "1", CES_AIR_GENERAL_LAW, 0.0, 1.0, "of the sphere: 0 Schiller-Naumann, 1 Stokes"},
        CES_AIR_PARAMETERS,
    },
    .size_formula = "1/8 [C_D(Re, sphericity) - C_D(Re)] 3/4 rho_air/rho v^2/(g d)",
    .size = size,
    .state_size = sizeof(ces_Air),
    .start = start,
    .damping = damping,
};
/* clang-format on */
