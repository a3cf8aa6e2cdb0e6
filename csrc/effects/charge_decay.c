/*
 * What is neither conductor nor insulator: a charge that relaxes on the grounded drum, in eps0 eps_r times the resistivity
 * or in a measured time; and the exact step of a charge under conduction and an ion flow together.
 */
#include "laws.h"

#include <math.h>

#include "../base/vec3.h"

double ces_decayed_charge(double charge, double rest, double decay_time, double step)
{
    return rest + (charge - rest) * exp(-step / decay_time);
}

/*
 * With u = 1 - Q/Qs, the room that is left: -du/dt = A u^2 + B u - C, A = 1/ion_time, B = 1/decay_time,
 * C = (1 - rest/Qs) B. Riccati's equation with constant coefficients; D^2 = B^2 + 4 A C.
 */
typedef struct Room {
    double A, B, C; /* 1/s */
} Room;

/* Room a time later where conduction makes room (C >= 0): no term cancels another. */
static double room_after(Room room, double u, double time)
{
    const double A = room.A, B = room.B, C = room.C, D = sqrt(B * B + 4.0 * A * C);
    const double less = 4.0 * A * C / (D + B); /* D - B */
    const double past = exp(-D * time), here = -expm1(-D * time);
    return (u * (less + (D + B) * past) + 2.0 * C * here) / ((D + B) + less * past + 2.0 * A * u * here);
}

/* Where conduction fills it too (C < 0) the room is gone after this time; before, it is u[1]. */
static double time_to_fill(Room room, double u, double time, double *after)
{
    const double square = room.B * room.B + 4.0 * room.A * room.C, D = sqrt(fabs(square));
    const double end = u / (u * room.B - 2.0 * room.C); /* tanh(D t/2)/D at the end, or tan */
    const double half = 0.5 * D * time;
    const double now = D * time < 1e-8 ? 0.5 * time : square > 0.0 ? tanh(half) / D : tan(half) / D;
    *after = (u * (1.0 - room.B * now) + 2.0 * room.C * now) / (1.0 + (2.0 * room.A * u + room.B) * now);
    if (D * end < 1e-8) {
        return 2.0 * end;
    }
    return square > 0.0 ? 2.0 * atanh(D * end) / D : 2.0 * atan(D * end) / D;
}

static double follow_both(double charge, const ces_ChargeFlow *flow, double step)
{
    const double x = charge / flow->saturation, rest = flow->rest / flow->saturation;
    const double decay = flow->decay_time;
    double left = step, u = 1.0 - x;
    if (x >= 1.0) { /* no ion arrives before conduction has made room */
        const double alone = ces_decayed_charge(x, rest, decay, step);
        if (alone >= 1.0) {
            return flow->saturation * alone;
        }
        left = fmax(step - decay * log((x - rest) / (1.0 - rest)), 0.0);
        u = 0.0;
    }
    if (flow->ion_time == 0.0) { /* full at once, and beyond only by conduction */
        return rest > 1.0 ? ces_decayed_charge(flow->saturation, flow->rest, decay, left) : flow->saturation;
    }
    const Room room = {1.0 / flow->ion_time, 1.0 / decay, (1.0 - rest) / decay};
    if (room.C >= 0.0) {
        return flow->saturation * (1.0 - room_after(room, u, left));
    }
    double after;
    const double full = time_to_fill(room, u, left, &after);
    return full < left ? ces_decayed_charge(flow->saturation, flow->rest, decay, left - full)
                       : flow->saturation * (1.0 - after);
}

double ces_charge_after(double charge, const ces_ChargeFlow *flow, double step)
{
    if (flow->decay_time == 0.0) {
        return flow->rest;
    }
    if (flow->decay_time == HUGE_VAL) {
        return ces_corona_charge(charge, flow->saturation, flow->ion_time, step);
    }
    if (flow->saturation == 0.0) {
        return ces_decayed_charge(charge, flow->rest, flow->decay_time, step);
    }
    return follow_both(charge, flow, step);
}

/* The force on what it gains or loses while it is on the drum. */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    (void)parameters;
    const ces_MaterialDef *material = &scale->material;
    if (!scale->has_drum || material->kind != CES_MIDDLING) {
        return 0.0;
    }
    const double k = material->permittivity / (material->permittivity + 2.0);
    const double part = scale->residence > 0.0 ? -expm1(-scale->residence / material->decay_time) : 1.0;
    return (9.0 * k + 3.0 * CES_SPHERE_K_Q) * part * ces_field_over_weight(scale);
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def, (void)parameters, (void)state, (void)error;
    return CES_OK;
}

static void flow(const void *state, const ces_Grain *grain, ces_ChargeFlow *out)
{
    (void)state;
    if (grain->material->kind == CES_MIDDLING && grain->touched & CES_TOUCHED_GROUND) {
        out->rest = ces_grain_contact_charge(grain, (double)NAN);
        out->decay_time = grain->material->decay_time;
    }
}

const ces_Effect ces_charge_decay = {
    .name = "charge_decay",
    .doc = "the charge of a poor conductor on the grounded drum relaxes to that of contact, in eps0 eps_r rho or a "
           "measured time",
    .source = "Maxwell's relaxation of a charge; Felici",
    .needs = CES_NEEDS_GROUND | CES_NEEDS_GROUND_FIELD,
    .size_formula = "(9 k + 3 pi^2/6) (1 - exp(-t_drum/tau)) eps0 E^2/(r rho g), k = eps_r/(eps_r + 2)",
    .size = size,
    .start = start,
    .flow = flow,
};
