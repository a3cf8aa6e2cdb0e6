/* A conductor takes its charge of induction while it touches the grounded drum, and keeps it in flight. */
#include "laws.h"

#include "../base/random.h"
#include "../base/vec3.h"

enum { K_Q, SCATTER };
enum { SCATTER_STREAM = 2 }; /* of the random numbers; the id is that of the grain */

typedef struct ContactCharging {
    double k_q;
    double scatter;
    uint64_t seed;
} ContactCharging;

double ces_charge_scatter(uint64_t seed, uint64_t id, double scatter)
{
    return scatter == 0.0 ? 1.0 : 1.0 - scatter * ces_random(seed, SCATTER_STREAM, id, 0);
}

double ces_contact_charge(double radius, double k_q, double field)
{
    return k_q * 4.0 * CES_PI * CES_VACUUM_PERMITTIVITY * radius * radius * field;
}

double ces_along_normal(const ces_Grain *grain, const double values[3])
{
    double n[3];
    ces_rotate_back(grain->orientation, grain->normal, n);
    return values[0] * n[0] * n[0] + values[1] * n[1] * n[1] + values[2] * n[2] * n[2];
}

double ces_grain_contact_charge(const ces_Grain *grain, double k_q)
{
    double factor = k_q;
    if (isnan(k_q)) {
        const bool round = grain->shape->kind == CES_SPHERE;
        factor = round ? CES_SPHERE_K_Q : ces_along_normal(grain, grain->shape->contact_charge);
    }
    return ces_contact_charge(grain->radius, factor, grain->ground_field);
}

/* The lift of the charged grain, at contact. */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    if (!scale->has_drum || scale->material.kind != CES_CONDUCTOR || parameters[K_Q] == 0.0) {
        return 0.0;
    }
    return 3.0 * CES_SPHERE_K_F * ces_field_over_weight(scale);
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)error;
    *(ContactCharging *)state =
        (ContactCharging){.k_q = parameters[K_Q], .scatter = parameters[SCATTER], .seed = def->seed};
    return CES_OK;
}

/* At once: a metal's time of induction is far below any step. */
static void flow(const void *state, const ces_Grain *grain, ces_ChargeFlow *out)
{
    const ContactCharging *contact = state;
    if (grain->material->kind == CES_CONDUCTOR && grain->touched & CES_TOUCHED_GROUND) {
        const double own = ces_charge_scatter(contact->seed, grain->id, contact->scatter);
        out->rest = own * ces_grain_contact_charge(grain, contact->k_q);
        out->decay_time = 0.0;
    }
}

/* clang-format off */
const ces_Effect ces_contact_charging = {
    .name = "contact_charging",
    .doc = "a conductor touching the grounded drum takes the charge k_q 4 pi eps0 r^2 E",
    .source = "Felici; Lebedev & Skal'skaya, Sov. Phys. Tech. Phys. 7 (1962) 268",
    .needs = CES_NEEDS_GROUND | CES_NEEDS_GROUND_FIELD,
    .parameters = {
        {"k_q", "1", (double)NAN, 0.0, 100.0, "nan: that of the grain's shape as it lies, pi^2/6 for a sphere"},
        {"scatter", "1", 0.0, 0.0, 1.0, "each grain's charge is multiplied by 1 - scatter U(0, 1)"},
    },
    .size_formula = "3 (zeta(3) + 1/6) eps0 E^2/(r rho g)",
    .size = size,
    .state_size = sizeof(ContactCharging),
    .start = start,
    .flow = flow,
};
/* clang-format on */
