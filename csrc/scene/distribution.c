#include "distribution.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../base/status.h"

/* ---- the standard normal law --------------------------------------------------------------------------------------- */

static double horner(const double *coefficients, int degree, double x)
{
    double sum = coefficients[degree];
    for (int i = degree - 1; i >= 0; i--) {
        sum = sum * x + coefficients[i];
    }
    return sum;
}

/* Wichura, "Algorithm AS 241: the percentage points of the normal distribution", Appl. Stat. 37 (1988) 477: PPND16,
 * relative accuracy 1e-16. */
double ces_normal_quantile(double u)
{
    static const double a[8] = {3.3871328727963666080e0,  1.3314166789178437745e+2, 1.9715909503065514427e+3,
                                1.3731693765509461125e+4, 4.5921953931549871457e+4, 6.7265770927008700853e+4,
                                3.3430575583588128105e+4, 2.5090809287301226727e+3};
    static const double b[8] = {1.0,
                                4.2313330701600911252e+1,
                                6.8718700749205790830e+2,
                                5.3941960214247511077e+3,
                                2.1213794301586595867e+4,
                                3.9307895800092710610e+4,
                                2.8729085735721942674e+4,
                                5.2264952788528545610e+3};
    static const double c[8] = {1.42343711074968357734e0,  4.63033784615654529590e0, 5.76949722146069140550e0,
                                3.64784832476320460504e0,  1.27045825245236838258e0, 2.41780725177450611770e-1,
                                2.27238449892691845833e-2, 7.74545014278341407640e-4};
    static const double d[8] = {1.0,
                                2.05319162663775882187e0,
                                1.67638483018380384940e0,
                                6.89767334985100004550e-1,
                                1.48103976427480074590e-1,
                                1.51986665636164571966e-2,
                                5.47593808499534494600e-4,
                                1.05075007164441684324e-9};
    static const double e[8] = {6.65790464350110377720e0,  5.46378491116411436990e0,  1.78482653991729133580e0,
                                2.96560571828504891230e-1, 2.65321895265761230930e-2, 1.24266094738807843860e-3,
                                2.71155556874348757815e-5, 2.01033439929228813265e-7};
    static const double f[8] = {1.0,
                                5.99832206555887937690e-1,
                                1.36929880922735805310e-1,
                                1.48753612908506148525e-2,
                                7.86869131145613259100e-4,
                                1.84631831751005468180e-5,
                                1.42151175831644588870e-7,
                                2.04426310338993978564e-15};
    const double q = u - 0.5;
    if (fabs(q) <= 0.425) {
        const double r = 0.180625 - q * q;
        return q * horner(a, 7, r) / horner(b, 7, r);
    }
    const double r = sqrt(-log(q < 0.0 ? u : 1.0 - u));
    const double z =
        r <= 5.0 ? horner(c, 7, r - 1.6) / horner(d, 7, r - 1.6) : horner(e, 7, r - 5.0) / horner(f, 7, r - 5.0);
    return q < 0.0 ? -z : z;
}

double ces_normal_cumulative(double z)
{
    return 0.5 * erfc(-z * 0.70710678118654752440);
}

/* ---- the laws ------------------------------------------------------------------------------------------------------ */

static double constant_quantile(const double *parameters, const ces_Table *table, double u)
{
    (void)table;
    (void)u;
    return parameters[0];
}

static double constant_cumulative(const double *parameters, const ces_Table *table, double x)
{
    (void)table;
    return x >= parameters[0] ? 1.0 : 0.0;
}

static double uniform_quantile(const double *parameters, const ces_Table *table, double u)
{
    (void)table;
    return parameters[0] + u * (parameters[1] - parameters[0]);
}

static double uniform_cumulative(const double *parameters, const ces_Table *table, double x)
{
    (void)table;
    if (x >= parameters[1]) {
        return 1.0;
    }
    return x <= parameters[0] ? 0.0 : (x - parameters[0]) / (parameters[1] - parameters[0]);
}

