/* data/shapes.h - the shapes of grains: what a definition gives, checked and copied, and what follows from it. */
#ifndef CES_SHAPES_H
#define CES_SHAPES_H

#include "../base/vec3.h"
#include "../cesim.h"

enum { CES_CONVEX_VERTICES = 128 }; /* of a convex shape, at most */

typedef struct ces_Shape {
    ces_ShapeDef def;                      /* its arrays are copies */
    double reach;                          /* bounding radius over d */
    ces_ShapeDef phase_shapes[CES_PHASES]; /* of a composite: what the effects see of its phases */
} ces_Shape;

typedef struct ces_Shapes {
    ces_Shape *list; /* (count), the first is a sphere */
    size_t count;
    double *numbers;   /* what the copies live in */
    uint32_t *indices; /* and the materials of their spheres */
    bool only_spheres;
    bool composites; /* some shape is one */
} ces_Shapes;

/* Checks and copies; a scene without shapes gets the sphere. All or nothing. */
ces_Status ces_shapes_create(ces_Shapes *shapes, const ces_ShapeDef *defs, size_t count, ces_Error *error);
void ces_shapes_free(ces_Shapes *shapes);

/* sum over the principal axes k of (axis k)(axis k)^T / moments[k], in the world frame, row-major: an inverse inertia. */
void ces_inverse_tensor(const double moments[3], const double orientation[4], double inverse[9]);

/* The inverse inertia in the world frame, row-major, of a grain; zero where nothing turns. */
void ces_inverse_inertia(const ces_Shape *shape, double mass, double diameter, const double orientation[4],
                         double inverse[9]);

/*
 * Free rotation over a step: orientation and angular velocity (world) are advanced without a moment; only the ratios of the
 * principal moments count. The angular momentum in
 * the body's frame is split into five rotations about the principal axes, in the order x y z y x, each exact: so the angular
 * momentum in the world is kept to rounding, and the energy does not drift (McLachlan, Phys. Rev. Lett. 71 (1993) 3043;
 * Touma & Wisdom, Astron. J. 107 (1994) 1189).
 */
void ces_rotate_freely(const double moments[3], double step, double orientation[4], double spin[3]);
/* The same, or, without the gyroscopic term, with the angular velocity kept. */
void ces_rotate_alone(const double moments[3], bool gyroscopic, double step, double orientation[4], double spin[3]);
/* What an angular momentum comes to, as an angular velocity (world), once the body has turned: spin becomes
 * I(to)^-1 I(from) spin. */
void ces_carry_spin(const double moments[3], const double from[4], const double to[4], double spin[3]);

#endif
