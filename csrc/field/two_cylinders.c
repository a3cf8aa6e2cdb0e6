/*
 * Two parallel cylinders, exact: a grounded drum and an electrode at voltage U, each seen as a line charge inside it.
 * Letters h1, h2, c, f as in Li, Lu, Xu & Zhou, J. Hazard. Mater. 151 (2008) 52 (their j is c).
 *
 * Local frame: the drum's axis at the origin, the electrode's at (L, 0). Every difference of nearly equal numbers is
 * written as a product, so that thin gaps and thin wires lose no digits.
 */
#include "field.h"

#include "../base/status.h"

#include <math.h>

#define CES_THINNEST 1e-6  /* m, radius */
#define CES_WIDEST 1e3     /* m, radius, distance, position */
#define CES_MOST_VOLTS 1e7 /* V */

typedef struct TwoCylinders {
    double center[2];        /* m, the drum's axis */
    double cosine, sine;     /* of the angle of the line of centres */
    double drum_radius;      /* m, R1 */
    double electrode_radius; /* m, R2 */
    double distance;         /* m, L */
    double line_drum;        /* m, x- = h1 - c, the line charge inside the drum */
    double line_electrode;   /* m, x+ = h1 + c, the one inside the electrode */
    double line_depth;       /* m, L - x+, measured from the electrode's axis */
    double half_width;       /* m, c */
    double voltage;          /* V, U */
    double strength;         /* V, f = U / Lambda */
} TwoCylinders;

static ces_Status check(const ces_FieldDef *def, ces_Error *error)
{
    ces_Status status;
    if ((status = ces_check_range(error, "field.drum_radius", def->drum_radius, CES_THINNEST, CES_WIDEST, "m")) ||
        (status =
             ces_check_range(error, "field.electrode_radius", def->electrode_radius, CES_THINNEST, CES_WIDEST, "m")) ||
        (status = ces_check_range(error, "field.angle", def->angle, -100.0, 100.0, "rad")) ||
        (status = ces_check_range(error, "field.voltage", def->voltage, -CES_MOST_VOLTS, CES_MOST_VOLTS, "V")) ||
        (status = ces_check_range(error, "field.drum_center[0]", def->drum_center[0], -CES_WIDEST, CES_WIDEST, "m")) ||
        (status = ces_check_range(error, "field.drum_center[1]", def->drum_center[1], -CES_WIDEST, CES_WIDEST, "m"))) {
        return status;
    }
    const double touching = def->drum_radius + def->electrode_radius;
    if (!(def->distance > touching && def->distance <= 3.0 * CES_WIDEST)) {
        return ces_fail(error, CES_INPUT,
                        "field.distance is %g m, outside (%g, %g] m: the least is drum_radius + electrode_radius",
                        def->distance, touching, 3.0 * CES_WIDEST);
    }
    return CES_OK;
}

static ces_Status start(const ces_FieldDef *def, void *state, ces_Error *error)
{
    const ces_Status status = check(def, error);
    if (status != CES_OK) {
        return status;
    }
    const double R1 = def->drum_radius, R2 = def->electrode_radius, L = def->distance, U = def->voltage;
    const double gap = L - (R1 + R2);
    const double h1 = 0.5 * (L + (R1 - R2) * (R1 + R2) / L);
    const double h2 = 0.5 * (L - (R1 - R2) * (R1 + R2) / L);
    /* c = sqrt(h1^2 - R1^2), which is Heron's product over 2 L. */
    const double c = sqrt(gap * (L - R1 + R2)) * sqrt((L + R1 - R2) * (L + R1 + R2)) / (2.0 * L);
    /* Lambda = acosh[(L^2 - R1^2 - R2^2)/(2 R1 R2)], by its half angle. */
    const double Lambda = 2.0 * asinh(0.5 * sqrt(gap * (L + R1 + R2) / R1 / R2));
    *(TwoCylinders *)state = (TwoCylinders){
        .center = {def->drum_center[0], def->drum_center[1]},
        .cosine = cos(def->angle),
        .sine = sin(def->angle),
        .drum_radius = R1,
        .electrode_radius = R2,
        .distance = L,
        .line_drum = R1 * R1 / (h1 + c), /* x- x+ = R1^2 */
        .line_electrode = h1 + c,
        .line_depth = R2 * R2 / (h2 + c), /* and the same seen from the electrode */
        .half_width = c,
        .voltage = U,
        .strength = U / Lambda,
    };
    return CES_OK;
}

