/*
 * contact/cone_direct.c - semi-smooth Newton on the natural map, with dense elimination (P. Alart, A. Curnier, Comput. Methods
 * Appl. Mech. Eng. 92 (1991) 353; L. Qi, J. Sun, Math. Program. 58 (1993) 353).
 *
 *     F(gamma) = gamma - P(z),  z = gamma - rho (u + shift(u) n),  u = N gamma + q
 *     J = I - P'(z) + P'(z) rho S (N + eps/rho),  S = du^/du
 *
 * N may lack rank: eps makes J regular, and changes only the way, since F is what is driven to 0. Newton's steps arrive once
 * it is settled which contacts stick, slide and part, and go astray before: sweeps of apgs settle it, first a few, then
 * twice as many each time that the steps led nowhere with any eps.
 */
#include <math.h>
#include <string.h>

#include "../base/dense.h"
#include "../base/vec3.h"
#include "block.h"
#include "cone_gradient.h"

enum {
    VECTORS = 6,
    MOST_ROWS = 1200, /* 400 contacts: 23 MB, and about a second a step; beyond them apgd answers, and says so */
    SWEEPS = 30,      /* before the first steps */
    STEPS = 15,       /* of Newton without a better point, before another eps or the sweeps go on */
};

/* eps, of a scaled N whose eigenvalues reach some tens. The first leaves Newton's steps their speed. Where a body lies on more
 * points than bear it, steps along what N does not see throw contacts out of their state: the others hold these back. */
static const double REGULAR[] = {1e-9, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3};

/* A jam: bodies wedged between surfaces that draw them in have no answer. Impulses that balance each other then grow without
 * end, held back by the smallest eps alone, and the residual stays. (Those of a light body under heavy ones are larger than
 * what stops it by the ratio of the masses; with them the residual falls.) */
static const double ENDLESS = 1e7;  /* times the impulse that stops the fastest velocity at the contact */
static const double BALANCE = 2.0;  /* times the best residual: so much is left where they balance */
static const double PROGRESS = 0.3; /* times that of the sweeps, and more: it stays */

/* Doubles of the Jacobian, whose room the sweeps use too. */
static size_t jacobian_room(const ces_ConeProblem *problem)
{
    const size_t n = problem->rows, sweeps = ces_cone_apgs.scratch(problem);
    return n * n > sweeps ? n * n : sweeps;
}

static size_t scratch(const ces_ConeProblem *problem)
{
    const size_t n = problem->rows;
    return n > MOST_ROWS ? ces_cone_apgd.scratch(problem)
                         : n * n + jacobian_room(problem) + VECTORS * n + problem->block_count;
}

typedef struct State {
    double *n_matrix, *jacobian; /* (rows, rows) */
    double *u, *f, *step, *reduced, *best, *swept;
    double speed;          /* m/s, the fastest without impulses */
    double regular;        /* eps */
    double swept_residual; /* of swept, where the sweeps ended */
    bool jammed;
    double *place; /* (blocks) where an active block stands in the reduced system; negative: P' = 0 there */
} State;

/* N, column by column, out of the operator. */
static void form_matrix(const ces_ConeProblem *problem, State *s)
{
    const size_t n = problem->rows;
    problem->op.reset(problem->op.self);
    ces_cone_slips(problem, s->u);
    s->speed = 0.0; /* what a probe makes about, so that no digits are lost against q */
    for (size_t row = 0; row < n; row++) {
        s->speed = ces_max(s->speed, fabs(s->u[row]));
    }
    for (uint32_t j = 0; j < problem->block_count; j++) {
        const ces_ConeBlock *block = &problem->blocks[j];
        for (uint32_t k = 0; k < block->rows; k++) {
            double unit[CES_BLOCK_ROWS] = {0.0};
            unit[k] = s->speed * ces_block_step(problem, block);
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

/* F of all rows. */
static void natural_map(const ces_ConeProblem *problem, State *s)
{
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        argument(problem, block, problem->impulse + block->first, s->u + block->first, s->f + block->first);
        ces_block_project(problem, block, s->f + block->first);
        for (uint32_t k = block->first; k < block->first + block->rows; k++) {
            s->f[k] = problem->impulse[k] - s->f[k];
        }
    }
}

/* P'(z) of rows between bounds. */
static bool bounds_slope(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *z,
                         double slope[CES_BLOCK_ROWS][CES_BLOCK_ROWS])
{
    bool any = false;
    for (uint32_t k = 0; k < block->rows; k++) {
        const uint32_t row = block->first + k;
        slope[k][k] = z[k] > problem->least[row] && z[k] < problem->most[row] ? 1.0 : 0.0;
        any = any || slope[k][k] > 0.0;
    }
    return any;
}

/* The rows of a disc in P'(z), once row 0, that of the normal force, is there. */
static void disc_slope(const ces_Disc *disc, uint32_t rows, double normal, const double *z,
                       double slope[CES_BLOCK_ROWS][CES_BLOCK_ROWS])
{
    const double length = ces_disc_length(disc, z), limit = disc->limit;
    const uint32_t end = disc->first + disc->rows;
    const bool cut = length > limit * normal;
    for (uint32_t i = disc->first; i < end; i++) {
        if (!cut) {
            slope[i][i] += 1.0;
            continue;
        }
        for (uint32_t k = 0; k < rows; k++) {
            slope[i][k] = limit * slope[0][k] * z[i] / length;
        }
        for (uint32_t k = disc->first; k < end; k++) {
            slope[i][k] += limit * normal / length * ((i == k ? 1.0 : 0.0) - z[i] * z[k] / (length * length));
        }
    }
}

/* P'(z), (rows, rows); false where it is 0 altogether. */
static bool projection_slope(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *z,
                             double slope[CES_BLOCK_ROWS][CES_BLOCK_ROWS])
{
    memset(slope, 0, sizeof(double[CES_BLOCK_ROWS][CES_BLOCK_ROWS]));
    if (block->kind == CES_JOINT_BLOCK) {
        return bounds_slope(problem, block, z, slope);
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
        disc_slope(&discs[d], block->rows, p[0], z, slope);
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
                    s->reduced[at + r] += sum * s->f[other->first + c]; /* there the step is -F */
                }
            }
        }
        for (uint32_t c = 0; c < block->rows; c++) {
            line[at + c] += (r == c ? 1.0 : 0.0) - slope[r][c] + s->regular / rho * left[r][c];
        }
    }
}

