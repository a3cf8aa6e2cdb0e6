/*
 * contact/cone_active.h - a problem solved on those of its blocks that act.
 *
 * Grains that fall on each other come with many contacts that are about to open: of an island of eight clusters with 350
 * contacts, 40 push. An open block has no impulse and changes nothing, so the others are solved by themselves, and what turns
 * out to be violated joins them.
 */
#ifndef CES_CONE_ACTIVE_H
#define CES_CONE_ACTIVE_H

#include "cone_solver.h"

/* Whether the blocks that act at problem->impulse have at most so many rows. The operator holds these impulses. */
bool ces_cone_few_act(const ces_ConeProblem *problem, size_t most_rows);

/* Doubles of scratch for the method on at most so many rows. */
size_t ces_cone_active_scratch(const ces_ConeProblem *problem, const ces_ConeSolver *method, size_t most_rows);

/*
 * Solves with the method from problem->impulse; the blocks that act must have at most so many rows, and where that ceases to
 * hold it ends. An iteration counts by the share of the blocks that it visits.
 */
ces_ConeReport ces_cone_solve_active(const ces_ConeProblem *problem, const ces_ConeSolver *method, size_t most_rows);

#endif
