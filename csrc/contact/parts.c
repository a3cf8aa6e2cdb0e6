#include "parts.h"

#include "../base/vec3.h"

void ces_part_place(const ces_Shape *shape, const ces_Particles *particles, size_t row, size_t ball, ces_Convex *part)
{
    static const double middle[3] = {0.0, 0.0, 0.0};
    const double d = particles->diameter[row];
    const double *orientation = &particles->orientation[4 * row];
    double place[3];
    ces_copy(&particles->position[3 * row], place);
    switch (shape->def.kind) {
    case CES_CONVEX:
        ces_convex_place(part, shape->def.vertices, shape->def.vertex_count, d, 0.0, place, orientation);
        return;
    case CES_CLUSTER: {
        const double *sphere = &shape->def.spheres[4 * ball];
        double off[3];
        ces_rotate(orientation, sphere, off);
        ces_add_scaled(place, d, off);
        ces_convex_place(part, middle, 1, d, d * sphere[3], place, orientation);
        return;
    }
    case CES_SPHERE:
        ces_convex_place(part, middle, 1, d, 0.5 * d, place, orientation);
        return;
    }
}
