#include "charge_law.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../base/status.h"
#include "../base/vec3.h"
#include "../effects/laws.h"

#define MOST_CHARGE 1.0 /* C/kg or C/m2 */

/* The quantiles of these laws of diameters know nothing of a sign. */
static const char *const usable[] = {"constant", "uniform", "normal", "table", NULL};

static ces_Status check_table(const ces_FamilyDef *family, const char *what, ces_Error *error)
{
    const double *before = NULL;
    for (size_t row = 0; row < family->charge_table_count; row++) {
        const double *entry = family->charge_table + 2 * row;
        const bool first = before == NULL;
        if (!(fabs(entry[0]) <= MOST_CHARGE && entry[1] >= 0.0 && entry[1] <= 1.0 + 1e-9) ||
            (!first && !(entry[0] >= before[0] && entry[1] >= before[1]))) {
            return ces_fail(error, CES_INPUT,
                            "%s.charge_table[%zu] is (%g, %g): charges in [-1, 1] and fractions in [0, 1] must ascend",
                            what, row, entry[0], entry[1]);
        }
        before = entry;
    }
    if (before == NULL || fabs(before[1] - 1.0) > 1e-9) {
        return ces_fail(error, CES_INPUT, "%s.charge_table must have rows and end at the fraction 1", what);
    }
    return CES_OK;
}

ces_Status ces_charge_law_start(const ces_FamilyDef *family, const char *what, ces_ChargeLaw *law, ces_Error *error)
{
    *law = (ces_ChargeLaw){.per_surface = family->charge_per_surface};
    if (family->charge[0] == '\0') {
        return CES_OK;
    }
    bool known = false;
    for (size_t k = 0; usable[k] != NULL; k++) {
        known = known || strcmp(usable[k], family->charge) == 0;
    }
    if (!known) {
        return ces_fail(error, CES_INPUT, "%s.charge is \"%s\", not one of: constant, uniform, normal, table", what,
                        family->charge);
    }
    law->row = ces_distribution_find(family->charge);
    law->table = (ces_Table){family->charge_table, family->charge_table_count};
    memcpy(law->parameters, family->charge_parameters, sizeof law->parameters);
    if (law->row->moment != NULL) {
        return check_table(family, what, error);
    }
    char name[96];
    for (int k = 0; law->row->parameters[k].name != NULL; k++) {
        snprintf(name, sizeof name, "%s.charge.%s", what, law->row->parameters[k].name);
        const ces_Status status = ces_check_range(error, name, law->parameters[k], -MOST_CHARGE, MOST_CHARGE,
                                                  law->per_surface ? "C/m2" : "C/kg");
        if (status != CES_OK) {
            return status;
        }
    }
    const bool spread = strcmp(family->charge, "normal") == 0, between = strcmp(family->charge, "uniform") == 0;
    if ((spread && law->parameters[1] < 0.0) || (between && law->parameters[0] > law->parameters[1])) {
        return ces_fail(error, CES_INPUT, "%s.charge is (%g, %g): a deviation below 0, or least above most", what,
                        law->parameters[0], law->parameters[1]);
    }
    return CES_OK;
}

double ces_charge_law_draw(const ces_ChargeLaw *law, double mass, double diameter, double u, bool *limited)
{
    *limited = false;
    if (law->row == NULL) {
        return 0.0;
    }
    const double inside = fmax(u, 0x1p-54); /* a normal law has no end */
    const double amount = law->per_surface ? CES_PI * diameter * diameter : mass;
    const double charge = amount * law->row->quantile(law->parameters, &law->table, inside);
    const double most = ces_breakdown_charge(0.5 * diameter);
    *limited = fabs(charge) > most;
    return *limited ? copysign(most, charge) : charge;
}
