/*
 * The exact force along the normal on a conducting sphere at a grounded plane, less the Q E that electric_force gives.
 * The curvature of the drum, a correction of order r/R, is left out; the field is the undisturbed one at the centre.
 */
#include "laws.h"

#include "../base/vec3.h"

#include <assert.h>

/*
 * The table. Near contact a, b and c grow as 1/(gap ln^2 gap), yet cancel for a charge near that of contact.
 * So what is tabulated is the force about a reference charge k, F = force + slope (q - k) - b (q - k)^2, in units of
 * 4 pi eps0 r^2 E^2 and with q = Q/(4 pi eps0 r^2 E). With k = (pi^2/6)/(s/r)^4 it is the charge of contact at contact,
 * and fades as fast as the force on an uncharged sphere, which would otherwise be lost in rounding afar.
 *
 * The argument is ln(s/r - 1). Below NEAREST a real grain is its roughness (0.5 um on 1 mm) and the gap conducts: there
 * slope and b are held, while the force at the charge of contact goes on to its exact value at contact.
 */
enum { FORCE, SLOPE, PULL, QUANTITIES }; /* force (s/r)^4, slope, b (s/r)^2 */
enum { NODES = 128, MARGIN = 2 };
enum { VALUE, RISE }; /* at a node; the derivative is per interval */

#define NEAREST 1e-3  /* gap over radius */
#define FARTHEST 32.0 /* distance over radius, where the asymptote is good to 3e-8 */

typedef struct SpherePlane {
    double first, per_node; /* of ln(s/r - 1) */
    double node[NODES][QUANTITIES][2];
} SpherePlane;

static double reference_charge(double s)
{
    return CES_SPHERE_K_Q / (s * s * s * s);
}

/*
 * Davis, Q. J. Mech. Appl. Math. 17 (1964) 499, in bispherical coordinates with cosh xi = s/r, c0 = r sinh xi, V the
 * potential of the sphere: A_n = 2 sqrt(2) (V + E c0 (2n+1))/(exp((2n+1) xi) - 1), Q = 2 sqrt(2) pi eps0 c0 sum A_n,
 * F = Q E - pi eps0 sum [(n + 1/2) A_n^2 - (n + 1) A_n A_(n+1)]. V goes out: A_n = 2 sqrt(2) (q alpha w_n + E u_n)
 * with w_n = 1/(exp((2n+1) xi) - 1), alpha = 1/(2 c0 sum w), u_n = 2 c0 (n - mean) w_n, mean = sum n w/sum w; r = 1.
 */
void ces_sphere_plane_series(double distance_over_radius, double factors[3])
{
    assert(distance_over_radius > 1.0);
    const double xi = acosh(distance_over_radius), c0 = sinh(xi);
    const int terms = 3 + (int)(24.0 / xi); /* the rest is below exp(-48) of the first */
    double sum = 0.0, moment = 0.0;
    for (int n = terms; n >= 0; n--) {
        const double w = 1.0 / expm1((2 * n + 1) * xi);
        sum += w;
        moment += n * w;
    }
    const double mean = moment / sum, alpha = 0.5 / (c0 * sum);

    double ww = 0.0, wu = 0.0, uu = 0.0;
    double w_next = 0.0, u_next = 0.0;
    for (int n = terms; n >= 0; n--) {
        const double w = 1.0 / expm1((2 * n + 1) * xi);
        const double u = 2.0 * c0 * (n - mean) * w;
        ww += (n + 0.5) * w * w - (n + 1) * w * w_next;
        wu += (2 * n + 1) * w * u - (n + 1) * (w * u_next + u * w_next);
        uu += (n + 0.5) * u * u - (n + 1) * u * u_next;
        w_next = w;
        u_next = u;
    }
    factors[0] = 1.0 - 2.0 * alpha * wu;
    factors[1] = 2.0 * alpha * alpha * ww;
    factors[2] = -2.0 * uu;
}

static void tabulated(double s, double out[QUANTITIES])
{
    double factors[3];
    ces_sphere_plane_series(s, factors);
    const double a = factors[0], b = factors[1], c = factors[2], k = reference_charge(s);
    out[FORCE] = (a * k - b * k * k + c) * (s * s) * (s * s);
    out[SLOPE] = a - 2.0 * b * k;
    out[PULL] = b * s * s;
}

static ces_Status start(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error)
{
    (void)def, (void)parameters, (void)error;
    SpherePlane *table = state;
    const double first = log(NEAREST), last = log(FARTHEST - 1.0);
    const double interval = (last - first) / (NODES - 1);
    table->first = first;
    table->per_node = 1.0 / interval;

    double value[NODES + 2 * MARGIN][QUANTITIES];
    for (int i = 0; i < NODES + 2 * MARGIN; i++) {
        tabulated(1.0 + exp(first + (i - MARGIN) * interval), value[i]);
    }
    for (int i = 0; i < NODES; i++) {
        for (int k = 0; k < QUANTITIES; k++) {
            const int at = i + MARGIN;
            table->node[i][k][VALUE] = value[at][k];
            table->node[i][k][RISE] =
                (8.0 * (value[at + 1][k] - value[at - 1][k]) - (value[at + 2][k] - value[at - 2][k])) / 12.0;
        }
    }
    return CES_OK;
}

/* Cubic Hermite: the table is smooth to its first derivative. */
static void interpolate(const SpherePlane *table, double gap, double out[QUANTITIES])
{
    const double x = (log(gap) - table->first) * table->per_node;
    const int i = x < 0.0 ? 0 : x < NODES - 2 ? (int)x : NODES - 2;
    const double t = x - i, rest = 1.0 - t;
    for (int k = 0; k < QUANTITIES; k++) {
        const double *left = table->node[i][k], *right = table->node[i + 1][k];
        out[k] = rest * rest * ((1.0 + 2.0 * t) * left[VALUE] + t * left[RISE]) +
                 t * t * ((3.0 - 2.0 * t) * right[VALUE] - rest * right[RISE]);
    }
}

