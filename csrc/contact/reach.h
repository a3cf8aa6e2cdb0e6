/*
 * contact/reach.h - how far the contacts of this very step may throw each grain off its free path, and so, which candidates
 * may come to touch. reach: m, (rows).
 */
#ifndef CES_REACH_H
#define CES_REACH_H

#include "candidate.h"

/* Raises the reach of the grains that these candidates hit. */
void ces_reach_raise(const ces_DetectInput *input, double *reach, const ces_Candidate *candidates, size_t count,
                     bool is_pair);
/* A push travels from grain to grain within the step; serial, so that its order is one. */
void ces_reach_spread(const ces_DetectInput *input, double *reach, const ces_Candidate *pairs, size_t count);
/* Whether a candidate touches, or may be pushed to. */
bool ces_is_near(const ces_DetectInput *input, const double *reach, const ces_Candidate *candidate, bool is_pair);

#endif