/* A deviation of 0 is a legal limit: everything at the middle. */
static double normal_like_cumulative(double offset, double deviation)
{
    if (deviation == 0.0) {
        return offset >= 0.0 ? 1.0 : 0.0;
    }
    return ces_normal_cumulative(offset / deviation);
}

static double normal_quantile(const double *parameters, const ces_Table *table, double u)
{
    (void)table;
    return parameters[0] + parameters[1] * ces_normal_quantile(u);
}

static double normal_cumulative(const double *parameters, const ces_Table *table, double x)
{
    (void)table;
    return normal_like_cumulative(x - parameters[0], parameters[1]);
}

static double lognormal_quantile(const double *parameters, const ces_Table *table, double u)
{
    (void)table;
    return parameters[0] * exp(log(parameters[1]) * ces_normal_quantile(u));
}

static double lognormal_cumulative(const double *parameters, const ces_Table *table, double x)
{
    (void)table;
    return x <= 0.0 ? 0.0 : normal_like_cumulative(log(x / parameters[0]), log(parameters[1]));
}

static double weibull_quantile(const double *parameters, const ces_Table *table, double u)
{
    (void)table;
    return parameters[0] * pow(-log1p(-u), 1.0 / parameters[1]);
}

static double weibull_cumulative(const double *parameters, const ces_Table *table, double x)
{
    (void)table;
    return x <= 0.0 ? 0.0 : -expm1(-pow(x / parameters[0], parameters[1]));
}

static double table_diameter(const ces_Table *table, size_t row)
{
    return table->rows[2 * row];
}

/* The last fraction is 1 but for rounding, which is divided out. */
static double table_fraction(const ces_Table *table, size_t row)
{
    return table->rows[2 * row + 1] / table->rows[2 * table->count - 1];
}

/* The first row whose column (0: diameter, 1: fraction) is at least value (or, if beyond, larger); count if none is. */
static size_t table_search(const ces_Table *table, int column, double value, bool beyond)
{
    size_t low = 0;
    size_t high = table->count;
    while (low < high) {
        const size_t middle = low + (high - low) / 2;
        const double entry = column == 0 ? table_diameter(table, middle) : table_fraction(table, middle);
        if (entry < value || (beyond && entry == value)) {
            low = middle + 1;
        } else {
            high = middle;
        }
    }
    return low;
}

/* The smallest diameter that at least the fraction u does not exceed. */
static double table_quantile(const double *parameters, const ces_Table *table, double u)
{
    (void)parameters;
    const size_t row = table_search(table, 1, u, false);
    if (row == 0) {
        return table_diameter(table, 0);
    }
    if (row == table->count) {
        return table_diameter(table, row - 1);
    }
    const double before = table_fraction(table, row - 1);
    const double share = (u - before) / (table_fraction(table, row) - before);
    const double base = table_diameter(table, row - 1);
    return base + share * (table_diameter(table, row) - base);
}

static double table_cumulative(const double *parameters, const ces_Table *table, double x)
{
    (void)parameters;
    const size_t row = table_search(table, 0, x, true);
    if (row == 0) {
        return 0.0;
    }
    const double before = table_fraction(table, row - 1);
    if (row == table->count) {
        return before;
    }
    const double base = table_diameter(table, row - 1);
    const double share = (x - base) / (table_diameter(table, row) - base);
    return before + share * (table_fraction(table, row) - before);
}

/* Mean of d^power for d uniform between a and b: (a^n + a^(n-1) b + ... + b^n)/(n + 1), of positive terms only. */
static double mean_power(double a, double b, int power)
{
    double sum = 1.0;
    double b_power = 1.0;
    for (int i = 0; i < power; i++) {
        b_power *= b;
        sum = sum * a + b_power;
    }
    return sum / (power + 1);
}

