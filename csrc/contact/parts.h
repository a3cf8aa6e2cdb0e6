/* contact/parts.h - a grain's part as a convex body: a sphere, a sphere of a cluster, or all of a convex grain. */
#ifndef CES_PARTS_H
#define CES_PARTS_H

#include "../data/particles.h"
#include "../data/shapes.h"
#include "convex.h"

/* ball: which sphere of a cluster. The grain's row says where it is now; its shape's vertices are borrowed. */
void ces_part_place(const ces_Shape *shape, const ces_Particles *particles, size_t row, size_t ball, ces_Convex *part);

static inline bool ces_is_convex(const ces_Shape *shapes, const ces_Particles *particles, size_t row)
{
    return shapes[particles->shape[row]].def.kind == CES_CONVEX;
}

#endif
