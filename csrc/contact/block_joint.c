/* contact/block_joint.c - the exact solution of a joint's block, whose rows may depend on each other and have bounds. */
#include <math.h>

#include "../base/vec3.h"
#include "block.h"

static const double RANK = 1e-13; /* of its diagonal: a pivot below it is none */

bool ces_solve_free(const double *a, uint32_t rows, const bool *free, const double *b, double *x)
{
    double l[CES_BLOCK_ROWS][CES_BLOCK_ROWS] = {{0.0}}, pivot[CES_BLOCK_ROWS] = {0.0};
    bool full = true;
    for (uint32_t i = 0; i < rows; i++) {
        x[i] = 0.0;
        if (!free[i]) {
            continue;
        }
        for (uint32_t j = 0; j <= i; j++) {
            double sum = a[i * rows + j];
            for (uint32_t k = 0; k < j; k++) {
                sum -= l[i][k] * l[j][k] * pivot[k];
            }
            if (j < i) {
                l[i][j] = pivot[j] > 0.0 ? sum / pivot[j] : 0.0;
            } else {
                pivot[i] = sum > RANK * a[i * rows + i] ? sum : 0.0;
            }
        }
        full = full && pivot[i] > 0.0;
        x[i] = b[i];
        for (uint32_t k = 0; k < i; k++) {
            x[i] -= l[i][k] * x[k];
        }
    }
    for (uint32_t i = rows; i-- > 0;) {
        x[i] = pivot[i] > 0.0 ? x[i] / pivot[i] : 0.0;
        for (uint32_t k = i + 1; k < rows; k++) {
            x[i] -= pivot[i] > 0.0 ? l[k][i] * x[k] : 0.0;
        }
    }
    return full;
}

/* u of the joint as its impulse goes from gamma to solved. */
static void joint_slip(const double *a, uint32_t rows, const double *gamma, const double *u, const double *solved,
                       double *now)
{
    for (uint32_t i = 0; i < rows; i++) {
        now[i] = u[i];
        for (uint32_t k = 0; k < rows; k++) {
            now[i] += a[i * rows + k] * (solved[k] - gamma[k]);
        }
    }
}

/* Primal active set: the rows that are not held at a bound are solved together, up to the first bound they meet; a held row
 * is let go when u pulls it off its bound. */
void ces_joint_solve(const ces_ConeProblem *problem, const ces_ConeBlock *block, const double *gamma, const double *u,
                     double *solved)
{
    const double *a = problem->diagonal + block->diagonal;
    const double *least = problem->least + block->first, *most = problem->most + block->first;
    const uint32_t rows = block->rows;
    bool free[CES_BLOCK_ROWS];
    for (uint32_t k = 0; k < rows; k++) {
        solved[k] = ces_min(ces_max(gamma[k], least[k]), most[k]);
        free[k] = true;
    }
    for (uint32_t round = 0; round < 8 * rows; round++) {
        double now[CES_BLOCK_ROWS], change[CES_BLOCK_ROWS], share = 1.0;
        uint32_t met = rows;
        joint_slip(a, rows, gamma, u, solved, now);
        ces_solve_free(a, rows, free, now, change);
        for (uint32_t k = 0; k < rows; k++) {
            const double room = change[k] > 0.0 ? solved[k] - least[k] : most[k] - solved[k];
            if (fabs(change[k]) * share > room) {
                share = room / fabs(change[k]);
                met = k;
            }
        }
        for (uint32_t k = 0; k < rows; k++) {
            solved[k] = ces_min(ces_max(solved[k] - share * change[k], least[k]), most[k]);
        }
        if (met < rows) {
            free[met] = false;
            continue;
        }
        bool freed = false;
        joint_slip(a, rows, gamma, u, solved, now);
        for (uint32_t k = 0; k < rows && !freed; k++) {
            freed = !free[k] && ((now[k] > 0.0 && solved[k] > least[k]) || (now[k] < 0.0 && solved[k] < most[k]));
            free[k] = free[k] || freed;
        }
        if (!freed) {
            break;
        }
    }
}