static double table_moment(const ces_Table *table, double from, double to, int power)
{
    double sum = 0.0;
    double before = 0.0;
    for (size_t row = 0; row < table->count; row++) {
        const double after = table_fraction(table, row);
        const double low = fmax(before, from);
        const double high = fmin(after, to);
        if (high > low) {
            const double end = table_diameter(table, row);
            const double begin = row == 0 ? end : table_diameter(table, row - 1);
            const double slope = (end - begin) / (after - before);
            sum += (high - low) * mean_power(begin + (low - before) * slope, begin + (high - before) * slope, power);
        }
        before = after;
    }
    return sum;
}

/* clang-format off */
static const ces_Distribution distributions[] = {
    {"constant", "all grains alike",
     {{"diameter", "m", 1e-9, 0.1, "diameter of every grain"}},
     constant_quantile, constant_cumulative, NULL},
    {"uniform", "equally likely between two diameters",
     {{"least", "m", 1e-9, 0.1, "smallest diameter"},
      {"most", "m", 1e-9, 0.1, "largest diameter"}},
     uniform_quantile, uniform_cumulative, NULL},
    {"normal", "the normal law",
     {{"mean", "m", 1e-9, 0.1, "mean diameter, before truncation"},
      {"deviation", "m", 0.0, 0.1, "standard deviation, before truncation"}},
     normal_quantile, normal_cumulative, NULL},
    {"lognormal", "the logarithm of the diameter is normal",
     {{"median", "m", 1e-9, 0.1, "median diameter by number"},
      {"gsd", "-", 1.0, 10.0, "geometric standard deviation: 84 % are smaller than gsd times the median"}},
     lognormal_quantile, lognormal_cumulative, NULL},
    {"weibull", "the law of Weibull, of Rosin and Rammler",
     {{"scale", "m", 1e-9, 0.1, "diameter that 63.2 % by number do not exceed"},
      {"shape", "-", 0.1, 100.0, "uniformity: the larger, the narrower"}},
     weibull_quantile, weibull_cumulative, NULL},
    {"table", "measured: cumulative number fraction over diameter, linear in between",
     {{NULL, NULL, 0.0, 0.0, NULL}},
     table_quantile, table_cumulative, table_moment},
};
/* clang-format on */

size_t ces_distribution_count(void)
{
    return sizeof distributions / sizeof distributions[0];
}

const ces_Distribution *ces_distribution_at(size_t index)
{
    assert(index < ces_distribution_count());
    return &distributions[index];
}

const ces_Distribution *ces_distribution_find(const char *name)
{
    for (size_t i = 0; i < ces_distribution_count(); i++) {
        if (strncmp(distributions[i].name, name, CES_NAME_LENGTH) == 0) {
            return &distributions[i];
        }
    }
    return NULL;
}

/* ---- checks at the door ---------------------------------------------------------------------------------------------- */

static const double smallest_diameter = 1e-9; /* m */
static const double largest_diameter = 0.1;   /* m */

static double cumulative(const ces_Law *law, double x)
{
    return law->row->cumulative(law->parameters, &law->table, x);
}

static ces_Status check_table(const ces_Table *table, const char *what, ces_Error *error)
{
    if (table->rows == NULL || table->count == 0) {
        return ces_fail(error, CES_INPUT, "%s.table has no rows; it needs at least one (diameter, cumulative fraction)",
                        what);
    }
    double diameter = 0.0;
    double fraction = 0.0;
    for (size_t row = 0; row < table->count; row++) {
        const double *entry = table->rows + 2 * row;
        if (!(entry[0] >= diameter && entry[0] >= smallest_diameter && entry[0] <= largest_diameter)) {
            return ces_fail(error, CES_INPUT,
                            "%s.table[%zu]: the diameter is %g m, outside [%g, %g] m or below the row before (%g m)",
                            what, row, entry[0], smallest_diameter, largest_diameter, diameter);
        }
        if (!(entry[1] >= fraction && entry[1] <= 1.0 + 1e-9)) {
            return ces_fail(error, CES_INPUT,
                            "%s.table[%zu]: the cumulative fraction is %g, outside [0, 1] or below the row before (%g)",
                            what, row, entry[1], fraction);
        }
        diameter = entry[0];
        fraction = entry[1];
    }
    if (fabs(fraction - 1.0) > 1e-9) {
        return ces_fail(error, CES_INPUT, "%s.table ends at the cumulative fraction %.12g; it must end at 1", what,
                        fraction);
    }
    return CES_OK;
}

