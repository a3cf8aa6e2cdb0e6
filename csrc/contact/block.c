/*
 * contact/block.c - the exact solution of one block: A gamma + c = u with A = N_ii and c = u - A gamma as it stands.
 *
 * A contact takes off (gamma = 0), sticks (u = 0) or slides on the border of its cone. Sliding by `coulomb` means u_N = 0 and
 * u_T = -alpha gamma_T with alpha >= 0, one unknown. All other cases are left to Newton, which needs a few rounds from the
 * impulse of the last sweep; where it does not settle, the normal impulse N is the unknown: for each N the moments on their
 * discs are a convex problem, and the normal row a scalar equation. That always ends, at ten times the price or more.
 */
#include "block.h"

#include <math.h>
#include <string.h>

#include "../base/dense.h"
#include "../base/vec3.h"

enum {
    ROOT_ROUNDS = 80, /* bisection alone would need about so many */
    DISC_ROUNDS = 50,
    NEWTON_ROUNDS = 12,
};

static const double ROUNDING = 2.3e-16;
static const double STILL = 1e-9; /* of the impulse: a step of Newton this short leaves about its square */

/* ---- sliding by coulomb --------------------------------------------------------------------------------------------------- */

/* Eigenvalues and vectors of [[a, b], [b, d]]: (x, y) belongs to value[0], (-y, x) to value[1]. */
typedef struct Eigen {
    double value[2], x, y;
} Eigen;

static Eigen eigen_of(double a, double b, double d)
{
    const double floor = ROUNDING * (fabs(a) + fabs(d));
    if (b == 0.0) {
        return (Eigen){.value = {ces_max(a, floor), ces_max(d, floor)}, .x = 1.0, .y = 0.0};
    }
    const double half = 0.5 * (a - d);
    const double root = sqrt(half * half + b * b);
    const double t = half >= 0.0 ? b / (half + root) : b / (half - root); /* tangent of the smaller angle */
    const double x = 1.0 / sqrt(1.0 + t * t);
    return (Eigen){.value = {ces_max(a + t * b, floor), ces_max(d - t * b, floor)}, .x = x, .y = t * x};
}

/* The contact without its normal row: gamma_T(alpha) = -(S + alpha)^-1 b and N(alpha) = -(c_N + a gamma_T)/A_NN, with
 * S = A_TT - a a'/A_NN and b = c_T - a c_N/A_NN, in the axes of S. */
typedef struct Slide {
    Eigen s;
    double a[2], b[2], a_nn, c_n, mu;
    double tangent[2], push; /* at the last alpha */
} Slide;

/* mu N/|gamma_T| - 1, which rises through 0 where the contact slides, and its derivative. */
static double slide_at(Slide *slide, double alpha, double *derivative)
{
    double change[2];
    for (int k = 0; k < 2; k++) {
        const double inverse = 1.0 / (slide->s.value[k] + alpha);
        slide->tangent[k] = -slide->b[k] * inverse;
        change[k] = -slide->tangent[k] * inverse;
    }
    const double length = sqrt(slide->tangent[0] * slide->tangent[0] + slide->tangent[1] * slide->tangent[1]);
    slide->push = -(slide->c_n + slide->a[0] * slide->tangent[0] + slide->a[1] * slide->tangent[1]) / slide->a_nn;
    const double push_change = -(slide->a[0] * change[0] + slide->a[1] * change[1]) / slide->a_nn;
    const double length_change = (slide->tangent[0] * change[0] + slide->tangent[1] * change[1]) / length;
    const double ratio = slide->mu * slide->push / length;
    *derivative = slide->mu * push_change / length - ratio * length_change / length;
    return ratio - 1.0;
}

