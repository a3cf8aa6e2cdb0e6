/* contact/convex_candidates.h - the candidates of parts of which at least one is a convex grain: one a point of contact. */
#ifndef CES_CONVEX_CANDIDATES_H
#define CES_CONVEX_CANDIDATES_H

#include "candidate.h"

#define CES_NO_CANDIDATE UINT32_MAX /* in the place of a: the place was not needed */

enum { CES_CONVEX_PLACES = 2 * CES_MANIFOLD_POINTS }; /* points of contact, and those in reserve */

/* Fill CES_CONVEX_PLACES places; those not needed are marked. margin: how far off its path either may be pushed, m. */
void ces_convex_pair_candidates(const ces_DetectInput *input, const ces_Balls *balls, const uint32_t rows[2],
                                const size_t ball[2], double margin, ces_Candidate *candidates);
void ces_convex_surface_candidates(const ces_DetectInput *input, uint32_t row, uint32_t surface, double margin,
                                   ces_Candidate *candidates);
void ces_convex_mesh_candidates(const ces_DetectInput *input, uint32_t row, uint32_t surface, double margin,
                                ces_Candidate *candidates);
/* A grain's body in the frame of a mesh, now, and the way it goes there by a path in the world. */
void ces_convex_in_mesh(const ces_Surface *surface, const ces_Convex *body, const double path[3], ces_Convex *local,
                        double local_path[3]);

/* Closes the gaps of the places that were not needed; gives the number left. */
size_t ces_squeeze_candidates(ces_Candidate *candidates, size_t count);

#endif
