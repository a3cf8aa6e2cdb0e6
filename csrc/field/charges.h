/*
 * field/charges.h - the forces that charged spheres have on each other: summed pair by pair, up to a cut-off, or by a tree.
 *
 * Two charges repel with k q q'/d^2; nearer than the sum of their radii the force falls linearly to nothing, as inside a
 * ball of that radius filled with charge: finite everywhere, with a potential. The force of a pair is one product of numbers
 * that do not depend on which of the two asks: so it is equal and opposite to the last bit.
 *
 * A grounded cylinder along z may be given. Each charge then has an image of opposite sign, at the inverse point of its
 * circle, which acts on all other charges; its pull on its own charge is left to the effects that know it better.
 */
#ifndef CES_CHARGES_H
#define CES_CHARGES_H

#include "../data/crowd.h"
#include "multipole.h"

typedef enum ces_ChargeMethod {
    CES_CHARGES_TREE,   /* all pairs: near ones one by one, far ones by multipoles of pairs of cells */
    CES_CHARGES_CUTOFF, /* pairs up to a distance, each with its images */
    CES_CHARGES_DIRECT, /* all pairs one by one */
    CES_CHARGE_METHOD_COUNT
} ces_ChargeMethod;

typedef struct ces_ChargesDef {
    ces_ChargeMethod method;
    double cutoff;       /* m */
    double opening;      /* of a pair of cells that counts as far: sum of their radii over their distance */
    double drum_axis[2]; /* m */
    double drum_radius;  /* m, 0: no images */
    uint64_t seed;       /* of the sample that the error is measured on */
    ces_MultipoleTable table;
} ces_ChargesDef;

/* Adds to force (count, 3), N. What is not charged, or not finite, neither acts nor feels anything. pools: memory that is
 * kept from call to call (CES_CROWD_POOLS). False: out of memory. */
bool ces_charges_force(const ces_ChargesDef *def, const ces_Crowd *crowd, ces_Pool *pools, double *force,
                       ces_CrowdError *error);

#endif
