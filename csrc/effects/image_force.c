/* Pull of the grounded drum on a charged insulator. The drum's curvature, a correction of order r/R, is left out. */
#include "laws.h"

#include "../base/vec3.h"

enum { KAPPA };

typedef struct ImageForce {
    double kappa;
} ImageForce;

double ces_image_pull(double charge, double distance, double kappa)
{
    return kappa * charge * charge / (16.0 * CES_PI * CES_VACUUM_PERMITTIVITY * distance * distance);
}

/* At contact, of the charge that corona gives (or that a grain is given by hand, so no corona is asked for). */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    if (!scale->has_drum || scale->material.kind == CES_CONDUCTOR) {
        return 0.0;
    }
    const double k = scale->material.permittivity / (scale->material.permittivity + 2.0);
    return parameters[KAPPA] > 0.0 ? 6.75 * parameters[KAPPA] * k * k * ces_field_over_weight(scale) : 0.0;
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def, (void)error;
    *(ImageForce *)state = (ImageForce){.kappa = parameters[KAPPA]};
    return CES_OK;
}

static void force(const void *state, const ces_Grain *grain, double out[3])
{
    if (grain->material->kind == CES_CONDUCTOR) {
        return; /* a point image is wrong near a conductor: sphere_plane has the exact law */
    }
    const ImageForce *image = state;
    const double distance = grain->height > grain->radius ? grain->height : grain->radius;
    ces_add_scaled(out, -ces_image_pull(grain->charge, distance, image->kappa), grain->normal);
}

/* clang-format off */
const ces_Effect ces_image_force = {
    .name = "image_force",
    .doc = "pull of the grounded drum on a charged insulator, kappa Q^2/(16 pi eps0 s^2)",
    .source = "method of images; Critelli et al., SIMUL 2014, eq. 12, without its permittivity",
    .needs = CES_NEEDS_GROUND,
    .parameters = {
        {"kappa", "1", 1.0, 0.0, 10.0, "1: charge at the centre; up to 1.9: spread over a dielectric sphere"},
    },
    .size_formula = "6.75 kappa k^2 eps0 E^2/(r rho g), k = eps_r/(eps_r + 2)",
    .size = size,
    .state_size = sizeof(ImageForce),
    .start = start,
    .force = force,
};
/* clang-format on */