/* Sticks or slides; c_N < 0. */
static void solve_coulomb(const double a[9], const double c[3], double mu, double solved[3])
{
    const double coupling[2] = {0.5 * (a[1] + a[3]), 0.5 * (a[2] + a[6])};
    const double b[2] = {c[1] - coupling[0] * c[0] / a[0], c[2] - coupling[1] * c[0] / a[0]};
    const Eigen s =
        eigen_of(a[4] - coupling[0] * coupling[0] / a[0], 0.5 * (a[5] + a[7]) - coupling[0] * coupling[1] / a[0],
                 a[8] - coupling[1] * coupling[1] / a[0]);
    Slide slide = {
        .s = s,
        .a = {s.x * coupling[0] + s.y * coupling[1], -s.y * coupling[0] + s.x * coupling[1]},
        .b = {s.x * b[0] + s.y * b[1], -s.y * b[0] + s.x * b[1]},
        .a_nn = a[0],
        .c_n = c[0],
        .mu = mu,
    };
    const double length_b = sqrt(b[0] * b[0] + b[1] * b[1]);
    if (length_b == 0.0 || mu == 0.0) {
        solved[0] = -c[0] / a[0];
        solved[1] = solved[2] = 0.0;
        return;
    }
    double derivative, value = slide_at(&slide, 0.0, &derivative);
    if (value < 0.0) {
        /* Beyond `high` the tangential impulse is too short to leave the cone. */
        const double length_a = sqrt(coupling[0] * coupling[0] + coupling[1] * coupling[1]);
        double low = 0.0, high = length_b * (a[0] + mu * length_a) / (mu * -c[0]), alpha = 0.0;
        for (int round = 0; round < ROOT_ROUNDS && value != 0.0 && high - low > ROUNDING * high; round++) {
            double next = alpha - value / derivative;
            if (!(next > low && next < high)) {
                next = low + 0.5 * (high - low);
            }
            if (next == alpha) {
                break;
            }
            alpha = next;
            value = slide_at(&slide, alpha, &derivative);
            *(value < 0.0 ? &low : &high) = alpha;
        }
    }
    solved[0] = slide.push;
    solved[1] = s.x * slide.tangent[0] - s.y * slide.tangent[1];
    solved[2] = s.y * slide.tangent[0] + s.x * slide.tangent[1];
}

/* ---- the moments on their discs, for a given normal impulse --------------------------------------------------------------- */

/* The least of x A x/2 + c x over a disc or an interval of this radius. */
static void disc_minimum(const double *a, uint32_t stride, uint32_t rows, const double c[2], double radius, double x[2])
{
    if (rows == 1) {
        x[0] = a[0] > 0.0 ? ces_min(ces_max(-c[0] / a[0], -radius), radius) : 0.0;
        return;
    }
    const Eigen s = eigen_of(a[0], 0.5 * (a[1] + a[stride]), a[stride + 1]);
    const double b[2] = {s.x * c[0] + s.y * c[1], -s.y * c[0] + s.x * c[1]};
    double y[2] = {-b[0] / s.value[0], -b[1] / s.value[1]}, alpha = 0.0;
    /* |y| = radius: Newton on 1/|y(alpha)|, which is concave, climbs without overshoot. */
    for (int round = 0; round < ROOT_ROUNDS; round++) {
        const double square = y[0] * y[0] + y[1] * y[1], length = sqrt(square);
        if (length <= radius * (1.0 + 2.0 * ROUNDING)) {
            break;
        }
        if (radius <= 0.0) {
            y[0] = y[1] = 0.0;
            break;
        }
        const double fall = y[0] * y[0] / (s.value[0] + alpha) + y[1] * y[1] / (s.value[1] + alpha);
        const double next = alpha + square / fall * (length - radius) / radius;
        if (!(next > alpha)) {
            break;
        }
        alpha = next;
        y[0] = -b[0] / (s.value[0] + alpha);
        y[1] = -b[1] / (s.value[1] + alpha);
    }
    x[0] = s.x * y[0] - s.y * y[1];
    x[1] = s.y * y[0] + s.x * y[1];
}

