/*
 * contact/solver_pgs.c - projected Gauss-Seidel: one exact one-contact solve after the other, in a fixed order.
 *
 * For spheres the local block of N is diagonal, w_N = 1/m_a + 1/m_b and w_T = (1 + spin_mobility) w_N, so the one-contact
 * problem has a closed form in both laws: gamma_N from the normal row, gamma_T on a disc (coulomb), or the projection on the
 * cone in the metric of the block (ccp: Anitescu & Tasora, Comput. Optim. Appl. 47 (2010) 207). Rolling friction adds a
 * second disc, coupled to the tangential row: the pair is solved exactly where neither slips, else by turns.
 */
#include "solver_pgs.h"

#include "cone.h"

/* One contact with its bodies, taken out of its pack; body b is NULL for a surface. */
typedef struct Visit {
    ces_Body *a, *b;
    double n[3], p[3], k[3];
    double slip[3], roll[3]; /* m/s, contact velocity u and rolling velocity, as the bodies move now */
    double bias, mu, limit;  /* limit: of the rolling disc, 0 without rolling friction */
    double ratio_a, ratio_b;
    double w_n, w_t, w_r, coupling; /* 1/kg: mobilities, and of the tangential by the rolling row */
    bool exact;                     /* the visit solved its contact in closed form, not by turns */
} Visit;

static void take(const ces_Problem *problem, const ces_Pack *pack, size_t lane, bool is_pair, Visit *visit)
{
    for (int k = 0; k < 3; k++) {
        visit->n[k] = pack->n[k][lane];
        visit->p[k] = pack->p[k][lane];
    }
    visit->bias = pack->bias[lane];
    visit->mu = pack->mu[lane];
    visit->a = &problem->bodies[pack->a[lane]];
    visit->b = is_pair ? &problem->bodies[pack->b[lane]] : NULL;
    visit->w_n = visit->a->inverse_mass + (is_pair ? visit->b->inverse_mass : 0.0);
    visit->w_t = (1.0 + problem->spin_mobility) * visit->w_n;
}

static void take_slip(Visit *visit, const ces_SurfacePack *motion, size_t lane)
{
    double spin[3];
    ces_copy(visit->a->v, visit->slip);
    ces_copy(visit->a->s, spin);
    if (visit->b != NULL) {
        ces_add_scaled(visit->slip, -1.0, visit->b->v);
        ces_add_scaled(spin, 1.0, visit->b->s);
    } else {
        for (int k = 0; k < 3; k++) {
            visit->slip[k] -= motion->velocity[k][lane];
        }
    }
    double turn[3];
    ces_cross(spin, visit->n, turn);
    ces_add_scaled(visit->slip, -1.0, turn);
}

static void take_roll(const ces_Problem *problem, const ces_RollPack *pack, size_t lane, Visit *visit)
{
    const double c = problem->spin_mobility;
    const double ra = visit->ratio_a = pack->ratio_a[lane];
    const double rb = visit->ratio_b = pack->ratio_b[lane];
    const double wa = visit->a->inverse_mass;
    const double wb = visit->b != NULL ? visit->b->inverse_mass : 0.0;
    visit->w_r = c * (ra * ra * wa + rb * rb * wb);
    visit->coupling = c * (ra * wa - rb * wb);
    visit->limit = visit->w_r > 0.0 ? pack->limit[lane] : 0.0;
    double spin[3];
    for (int k = 0; k < 3; k++) {
        visit->k[k] = pack->k[k][lane];
        spin[k] = ra * visit->a->s[k] - (visit->b != NULL ? rb * visit->b->s[k] : 0.0);
    }
    ces_cross(spin, visit->n, visit->roll);
    for (int k = 0; k < 3; k++) {
        visit->roll[k] -= pack->velocity[k][lane];
    }
}

/* Splits a vector into its normal component (returned) and its tangential part. */
static double split(const double n[3], const double v[3], double tangent[3])
{
    const double normal = ces_dot(n, v);
    for (int k = 0; k < 3; k++) {
        tangent[k] = v[k] - normal * n[k];
    }
    return normal;
}

