/*
 * contact/cone_direct.c - semi-smooth Newton on the natural map, with dense elimination (P. Alart, A. Curnier, Comput. Methods
 * Appl. Mech. Eng. 92 (1991) 353; L. Qi, J. Sun, Math. Program. 58 (1993) 353).
 *
 *     F(gamma) = gamma - P(z),  z = gamma - rho (u + shift(u) n),  u = N gamma + q
 *     J = I - P'(z) + P'(z) rho S (N + eps/rho),  S = du^/du
 *
 * N may lack rank: eps makes J regular, and changes only the way, since F is what is driven to 0. Sweeps bring the start, and
 * take over where the line search finds no way down.
 */
#include <math.h>
#include <string.h>

#include "../base/dense.h"
#include "../base/vec3.h"
#include "block.h"
#include "cone_gradient.h"

enum {
    VECTORS = 6,
    MOST_ROWS = 1200, /* 400 contacts: 23 MB, and a second a step; beyond them apgd answers, and says so */
    SWEEPS = 30,
    HALVINGS = 6,
};

static const double REGULAR = 1e-9; /* eps */

static size_t scratch(const ces_ConeProblem *problem)
{
    const size_t n = problem->rows;
    if (n > MOST_ROWS) {
        return ces_cone_apgd.scratch(problem);
    }
    const size_t own = VECTORS * n + 2 * n * n + problem->block_count, sweeps = ces_cone_apgs.scratch(problem);
    return own > sweeps ? own : sweeps;
}

typedef struct State {
    double *n_matrix, *jacobian; /* (rows, rows) */
    double *u, *f, *step, *trial, *best, *residuals;
    double *place; /* (blocks) where an active block stands in the reduced system; negative: P' = 0 there */
    double best_residual;
} State;

/* N, column by column, out of the operator. */
static void form_matrix(const ces_ConeProblem *problem, State *s)
{
    const size_t n = problem->rows;
    problem->op.reset(problem->op.self);
    ces_cone_slips(problem, s->u);
    for (uint32_t j = 0; j < problem->block_count; j++) {
        const ces_ConeBlock *block = &problem->blocks[j];
        for (uint32_t k = 0; k < block->rows; k++) {
            double unit[CES_BLOCK_ROWS] = {0.0};
            unit[k] = ces_block_step(problem, block); /* about what makes 1 m/s: no digits are lost against q */
            problem->op.reset(problem->op.self);
            problem->op.push(problem->op.self, j, unit);
            ces_cone_slips(problem, s->step);
            for (size_t row = 0; row < n; row++) {
                s->n_matrix[row * n + block->first + k] = (s->step[row] - s->u[row]) / unit[k];
            }
        }
    }
}

/* z of one block. */
static void argument(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *gamma, const double *u,
                     double *z)
{
    const double rho = ces_block_step(problem, block);
    for (uint32_t k = 0; k < block->rows; k++) {
        z[k] = gamma[k] - rho * u[k];
    }
    z[0] -= rho * ces_block_shift(problem, block, u);
}

/* F of all rows, and the sum of |F_i|^2/rho_i, J. */
static double natural_map(const ces_ConeProblem *problem, const double *gamma, const double *u, double *f)
{
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        argument(problem, block, gamma + block->first, u + block->first, f + block->first);
        ces_block_project(problem, block, f + block->first);
        for (uint32_t k = block->first; k < block->first + block->rows; k++) {
            f[k] = gamma[k] - f[k];
        }
    }
    double sum = 0.0;
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        double part = 0.0;
        for (uint32_t k = block->first; k < block->first + block->rows; k++) {
            part += f[k] * f[k];
        }
        sum += part / ces_block_step(problem, block);
    }
    return sum;
}

