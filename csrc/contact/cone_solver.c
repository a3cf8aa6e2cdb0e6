#include "cone_solver.h"

#include <string.h>

static const ces_ConeSolver *const table[] = {
    &ces_cone_auto, &ces_cone_pgs, &ces_cone_apgs, &ces_cone_apgd, &ces_cone_spg, &ces_cone_jacobi, &ces_cone_direct,
};

size_t ces_cone_solver_count(void)
{
    return sizeof table / sizeof table[0];
}

const ces_ConeSolver *ces_cone_solver_at(size_t row)
{
    return table[row];
}

const ces_ConeSolver *ces_cone_solver_find(const char *name)
{
    for (size_t k = 0; k < ces_cone_solver_count(); k++) {
        if (strcmp(table[k]->name, name) == 0) {
            return table[k];
        }
    }
    return NULL;
}
