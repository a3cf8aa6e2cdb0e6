/* Weight. */
#include "effect.h"

typedef struct Gravity {
    double acceleration[3]; /* m/s2 */
} Gravity;

static double size(const ces_EffectScale *scale, const double *parameters)
{
    (void)parameters;
    return scale->gravity != 0.0 ? 1.0 : 0.0;
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)parameters, (void)error;
    *(Gravity *)state = (Gravity){{def->gravity[0], def->gravity[1], def->gravity[2]}};
    return CES_OK;
}

static void force(const void *state, const ces_Grain *grain, double out[3])
{
    const Gravity *gravity = state;
    out[0] += grain->mass * gravity->acceleration[0];
    out[1] += grain->mass * gravity->acceleration[1];
    out[2] += grain->mass * gravity->acceleration[2];
}

const ces_Effect ces_gravity = {
    .name = "gravity",
    .doc = "weight m g",
    .source = "Newton",
    .size_formula = "1",
    .size = size,
    .state_size = sizeof(Gravity),
    .start = start,
    .force = force,
};