/* P'(z), (rows, rows); false where it is 0 altogether. */
static bool projection_slope(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *z,
                             double slope[CES_BLOCK_ROWS][CES_BLOCK_ROWS])
{
    memset(slope, 0, sizeof(double[CES_BLOCK_ROWS][CES_BLOCK_ROWS]));
    if (block->kind == CES_JOINT_BLOCK) {
        bool any = false;
        for (uint32_t k = 0; k < block->rows; k++) {
            const uint32_t row = block->first + k;
            slope[k][k] = z[k] > problem->least[row] && z[k] < problem->most[row] ? 1.0 : 0.0;
            any = any || slope[k][k] > 0.0;
        }
        return any;
    }
    double p[CES_BLOCK_ROWS], push[CES_BLOCK_ROWS] = {1.0}, bottom = 1.0; /* push: dN/dz */
    memcpy(p, z, block->rows * sizeof *p);
    ces_block_project(problem, block, p);
    if (p[0] <= 0.0) {
        return false;
    }
    ces_Disc discs[CES_BLOCK_DISCS];
    const size_t count = ces_block_discs(block, discs);
    for (size_t d = 0; d < count; d++) {
        const double length = ces_disc_length(&discs[d], z), limit = discs[d].limit;
        const bool cut = length > limit * p[0];
        bottom += cut ? limit * limit : 0.0;
        for (uint32_t k = discs[d].first; k < discs[d].first + discs[d].rows; k++) {
            push[k] = cut ? limit * z[k] / length : 0.0;
        }
    }
    for (uint32_t k = 0; k < block->rows; k++) {
        slope[0][k] = push[k] / bottom;
    }
    for (size_t d = 0; d < count; d++) {
        const double length = ces_disc_length(&discs[d], z), limit = discs[d].limit;
        const bool cut = length > limit * p[0];
        for (uint32_t i = discs[d].first; i < discs[d].first + discs[d].rows; i++) {
            for (uint32_t k = 0; cut && k < block->rows; k++) {
                slope[i][k] = limit * slope[0][k] * z[i] / length;
            }
            for (uint32_t k = discs[d].first; cut && k < discs[d].first + discs[d].rows; k++) {
                slope[i][k] += limit * p[0] / length * ((i == k ? 1.0 : 0.0) - z[i] * z[k] / (length * length));
            }
            slope[i][i] += cut ? 0.0 : 1.0;
        }
    }
    return true;
}

/* The row that De Saxce's shift adds to S: d shift/du. */
static void shift_slope(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *u, double *slope)
{
    memset(slope, 0, CES_BLOCK_ROWS * sizeof *slope);
    ces_Disc discs[CES_BLOCK_DISCS];
    const size_t count = ces_block_discs(block, discs);
    for (size_t d = problem->law == CES_CCP ? 1 : 0; d < count; d++) {
        const double length = ces_disc_length(&discs[d], u);
        for (uint32_t k = discs[d].first; length > 0.0 && k < discs[d].first + discs[d].rows; k++) {
            slope[k] = discs[d].limit * u[k] / length;
        }
    }
}

/* Rows of the reduced system for one active block. */
static void assemble(const ces_ConeProblem *problem, State *s, uint32_t i, size_t count,
                     double slope[CES_BLOCK_ROWS][CES_BLOCK_ROWS])
{
    const ces_ConeBlock *block = &problem->blocks[i];
    const size_t n = problem->rows, at = (size_t)s->place[i];
    const double rho = ces_block_step(problem, block);
    double shift[CES_BLOCK_ROWS], left[CES_BLOCK_ROWS][CES_BLOCK_ROWS]; /* left: rho P' S */
    shift_slope(problem, block, s->u + block->first, shift);
    for (uint32_t r = 0; r < block->rows; r++) {
        for (uint32_t k = 0; k < block->rows; k++) {
            left[r][k] = rho * (slope[r][k] + slope[r][0] * shift[k]);
        }
    }
    for (uint32_t r = 0; r < block->rows; r++) {
        double *line = s->jacobian + (at + r) * count;
        for (uint32_t j = 0; j < problem->block_count; j++) {
            const ces_ConeBlock *other = &problem->blocks[j];
            for (uint32_t c = 0; c < other->rows; c++) {
                double sum = 0.0;
                for (uint32_t k = 0; k < block->rows; k++) {
                    sum += left[r][k] * s->n_matrix[(block->first + k) * n + other->first + c];
                }
                if (s->place[j] >= 0.0) {
                    line[(size_t)s->place[j] + c] = sum;
                } else {
                    s->step[at + r] += sum * s->f[other->first + c]; /* there the step is -F */
                }
            }
        }
        for (uint32_t c = 0; c < block->rows; c++) {
            line[at + c] += (r == c ? 1.0 : 0.0) - slope[r][c] + REGULAR / rho * left[r][c];
        }
    }
}

