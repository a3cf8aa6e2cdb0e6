/*
 * field/multipole.h - Cartesian expansions of 1/r about the centres of two cells, to a fixed order.
 *
 * With targets at A + a and sources at B + b, R = A - B, and multi-indices n, m:
 *
 *     sum_b q/|R + a - b| = sum_n a^n/n! L_n,   L_n = sum_(|n| + |m| <= order) D^(n+m)(1/R) M_m,   M_m = sum_b q (-b)^m/m!
 *
 * The sum is cut at |n| + |m|, not at |n| and |m|: then the force of B on all of A is the opposite of that of A on all of B,
 * whatever is cut off (Dehnen, J. Comput. Phys. 179 (2002) 27).
 */
#ifndef CES_MULTIPOLE_H
#define CES_MULTIPOLE_H

#include <stddef.h>
#include <stdint.h>

enum {
    CES_MULTIPOLE_ORDER = 4,
    CES_MULTIPOLE_TERMS = 35,     /* (order + 1)(order + 2)(order + 3)/6 multi-indices */
    CES_MULTIPOLE_PRODUCTS = 210, /* (order + 6)!/(order! 6!) pairs of them with |n| + |m| <= order */
    CES_MULTIPOLE_LANES = 4,      /* sources taken at a time */
};

/* Multi-indices by their sum, and what adds up to what. */
typedef struct ces_MultipoleTable {
    uint8_t power[CES_MULTIPOLE_TERMS][3];
    uint8_t less[CES_MULTIPOLE_TERMS][3];  /* one lower in this power; TERMS where it is 0 */
    uint8_t less2[CES_MULTIPOLE_TERMS][3]; /* two lower */
    double factorial[CES_MULTIPOLE_TERMS]; /* n! */
    struct {
        uint8_t n, m, sum;
    } products[CES_MULTIPOLE_PRODUCTS]; /* by n; those of n = 0 come first */
    size_t with_force;                  /* the first product with n > 0 */
} ces_MultipoleTable;

void ces_multipole_table(ces_MultipoleTable *table);

/* Adds a charge at offset from the centre of its cell to the moments (TERMS). */
void ces_multipole_charge(const ces_MultipoleTable *table, double charge, const double offset[3], double *moments);
/* Adds moments about a centre to those about another; offset: of the first from the second. */
void ces_multipole_shift(const ces_MultipoleTable *table, const double *from, const double offset[3], double *to);
/* Adds to the local expansion (TERMS) what LANES cells do: distance[k]: target less source centre; lanes side by side. */
void ces_multipole_interact(const ces_MultipoleTable *table, double distance[3][CES_MULTIPOLE_LANES],
                            double moments[CES_MULTIPOLE_TERMS][CES_MULTIPOLE_LANES], double *local);
/* Adds a local expansion about a centre to that about another; offset: of the second from the first. */
void ces_local_shift(const ces_MultipoleTable *table, const double *from, const double offset[3], double *to);
/* Minus the gradient of a local expansion at offset from its centre. */
void ces_local_field(const ces_MultipoleTable *table, const double *local, const double offset[3], double field[3]);

#endif
