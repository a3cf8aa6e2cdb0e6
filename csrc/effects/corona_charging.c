/* Insulators in the ion flow over an arc of the drum charge towards Pauthenier's saturation. */
#include "laws.h"

#include <string.h>

#include "../base/status.h"
#include "../base/vec3.h"

enum { FROM, TO, HEIGHT, FIELD, CURRENT_DENSITY, SCATTER };

#define CES_TYPICAL_ARC 0.050 /* m along the drum, for a scene that names none */

enum { ANGLE, TABLE_FIELD, TABLE_CURRENT, WIDTH }; /* of a row of the table */

typedef struct CoronaCharging {
    double from, to;        /* rad on the drum */
    double height;          /* m */
    double field;           /* V/m, NAN: the field on the drum */
    double current_density; /* A/m2, infinite: saturated at once */
    double polarity;        /* of the ions: -1, 0, 1 */
    double scatter;
    uint64_t seed;
    double step;          /* s */
    double drum_radius;   /* m */
    size_t row_count;     /* 0: no table */
    double rows[][WIDTH]; /* angle, field, current density along the drum; they stand for the two above */
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
 * Of an ellipsoid whose charge lies as on a conductor: at saturation the field of the charge, Q h/(4 pi eps0 a b c) with the
 * distance h of the tangent plane, nowhere lets ions in, where a field E along its axes makes eps_r h sum E_k x_k/((1 +
 * (eps_r - 1) N_k) a_k^2) of the other sign. The largest sum over the surface is the root of a sum of squares. A sphere's is
 * Pauthenier's.
 */
double ces_shape_saturation(const ces_Grain *grain)
{
    if (grain->shape->kind == CES_SPHERE) {
        return 1.0;
    }
    const double permittivity = grain->material->permittivity;
    double square[3];
    for (int k = 0; k < 3; k++) {
        const double inside = 1.0 + (permittivity - 1.0) * grain->shape->depolarization[k];
        const double part = 0.5 / (inside * grain->shape->semi_axes[k]);
        square[k] = part * part;
    }
    return sqrt(ces_along_normal(grain, square)) * (permittivity + 2.0) / 3.0;
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

/* The table as the definition has it, copied to the end of the state, where the scene has made room for it. */
static ces_Status take_table(const ces_SceneDef *def, CoronaCharging *corona, ces_Error *error)
{
    const ces_EffectDef *given = ces_effect_def(def, ces_corona_charging.name);
    corona->row_count = given == NULL ? 0 : given->table_count;
    if (corona->row_count == 0) {
        return CES_OK;
    }
    if (corona->row_count < 2) {
        return ces_fail(error, CES_INPUT, "corona_charging.table has %zu row, must have at least 2", corona->row_count);
    }
    memcpy(corona->rows, given->table, corona->row_count * sizeof *corona->rows);
    for (size_t k = 0; k < corona->row_count; k++) {
        const double *row = corona->rows[k];
        if (!(row[TABLE_FIELD] >= 0.0 && row[TABLE_FIELD] <= 1e8 && row[TABLE_CURRENT] >= 0.0 &&
              row[TABLE_CURRENT] <= 1e3)) {
            return ces_fail(
                error, CES_INPUT,
                "corona_charging.table[%zu] has a field of %g V/m and a current density of %g A/m2, outside "
                "[0, 1e8] V/m and [0, 1000] A/m2",
                k, row[TABLE_FIELD], row[TABLE_CURRENT]);
        }
        if (!(fabs(row[ANGLE]) <= CES_PI && (k == 0 || row[ANGLE] > corona->rows[k - 1][ANGLE]))) {
            return ces_fail(error, CES_INPUT,
                            "corona_charging.table[%zu] is at %g rad, angles must rise within [-pi, pi]", k,
                            row[ANGLE]);
        }
    }
    return CES_OK;
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    CoronaCharging *corona = state;
    const ces_Status status = take_table(def, corona, error);
    if (status != CES_OK) {
        return status;
    }
    const double facing = 0.5 * CES_PI - def->field.angle; /* the electrode, seen as an angle from the drum's top */
    const double half_arc = 0.5 * CES_TYPICAL_ARC / def->drum_radius;
    const size_t rows = corona->row_count;
    const double from =
        isnan(parameters[FROM]) ? (rows > 0 ? corona->rows[0][ANGLE] : facing - half_arc) : parameters[FROM];
    const double to =
        isnan(parameters[TO]) ? (rows > 0 ? corona->rows[rows - 1][ANGLE] : facing + half_arc) : parameters[TO];
    if (!(from <= to)) {
        return ces_fail(error, CES_INPUT, "corona_charging.to is %g rad, below corona_charging.from, which is %g rad",
                        to, from);
    }
    const double voltage = def->field.voltage;
    corona->from = from;
    corona->to = to;
    corona->height = parameters[HEIGHT];
    corona->field = parameters[FIELD];
    corona->current_density = isnan(parameters[CURRENT_DENSITY]) ? HUGE_VAL : parameters[CURRENT_DENSITY];
    /* A negative electrode sends negative ions; the field, out of the drum then, presses what they charge on it. */
    corona->polarity = (double)((voltage > 0.0) - (voltage < 0.0));
    corona->step = def->step;
    corona->drum_radius = def->drum_radius;
    corona->scatter = parameters[SCATTER];
    corona->seed = def->seed;
    return CES_OK;
}

double ces_share_in_arc(double angle, double turn, double from, double to, double *middle)
{
    const double least = turn < 0.0 ? angle + turn : angle, most = turn < 0.0 ? angle : angle + turn;
    double inside = 0.0, longest = -1.0;
    for (int lap = -1; lap <= 1; lap++) {
        const double shift = 2.0 * CES_PI * lap;
        const double begin = fmax(least, from + shift), end = fmin(most, to + shift);
        if (begin <= end) {
            inside += end - begin;
            if (end - begin > longest) {
                longest = end - begin;
                *middle = 0.5 * (begin + end) - shift;
            }
        }
    }
    if (longest < 0.0) {
        return 0.0;
    }
    return most > least ? fmin(inside / (most - least), 1.0) : 1.0;
}

/* Field and current density at an angle, linear between the rows of the table. */
static void look_up(const CoronaCharging *corona, double angle, double *field, double *current_density)
{
    size_t low = 0, high = corona->row_count - 1;
    while (high - low > 1) {
        const size_t middle = low + (high - low) / 2;
        *(corona->rows[middle][ANGLE] <= angle ? &low : &high) = middle;
    }
    const double *a = corona->rows[low], *b = corona->rows[high];
    const double share = fmin(fmax((angle - a[ANGLE]) / (b[ANGLE] - a[ANGLE]), 0.0), 1.0);
    *field = a[TABLE_FIELD] + share * (b[TABLE_FIELD] - a[TABLE_FIELD]);
    *current_density = a[TABLE_CURRENT] + share * (b[TABLE_CURRENT] - a[TABLE_CURRENT]);
}

/*
 * In flight an insulator collects ions and a metal, as in the founding papers, none. Between the two the current has the
 * share tau/(tau + ion_time), by the ratio that decides on the drum how much of their charge stays: so a landing is a
 * continuous function of the resistivity.
 */
static double slower_in_flight(const ces_Grain *grain, double ion_time)
{
    const bool decays = grain->material->kind == CES_MIDDLING && !(grain->touched & CES_TOUCHED_GROUND);
    return decays ? 1.0 + ion_time / grain->material->decay_time : 1.0;
}

/*
 * The ions that arrive in a share of the step are those of the whole step at that share of the current: Pauthenier's curve
 * depends on J t alone. So the edges of the arc lie where they are, not where a step ends.
 */
static void flow(const void *state, const ces_Grain *grain, ces_ChargeFlow *out)
{
    const CoronaCharging *corona = state;
    if (grain->material->kind == CES_CONDUCTOR || grain->height - grain->radius > corona->height) {
        return;
    }
    const double *normal = grain->normal;
    const double angle = atan2(normal[0], normal[1]); /* from the drum's top, clockwise */
    const double along = grain->velocity[0] * normal[1] - grain->velocity[1] * normal[0];
    const double turn = corona->step * along / (corona->drum_radius + grain->height);
    double middle = angle;
    const double share = ces_share_in_arc(angle, turn, corona->from, corona->to, &middle);
    double field = isnan(corona->field) ? fabs(grain->ground_field) : corona->field;
    double current_density = corona->current_density;
    if (corona->row_count > 0 && share > 0.0) {
        look_up(corona, middle, &field, &current_density);
    }
    if (share == 0.0 || current_density == 0.0) {
        return;
    }
    const double sphere = ces_pauthenier_charge(grain->radius, grain->material->permittivity, field);
    const double saturation =
        fmin(ces_shape_saturation(grain) * sphere, ces_breakdown_charge(grain->radius) / grain->shape->sphericity);
    out->saturation = corona->polarity * saturation * ces_charge_scatter(corona->seed, grain->id, corona->scatter);
    const double ion_time = 4.0 * CES_VACUUM_PERMITTIVITY * field / current_density;
    out->ion_time = ion_time / share * slower_in_flight(grain, ion_time);
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
         "that charges, with its space charge; nan: the one on the drum below the grain; a table goes before it"},
        {"current_density", "A/m2", (double)NAN, 1e-9, 1e3,
         "of the ions at the drum; nan: saturated at once; a table goes before it"},
        {"scatter", "1", 0.0, 0.0, 1.0,
         "each grain's saturation is multiplied by 1 - scatter U(0, 1); Critelli et al.'s programs: 0.3"},
    },
    .table = "angle [rad], field [V/m], current density [A/m2] along the drum",
    .size_formula = "9 k eps0 E_charging E/(r rho g), k = eps_r/(eps_r + 2)",
    .size = size,
    .state_size = sizeof(CoronaCharging),
    .start = start,
    .flow = flow,
};
/* clang-format on */