static void to_local(const TwoCylinders *pair, const double position[3], double local[2])
{
    const double x = position[0] - pair->center[0], y = position[1] - pair->center[1];
    local[0] = pair->cosine * x + pair->sine * y;
    local[1] = pair->cosine * y - pair->sine * x;
}

/*
 * With z = x + i y: Ex - i Ey = 2 c f / [(z - x-)(z - x+)], a product where the sum of the two line fields would cancel. The
 * factors u = 1/(z - x-) and v = 1/(z - x+) come conjugated; each underflows to 0 far away, none overflows.
 */
static void factors(const TwoCylinders *pair, const double position[3], double u[2], double v[2])
{
    double local[2];
    to_local(pair, position, local);
    ces_field_leave_cylinder(pair->drum_radius, 1.0, local);
    local[0] -= pair->distance;
    ces_field_leave_cylinder(pair->electrode_radius, -1.0, local);
    local[0] += pair->distance;

    const double y = local[1];
    const double from_drum = local[0] - pair->line_drum, from_electrode = local[0] - pair->line_electrode;
    const double inverse_drum = 1.0 / (from_drum * from_drum + y * y);
    const double inverse_electrode = 1.0 / (from_electrode * from_electrode + y * y);
    u[0] = from_drum * inverse_drum;
    u[1] = y * inverse_drum;
    v[0] = from_electrode * inverse_electrode;
    v[1] = y * inverse_electrode;
}

static void to_world(const TwoCylinders *pair, double x, double y, double world[3])
{
    world[0] = pair->cosine * x - pair->sine * y;
    world[1] = pair->sine * x + pair->cosine * y;
    world[2] = 0.0;
}

static void field_at(const void *state, const double position[3], double field[3])
{
    const TwoCylinders *pair = state;
    double u[2], v[2];
    factors(pair, position, u, v);
    const double scale = 2.0 * pair->half_width * pair->strength;
    to_world(pair, scale * (u[0] * v[0] - u[1] * v[1]), scale * (u[0] * v[1] + u[1] * v[0]), field);
}

/* E^2 = |F|^2 with F = 2 c f u v analytic in z, so that its gradient, as a complex number, is 2 F times the conjugate of F',
 * and F' = -F (u + v). */
static void square_gradient_at(const void *state, const double position[3], double gradient[3])
{
    const TwoCylinders *pair = state;
    double u[2], v[2];
    factors(pair, position, u, v);
    const double scale = 2.0 * pair->half_width * pair->strength;
    const double square = scale * scale * (u[0] * u[0] + u[1] * u[1]) * (v[0] * v[0] + v[1] * v[1]);
    to_world(pair, -2.0 * square * (u[0] + v[0]), -2.0 * square * (u[1] + v[1]), gradient);
}

/*
 * V = f [ln(r-/r+) - ln k1] in a form that is exactly 0 on the drum: with rho the distance from the drum's axis,
 * r-^2 - k1^2 r+^2 = (1 - k1^2)(rho^2 - R1^2) and (1 - k1^2)/k1^2 = 2 c/x-. By symmetry the same form counts down
 * from U at the electrode.
 */
static double climb(double f, double c, double line, double above, double sum, double far_line)
{
    return 0.5 * f * log1p(2.0 * c / line * (above / far_line) * (sum / far_line));
}

static double potential_at(const void *state, const double position[3])
{
    const TwoCylinders *pair = state;
    double local[2];
    to_local(pair, position, local);
    const double above_drum = hypot(local[0], local[1]) - pair->drum_radius;
    const double above_electrode = hypot(local[0] - pair->distance, local[1]) - pair->electrode_radius;
    if (above_drum <= 0.0) {
        return 0.0;
    }
    if (above_electrode <= 0.0) {
        return pair->voltage;
    }
    if (above_drum < above_electrode) {
        return climb(pair->strength, pair->half_width, pair->line_drum, above_drum,
                     above_drum + 2.0 * pair->drum_radius, hypot(local[0] - pair->line_electrode, local[1]));
    }
    return pair->voltage - climb(pair->strength, pair->half_width, pair->line_depth, above_electrode,
                                 above_electrode + 2.0 * pair->electrode_radius,
                                 hypot(local[0] - pair->line_drum, local[1]));
}

const ces_FieldRow ces_two_cylinders_row = {
    .name = "two_cylinders",
    .doc = "exact field of a grounded drum and one parallel cylindrical electrode, without end effects or space charge",
    .state_size = sizeof(TwoCylinders),
    .start = start,
    .field = field_at,
    .potential = potential_at,
    .square_gradient = square_gradient_at,
};