ces_Status ces_distribution_check(const ces_Distribution *row, const double *parameters, const ces_Table *table,
                                  const char *what, ces_Error *error)
{
    if (row->moment != NULL) {
        return check_table(table, what, error);
    }
    for (const ces_DistributionParameter *parameter = row->parameters; parameter->name != NULL; parameter++) {
        const double value = parameters[parameter - row->parameters];
        const char *unit = strcmp(parameter->unit, "-") == 0 ? "" : parameter->unit;
        const char *space = unit[0] == '\0' ? "" : " ";
        if (!(value >= parameter->least && value <= parameter->most)) {
            return ces_fail(error, CES_INPUT, "%s.%s is %g%s%s, outside [%g, %g]%s%s", what, parameter->name, value,
                            space, unit, parameter->least, parameter->most, space, unit);
        }
    }
    if (row->quantile == uniform_quantile && parameters[0] > parameters[1]) {
        return ces_fail(error, CES_INPUT, "%s.least is %g m, larger than %s.most, %g m", what, parameters[0], what,
                        parameters[1]);
    }
    return CES_OK;
}

static ces_Status unknown_distribution(const char *name, const char *what, ces_Error *error)
{
    char names[160] = "";
    size_t length = 0;
    for (size_t i = 0; i < ces_distribution_count(); i++) {
        const int written =
            snprintf(names + length, sizeof names - length, "%s%s", i == 0 ? "" : ", ", distributions[i].name);
        length += (size_t)written;
        assert(length < sizeof names);
    }
    return ces_fail(error, CES_INPUT, "%s.distribution is \"%.*s\", not one of: %s", what, CES_NAME_LENGTH, name,
                    names);
}

/* Sets from and to, the part of (0, 1) that truncation leaves. Beyond the diameters that a grain may have every law is cut,
 * and refused if it would miss what it loses by that. */
static ces_Status truncate_law(const ces_FamilyDef *family, const char *what, ces_Law *law, ces_Error *error)
{
    const bool truncated = family->most != 0.0;
    if (!(family->least >= 0.0 && (family->least <= family->most || (!truncated && family->least == 0.0)))) {
        return ces_fail(error, CES_INPUT,
                        "%s is truncated to [%g, %g] m; it must be 0 <= least <= most, or 0 and 0 for not at all", what,
                        family->least, family->most);
    }
    /* A jump at the lower end belongs to the law: the fraction strictly below is cut. */
    const double below = !truncated ? 0.0 : cumulative(law, nextafter(family->least, -1.0));
    const double above = !truncated ? 1.0 : cumulative(law, family->most);
    if (!(above - below >= 1e-6)) {
        return ces_fail(
            error, CES_INPUT,
            "%s: only %.3g of the law \"%s\" lies in [%g, %g] m, where it is truncated; at least 1e-06 must", what,
            fmax(above - below, 0.0), law->row->name, family->least, family->most);
    }
    const double too_small = cumulative(law, nextafter(smallest_diameter, -1.0));
    const double too_large = cumulative(law, largest_diameter);
    const double lost = (fmax(too_small - below, 0.0) + fmax(above - too_large, 0.0)) / (above - below);
    if (lost > 1e-9) {
        return ces_fail(
            error, CES_INPUT,
            "%s: %.3g of the law \"%s\" lies outside [%g, %g] m, at most 1e-09 may; truncate it by least and "
            "most",
            what, lost, law->row->name, smallest_diameter, largest_diameter);
    }
    /* A draw has 53 bits: beyond these ends there is nothing to draw. */
    law->from = fmax(0x1p-54, fmax(below, too_small));
    law->to = fmin(1.0 - 0x1p-53, fmin(above, too_large));
    return CES_OK;
}

