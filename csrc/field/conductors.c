/*
 * Parallel cylinders at voltages of their own, with or without a grounded box around them. Exact in a plane: V = Re Phi(z),
 *
 *     Phi = C - sum_p s_p log(z - z_p) + sum_e sum_m c_em w_e^m,     w_e = r_e/(z - z_e), or (z - z_e)/r_e where growing,
 *
 * line charges and multipoles that were found for these surfaces (cesim/fields/multipoles.py); Ex - i Ey = -dPhi/dz.
 */
#include "field.h"

#include "../base/memory.h"
#include "../base/status.h"

#include <math.h>

enum { LANES = 4, MOST_ROWS = 1000000 };
#define MOST_VOLTS 1e9 /* of a coefficient: those of near cylinders outgrow the voltages */
#define FARTHEST 1e4   /* m */
#define NOWHERE 1e9    /* m */

typedef struct Complex {
    double re, im;
} Complex;

/* A power series sum c_m w^m without its first power, in LANES interleaved ones, so that their sums do not wait on each other:
 * coefficient 4 b + l of lane l. */
typedef struct Series {
    Complex center;
    double radius;
    bool growing;
    size_t blocks;
    const double *potential, *slope; /* (blocks, 2, LANES): real parts, imaginary parts; of m c_m in slope */
} Series;

typedef struct Conductors {
    size_t pole_count, series_count, circle_count;
    const double *poles; /* (blocks of poles, 3, LANES): x, y m, strength V, the last filled up with nothing far away */
    const double *circles; /* (circle_count, 4): x, y, radius m, voltage V */
    Series *series;
    double constant; /* V */
    bool enclosed;
    double lower[2], upper[2]; /* m, of the box */
    double *numbers;           /* all of the above */
} Conductors;

/* ---- creation ---------------------------------------------------------------------------------------------------------- */

static ces_Status check_rows(const char *what, const double *values, size_t rows, size_t width, double most,
                             ces_Error *error)
{
    if (rows > MOST_ROWS) {
        return ces_fail(error, CES_INPUT, "field.%s has %zu rows, at most %d may be", what, rows, MOST_ROWS);
    }
    for (size_t k = 0; k < rows * width; k++) {
        if (!(fabs(values[k]) <= most)) {
            return ces_fail(error, CES_INPUT, "field.%s[%zu, %zu] is %g, outside [%g, %g]", what, k / width, k % width,
                            values[k], -most, most);
        }
    }
    return CES_OK;
}

static ces_Status check(const ces_FieldDef *def, ces_Error *error)
{
    ces_Status status;
    if (def->circle_count == 0) {
        return ces_fail(error, CES_INPUT, "field.circles are missing, there must be one conductor at least");
    }
    if ((status = check_rows("circles", def->circles, def->circle_count, 4, MOST_VOLTS, error)) ||
        (status = check_rows("poles", def->poles, def->pole_count, 3, MOST_VOLTS, error)) ||
        (status = check_rows("series", def->series, def->series_count, 5, FARTHEST, error)) ||
        (status = check_rows("terms", def->terms, def->term_count, 2, MOST_VOLTS, error)) ||
        (status = ces_check_range(error, "field.constant", def->constant, -MOST_VOLTS, MOST_VOLTS, "V"))) {
        return status;
    }
    double terms = 0.0;
    for (size_t k = 0; k < def->series_count; k++) {
        const double *row = &def->series[5 * k];
        if (!(row[2] > 0.0) || !(row[3] >= 0.0) || row[3] != floor(row[3])) {
            return ces_fail(error, CES_INPUT,
                            "field.series[%zu] has radius %g m and %g terms, must be above 0 and whole", k, row[2],
                            row[3]);
        }
        terms += row[3];
    }
    if (terms != (double)def->term_count) {
        return ces_fail(error, CES_INPUT, "field.series count %g terms, field.terms are %zu", terms, def->term_count);
    }
    return CES_OK;
}

static size_t blocks_of(const double *row)
{
    return ((size_t)row[3] + LANES - 1) / LANES;
}

