/* Insulators in the ion flow over an arc of the drum charge towards Pauthenier's saturation. */
#include "laws.h"

#include "../base/status.h"
#include "../base/vec3.h"

enum { FROM, TO, HEIGHT, FIELD, CURRENT_DENSITY };

#define CES_TYPICAL_ARC 0.050 /* m along the drum, for a scene that names none */

typedef struct CoronaCharging {
    double from, to;        /* rad on the drum */
    double height;          /* m */
    double field;           /* V/m, NAN: the field on the drum */
    double current_density; /* A/m2, infinite: saturated at once */
    double polarity;        /* of the ions: -1, 0, 1 */
} CoronaCharging;

double ces_pauthenier_charge(double radius, double permittivity, double field)
{
    const double k = permittivity / (permittivity + 2.0);
    return 12.0 * CES_PI * CES_VACUUM_PERMITTIVITY * radius * radius * field * k;
}

double ces_breakdown_charge(double radius)
{
    return CES_MOST_SURFACE_CHARGE * 4.0 * CES_PI * radius * radius;
}

/*
 * From Q the curve Q(t) = Qs t/(t + tau) is entered at t = tau Q/(Qs - Q) and followed for a step: nothing but the
 * charge need be remembered, and two half steps are one step. A grain beyond saturation collects no ions and keeps its
 * charge.
 */
double ces_corona_charge(double charge, double saturation, double time_constant, double step)
{
    const double sign = saturation < 0.0 ? -1.0 : 1.0;
    const double target = sign * saturation, now = sign * charge;
    if (target == 0.0 || now >= target) {
        return charge;
    }
    const double arriving = (target - now) * step;
    return saturation * (now * time_constant + arriving) / (target * time_constant + arriving);
}

/* The force of the field on the charge it gives. */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    if (!scale->has_drum || !scale->has_corona || scale->material.kind == CES_CONDUCTOR) {
        return 0.0;
    }
    const double k = scale->material.permittivity / (scale->material.permittivity + 2.0);
    const double ratio = 9.0 * k * ces_field_over_weight(scale);
    return isnan(parameters[FIELD]) || ratio == 0.0 ? ratio : ratio * (parameters[FIELD] / fabs(scale->field));
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    const double facing = 0.5 * CES_PI - def->field.angle; /* the electrode, seen as an angle from the drum's top */
    const double half_arc = 0.5 * CES_TYPICAL_ARC / def->drum_radius;
    const double from = isnan(parameters[FROM]) ? facing - half_arc : parameters[FROM];
    const double to = isnan(parameters[TO]) ? facing + half_arc : parameters[TO];
    if (!(from <= to)) {
        return ces_fail(error, CES_INPUT, "corona_charging.to is %g rad, below corona_charging.from, which is %g rad",
                        to, from);
    }
    const double voltage = def->field.voltage;
    *(CoronaCharging *)state = (CoronaCharging){
        .from = from,
        .to = to,
        .height = parameters[HEIGHT],
        .field = parameters[FIELD],
        .current_density = isnan(parameters[CURRENT_DENSITY]) ? HUGE_VAL : parameters[CURRENT_DENSITY],
        /* A negative electrode sends negative ions; the field, out of the drum then, presses what they charge on it. */
        .polarity = (double)((voltage > 0.0) - (voltage < 0.0)),
    };
    return CES_OK;
}

static void flow(const void *state, const ces_Grain *grain, ces_ChargeFlow *out)
{
    const CoronaCharging *corona = state;
    if (grain->material->kind == CES_CONDUCTOR || grain->height - grain->radius > corona->height) {
        return;
    }
    const double angle = atan2(grain->normal[0], grain->normal[1]); /* from the drum's top, clockwise */
    if (angle < corona->from || angle > corona->to) {
        return;
    }
    const double field = isnan(corona->field) ? fabs(grain->ground_field) : corona->field;
    const double saturation = fmin(ces_pauthenier_charge(grain->radius, grain->material->permittivity, field),
                                   ces_breakdown_charge(grain->radius));
    out->saturation = corona->polarity * saturation;
    out->ion_time = 4.0 * CES_VACUUM_PERMITTIVITY * field / corona->current_density;
}

/* clang-format off */
const ces_Effect ces_corona_charging = {
    .name = "corona_charging",
    .doc = "insulators in the ion flow over an arc of the drum charge to 12 pi eps0 r^2 E eps_r/(eps_r + 2)",
    .source = "Pauthenier & Moreau-Hanot, J. Phys. Radium 3 (1932) 590; Critelli et al., SIMUL 2014, eq. 13",
    .needs = CES_NEEDS_GROUND | CES_NEEDS_GROUND_FIELD,
    .parameters = {
        {"from", "rad", (double)NAN, -CES_PI, CES_PI,
         "start of the arc, from the drum's top clockwise; nan: 25 mm before the electrode"},
        {"to", "rad", (double)NAN, -CES_PI, CES_PI,
         "end of the arc; nan: 25 mm past the electrode"},
        {"height", "m", 1e-3, 0.0, 10.0,
         "of the ion flow over the drum; a grain whose lowest point is below it is charged"},
        {"field", "V/m", (double)NAN, 0.0, 1e7,
         "that charges, with its space charge; nan: the one on the drum below the grain"},
        {"current_density", "A/m2", (double)NAN, 1e-9, 1e3,
         "of the ions at the drum; nan: saturated at once"},
    },
    .size_formula = "9 k eps0 E_charging E/(r rho g), k = eps_r/(eps_r + 2)",
    .size = size,
    .state_size = sizeof(CoronaCharging),
    .start = start,
    .flow = flow,
};
/* clang-format on */
