#include "multipole.h"

#include <math.h>
#include <string.h>

enum { ORDER = CES_MULTIPOLE_ORDER, TERMS = CES_MULTIPOLE_TERMS, LANES = CES_MULTIPOLE_LANES };

static uint8_t index_of(const ces_MultipoleTable *table, int x, int y, int z)
{
    for (uint8_t n = 0; n < TERMS; n++) {
        if (table->power[n][0] == x && table->power[n][1] == y && table->power[n][2] == z) {
            return n;
        }
    }
    return TERMS;
}

void ces_multipole_table(ces_MultipoleTable *table)
{
    static const double factorials[] = {1.0, 1.0, 2.0, 6.0, 24.0, 120.0, 720.0};
    uint8_t count = 0;
    *table = (ces_MultipoleTable){0};
    for (int sum = 0; sum <= ORDER; sum++) {
        for (int x = sum; x >= 0; x--) {
            for (int y = sum - x; y >= 0; y--) {
                const int power[3] = {x, y, sum - x - y};
                table->factorial[count] = factorials[x] * factorials[y] * factorials[power[2]];
                for (int k = 0; k < 3; k++) {
                    table->power[count][k] = (uint8_t)power[k];
                }
                count++;
            }
        }
    }
    size_t products = 0;
    for (uint8_t n = 0; n < TERMS; n++) {
        const uint8_t *p = table->power[n];
        for (int k = 0; k < 3; k++) {
            const int one[3] = {k == 0, k == 1, k == 2};
            table->less[n][k] = index_of(table, p[0] - one[0], p[1] - one[1], p[2] - one[2]);
            table->less2[n][k] = index_of(table, p[0] - 2 * one[0], p[1] - 2 * one[1], p[2] - 2 * one[2]);
        }
        for (uint8_t m = 0; m < TERMS; m++) {
            const uint8_t *q = table->power[m];
            const uint8_t sum = index_of(table, p[0] + q[0], p[1] + q[1], p[2] + q[2]);
            if (sum < TERMS) {
                table->products[products].n = n;
                table->products[products].m = m;
                table->products[products++].sum = sum;
            }
        }
        if (n == 0) {
            table->with_force = products;
        }
    }
}

/* x^n/n! for all n. */
static void monomials(const ces_MultipoleTable *table, const double x[3], double *values)
{
    values[0] = 1.0;
    for (size_t n = 1; n < TERMS; n++) {
        const uint8_t *power = table->power[n];
        const int k = power[0] > 0 ? 0 : power[1] > 0 ? 1 : 2;
        values[n] = values[table->less[n][k]] * x[k] / (double)power[k];
    }
}

void ces_multipole_charge(const ces_MultipoleTable *table, double charge, const double offset[3], double *moments)
{
    const double minus[3] = {-offset[0], -offset[1], -offset[2]};
    double values[TERMS];
    monomials(table, minus, values);
    for (size_t n = 0; n < TERMS; n++) {
        moments[n] += charge * values[n];
    }
}

void ces_multipole_shift(const ces_MultipoleTable *table, const double *from, const double offset[3], double *to)
{
    const double minus[3] = {-offset[0], -offset[1], -offset[2]};
    double values[TERMS];
    monomials(table, minus, values);
    for (size_t k = 0; k < CES_MULTIPOLE_PRODUCTS; k++) {
        to[table->products[k].sum] += from[table->products[k].n] * values[table->products[k].m];
    }
}

void ces_local_shift(const ces_MultipoleTable *table, const double *from, const double offset[3], double *to)
{
    double values[TERMS];
    monomials(table, offset, values);
    for (size_t k = table->with_force; k < CES_MULTIPOLE_PRODUCTS; k++) {
        to[table->products[k].n] += from[table->products[k].sum] * values[table->products[k].m];
    }
}

void ces_local_field(const ces_MultipoleTable *table, const double *local, const double offset[3], double field[3])
{
    double values[TERMS];
    monomials(table, offset, values);
    field[0] = field[1] = field[2] = 0.0;
    for (size_t n = 1; n < TERMS; n++) {
        for (int k = 0; k < 3; k++) {
            if (table->less[n][k] < TERMS) {
                field[k] -= local[n] * values[table->less[n][k]];
            }
        }
    }
}

/* D^n(1/r) for all n: with T_n = D^n/n!, |n| r^2 T_n = -(2|n| - 1) sum_k x_k T_(n-k) - (|n| - 1) sum_k T_(n-2k). Row TERMS
 * stands for the terms that do not exist. Lindsay & Krasny, J. Comput. Phys. 172 (2001) 879, without their smoothing. */
static void derivatives(const ces_MultipoleTable *table, double x[3][LANES], double values[TERMS + 1][LANES])
{
    double inverse[LANES];
    for (int lane = 0; lane < LANES; lane++) {
        inverse[lane] = 1.0 / (x[0][lane] * x[0][lane] + x[1][lane] * x[1][lane] + x[2][lane] * x[2][lane]);
        values[0][lane] = sqrt(inverse[lane]);
        values[TERMS][lane] = 0.0;
    }
    for (size_t n = 1; n < TERMS; n++) {
        const uint8_t *less = table->less[n], *less2 = table->less2[n];
        const double sum = (double)(table->power[n][0] + table->power[n][1] + table->power[n][2]);
        const double one = (1.0 - 2.0 * sum) / sum, two = (1.0 - sum) / sum;
        for (int lane = 0; lane < LANES; lane++) {
            values[n][lane] =
                inverse[lane] * (one * (x[0][lane] * values[less[0]][lane] + x[1][lane] * values[less[1]][lane] +
                                        x[2][lane] * values[less[2]][lane]) +
                                 two * (values[less2[0]][lane] + values[less2[1]][lane] + values[less2[2]][lane]));
        }
    }
    for (size_t n = 0; n < TERMS; n++) {
        for (int lane = 0; lane < LANES; lane++) {
            values[n][lane] *= table->factorial[n];
        }
    }
}

void ces_multipole_interact(const ces_MultipoleTable *table, double distance[3][LANES], double moments[TERMS][LANES],
                            double *local)
{
    double d[TERMS + 1][LANES], sums[TERMS][LANES];
    derivatives(table, distance, d);
    memset(sums, 0, sizeof sums);
    for (size_t k = table->with_force; k < CES_MULTIPOLE_PRODUCTS; k++) {
        double *sum = sums[table->products[k].n];
        const double *moment = moments[table->products[k].m], *derivative = d[table->products[k].sum];
        for (int lane = 0; lane < LANES; lane++) {
            sum[lane] += moment[lane] * derivative[lane];
        }
    }
    for (size_t n = 1; n < TERMS; n++) {
        for (int lane = 0; lane < LANES; lane++) {
            local[n] += sums[n][lane];
        }
    }
}
