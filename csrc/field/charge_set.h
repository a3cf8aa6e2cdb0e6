/* field/charge_set.h - the charges of a crowd as columns that a vector unit can read, and the sums over their pairs. */
#ifndef CES_CHARGE_SET_H
#define CES_CHARGE_SET_H

#include "charges.h"

typedef struct ces_ChargeSet {
    size_t count;
    double *x[3];     /* m */
    double *image[3]; /* m, of each charge in the cylinder; only where there is one */
    double *charge;   /* C */
    double *radius;   /* m */
    double *force[3]; /* N over the Coulomb constant, so far */
    uint32_t *row;    /* in the crowd */
} ces_ChargeSet;

/* The rows of a crowd that carry a charge; the caller has room for crowd->count in rows. */
size_t ces_charged_rows(const ces_Crowd *crowd, uint32_t *rows);

/* Places the columns of count charges in a pool; set->row is the caller's. False: out of memory. */
bool ces_charge_set_reserve(ces_ChargeSet *set, size_t count, ces_Pool *pool);
/* Fills the columns with the rows of the crowd that set->row names, no force yet. */
void ces_charge_set_fill(ces_ChargeSet *set, const ces_ChargesDef *def, const ces_Crowd *crowd);
/* Fills those of a set of image charges: its row names charges of the set. */
void ces_charge_set_images(ces_ChargeSet *images, const ces_ChargeSet *set);

typedef struct ces_Range {
    size_t first, last;
} ces_Range;

/* Adds to the force on targets what sources do, one by one. A charge and itself do nothing. */
void ces_pairs_all(const ces_ChargeSet *targets, ces_Range at, const ces_ChargeSet *sources, ces_Range of);
/* The same of pairs up to a distance, each charge with its image where the set has images. */
void ces_pairs_near(const ces_ChargeSet *set, ces_Range at, ces_Range of, double cutoff, bool images);
/* Takes away what a charge's own image does to it. */
void ces_pairs_leave_own_image(const ces_ChargeSet *set, size_t i, double force[3]);
/* What all others, and their images, do to one. */
void ces_pairs_on_one(const ces_ChargeSet *set, size_t i, bool images, double force[3]);

#endif
