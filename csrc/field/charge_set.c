#include "charge_set.h"

#include <math.h>

#include "../base/vec3.h"

size_t ces_charged_rows(const ces_Crowd *crowd, uint32_t *rows)
{
    size_t count = 0;
    for (size_t row = 0; row < crowd->count; row++) {
        const double *x = &crowd->position[3 * row];
        /* What is not finite ends the step elsewhere, with an error that names it; here it must only do no harm. */
        if (crowd->charge[row] != 0.0 && isfinite(crowd->charge[row] + x[0] + x[1] + x[2])) {
            rows[count++] = (uint32_t)row;
        }
    }
    return count;
}

bool ces_charge_set_reserve(ces_ChargeSet *set, size_t count, ces_Pool *pool)
{
    if (!ces_pool_reserve(pool, 11 * count, sizeof(double))) {
        return false;
    }
    double *column = pool->data;
    set->count = count;
    for (int k = 0; k < 3; k++) {
        set->x[k] = column + (size_t)k * count;
        set->image[k] = column + (size_t)(3 + k) * count;
        set->force[k] = column + (size_t)(6 + k) * count;
    }
    set->charge = column + 9 * count;
    set->radius = column + 10 * count;
    return true;
}

/* The inverse point in the cylinder's circle. A centre is taken to be its radius over the surface, where it is lower. */
static void place_image(const ces_ChargesDef *def, ces_ChargeSet *set, size_t i)
{
    const double x = set->x[0][i] - def->drum_axis[0], y = set->x[1][i] - def->drum_axis[1];
    const double distance = sqrt(x * x + y * y);
    const double outside = ces_max(distance, def->drum_radius + set->radius[i]);
    const double scale = distance > 0.0 ? def->drum_radius * def->drum_radius / (outside * distance) : 0.0;
    set->image[0][i] = def->drum_axis[0] + scale * x;
    set->image[1][i] = def->drum_axis[1] + scale * y;
    set->image[2][i] = set->x[2][i];
}

void ces_charge_set_fill(ces_ChargeSet *set, const ces_ChargesDef *def, const ces_Crowd *crowd)
{
    for (size_t i = 0; i < set->count; i++) {
        const size_t row = set->row[i];
        for (int k = 0; k < 3; k++) {
            set->x[k][i] = crowd->position[3 * row + (size_t)k];
            set->force[k][i] = 0.0;
        }
        set->charge[i] = crowd->charge[row];
        set->radius[i] = 0.5 * crowd->diameter[row];
        if (def->drum_radius > 0.0) {
            place_image(def, set, i);
        }
    }
}

void ces_charge_set_images(ces_ChargeSet *images, const ces_ChargeSet *set)
{
    for (size_t i = 0; i < images->count; i++) {
        const size_t of = images->row[i];
        for (int k = 0; k < 3; k++) {
            images->x[k][i] = set->image[k][of];
        }
        images->charge[i] = -set->charge[of];
        images->radius[i] = set->radius[of];
    }
}

/* ---- pairs ------------------------------------------------------------------------------------------------------------- */

/* Force over distance of two charges, over the Coulomb constant. */
static inline double pull(double charges, double distance2, double contact)
{
    const double softened = ces_max(distance2, contact * contact);
    return charges / (softened * sqrt(softened));
}

/* The inner loop runs over targets: each has a sum of its own, so the lanes of a vector unit do not change its order. */
void ces_pairs_all(const ces_ChargeSet *targets, ces_Range at, const ces_ChargeSet *sources, ces_Range of)
{
    const double *restrict x = targets->x[0], *restrict y = targets->x[1], *restrict z = targets->x[2];
    const double *restrict q = targets->charge, *restrict r = targets->radius;
    double *restrict fx = targets->force[0], *restrict fy = targets->force[1], *restrict fz = targets->force[2];
    for (size_t j = of.first; j < of.last; j++) {
        const double xj = sources->x[0][j], yj = sources->x[1][j], zj = sources->x[2][j];
        const double qj = sources->charge[j], rj = sources->radius[j];
        for (size_t i = at.first; i < at.last; i++) {
            const double dx = x[i] - xj, dy = y[i] - yj, dz = z[i] - zj;
            const double w = pull(q[i] * qj, dx * dx + dy * dy + dz * dz, r[i] + rj);
            fx[i] += w * dx;
            fy[i] += w * dy;
            fz[i] += w * dz;
        }
    }
}

void ces_pairs_near(const ces_ChargeSet *set, ces_Range at, ces_Range of, double cutoff, bool images)
{
    const double *restrict x = set->x[0], *restrict y = set->x[1], *restrict z = set->x[2];
    const double *restrict q = set->charge, *restrict r = set->radius;
    double *restrict fx = set->force[0], *restrict fy = set->force[1], *restrict fz = set->force[2];
    double *const *from = images ? set->image : set->x;
    const double sign = images ? -1.0 : 1.0, most = cutoff * cutoff;
    for (size_t j = of.first; j < of.last; j++) {
        const double xj = x[j], yj = y[j], zj = z[j], qj = sign * q[j], rj = r[j];
        const double xf = from[0][j], yf = from[1][j], zf = from[2][j];
        for (size_t i = at.first; i < at.last; i++) {
            const double gx = x[i] - xj, gy = y[i] - yj, gz = z[i] - zj;
            const double dx = x[i] - xf, dy = y[i] - yf, dz = z[i] - zf;
            const double w = pull(q[i] * qj, dx * dx + dy * dy + dz * dz, r[i] + rj);
            const double near = gx * gx + gy * gy + gz * gz <= most ? w : 0.0;
            fx[i] += near * dx;
            fy[i] += near * dy;
            fz[i] += near * dz;
        }
    }
}

static void add_pull(const ces_ChargeSet *set, size_t i, double *const from[3], size_t j, double sign, double force[3])
{
    const double d[3] = {set->x[0][i] - from[0][j], set->x[1][i] - from[1][j], set->x[2][i] - from[2][j]};
    const double charges = sign * set->charge[i] * set->charge[j];
    ces_add_scaled(force, pull(charges, ces_dot(d, d), set->radius[i] + set->radius[j]), d);
}

void ces_pairs_leave_own_image(const ces_ChargeSet *set, size_t i, double force[3])
{
    add_pull(set, i, set->image, i, 1.0, force);
}

void ces_pairs_on_one(const ces_ChargeSet *set, size_t i, bool images, double force[3])
{
    for (size_t j = 0; j < set->count; j++) {
        add_pull(set, i, set->x, j, 1.0, force);
        if (images && j != i) {
            add_pull(set, i, set->image, j, -1.0, force);
        }
    }
}
