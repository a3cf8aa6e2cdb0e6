#include "cone_sweep.h"
static size_t scratch(const ces_ConeProblem *problem)
{
    return ces_cone_apgd.scratch(problem);
}
static ces_ConeReport solve(const ces_ConeProblem *problem)
{
    return ces_cone_apgd.solve(problem);
}
const ces_ConeSolver ces_cone_auto = {.name = "auto", .doc = "", .scratch = scratch, .solve = solve};
