/* Drag of the air on a sphere. It is stiff for fine grains, so it is handed over as a rate for an implicit step. */
#include "laws.h"

#include "../base/status.h"
#include "../base/vec3.h"

enum { LAW, DENSITY, VISCOSITY };
enum { SCHILLER_NAUMANN, STOKES };

typedef struct Drag {
    double density;   /* kg/m3, of air */
    double viscosity; /* Pa s */
    bool stokes;
} Drag;

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
    const double reynolds = parameters[DENSITY] * scale->speed * 2.0 * scale->radius / parameters[VISCOSITY];
    return ces_drag_over_weight(scale,
                                parameters[LAW] == STOKES ? ces_drag_coefficient_stokes(reynolds)
                                                          : ces_drag_coefficient_schiller_naumann(reynolds),
                                parameters[DENSITY]);
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def;
    if (parameters[LAW] != SCHILLER_NAUMANN && parameters[LAW] != STOKES) {
        return ces_fail(error, CES_INPUT, "drag.law is %g, must be %d (Schiller-Naumann) or %d (Stokes)",
                        parameters[LAW], SCHILLER_NAUMANN, STOKES);
    }
    *(Drag *)state = (Drag){
        .density = parameters[DENSITY],
        .viscosity = parameters[VISCOSITY],
        .stokes = parameters[LAW] == STOKES,
    };
    return CES_OK;
}

static double damping(const void *state, const ces_Grain *grain)
{
    const Drag *drag = state;
    const double stokes_rate = 6.0 * CES_PI * drag->viscosity * grain->radius / grain->mass;
    if (drag->stokes) {
        return stokes_rate;
    }
    const double reynolds = drag->density * ces_norm(grain->relative_velocity) * 2.0 * grain->radius / drag->viscosity;
    return stokes_rate * ces_drag_multiple_schiller_naumann(reynolds);
}

/* clang-format off */
const ces_Effect ces_drag = {
    .name = "drag",
    .doc = "drag of the air on a sphere",
    .source = "Schiller & Naumann, Z. VDI 77 (1933) 318: C_D = 24/Re (1 + 0.15 Re^0.687) for Re < 1000, else 0.44; "
              "or Stokes",
    .parameters = {
        {"law",       "1",      SCHILLER_NAUMANN, 0.0, 1.0,  "0 Schiller-Naumann, 1 Stokes (too small above Re = 0.2)"},
        {"density",   "kg/m3",  1.204,            0.0, 1e3,  "of the air"},
        {"viscosity", "Pa s",   1.81e-5,          1e-9, 1e3, "dynamic, of the air"},
    },
    .size_formula = "1/8 C_D(Re) 3/4 rho_air/rho v^2/(g d)",
    .size = size,
    .state_size = sizeof(Drag),
    .start = start,
    .damping = damping,
};
/* clang-format on */
