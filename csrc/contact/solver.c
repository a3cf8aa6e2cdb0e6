#include "solver.h"

#include <string.h>

static const ces_SolverRow *const table[] = {&ces_solver_pgs};

const ces_SolverRow *ces_solver_find(const char *name)
{
    for (size_t k = 0; k < sizeof table / sizeof table[0]; k++) {
        if (strcmp(table[k]->name, name) == 0) {
            return table[k];
        }
    }
    return NULL;
}
