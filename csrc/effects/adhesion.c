/*
 * Van der Waals adhesion to what a grain touches, through the asperity that keeps the two apart. A rigid contact knows no
 * distances of nanometres, so the force acts while the contact presses: a pull towards what is touched, from the step after the
 * first in which it pressed, to the one after the last. A collision is no touch: its few microseconds are not a step.
 */
#include "laws.h"

#include "../base/vec3.h"

enum { HAMAKER, ASPERITY, DISTANCE };

typedef struct Adhesion {
    double pull; /* N, of a contact */
} Adhesion;

double ces_van_der_waals_pull(double hamaker, double radius, double distance)
{
    return hamaker * radius / (6.0 * distance * distance);
}

static double size(const ces_EffectScale *scale, const double *parameters)
{
    const double pull = ces_van_der_waals_pull(parameters[HAMAKER], parameters[ASPERITY], parameters[DISTANCE]);
    if (pull == 0.0) {
        return 0.0;
    }
    const double r = scale->radius, mass = scale->material.density * 4.0 / 3.0 * CES_PI * r * r * r;
    return scale->gravity > 0.0 ? pull / (mass * scale->gravity) : HUGE_VAL;
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def, (void)error;
    *(Adhesion *)state =
        (Adhesion){ces_van_der_waals_pull(parameters[HAMAKER], parameters[ASPERITY], parameters[DISTANCE])};
    return CES_OK;
}

static void force(const void *state, const ces_Grain *grain, double out[3])
{
    ces_add_scaled(out, ((const Adhesion *)state)->pull, grain->touch);
}

/* clang-format off */
const ces_Effect ces_adhesion = {
    .name = "adhesion",
    .doc = "van der Waals pull towards what a grain touches, A r_a/(6 z0^2) for each contact",
    .source = "Hamaker, Physica 4 (1937) 1058: sphere and plane, here the asperity of a rough grain",
    .needs = CES_NEEDS_TOUCH,
    .parameters = {
        {"hamaker",  "J", 1e-19,  0.0,   1e-17, "constant A of the two materials"},
        {"asperity", "m", 0.2e-6, 1e-10, 1e-2,  "radius r_a of what touches first"},
        {"distance", "m", 0.4e-9, 1e-10, 1e-6,  "z0, at which they touch"},
    },
    .size_formula = "A r_a/(6 z0^2)/(m g)",
    .size = size,
    .state_size = sizeof(Adhesion),
    .start = start,
    .force = force,
};
/* clang-format on */