ces_Status ces_law_start(const ces_FamilyDef *family, const char *what, ces_Law *law, ces_Error *error)
{
    const ces_Distribution *row = ces_distribution_find(family->distribution);
    if (row == NULL) {
        return unknown_distribution(family->distribution, what, error);
    }
    *law = (ces_Law){.row = row, .table = {family->table, family->table_count}};
    memcpy(law->parameters, family->parameters, sizeof law->parameters);
    ces_Status status = ces_distribution_check(row, law->parameters, &law->table, what, error);
    if (status == CES_OK) {
        status = truncate_law(family, what, law, error);
    }
    if (status != CES_OK) {
        return status;
    }
    /* The way to a fraction and back rounds; the ends hold exactly. */
    law->least = fmax(row->quantile(law->parameters, &law->table, law->from), fmax(smallest_diameter, family->least));
    law->most = fmin(row->quantile(law->parameters, &law->table, law->to), largest_diameter);
    law->most = family->most > 0.0 ? fmin(law->most, family->most) : law->most;
    return CES_OK;
}

double ces_law_quantile(const ces_Law *law, double u)
{
    const double diameter = law->row->quantile(law->parameters, &law->table, law->from + u * (law->to - law->from));
    return fmin(fmax(diameter, law->least), law->most);
}

/* ---- moments ------------------------------------------------------------------------------------------------------- */

/* Integral of power x^(power - 1) (to - F(x)) from a to b by Gauss and Legendre's rule with eight points. */
static double tail_integral(const ces_Law *law, double a, double b, int power)
{
    static const double node[4] = {0.1834346424956498049, 0.5255324099163289858, 0.7966664774136267396,
                                   0.9602898564975362317};
    static const double weight[4] = {0.3626837833783619830, 0.3137066458778872873, 0.2223810344533744706,
                                     0.1012285362903762591};
    const double half = 0.5 * (b - a);
    double sum = 0.0;
    for (int i = 0; i < 8; i++) {
        const double x = a + half * (1.0 + (i % 2 == 0 ? node[i / 2] : -node[i / 2]));
        const double left = law->to - cumulative(law, x);
        sum += weight[i / 2] * power * pow(x, power - 1) * fmax(left, 0.0);
    }
    return half * sum;
}

/* E[d^n] = a^n + integral over [a, b] of n x^(n-1) (1 - F(x)) dx: by parts, so that every term is positive and nothing
 * cancels. The panels end at the law's own quantiles, a quarter of a normal deviation apart: fine where the law is. */
double ces_law_moment(const ces_Law *law, int power)
{
    assert(power > 0);
    const double width = law->to - law->from;
    if (law->row->moment != NULL) {
        return law->row->moment(&law->table, law->from, law->to, power) / width;
    }
    const double first = ces_normal_quantile(law->from);
    const double last = ces_normal_quantile(law->to);
    const int panels = (int)ceil((last - first) / 0.25);
    double begin = law->least;
    double sum = 0.0;
    for (int i = 1; i <= panels; i++) {
        const double u = ces_normal_cumulative(first + (last - first) * i / panels);
        const double quantile = law->row->quantile(law->parameters, &law->table, fmin(u, law->to));
        const double end = i == panels ? law->most : fmin(fmax(quantile, begin), law->most);
        sum += tail_integral(law, begin, end, power);
        begin = end;
    }
    return pow(law->least, power) + sum / width;
}