typedef struct Moments {
    const double *a, *c;
    uint32_t rows;
    ces_Disc discs[CES_BLOCK_DISCS];
    size_t disc_count;
    bool convex; /* the law is ccp */
} Moments;

static double row_of(const Moments *m, uint32_t row, const double *gamma)
{
    double sum = m->c[row];
    for (uint32_t k = 0; k < m->rows; k++) {
        sum += m->a[row * m->rows + k] * gamma[k];
    }
    return sum;
}

/* Solves the discs by turns for gamma[0] held; gives what the normal row then lacks: u_N, less friction |u_T| by ccp. */
static double moments_at(const Moments *m, double push, double *gamma)
{
    gamma[0] = push;
    for (int round = 0; round < DISC_ROUNDS; round++) {
        double change = 0.0, size = 0.0;
        for (size_t d = 0; d < m->disc_count; d++) {
            const ces_Disc *disc = &m->discs[d];
            const double *block = m->a + disc->first * (m->rows + 1);
            double c[2] = {0.0, 0.0}, x[2] = {0.0, 0.0};
            for (uint32_t k = 0; k < disc->rows; k++) {
                c[k] = row_of(m, disc->first + k, gamma);
                for (uint32_t j = 0; j < disc->rows; j++) {
                    c[k] -= block[k * m->rows + j] * gamma[disc->first + j];
                }
            }
            disc_minimum(block, m->rows, disc->rows, c, disc->limit * push, x);
            for (uint32_t k = 0; k < disc->rows; k++) {
                change = ces_max(change, fabs(x[k] - gamma[disc->first + k]));
                size = ces_max(size, fabs(x[k]));
                gamma[disc->first + k] = x[k];
            }
        }
        if (m->disc_count == 1 || change <= 2.0 * ROUNDING * size) {
            break;
        }
    }
    double lack = row_of(m, 0, gamma);
    if (m->convex) {
        const double slip[3] = {0.0, row_of(m, 1, gamma), row_of(m, 2, gamma)};
        lack -= m->discs[0].limit * ces_disc_length(&m->discs[0], slip);
    }
    return lack;
}

/* The root of the normal row in N, of which `lack` is left without an impulse, by false position (Illinois), bisection
 * where that creeps. */
static void solve_by_push(const Moments *m, double lack, double *gamma)
{
    double low = 0.0, at_low = lack;
    memset(gamma, 0, m->rows * sizeof *gamma);
    double high = -at_low / m->a[0], at_high = moments_at(m, high, gamma);
    for (int round = 0; round < ROOT_ROUNDS && at_high < 0.0; round++) {
        low = high;
        at_low = at_high;
        high *= 2.0;
        at_high = moments_at(m, high, gamma);
    }
    int side = 0;
    for (int round = 0; round < ROOT_ROUNDS && at_high > 0.0 && high - low > 2.0 * ROUNDING * high; round++) {
        double push = (low * at_high - high * at_low) / (at_high - at_low);
        if (!(push > low && push < high) || round % 8 == 7) {
            push = low + 0.5 * (high - low);
        }
        const double value = moments_at(m, push, gamma);
        if (fabs(value) <= ROUNDING * m->a[0] * push) {
            return;
        }
        if (value < 0.0) {
            low = push;
            at_low = value;
            at_high *= side < 0 ? 0.5 : 1.0;
            side = -1;
        } else {
            high = push;
            at_high = value;
            at_low *= side > 0 ? 0.5 : 1.0;
            side = 1;
        }
    }
    if (gamma[0] != high) {
        moments_at(m, high, gamma);
    }
}

/* ---- all rows at once ------------------------------------------------------------------------------------------------------- */

/* About the largest of the rows' own inverse masses. */
static double row_size(const Moments *m, uint32_t first, uint32_t rows)
{
    double size = 0.0;
    for (uint32_t k = first; k < first + rows; k++) {
        size = ces_max(size, m->a[k * (m->rows + 1)]);
    }
    return size;
}

