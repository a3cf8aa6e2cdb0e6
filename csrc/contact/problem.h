/*
 * contact/problem.h - the cone problems of islands of spheres, laid out for the kernel of solver_pgs.c.
 *
 * A grain is one cache line: its velocity and its surface spin s = radius * angular velocity. With s in place of the angular
 * velocity the radii leave the contact rows: u = v_a - v_b - (s_a + s_b) x n, and an impulse p changes v by p/m and s by
 * -(spin_mobility/m) n x p. Contacts stand in packs of eight lanes (array of structures of arrays), island by island,
 * grain-grain and grain-surface in lists of their own: what a vector unit reads.
 */
#ifndef CES_PROBLEM_H
#define CES_PROBLEM_H

#include "../base/vec3.h"
#include "../data/particles.h"
#include "islands.h"

enum { CES_LANES = 8 };
#define CES_SPHERE_SPIN 2.5 /* mass radius^2 / inertia of a solid sphere */

typedef struct ces_Body {
    double v[3]; /* m/s */
    double s[3]; /* m/s */
    double inverse_mass;
    double moved; /* fraction of the step before its first collision; negative: no contact pushed it */
} ces_Body;

typedef struct ces_Pack {
    double n[3][CES_LANES];
    double p[3][CES_LANES]; /* N s, on a */
    double bias[CES_LANES]; /* m/s */
    double mu[CES_LANES];
    uint32_t a[CES_LANES], b[CES_LANES];
} ces_Pack;

/* What only a surface contact has, and what only rolling friction needs: present when the scene has it. */
typedef struct ces_SurfacePack {
    double velocity[3][CES_LANES]; /* m/s */
} ces_SurfacePack;

typedef struct ces_RollPack {
    double k[3][CES_LANES];        /* N s */
    double velocity[3][CES_LANES]; /* m/s, rolling velocity of the surface */
    double limit[CES_LANES];       /* |k| <= limit * normal impulse */
    double ratio_a[CES_LANES], ratio_b[CES_LANES];
} ces_RollPack;

typedef struct ces_Problem {
    ces_Body *bodies; /* (rows); only rows with contacts are filled */
    ces_Pack *pairs, *surfaces;
    ces_SurfacePack *surface_motion;
    ces_RollPack *pair_roll, *surface_roll; /* NULL: no rolling friction in the scene */
    const ces_Islands *islands;
    ces_ContactLaw law;
    double spin_mobility; /* 2.5 for spheres, 0 when nothing rotates */
    double tolerance;     /* m/s */
    uint32_t max_iterations;
    ces_Pool body_pool, pair_pool, surface_pool, motion_pool, pair_roll_pool, surface_roll_pool;
} ces_Problem;

/* Fills the problem from the contacts, with their impulses as the start. free_velocity (rows, 3). False: out of memory. */
bool ces_problem_build(ces_Problem *problem, const ces_Contacts *contacts, const ces_Islands *islands,
                       const ces_Particles *particles, size_t rows, const double *free_velocity, bool rolling);
/* Writes the impulses of the packed islands back to their contacts. */
void ces_problem_finish(const ces_Problem *problem, ces_Contacts *contacts);
/* Notes of each body, of all islands, whether and when it was pushed. */
void ces_problem_mark(ces_Problem *problem, const ces_Contacts *contacts);
void ces_problem_free(ces_Problem *problem);

#endif