/* Normal impulse and tangential impulse of the one-contact problem, without rolling friction. */
static double solve_contact(const Visit *visit, ces_ContactLaw law, double tangent[3])
{
    double slip[3];
    const double slip_n = split(visit->n, visit->slip, slip) + visit->bias;
    double push = split(visit->n, visit->p, tangent) - slip_n / visit->w_n; /* z_N */
    ces_add_scaled(tangent, -1.0 / visit->w_t, slip);                       /* z_T */
    if (law == CES_CCP) {
        /* Projection in the metric diag(w_N, w_T, w_T). */
        const double stiffness = visit->w_t / visit->w_n;
        const double length = ces_norm(tangent);
        if (length > visit->mu * push) {
            push = (push + stiffness * visit->mu * length) / (1.0 + stiffness * visit->mu * visit->mu);
        }
    }
    push = ces_max(push, 0.0);
    ces_project_disc(tangent, visit->mu * push);
    return push;
}

/* Tangential impulse and rolling impulse on their discs, for a given normal impulse; both rows see the other's change.
 * True where the answer is exact. */
static bool solve_rolling(const Visit *visit, double push, double tangent[3], double k[3])
{
    double slip[3], start[3];
    split(visit->n, visit->slip, slip);
    split(visit->n, visit->p, start);
    const double friction = visit->mu * push, rolling = visit->limit * push;

    /* Neither slips: [w_T, -x; -x, w_R] [dt; dk] = -[slip; roll]. */
    const double inverse = 1.0 / (visit->w_t * visit->w_r - visit->coupling * visit->coupling);
    double t_stick[3], k_stick[3];
    for (int i = 0; i < 3; i++) {
        t_stick[i] = start[i] - inverse * (visit->w_r * slip[i] + visit->coupling * visit->roll[i]);
        k_stick[i] = visit->k[i] - inverse * (visit->coupling * slip[i] + visit->w_t * visit->roll[i]);
    }
    if (ces_dot(t_stick, t_stick) <= friction * friction && ces_dot(k_stick, k_stick) <= rolling * rolling) {
        ces_copy(t_stick, tangent);
        ces_copy(k_stick, k);
        return true;
    }
    enum { TURNS = 4 }; /* the sweeps go on from here */
    const double inverse_t = 1.0 / visit->w_t, inverse_r = 1.0 / visit->w_r;
    ces_copy(start, tangent);
    ces_copy(visit->k, k);
    for (int turn = 0; turn < TURNS; turn++) {
        for (int i = 0; i < 3; i++) {
            k[i] = visit->k[i] - inverse_r * (visit->roll[i] - visit->coupling * (tangent[i] - start[i]));
        }
        ces_project_disc(k, rolling);
        for (int i = 0; i < 3; i++) {
            tangent[i] = start[i] - inverse_t * (slip[i] - visit->coupling * (k[i] - visit->k[i]));
        }
        ces_project_disc(tangent, friction);
    }
    return false;
}

static void turn_body(ces_Body *body, double spin_mobility, double sign, double ratio, const Visit *visit,
                      const double dp[3], const double dk[3])
{
    double turn[3], roll[3];
    ces_cross(visit->n, dp, turn);
    ces_add_scaled(body->v, sign * body->inverse_mass, dp);
    ces_add_scaled(body->s, -spin_mobility * body->inverse_mass, turn);
    if (visit->limit > 0.0) {
        ces_cross(visit->n, dk, roll);
        ces_add_scaled(body->s, sign * ratio * spin_mobility * body->inverse_mass, roll);
    }
}

/* Solves the contact and moves its bodies; gives the largest change of velocity that its impulses make, m/s. */
static double act(const ces_Problem *problem, Visit *visit)
{
    double tangent[3], k[3] = {0.0, 0.0, 0.0}, dp[3], dk[3] = {0.0, 0.0, 0.0};
    const double push = solve_contact(visit, problem->law, tangent);
    visit->exact = visit->limit == 0.0 || solve_rolling(visit, push, tangent, k);
    for (int i = 0; i < 3; i++) {
        const double p = push * visit->n[i] + tangent[i];
        dp[i] = p - visit->p[i];
        dk[i] = visit->limit > 0.0 ? k[i] - visit->k[i] : 0.0;
        visit->p[i] = p;
        visit->k[i] = k[i];
    }
    const double change = ces_max(visit->w_t * ces_norm(dp), visit->limit > 0.0 ? visit->w_r * ces_norm(dk) : 0.0);
    if (change > 0.0) {
        turn_body(visit->a, problem->spin_mobility, 1.0, visit->ratio_a, visit, dp, dk);
        if (visit->b != NULL) {
            turn_body(visit->b, problem->spin_mobility, -1.0, visit->ratio_b, visit, dp, dk);
        }
    }
    return change;
}

/* Residual of one contact (docs/numerics.md 2): |gamma - P(gamma - rho u^)|/rho with rho = 3/tr N_ii, and the same of
 * its rolling row. */