/* The rows of one disc, gamma_d = its projection of v = gamma_d - rho u_d on the disc of radius L N, as a linear system in
 * the change of gamma. */
static void linearise_disc(const Moments *m, const ces_Disc *disc, const double *gamma, const double *u, double *system,
                           double *rest)
{
    const bool convex = m->convex && disc == m->discs;
    const double rho = 1.0 / row_size(m, disc->first, disc->rows), radius = disc->limit * gamma[0];
    double v[2] = {0.0, 0.0};
    for (uint32_t k = 0; k < disc->rows; k++) {
        v[k] = gamma[disc->first + k] - rho * u[disc->first + k];
    }
    const double length = sqrt(v[0] * v[0] + v[1] * v[1]), inverse = length > 0.0 ? 1.0 / length : 0.0;
    for (uint32_t k = 0; k < disc->rows; k++) {
        double *line = system + (size_t)(disc->first + k) * m->rows;
        if (length < radius) { /* u_d = 0 */
            for (uint32_t j = 0; j < m->rows; j++) {
                line[j] = rho * m->a[(disc->first + k) * m->rows + j];
            }
            rest[disc->first + k] = -rho * u[disc->first + k];
            continue;
        }
        const double along = v[k] * inverse;
        for (uint32_t j = 0; j < m->rows; j++) { /* -L N/|v| (1 - v v'/v^2) dv, dv = dgamma - rho A dgamma */
            double turn = 0.0;
            for (uint32_t i = 0; i < disc->rows; i++) {
                const double change = (j == disc->first + i) - rho * m->a[(disc->first + i) * m->rows + j];
                turn += ((i == k) - along * v[i] * inverse) * change;
            }
            line[j] = (j == disc->first + k) - radius * inverse * turn;
        }
        if (convex) { /* the normal row is u_N + L v/|v| u_T, less what vanishes with the answer */
            for (uint32_t j = 0; j < m->rows; j++) {
                system[j] += disc->limit * along * m->a[(disc->first + k) * m->rows + j] / m->a[0];
            }
            rest[0] -= disc->limit * along * u[disc->first + k] / m->a[0];
        }
        line[0] -= disc->limit * along;
        rest[disc->first + k] = radius * along - gamma[disc->first + k];
    }
}

/* Newton on all rows (Alart & Curnier, Comput. Methods Appl. Mech. Eng. 92 (1991) 353), from the impulse that stands and
 * pushes: a few rounds where the sets of discs that stick settle; false where they do not. */
static bool solve_by_newton(const Moments *m, double *gamma)
{
    for (int round = 0; round < NEWTON_ROUNDS; round++) {
        double system[CES_BLOCK_ROWS * CES_BLOCK_ROWS], rest[CES_BLOCK_ROWS], u[CES_BLOCK_ROWS];
        for (uint32_t k = 0; k < m->rows; k++) {
            u[k] = row_of(m, k, gamma);
        }
        for (uint32_t k = 0; k < m->rows; k++) {
            system[k] = m->a[k] / m->a[0];
        }
        rest[0] = -u[0] / m->a[0];
        for (size_t d = 0; d < m->disc_count; d++) {
            linearise_disc(m, &m->discs[d], gamma, u, system, rest);
        }
        ces_dense_solve(system, m->rows, rest);
        bool still = fabs(rest[0]) <= STILL * gamma[0];
        for (size_t d = 0; d < m->disc_count; d++) {
            still = still && ces_disc_length(&m->discs[d], rest) <= STILL * m->discs[d].limit * gamma[0];
        }
        for (uint32_t k = 0; k < m->rows; k++) {
            gamma[k] += rest[k];
        }
        if (!(gamma[0] > 0.0)) {
            return false;
        }
        if (still) {
            return true;
        }
    }
    return false;
}

