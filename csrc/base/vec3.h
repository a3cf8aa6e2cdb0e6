/* base/vec3.h - small inline functions on vectors, quaternions (w, x, y, z) and rotations. */
#ifndef CES_VEC3_H
#define CES_VEC3_H

#include <math.h>

#define CES_PI 3.14159265358979323846

/* fmax and fmin look after nan, and are calls for it; these are one instruction. */
static inline double ces_max(double a, double b)
{
    return a > b ? a : b;
}

static inline double ces_min(double a, double b)
{
    return a < b ? a : b;
}

static inline double ces_dot(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double ces_norm(const double a[3])
{
    return sqrt(ces_dot(a, a));
}

static inline void ces_cross(const double a[3], const double b[3], double out[3])
{
    const double x = a[1] * b[2] - a[2] * b[1];
    const double y = a[2] * b[0] - a[0] * b[2];
    const double z = a[0] * b[1] - a[1] * b[0];
    out[0] = x;
    out[1] = y;
    out[2] = z;
}

static inline void ces_copy(const double a[3], double out[3])
{
    out[0] = a[0];
    out[1] = a[1];
    out[2] = a[2];
}

static inline void ces_subtract(const double a[3], const double b[3], double out[3])
{
    out[0] = a[0] - b[0];
    out[1] = a[1] - b[1];
    out[2] = a[2] - b[2];
}

/* out += factor a */
static inline void ces_add_scaled(double out[3], double factor, const double a[3])
{
    out[0] += factor * a[0];
    out[1] += factor * a[1];
    out[2] += factor * a[2];
}

/* Rotation by a unit quaternion: v + 2 w (q x v) + 2 q x (q x v). */
static inline void ces_rotate(const double q[4], const double v[3], double out[3])
{
    double t[3], u[3];
    ces_cross(&q[1], v, t);
    ces_cross(&q[1], t, u);
    for (int k = 0; k < 3; k++) {
        out[k] = v[k] + 2.0 * (q[0] * t[k] + u[k]);
    }
}

static inline void ces_rotate_back(const double q[4], const double v[3], double out[3])
{
    const double conjugate[4] = {q[0], -q[1], -q[2], -q[3]};
    ces_rotate(conjugate, v, out);
}

/* The rotation q, then p. out may be neither. */
static inline void ces_multiply(const double p[4], const double q[4], double out[4])
{
    double cross[3];
    ces_cross(&p[1], &q[1], cross);
    out[0] = p[0] * q[0] - ces_dot(&p[1], &q[1]);
    for (int k = 1; k < 4; k++) {
        out[k] = p[0] * q[k] + q[0] * p[k] + cross[k - 1];
    }
}

/* The exponential map: q turned by the world rotation vector (its length is the angle), normalised. */
static inline void ces_turn(double q[4], const double rotation[3])
{
    const double angle = ces_norm(rotation);
    /* sin(angle/2)/angle, by its series where the quotient loses digits */
    const double scale = angle > 1e-4 ? sin(0.5 * angle) / angle : 0.5 - angle * angle / 48.0;
    const double w = cos(0.5 * angle);
    const double d[3] = {scale * rotation[0], scale * rotation[1], scale * rotation[2]};
    double vector[3];
    ces_cross(d, &q[1], vector);
    const double p[4] = {
        w * q[0] - ces_dot(d, &q[1]),
        w * q[1] + d[0] * q[0] + vector[0],
        w * q[2] + d[1] * q[0] + vector[1],
        w * q[3] + d[2] * q[0] + vector[2],
    };
    const double inverse = 1.0 / sqrt(p[0] * p[0] + p[1] * p[1] + p[2] * p[2] + p[3] * p[3]);
    for (int k = 0; k < 4; k++) {
        q[k] = inverse * p[k];
    }
}

#endif
