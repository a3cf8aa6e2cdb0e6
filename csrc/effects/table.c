#include "effect.h"

#include "../base/status.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

/* In the order in which they act: charges before forces, the brush last of the charges: what it wipes off is off. */
/* clang-format off */
static const ces_Effect *const rows[] = {
    &ces_contact_charging,
    &ces_charge_decay,
    &ces_corona_charging,
    &ces_brush_discharge,
    &ces_gravity,
    &ces_electric_force,
    &ces_sphere_plane,
    &ces_image_force,
    &ces_pair_coulomb,
    &ces_drag,
    &ces_shape_drag,
    &ces_wind,
    &ces_magnus,
    &ces_dielectrophoresis,
    &ces_adhesion,
};
/* clang-format on */

size_t ces_effect_count(void)
{
    return sizeof rows / sizeof rows[0];
}

const ces_Effect *ces_effect_at(size_t index)
{
    assert(index < ces_effect_count());
    return rows[index];
}

const ces_Effect *ces_effect_find(const char *name)
{
    for (size_t index = 0; index < ces_effect_count(); index++) {
        if (strcmp(rows[index]->name, name) == 0) {
            return rows[index];
        }
    }
    return NULL;
}

const ces_EffectDef *ces_effect_def(const ces_SceneDef *def, const char *name)
{
    for (size_t e = 0; e < def->effect_count; e++) {
        if (strcmp(def->effects[e].name, name) == 0) {
            return &def->effects[e];
        }
    }
    return NULL;
}

ces_Status ces_effect_check(const ces_Effect *effect, const ces_SceneDef *def, const double *parameters,
                            ces_Error *error)
{
    for (int k = 0; k < CES_MAX_EFFECT_PARAMETERS && effect->parameters[k].name != NULL; k++) {
        const ces_EffectParameter *parameter = &effect->parameters[k];
        if (isnan(parameters[k]) && isnan(parameter->preset)) {
            continue;
        }
        char what[2 * CES_NAME_LENGTH];
        snprintf(what, sizeof what, "%s.%s", effect->name, parameter->name);
        const ces_Status status =
            ces_check_range(error, what, parameters[k], parameter->least, parameter->most, parameter->unit);
        if (status != CES_OK) {
            return status;
        }
    }
    if ((effect->needs & (CES_NEEDS_GROUND | CES_NEEDS_GROUND_FIELD)) && !(def->drum_radius > 0.0)) {
        return ces_fail(error, CES_INPUT, "effect '%s' needs a drum, but drum_radius is %g m, outside (0, inf) m",
                        effect->name, def->drum_radius);
    }
    if ((effect->needs & (CES_NEEDS_FIELD | CES_NEEDS_GROUND_FIELD | CES_NEEDS_GRADIENT)) &&
        def->field.kind[0] == '\0') {
        return ces_fail(error, CES_INPUT, "effect '%s' needs an electric field, and the scene has none", effect->name);
    }
    return CES_OK;
}