static double residual_of(const ces_Problem *problem, const Visit *visit)
{
    const double rho = 3.0 / (visit->w_n + 2.0 * visit->w_t);
    double tangent[3], moved[3], difference[3];
    const double slip_n = split(visit->n, visit->slip, tangent) + visit->bias;
    const double lift = problem->law == CES_COULOMB ? visit->mu * ces_norm(tangent) : 0.0; /* De Saxce's term */
    for (int k = 0; k < 3; k++) {
        moved[k] = visit->p[k] - rho * (tangent[k] + (slip_n + lift) * visit->n[k]);
    }
    ces_project_cone(visit->n, visit->mu, moved);
    ces_subtract(visit->p, moved, difference);
    double residual = ces_norm(difference) / rho;
    if (visit->limit > 0.0) {
        for (int k = 0; k < 3; k++) {
            moved[k] = visit->k[k] - visit->roll[k] / visit->w_r;
        }
        ces_project_disc(moved, visit->limit * ces_max(0.0, ces_dot(visit->n, visit->p)));
        ces_subtract(visit->k, moved, difference);
        residual = ces_max(residual, visit->w_r * ces_norm(difference));
    }
    return residual;
}

typedef double Action(const ces_Problem *problem, Visit *visit);

/* A contact alone in its island that was solved in closed form is solved: no sweep changes it any more. */
static double act_alone(const ces_Problem *problem, Visit *visit)
{
    const double change = act(problem, visit);
    return visit->exact ? 0.0 : change;
}

static double measure(const ces_Problem *problem, Visit *visit)
{
    return residual_of(problem, visit);
}

/* Goes through one list of an island; gives the largest answer of the action. Inlined for each action and kind of contact:
 * the compiler then drops what a kind does not have. */
static inline __attribute__((always_inline)) double go_through(const ces_Problem *problem, ces_Pack *packs,
                                                               ces_RollPack *rolls, uint32_t first, uint32_t last,
                                                               bool is_pair, Action *action)
{
    double largest = 0.0;
    for (uint32_t index = first; index < last; index++) {
        const size_t pack = index / CES_LANES, lane = index % CES_LANES;
        Visit visit = {.limit = 0.0};
        take(problem, &packs[pack], lane, is_pair, &visit);
        take_slip(&visit, is_pair ? NULL : &problem->surface_motion[pack], lane);
        if (rolls != NULL) {
            take_roll(problem, &rolls[pack], lane, &visit);
        }
        largest = ces_max(largest, action(problem, &visit));
        for (int k = 0; k < 3; k++) {
            packs[pack].p[k][lane] = visit.p[k];
            if (rolls != NULL) {
                rolls[pack].k[k][lane] = visit.k[k];
            }
        }
    }
    return largest;
}

static inline __attribute__((always_inline)) double sweep(const ces_Problem *problem, const ces_Island *island,
                                                          Action *action)
{
    const double pairs =
        go_through(problem, problem->pairs, problem->pair_roll, island->pair_first, island->pair_last, true, action);
    const double surfaces = go_through(problem, problem->surfaces, problem->surface_roll, island->surface_first,
                                       island->surface_last, false, action);
    return ces_max(pairs, surfaces);
}

static double sweep_once(const ces_Problem *problem, const ces_Island *island)
{
    return sweep(problem, island, act);
}

static double residual_now(const ces_Problem *problem, const ces_Island *island)
{
    return sweep(problem, island, measure);
}

static double visit_once(const ces_Problem *problem, const ces_Island *island)
{
    return sweep(problem, island, act_alone);
}

ces_SolverReport ces_solve_packed(ces_Problem *problem, const ces_Island *island)
{
    ces_SolverReport report = {0, 0.0, false, false};
    const uint32_t contacts = island->pair_last - island->pair_first + island->surface_last - island->surface_first;
    const uint32_t limit =
        contacts <= CES_SMALL_ISLAND ? CES_SMALL_FACTOR * problem->max_iterations : problem->max_iterations;
    while (report.iterations < limit) {
        const double change = contacts == 1 ? visit_once(problem, island) : sweep_once(problem, island);
        report.iterations++;
        if (contacts == 1 && change == 0.0) {
            report.residual = 0.0;
            report.converged = report.exact = true;
            break;
        }
        /* The residual costs a sweep: it is asked for only when the sweeps have almost come to rest. */
        if (change <= problem->tolerance || contacts == 1 || report.iterations == limit) {
            report.residual = residual_now(problem, island);
            report.converged = report.residual <= problem->tolerance;
            if (report.converged) {
                break;
            }
        }
    }
    return report;
}
