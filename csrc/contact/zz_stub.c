#include "cone_solver.h"
#include "../base/vec3.h"
#include <string.h>
static double norm2(const double *t)
{
    return sqrt(t[0] * t[0] + t[1] * t[1]);
}
void ces_block_project(const ces_ConeProblem *pr, const ces_ConeBlock *b, double *p)
{
    (void)pr;
    double n = p[0], l = norm2(p + 1), mu = b->friction;
    if (l <= mu * n)
        return;
    if (mu * l <= -n) {
        memset(p, 0, 24);
        return;
    }
    double q = (n + mu * l) / (1 + mu * mu);
    double f = l > 0 ? mu * q / l : 0;
    p[0] = q;
    p[1] *= f;
    p[2] *= f;
}
static size_t scr(const ces_ConeProblem *p)
{
    (void)p;
    return 0;
}
static ces_ConeReport solve(const ces_ConeProblem *p)
{
    ces_ConeReport r = {0, 0, false, "stub"};
    p->op.reset(p->op.self);
    for (uint32_t i = 0; i < p->block_count; i++)
        p->op.push(p->op.self, i, &p->impulse[p->blocks[i].first]);
    for (r.iterations = 0; r.iterations < 5000; r.iterations++) {
        double worst = 0;
        for (uint32_t i = 0; i < p->block_count; i++) {
            const ces_ConeBlock *b = &p->blocks[i];
            double u[6], c[6], d[6];
            double *g = &p->impulse[b->first];
            p->op.slip(p->op.self, i, u);
            const double *D = &p->diagonal[b->diagonal];
            double rho = b->rows / (D[0] + D[b->rows + 1] + D[2 * b->rows + 2]);
            u[0] += b->friction * norm2(u + 1);
            for (uint32_t k = 0; k < b->rows; k++)
                c[k] = k < 3 ? g[k] - rho * u[k] : 0;
            ces_block_project(p, b, c);
            for (uint32_t k = 0; k < b->rows; k++) {
                d[k] = c[k] - g[k];
                g[k] = c[k];
                worst = ces_max(worst, fabs(d[k]) / rho);
            }
            p->op.push(p->op.self, i, d);
        }
        r.residual = worst;
        if (worst <= p->tolerance) {
            r.converged = true;
            break;
        }
    }
    return r;
}
static const ces_ConeSolver row = {"stub", "", scr, solve};
const ces_ConeSolver *ces_cone_solver_find(const char *n)
{
    (void)n;
    return &row;
}