/* The Newton step, into s->trial. */
static void newton(const ces_ConeProblem *problem, State *s, const double *gamma)
{
    size_t count = 0;
    double z[CES_BLOCK_ROWS], slope[CES_BLOCK_ROWS][CES_BLOCK_ROWS];
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        argument(problem, block, gamma + block->first, s->u + block->first, z);
        const bool active = projection_slope(problem, block, z, slope);
        s->place[i] = active ? (double)count : -1.0;
        for (uint32_t k = 0; k < block->rows && active; k++) {
            s->step[count + k] = -s->f[block->first + k];
        }
        count += active ? block->rows : 0;
    }
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        if (s->place[i] >= 0.0) {
            argument(problem, block, gamma + block->first, s->u + block->first, z);
            projection_slope(problem, block, z, slope);
            assemble(problem, s, i, count, slope);
        }
    }
    ces_dense_solve(s->jacobian, count, s->step);
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        for (uint32_t k = 0; k < block->rows; k++) {
            s->trial[block->first + k] =
                s->place[i] >= 0.0 ? s->step[(size_t)s->place[i] + k] : -s->f[block->first + k];
        }
    }
}
#include <stdio.h>
#include <stdlib.h>

static ces_ConeReport solve(const ces_ConeProblem *problem)
{
    const size_t n = problem->rows;
    if (n > MOST_ROWS) {
        return ces_cone_apgd.solve(problem);
    }
    double *free = problem->scratch;
    double *gamma = problem->impulse;
    ces_ConeProblem start = *problem;
    start.max_iterations = problem->max_iterations < SWEEPS ? problem->max_iterations : SWEEPS;
    ces_ConeReport report = ces_cone_apgs.solve(&start);
    report.name = ces_cone_direct.name;
    if (report.converged) {
        return report;
    }
    State s = {.n_matrix = ces_take(&free, n * n),
               .jacobian = ces_take(&free, n * n),
               .u = ces_take(&free, n),
               .f = ces_take(&free, n),
               .step = ces_take(&free, n),
               .trial = ces_take(&free, n),
               .best = ces_take(&free, n),
               .residuals = ces_take(&free, n),
               .place = ces_take(&free, problem->block_count)};
    form_matrix(problem, &s);
    ces_rows_slip(problem, gamma, s.u);
    s.best_residual = ces_rows_residual(problem, gamma, s.u);
    ces_rows_copy(problem, gamma, s.best);
    uint32_t k = report.iterations;
    while (k < problem->max_iterations && s.best_residual > problem->tolerance) {
        k++;
        const double merit = natural_map(problem, gamma, s.u, s.f);
        newton(problem, &s, gamma);
        ces_rows_copy(problem, gamma, s.step);
        bool down = false;
        for (int halving = 0; halving <= HALVINGS && !down; halving++) {
            const double share = ldexp(1.0, -halving);
            for (size_t row = 0; row < n; row++) {
                gamma[row] = s.step[row] + share * s.trial[row];
            }
            ces_rows_slip(problem, gamma, s.u);
            down = natural_map(problem, gamma, s.u, s.f) < (1.0 - 0.1 * share) * merit;
            if (getenv("VERB"))
                printf("%u h %d merit %.2e -> %.2e\n", k, halving, merit, natural_map(problem, gamma, s.u, s.f));
        }
        if (!down) { /* no way down */
            ces_rows_copy(problem, s.step, gamma);
            for (size_t i = 0; i < problem->block_count; i++) {
                ces_block_project(problem, &problem->blocks[i], gamma + problem->blocks[i].first);
            }
            ces_cone_load(problem, gamma);
            for (int sweep = 0; sweep < SWEEPS && k < problem->max_iterations; sweep++) {
                ces_cone_sweep(problem);
                k++;
            }
            ces_rows_slip(problem, gamma, s.u);
        }
        const double residual = ces_rows_residual(problem, gamma, s.u);
        if (residual < s.best_residual) {
            s.best_residual = residual;
            ces_rows_copy(problem, gamma, s.best);
        }
    }
    ces_rows_copy(problem, s.best, gamma);
    for (size_t i = 0; i < problem->block_count; i++) {
        ces_block_project(problem, &problem->blocks[i], gamma + problem->blocks[i].first);
    }
    return ces_cone_report(problem, ces_cone_direct.name, k);
}

const ces_ConeSolver ces_cone_direct = {
    .name = "direct",
    .doc = "semi-smooth Newton with dense elimination, up to 400 contacts (apgd beyond)",
    .scratch = scratch,
    .solve = solve,
};