/* Charge, dipole and their images: the next terms are of the fifth order in r/s. */
static void far_factors(double s, double factors[3])
{
    const double g = 1.0 + 0.5 / (s * s * s);
    factors[0] = g;
    factors[1] = 0.25 * g / (s * s);
    factors[2] = -0.375 * g / (s * s) / (s * s);
}

void ces_sphere_plane_factors(const void *state, double distance_over_radius, double factors[3])
{
    const SpherePlane *table = state;
    const double s = distance_over_radius < 1.0 ? 1.0 : distance_over_radius;
    if (!(s < FARTHEST)) {
        far_factors(s, factors);
        return;
    }
    const double gap = s - 1.0;
    double value[QUANTITIES];
    if (gap > NEAREST) {
        interpolate(table, gap, value);
    } else {
        for (int k = 0; k < QUANTITIES; k++) {
            value[k] = table->node[0][k][VALUE];
        }
        value[FORCE] = CES_SPHERE_K_F + (value[FORCE] - CES_SPHERE_K_F) * (gap / NEAREST);
    }
    const double k = reference_charge(s), b = value[PULL] / (s * s);
    const double force = value[FORCE] / (s * s) / (s * s);
    factors[0] = value[SLOPE] + 2.0 * b * k;
    factors[1] = b;
    factors[2] = force - value[SLOPE] * k - b * k * k;
}

/* What the contact force lacks of Q E. */
static double size(const ces_EffectScale *scale, const double *parameters)
{
    (void)parameters;
    const double share = scale->material.kind == CES_CONDUCTOR ? 1.0 : scale->material.conducting;
    if (!scale->has_drum || share == 0.0) {
        return 0.0;
    }
    return 3.0 * (CES_SPHERE_K_Q - CES_SPHERE_K_F) * share * ces_field_over_weight(scale);
}

/* What a conducting sphere's force exceeds Q E by, N along the normal. */
static double sphere_excess(const void *state, double radius, double distance, double Q, double E)
{
    const double unit = 4.0 * CES_PI * CES_VACUUM_PERMITTIVITY * radius * radius;
    double factors[3];
    ces_sphere_plane_factors(state, distance / radius, factors);
    return (factors[0] - 1.0) * Q * E - factors[1] * Q * Q / unit + factors[2] * unit * E * E;
}

/*
 * Other shapes: at contact with their charge of contact the force is contact_force Q E; the way there from their own charge
 * and gap is a sphere's, with the charge in units of that of contact. Afar only the charge counts, so the two are blended
 * by (r/s)^3, the order in which what a shape adds to a point charge fades.
 */
static double shape_excess(const void *state, const ces_Grain *grain, double E)
{
    const double radius = grain->radius, Q = grain->charge;
    const double k = ces_along_normal(grain, grain->shape->contact_charge);
    const double ratio = ces_along_normal(grain, grain->shape->contact_force);
    const double *axes = grain->shape->semi_axes;
    const double square[3] = {axes[0] * axes[0], axes[1] * axes[1], axes[2] * axes[2]};
    const double half_height = 2.0 * radius * sqrt(ces_along_normal(grain, square));
    const double distance = radius + ces_max(grain->lift - half_height, 0.0);
    const double near = sphere_excess(state, radius, distance, Q * CES_SPHERE_K_Q / k, E);
    const double scale = (1.0 - ratio) * k / (CES_SPHERE_K_Q - CES_SPHERE_K_F);
    const double part = radius / distance, weight = part * part * part;
    return weight * scale * near + (1.0 - weight) * sphere_excess(state, radius, distance, Q, E);
}

static double conductor_excess(const void *state, const ces_Grain *grain, double E)
{
    return grain->shape->kind == CES_SPHERE ? sphere_excess(state, grain->radius, grain->height, grain->charge, E)
                                            : shape_excess(state, grain, E);
}

/*
 * A middling has the image force of its charge, as an insulator has, wherever the charge sits; what conduction adds is that
 * the field moves charges in it. That part is a conductor's with its charge of contact, less the image force of that: so a
 * relaxed grain feels what a conductor feels, and a charge that ions left on it is not drawn to the foot of the grain.
 */
static double middling_excess(const void *state, const ces_Grain *grain, double E)
{
    ces_Grain relaxed = *grain;
    relaxed.ground_field = E;
    relaxed.charge = ces_grain_contact_charge(&relaxed, (double)NAN);
    const double moved = conductor_excess(state, &relaxed, E) + ces_image_pull(relaxed.charge, grain->height, 1.0);
    return grain->material->conducting * moved;
}

static void force(const void *state, const ces_Grain *grain, double out[3])
{
    if (grain->material->kind == CES_INSULATOR) {
        return;
    }
    const double E = ces_dot(grain->field, grain->normal);
    const bool between = grain->material->kind == CES_MIDDLING;
    ces_add_scaled(out, between ? middling_excess(state, grain, E) : conductor_excess(state, grain, E), grain->normal);
}

const ces_Effect ces_sphere_plane = {
    .name = "sphere_plane",
    .doc = "exact force along the normal on a conducting sphere near the drum, less its Q E",
    .source = "Davis, Q. J. Mech. Appl. Math. 17 (1964) 499",
    .needs = CES_NEEDS_FIELD | CES_NEEDS_GROUND,
    .size_formula = "3 (pi^2/6 - zeta(3) - 1/6) eps0 E^2/(r rho g)",
    .size = size,
    .state_size = sizeof(SpherePlane),
    .start = start,
    .force = force,
};
