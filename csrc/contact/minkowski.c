#include "minkowski.h"

#include "../base/vec3.h"

#define FLAT 1e-14 /* a triangle or tetrahedron thinner than this share of its size has no inside */

size_t ces_convex_support(const ces_Convex *body, const double direction[3], double point[3])
{
    const double(*r)[3] = body->rotation;
    double local[3], found[3];
    for (int k = 0; k < 3; k++) {
        local[k] = r[0][k] * direction[0] + r[1][k] * direction[1] + r[2][k] * direction[2];
    }
    size_t best = 0;
    if (body->count == 0) {
        const double radial = sqrt(local[0] * local[0] + local[1] * local[1]);
        const double factor = radial > 0.0 ? body->cylinder[0] / radial : 0.0;
        found[0] = factor * local[0];
        found[1] = factor * local[1];
        found[2] = copysign(body->cylinder[1], local[2]);
    } else {
        double most = ces_dot(local, body->vertices);
        for (size_t k = 1; k < body->count; k++) {
            const double along = ces_dot(local, &body->vertices[3 * k]);
            if (along > most) {
                most = along;
                best = k;
            }
        }
        ces_copy(&body->vertices[3 * best], found);
    }
    for (int k = 0; k < 3; k++) {
        point[k] = body->scale * ces_dot(r[k], found);
    }
    return best;
}

void ces_support(const ces_Difference *difference, const double direction[3], ces_Support *support)
{
    const double opposite[3] = {-direction[0], -direction[1], -direction[2]};
    ces_convex_support(difference->b, direction, support->b);
    ces_convex_support(difference->a, opposite, support->a);
    for (int k = 0; k < 3; k++) {
        support->w[k] = (support->b[k] - support->a[k]) - difference->offset[k];
    }
}

/* ---- nearest point of a simplex: signed volumes, and the faces where a sign fails (Montanari et al., ACM Trans. Graph. 36
 * (2017) 30) ---------------------------------------------------------------------------------------------------------- */

static void nearest_of_line(ces_Simplex *s, double nearest[3])
{
    const double *p = s->point[0].w, *q = s->point[1].w;
    double edge[3];
    ces_subtract(q, p, edge);
    const double along = -ces_dot(p, edge), squared = ces_dot(edge, edge);
    if (along <= 0.0) {
        s->count = 1;
    } else if (along >= squared) {
        s->count = 1;
        s->point[0] = s->point[1];
    } else {
        s->weight[1] = along / squared;
        s->weight[0] = 1.0 - s->weight[1];
        for (int k = 0; k < 3; k++) {
            nearest[k] = p[k] + s->weight[1] * edge[k];
        }
        return;
    }
    s->weight[0] = 1.0;
    ces_copy(s->point[0].w, nearest);
}

/* Takes the face without one corner if its nearest point beats the best so far. */
static void try_face(const ces_Simplex *s, int without, ces_Simplex *best, double nearest[3], double *least)
{
    ces_Simplex face = {.count = 0};
    double point[3];
    for (int k = 0; k < s->count; k++) {
        if (k != without) {
            face.point[face.count++] = s->point[k];
        }
    }
    ces_simplex_nearest(&face, point);
    const double squared = ces_dot(point, point);
    if (squared < *least) {
        *least = squared;
        *best = face;
        ces_copy(point, nearest);
    }
}

static double longest_edge(const ces_Simplex *s)
{
    double squared = 0.0;
    for (int i = 0; i < s->count; i++) {
        for (int j = 0; j < i; j++) {
            double edge[3];
            ces_subtract(s->point[i].w, s->point[j].w, edge);
            squared = ces_max(squared, ces_dot(edge, edge));
        }
    }
    return sqrt(squared);
}

static void triangle_normal(const double p[3], const double q[3], const double r[3], double normal[3])
{
    double first[3], second[3];
    ces_subtract(q, p, first);
    ces_subtract(r, p, second);
    ces_cross(first, second, normal);
}

static void nearest_of_triangle(ces_Simplex *s, double nearest[3])
{
    double normal[3], share[3], part[3];
    triangle_normal(s->point[0].w, s->point[1].w, s->point[2].w, normal);
    const double squared = ces_dot(normal, normal), size = longest_edge(s);
    const bool flat = sqrt(squared) <= FLAT * size * size;
    bool inside = !flat;
    for (int k = 0; k < 3; k++) {
        ces_cross(s->point[(k + 1) % 3].w, s->point[(k + 2) % 3].w, part);
        share[k] = ces_dot(normal, part);
        inside = inside && share[k] > 0.0;
    }
    if (inside) {
        const double total = share[0] + share[1] + share[2];
        const double factor = ces_dot(normal, s->point[0].w) / squared;
        for (int k = 0; k < 3; k++) {
            s->weight[k] = share[k] / total;
            nearest[k] = factor * normal[k];
        }
        return;
    }
    const ces_Simplex whole = *s;
    double least = HUGE_VAL;
    for (int k = 0; k < 3; k++) {
        if (flat || share[k] <= 0.0) {
            try_face(&whole, k, s, nearest, &least);
        }
    }
}

static bool nearest_of_tetrahedron(ces_Simplex *s, double nearest[3])
{
    const ces_Simplex whole = *s;
    const double size = longest_edge(s);
    double least = HUGE_VAL;
    for (int k = 0; k < 4; k++) {
        const double *p = whole.point[(k + 1) % 4].w, *opposite = whole.point[k].w;
        double normal[3], to_opposite[3];
        triangle_normal(p, whole.point[(k + 2) % 4].w, whole.point[(k + 3) % 4].w, normal);
        ces_subtract(opposite, p, to_opposite);
        const double height = ces_dot(normal, to_opposite), origin = -ces_dot(normal, p);
        const bool flat = fabs(height) <= FLAT * size * size * size;
        if (flat || (height > 0.0 ? origin <= 0.0 : origin >= 0.0)) {
            try_face(&whole, k, s, nearest, &least);
        }
    }
    return least < HUGE_VAL;
}

bool ces_simplex_nearest(ces_Simplex *simplex, double nearest[3])
{
    switch (simplex->count) {
    case 1:
        simplex->weight[0] = 1.0;
        ces_copy(simplex->point[0].w, nearest);
        return true;
    case 2:
        nearest_of_line(simplex, nearest);
        return true;
    case 3:
        nearest_of_triangle(simplex, nearest);
        return true;
    default:
        return nearest_of_tetrahedron(simplex, nearest);
    }
}
