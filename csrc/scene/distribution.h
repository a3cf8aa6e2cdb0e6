/*
 * scene/distribution.h - the laws a grain's diameter may follow, one row each, and a law made ready for drawing:
 * a row with its parameters, truncated.
 */
#ifndef CES_DISTRIBUTION_H
#define CES_DISTRIBUTION_H

#include "../cesim.h"

/* A measured law: piecewise linear between its rows, a jump where a diameter is repeated or the first fraction is not 0. */
typedef struct ces_Table {
    const double *rows; /* (count, 2): diameter in m, cumulative number fraction */
    size_t count;
} ces_Table;

typedef struct ces_DistributionParameter {
    const char *name, *unit;
    double least, most; /* what it may be */
    const char *doc;
} ces_DistributionParameter;

typedef struct ces_Distribution {
    const char *name, *doc;
    ces_DistributionParameter parameters[CES_MAX_DISTRIBUTION_PARAMETERS + 1];        /* ends with name == NULL */
    double (*quantile)(const double *parameters, const ces_Table *table, double u);   /* m, for u in (0, 1) */
    double (*cumulative)(const double *parameters, const ces_Table *table, double x); /* fraction with diameter <= x */
    /* Integral of quantile(u)^power from u = from to u = to; NULL: by quadrature, the law is smooth. */
    double (*moment)(const ces_Table *table, double from, double to, int power);
} ces_Distribution;

size_t ces_distribution_count(void);
const ces_Distribution *ces_distribution_at(size_t index);
const ces_Distribution *ces_distribution_find(const char *name); /* NULL: no such row */

/* Whether the parameters (and the table, for the row "table") are legal; what names their owner in the error's text. */
ces_Status ces_distribution_check(const ces_Distribution *row, const double *parameters, const ces_Table *table,
                                  const char *what, ces_Error *error);

/* The law of one family. It borrows its table. */
typedef struct ces_Law {
    const ces_Distribution *row;
    double parameters[CES_MAX_DISTRIBUTION_PARAMETERS];
    ces_Table table;
    double from, to;    /* the part of (0, 1) that u is mapped to */
    double least, most; /* m, the smallest and the largest diameter it can draw */
} ces_Law;

ces_Status ces_law_start(const ces_FamilyDef *family, const char *what, ces_Law *law, ces_Error *error);
double ces_law_quantile(const ces_Law *law, double u); /* m, for u in [0, 1) */
double ces_law_moment(const ces_Law *law, int power);  /* m^power, mean of diameter^power of the truncated law */

double ces_normal_quantile(double u); /* of the standard normal law, u in (0, 1) */
double ces_normal_cumulative(double z);

#endif
