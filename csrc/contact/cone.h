/*
 * contact/cone.h - the friction cone K = {p : |p_t| <= mu p_n}, in world vectors with the contact's normal n.
 */
#ifndef CES_CONE_H
#define CES_CONE_H

#include "../base/vec3.h"

/* Shortens v, a vector in a plane, to a disc of this radius. */
static inline void ces_project_disc(double v[3], double radius)
{
    const double length = ces_norm(v);
    if (length > radius) {
        const double factor = radius > 0.0 ? radius / length : 0.0;
        v[0] *= factor;
        v[1] *= factor;
        v[2] *= factor;
    }
}

/* Nearest point of the cone, Euclidean: the projection that the residual is made of. */
static inline void ces_project_cone(const double n[3], double mu, double p[3])
{
    const double normal = ces_dot(n, p);
    double tangent[3] = {p[0] - normal * n[0], p[1] - normal * n[1], p[2] - normal * n[2]};
    const double length = ces_norm(tangent);
    if (normal >= 0.0 && length <= mu * normal) {
        return;
    }
    if (mu * length <= -normal) {
        p[0] = p[1] = p[2] = 0.0;
        return;
    }
    const double projected = (normal + mu * length) / (1.0 + mu * mu);
    const double factor = length > 0.0 ? mu * projected / length : 0.0;
    for (int k = 0; k < 3; k++) {
        p[k] = projected * n[k] + factor * tangent[k];
    }
}

#endif