/* ---- the kinds -------------------------------------------------------------------------------------------------------------- */

/* Spheres and blocks that do not turn: A = diag(w_N, w_T, w_T), and both laws have a closed form. */
static void solve_diagonal(const ces_ConeProblem *problem, double mu, const double a[9], const double c[3],
                           double solved[3])
{
    double push = -c[0] / a[0];
    solved[1] = -c[1] / a[4];
    solved[2] = -c[2] / a[4];
    const double length = sqrt(solved[1] * solved[1] + solved[2] * solved[2]);
    if (problem->law == CES_CCP && length > mu * push) {
        const double stiffness = a[4] / a[0];
        push = (push + stiffness * mu * length) / (1.0 + stiffness * mu * mu);
    }
    solved[0] = ces_max(push, 0.0);
    const ces_Disc disc = {.first = 1, .rows = 2, .limit = mu};
    ces_disc_cut(&disc, mu * solved[0], solved);
}

static bool is_diagonal(const double a[9])
{
    return a[1] == 0.0 && a[2] == 0.0 && a[5] == 0.0 && a[3] == 0.0 && a[6] == 0.0 && a[7] == 0.0 && a[4] == a[8];
}

static void solve_cone(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *a, const double *c,
                       const double *gamma, double *solved)
{
    if (block->rows == 3 && is_diagonal(a)) {
        solve_diagonal(problem, block->friction, a, c, solved);
        return;
    }
    memset(solved, 0, block->rows * sizeof *solved);
    const bool convex = problem->law == CES_CCP;
    const double lack = c[0] - (convex ? block->friction * sqrt(c[1] * c[1] + c[2] * c[2]) : 0.0);
    if (lack >= 0.0) {
        return; /* takes off */
    }
    if (!convex && block->rows == 3) {
        solve_coulomb(a, c, block->friction, solved);
    } else {
        Moments m = {.a = a, .c = c, .rows = block->rows, .convex = convex};
        m.disc_count = ces_block_discs(block, m.discs);
        const bool all[CES_BLOCK_ROWS] = {true, true, true, true, true, true};
        double stuck[CES_BLOCK_ROWS], back[CES_BLOCK_ROWS];
        bool sticks = ces_solve_free(a, block->rows, all, c, back);
        for (uint32_t k = 0; k < block->rows; k++) {
            stuck[k] = -back[k];
        }
        for (size_t d = 0; d < m.disc_count && sticks; d++) {
            sticks = ces_disc_length(&m.discs[d], stuck) <= m.discs[d].limit * stuck[0];
        }
        if (sticks) {
            memcpy(solved, stuck, block->rows * sizeof *solved);
            return;
        }
        if (gamma[0] > 0.0) {
            memcpy(solved, gamma, block->rows * sizeof *solved);
        } else {
            solved[0] = -lack / a[0];
        }
        if (!solve_by_newton(&m, solved)) {
            solve_by_push(&m, lack, solved);
        }
    }
    ces_Disc discs[CES_BLOCK_DISCS];
    const size_t count = ces_block_discs(block, discs);
    solved[0] = ces_max(solved[0], 0.0);
    for (size_t d = 0; d < count; d++) {
        ces_disc_cut(&discs[d], discs[d].limit * solved[0], solved);
    }
}

void ces_block_solve(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *gamma, const double *u,
                     double *solved)
{
    const double *a = problem->diagonal + block->diagonal;
    if (block->kind == CES_JOINT_BLOCK) {
        ces_joint_solve(problem, block, gamma, u, solved);
        return;
    }
    double c[CES_BLOCK_ROWS];
    for (uint32_t i = 0; i < block->rows; i++) {
        c[i] = u[i];
        for (uint32_t k = 0; k < block->rows; k++) {
            c[i] -= a[i * block->rows + k] * gamma[k];
        }
    }
    solve_cone(problem, block, a, c, gamma, solved);
}