/* Lays out a series from its terms; gives the place behind it. */
static double *fill_series(Series *series, const double *row, const double *terms, double *place)
{
    const size_t count = (size_t)row[3], blocks = blocks_of(row);
    *series = (Series){.center = {row[0], row[1]}, .radius = row[2], .growing = row[4] > 0.0, .blocks = blocks};
    double *potential = place, *slope = place + 2 * LANES * blocks;
    for (size_t k = 0; k < count; k++) {
        const size_t at = 2 * LANES * (k / LANES) + k % LANES;
        for (size_t part = 0; part < 2; part++) {
            potential[at + LANES * part] = terms[2 * k + part];
            slope[at + LANES * part] = (double)(k + 1) * terms[2 * k + part];
        }
    }
    series->potential = potential;
    series->slope = slope;
    return slope + 2 * LANES * blocks;
}

static size_t pole_blocks(const ces_FieldDef *def)
{
    return (def->pole_count + LANES - 1) / LANES;
}

/* x, y and charge of the line charges in blocks of lanes; lanes without one have no charge, far away. */
static double *fill_poles(const ces_FieldDef *def, double *place)
{
    static const double nothing[3] = {NOWHERE, NOWHERE, 0.0};
    for (size_t k = 0; k < LANES * pole_blocks(def); k++) {
        const double *pole = k < def->pole_count ? &def->poles[3 * k] : nothing;
        for (size_t part = 0; part < 3; part++) {
            place[3 * LANES * (k / LANES) + LANES * part + k % LANES] = pole[part];
        }
    }
    return place + 3 * LANES * pole_blocks(def);
}

static ces_Status start(const ces_FieldDef *def, void *state, ces_Error *error)
{
    Conductors *field = state;
    *field = (Conductors){.constant = def->constant};
    const ces_Status status = check(def, error);
    if (status != CES_OK) {
        return status;
    }
    size_t size = 3 * LANES * pole_blocks(def) + 4 * def->circle_count;
    for (size_t k = 0; k < def->series_count; k++) {
        size += 4 * LANES * blocks_of(&def->series[5 * k]);
    }
    field->numbers = ces_alloc(size, sizeof(double));
    field->series = ces_alloc(def->series_count + 1, sizeof *field->series);
    if (field->numbers == NULL || field->series == NULL) {
        return ces_fail(error, CES_MEMORY, "no memory for the field of %zu conductors", def->circle_count);
    }
    double *place = field->numbers;
    const double *terms = def->terms;
    for (size_t k = 0; k < def->series_count; k++) {
        place = fill_series(&field->series[k], &def->series[5 * k], terms, place);
        terms += 2 * (size_t)def->series[5 * k + 3];
    }
    field->poles = place;
    place = fill_poles(def, place);
    field->circles = place;
    for (size_t k = 0; k < 4 * def->circle_count; k++) {
        *place++ = def->circles[k];
    }
    field->pole_count = def->pole_count;
    field->series_count = def->series_count;
    field->circle_count = def->circle_count;
    for (int k = 0; k < 2; k++) {
        field->lower[k] = def->box[k];
        field->upper[k] = def->box[2 + k];
    }
    field->enclosed = def->box[0] < def->box[2] && def->box[1] < def->box[3];
    return CES_OK;
}

static void stop(void *state)
{
    ces_free(((Conductors *)state)->numbers);
    ces_free(((Conductors *)state)->series);
}

/* ---- sampling ------------------------------------------------------------------------------------------------------------ */

static Complex times(Complex a, Complex b)
{
    return (Complex){a.re * b.re - a.im * b.im, a.re * b.im + a.im * b.re};
}

static Complex inverse(Complex a)
{
    const double scale = 1.0 / (a.re * a.re + a.im * a.im);
    return (Complex){a.re * scale, -a.im * scale};
}

/* sum over k of c_k w^k by Horner's rule in w^4 on each lane. */
static Complex sum_powers(const double *c, size_t blocks, Complex w)
{
    const Complex square = times(w, w), fourth = times(square, square);
    double re[LANES] = {0.0}, im[LANES] = {0.0};
    for (size_t b = blocks; b-- > 0;) {
        const double *row = &c[2 * LANES * b];
        for (int l = 0; l < LANES; l++) {
            const double next = re[l] * fourth.re - im[l] * fourth.im + row[l];
            im[l] = re[l] * fourth.im + im[l] * fourth.re + row[LANES + l];
            re[l] = next;
        }
    }
    Complex sum = {re[LANES - 1], im[LANES - 1]};
    for (int l = LANES - 2; l >= 0; l--) {
        sum = times(sum, w);
        sum.re += re[l];
        sum.im += im[l];
    }
    return sum;
}