/* J step = -F, reduced to the blocks where P' is not 0; elsewhere the step is -F. */
static void newton(const ces_ConeProblem *problem, State *s)
{
    size_t count = 0;
    double z[CES_BLOCK_ROWS], slope[CES_BLOCK_ROWS][CES_BLOCK_ROWS];
    natural_map(problem, s);
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        argument(problem, block, problem->impulse + block->first, s->u + block->first, z);
        const bool active = projection_slope(problem, block, z, slope);
        s->place[i] = active ? (double)count : -1.0;
        for (uint32_t k = 0; k < block->rows && active; k++) {
            s->reduced[count + k] = -s->f[block->first + k];
        }
        count += active ? block->rows : 0;
    }
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        if (s->place[i] >= 0.0) {
            argument(problem, block, problem->impulse + block->first, s->u + block->first, z);
            projection_slope(problem, block, z, slope);
            assemble(problem, s, i, count, slope);
        }
    }
    ces_dense_solve(s->jacobian, count, s->reduced);
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        for (uint32_t k = 0; k < block->rows; k++) {
            s->step[block->first + k] =
                s->place[i] >= 0.0 ? s->reduced[(size_t)s->place[i] + k] : -s->f[block->first + k];
        }
    }
}

static bool is_endless(const ces_ConeProblem *problem, const State *s)
{
    for (uint32_t i = 0; i < problem->block_count; i++) {
        const ces_ConeBlock *block = &problem->blocks[i];
        if (fabs(problem->impulse[block->first]) > ENDLESS * s->speed * ces_block_step(problem, block)) {
            return true;
        }
    }
    return false;
}

/* Full steps from problem->impulse, which is then the best point met, in its sets but for its residual: the sweeps put it into
 * them, and measure again. How many steps there were; residual: of the best point. */
static uint32_t finish(const ces_ConeProblem *problem, State *s, double *residual, uint32_t most)
{
    uint32_t steps = 0, idle = 0;
    ces_rows_copy(problem, problem->impulse, s->best);
    ces_rows_slip(problem, problem->impulse, s->u);
    while (steps < most && idle<STEPS && * residual> problem->tolerance && !s->jammed) {
        steps++;
        idle++;
        newton(problem, s);
        for (uint32_t row = 0; row < problem->rows; row++) {
            problem->impulse[row] += s->step[row];
        }
        ces_rows_slip(problem, problem->impulse, s->u);
        const double now = ces_rows_residual(problem, problem->impulse, s->u);
        s->jammed = now > PROGRESS * s->swept_residual && now < BALANCE * *residual && is_endless(problem, s);
        if (now < *residual) {
            *residual = now;
            idle = 0;
            ces_rows_copy(problem, problem->impulse, s->best);
        }
    }
    ces_rows_copy(problem, s->best, problem->impulse);
    return steps;
}

static ces_ConeReport solve(const ces_ConeProblem *problem)
{
    const size_t n = problem->rows;
    if (n > MOST_ROWS) {
        return ces_cone_apgd.solve(problem);
    }
    double *free = problem->scratch;
    State s = {.n_matrix = ces_take(&free, n * n),
               .u = ces_take(&free, n),
               .f = ces_take(&free, n),
               .step = ces_take(&free, n),
               .reduced = ces_take(&free, n),
               .best = ces_take(&free, n),
               .swept = ces_take(&free, n),
               .place = ces_take(&free, problem->block_count),
               .jacobian = ces_take(&free, jacobian_room(problem))};
    ces_ConeProblem sweeps = *problem;
    sweeps.scratch = s.jacobian;
    uint32_t done = 0;
    for (uint32_t chunk = SWEEPS;; chunk *= 2) {
        const uint32_t left = problem->max_iterations - done;
        sweeps.max_iterations = chunk < left ? chunk : left;
        ces_ConeReport report = ces_cone_apgs.solve(&sweeps);
        report.iterations = done += report.iterations;
        report.name = ces_cone_direct.name;
        if (report.converged || done >= problem->max_iterations || !isfinite(report.residual)) {
            return report;
        }
        if (chunk == SWEEPS) {
            form_matrix(problem, &s);
        }
        s.swept_residual = report.residual;
        ces_rows_copy(problem, problem->impulse, s.swept);
        for (size_t k = 0; k < sizeof REGULAR / sizeof REGULAR[0] && !s.jammed; k++) {
            s.regular = REGULAR[k];
            done += finish(problem, &s, &report.residual, problem->max_iterations - done);
        }
        if (s.jammed) {
            ces_rows_copy(problem, s.swept, problem->impulse);
            return ces_cone_report(problem, ces_cone_direct.name, done);
        }
    }
}

const ces_ConeSolver ces_cone_direct = {
    .name = "direct",
    .doc = "semi-smooth Newton with dense elimination after sweeps, up to 400 contacts (apgd beyond)",
    .scratch = scratch,
    .solve = solve,
};
