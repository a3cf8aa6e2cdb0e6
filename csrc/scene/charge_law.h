/* scene/charge_law.h - the charges that grains are fed with: a law per mass or per surface, within what air can hold. */
#ifndef CES_CHARGE_LAW_H
#define CES_CHARGE_LAW_H

#include "distribution.h"

/* The law of one family. It borrows its table; row NULL: its grains come without charge. */
typedef struct ces_ChargeLaw {
    const ces_Distribution *row;
    double parameters[CES_MAX_DISTRIBUTION_PARAMETERS];
    ces_Table table;
    bool per_surface;
} ces_ChargeLaw;

ces_Status ces_charge_law_start(const ces_FamilyDef *family, const char *what, ces_ChargeLaw *law, ces_Error *error);

/* C, of a grain of this mass and diameter, for u in [0, 1); limited: whether air would not hold more. */
double ces_charge_law_draw(const ces_ChargeLaw *law, double mass, double diameter, double u, bool *limited);

#endif