/* Moves a point inside a conductor to its surface; gives the conductor, -1 for none. */
static int leave_conductors(const Conductors *field, double place[2])
{
    for (size_t k = 0; k < field->circle_count; k++) {
        const double *circle = &field->circles[4 * k];
        double local[2] = {place[0] - circle[0], place[1] - circle[1]};
        if (local[0] * local[0] + local[1] * local[1] < circle[2] * circle[2]) {
            ces_field_leave_cylinder(circle[2], 1.0, local);
            place[0] = circle[0] + local[0];
            place[1] = circle[1] + local[1];
            return (int)k;
        }
    }
    return -1;
}

/* Beyond a grounded box nothing is felt of what is in it. */
static bool is_shielded(const Conductors *field, const double position[3])
{
    return field->enclosed && (position[0] < field->lower[0] || position[0] > field->upper[0] ||
                               position[1] < field->lower[1] || position[1] > field->upper[1]);
}

static void field_at(const void *state, const double position[3], double out[3])
{
    const Conductors *field = state;
    out[0] = out[1] = out[2] = 0.0;
    if (is_shielded(field, position)) {
        return;
    }
    double place[2] = {position[0], position[1]};
    (void)leave_conductors(field, place);
    double Ex[LANES] = {0.0}, Ey[LANES] = {0.0};
    for (size_t k = 0; k < field->pole_count; k += LANES) {
        const double *pole = &field->poles[3 * k];
        for (int l = 0; l < LANES; l++) {
            const double x = place[0] - pole[l], y = place[1] - pole[LANES + l];
            const double scale = pole[2 * LANES + l] / (x * x + y * y);
            Ex[l] += x * scale;
            Ey[l] += y * scale;
        }
    }
    for (int l = 0; l < LANES; l++) {
        out[0] += Ex[l];
        out[1] += Ey[l];
    }
    for (size_t k = 0; k < field->series_count; k++) {
        const Series *series = &field->series[k];
        const Complex from = {place[0] - series->center.re, place[1] - series->center.im};
        Complex w = {from.re / series->radius, from.im / series->radius}, slope;
        if (series->growing) {
            slope = sum_powers(series->slope, series->blocks, w);
            slope = (Complex){-slope.re, -slope.im};
        } else {
            w = inverse(w);
            slope = times(times(w, w), sum_powers(series->slope, series->blocks, w));
        }
        out[0] += slope.re / series->radius;
        out[1] -= slope.im / series->radius;
    }
}

static double potential_at(const void *state, const double position[3])
{
    const Conductors *field = state;
    double place[2] = {position[0], position[1]};
    if (is_shielded(field, position)) {
        return 0.0;
    }
    const int inside = leave_conductors(field, place);
    if (inside >= 0) {
        return field->circles[4 * inside + 3];
    }
    double sum = field->constant;
    for (size_t k = 0; k < field->pole_count; k++) {
        const double *pole = &field->poles[3 * LANES * (k / LANES) + k % LANES];
        sum -= pole[2 * LANES] * log(hypot(place[0] - pole[0], place[1] - pole[LANES]));
    }
    for (size_t k = 0; k < field->series_count; k++) {
        const Series *series = &field->series[k];
        Complex w = {(place[0] - series->center.re) / series->radius, (place[1] - series->center.im) / series->radius};
        w = series->growing ? w : inverse(w);
        sum += times(w, sum_powers(series->potential, series->blocks, w)).re;
    }
    return sum;
}

const ces_FieldRow ces_conductors_row = {
    .name = "conductors",
    .doc = "parallel cylinders and wires at voltages of their own, alone or in a grounded box, by multipoles",
    .state_size = sizeof(Conductors),
    .start = start,
    .field = field_at,
    .potential = potential_at,
    .stop = stop,
};
