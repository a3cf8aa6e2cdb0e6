#include "rigid.h"

#include <math.h>
#include <string.h>

#include "block.h"
#include "rigid_parts.h"

enum { DRIVE_ROUNDS = 20 };

/* ---- building -------------------------------------------------------------------------------------------------------- */

/* Two tangents from the normal alone, without a singular direction (Duff et al., J. Comput. Graph. Tech. 6 (2017) 1). */
static void set_frame(const double n[3], double frame[3][3])
{
    const double sign = copysign(1.0, n[2]);
    const double a = -1.0 / (sign + n[2]);
    const double b = n[0] * n[1] * a;
    ces_copy(n, frame[0]);
    frame[1][0] = 1.0 + sign * n[0] * n[0] * a;
    frame[1][1] = sign * b;
    frame[1][2] = -sign * n[0];
    frame[2][0] = b;
    frame[2][1] = sign + n[1] * n[1] * a;
    frame[2][2] = -n[1];
}

static void start_again(ces_RigidBody *body)
{
    ces_copy(body->free_v, body->v);
    ces_copy(body->free_w, body->w);
}

static void fill_body(const ces_RigidInput *input, uint32_t row, ces_RigidBody *body)
{
    const ces_Particles *particles = input->particles;
    const double *spin = input->free_spin != NULL ? input->free_spin : particles->angular_velocity;
    ces_copy(&input->free_velocity[3 * (size_t)row], body->free_v);
    ces_copy(&spin[3 * (size_t)row], body->free_w);
    ces_copy(body->free_v, body->v);
    ces_copy(body->free_w, body->w);
    body->inverse_mass = 1.0 / particles->mass[row];
    memset(body->inverse_inertia, 0, sizeof body->inverse_inertia);
    if (input->rotation) {
        ces_inverse_inertia(&input->shapes[particles->shape[row]], particles->mass[row], particles->diameter[row],
                            &particles->orientation[4 * (size_t)row], body->inverse_inertia);
    }
}

/* What the body does to the velocity of its matter at the end of an arm when it is pushed there. */
static void respond(const ces_RigidBody *body, const double arm[3], const double impulse[3], const double moment[3],
                    double dv[3], double dw[3])
{
    double turn[3];
    ces_cross(arm, impulse, turn);
    for (int k = 0; k < 3; k++) {
        turn[k] += moment[k];
        dv[k] = body->inverse_mass * impulse[k];
    }
    for (int k = 0; k < 3; k++) {
        dw[k] = ces_dot(&body->inverse_inertia[3 * k], turn);
    }
}

/* The same of any body; a part does what its joints let it. */
static void respond_at(const ces_Rigid *rigid, uint32_t index, const double arm[3], const double impulse[3],
                       const double moment[3], double dv[3], double dw[3])
{
    if (index < rigid->input.rows) {
        respond(&rigid->bodies[index], arm, impulse, moment, dv, dw);
        return;
    }
    double both[6], twist[6];
    ces_gather_push(arm, impulse, moment, both);
    ces_part_respond(rigid, index - (uint32_t)rigid->input.rows, both, twist);
    ces_copy(&twist[0], dv);
    ces_copy(&twist[3], dw);
}

/* World impulse and moment of a row's impulses. */
static void to_world(const ces_RigidRow *row, const double *gamma, double impulse[3], double moment[3])
{
    for (int k = 0; k < 3; k++) {
        impulse[k] = gamma[0] * row->frame[0][k] + gamma[1] * row->frame[1][k] + gamma[2] * row->frame[2][k];
        moment[k] = 0.0;
        if (row->rows == 6) {
            moment[k] =
                row->radius * (gamma[3] * row->frame[0][k] + gamma[4] * row->frame[1][k] + gamma[5] * row->frame[2][k]);
        }
    }
}

static void add_motion(const ces_RigidRow *row, double sign, const double v[3], const double w[3], const double arm[3],
                       double *u)
{
    double turn[3];
    ces_cross(w, arm, turn);
    for (int k = 0; k < 3; k++) {
        u[k] += sign * (ces_dot(row->frame[k], v) + ces_dot(row->frame[k], turn));
    }
    if (row->rows == 6) {
        for (int k = 0; k < 3; k++) {
            u[3 + k] += sign * row->radius * ces_dot(row->frame[k], w);
        }
    }
}

static void fill_diagonal(const ces_Rigid *rigid, const ces_RigidRow *row, double *diagonal)
{
    const uint32_t n = row->rows;
    if (row->drive != NULL) {
        diagonal[0] = row->drive->diagonal;
        return;
    }
    for (uint32_t column = 0; column < n; column++) {
        double unit[6] = {0.0}, answer[6] = {0.0}, impulse[3], moment[3], dv[3], dw[3];
        unit[column] = 1.0;
        to_world(row, unit, impulse, moment);
        respond(&rigid->bodies[row->a], row->arm_a, impulse, moment, dv, dw);
        add_motion(row, 1.0, dv, dw, row->arm_a, answer);
        if (row->b != CES_NO_BODY) {
            respond_at(rigid, row->b, row->arm_b, impulse, moment, dv, dw);
            add_motion(row, 1.0, dv, dw, row->arm_b, answer);
        }
        for (uint32_t k = 0; k < n; k++) {
            diagonal[n * k + column] = answer[k];
        }
    }
    for (uint32_t k = 0; k < n; k++) { /* symmetric to the last bit, for those who factorise it */
        for (uint32_t column = 0; column < k; column++) {
            diagonal[n * k + column] = diagonal[n * column + k];
        }
    }
}

static void fill_row(const ces_Contact *contact, uint32_t index, bool is_pair, bool has_moments, ces_RigidRow *row)
{
    *row = (ces_RigidRow){
        .a = contact->a,
        .b = is_pair ? contact->b : CES_NO_BODY,
        .contact = index,
        .radius = contact->rolling_radius,
        .rows = has_moments ? 6 : 3,
    };
    set_frame(contact->normal, row->frame);
    ces_copy(contact->arm_a, row->arm_a);
    ces_copy(contact->arm_b, row->arm_b);
    row->offset[0] = contact->bias;
    for (int k = 0; k < 3; k++) {
        row->offset[k] -= ces_dot(row->frame[k], contact->surface);
    }
    /* A rolling velocity is R w x n, the row's is R w along the tangents: t1 x n = -t2, t2 x n = t1. */
    row->offset[3] = -contact->surface_spin;
    row->offset[4] = ces_dot(row->frame[2], contact->surface_roll);
    row->offset[5] = -ces_dot(row->frame[1], contact->surface_roll);
}

static void fill_impulse(const ces_Contact *contact, const ces_RigidRow *row, double *impulse)
{
    for (int k = 0; k < 3; k++) {
        impulse[k] = ces_dot(row->frame[k], contact->impulse);
    }
    if (row->rows == 6) {
        impulse[3] = contact->spin_impulse;
        impulse[4] = -ces_dot(row->frame[2], contact->roll_impulse);
        impulse[5] = ces_dot(row->frame[1], contact->roll_impulse);
    }
}

static void add_contact(ces_Rigid *rigid, ces_RigidIsland *island, uint32_t index, bool is_pair)
{
    const ces_RigidInput *input = &rigid->input;
    const ces_Contact *contact = &input->contacts->list[index];
    const bool has_moments = input->rotation && (contact->rolling > 0.0 || contact->spinning > 0.0);
    ces_RigidRow *row = &rigid->list[rigid->block_count];
    fill_row(contact, index, is_pair, has_moments, row);
    if (contact->carrier != CES_NO_PART) {
        row->b = (uint32_t)input->rows + contact->carrier;
    }
    fill_body(input, row->a, &rigid->bodies[row->a]);
    if (is_pair) {
        fill_body(input, row->b, &rigid->bodies[row->b]);
    }
    fill_impulse(contact, row, &rigid->impulse[rigid->row_count]);
    rigid->blocks[rigid->block_count] = (ces_ConeBlock){
        .kind = has_moments ? CES_ROLLING_BLOCK : CES_CONTACT_BLOCK,
        .rows = row->rows,
        .first = island->row_count,
        .diagonal = rigid->diagonal_count - island->first_diagonal,
        .friction = contact->friction,
        .spinning = has_moments ? contact->spinning : 0.0,
        .rolling = has_moments ? contact->rolling : 0.0,
    };
    island->block_count++;
    island->row_count += row->rows;
    rigid->block_count++;
    rigid->row_count += row->rows;
    rigid->diagonal_count += (size_t)row->rows * row->rows;
}

static void add_assembly(ces_Rigid *rigid, ces_RigidIsland *island, const ces_Assembly *assembly)
{
    const ces_Mechanism *mechanism = rigid->input.mechanism;
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        const uint32_t part = assembly->parts[slot];
        ces_RigidBody *body = &rigid->bodies[rigid->input.rows + part];
        ces_copy(mechanism->free[part].velocity, body->free_v);
        ces_copy(mechanism->free[part].spin, body->free_w);
        start_again(body);
    }
    for (uint32_t d = assembly->first_drive; d < assembly->first_drive + assembly->drive_count; d++) {
        ces_Drive *drive = &mechanism->drives[d];
        if (drive->diagonal == 0.0) {
            continue;
        }
        rigid->list[rigid->block_count] = (ces_RigidRow){.a = CES_NO_BODY, .b = CES_NO_BODY, .drive = drive, .rows = 1};
        rigid->impulse[rigid->row_count] = drive->impulse;
        rigid->least[rigid->row_count] = drive->least;
        rigid->most[rigid->row_count] = drive->most;
        rigid->blocks[rigid->block_count] = (ces_ConeBlock){
            .kind = CES_JOINT_BLOCK,
            .rows = 1,
            .first = island->row_count,
            .diagonal = rigid->diagonal_count - island->first_diagonal,
        };
        island->block_count++;
        island->row_count++;
        rigid->block_count++;
        rigid->row_count++;
        rigid->diagonal_count++;
    }
}

static ces_ConeProblem problem_of(const ces_Rigid *rigid, const ces_RigidIsland *island)
{
    return (ces_ConeProblem){
        .blocks = &rigid->blocks[island->first_block],
        .block_count = island->block_count,
        .rows = island->row_count,
        .diagonal = &rigid->diagonal[island->first_diagonal],
        .least = &rigid->least[island->first_row],
        .most = &rigid->most[island->first_row],
        .law = rigid->input.law,
        .tolerance = rigid->input.tolerance,
        .max_iterations =
            (island->block_count <= CES_SMALL_ISLAND ? CES_SMALL_FACTOR : 1) * rigid->input.max_iterations,
        .impulse = &rigid->impulse[island->first_row],
    };
}

bool ces_rigid_build(ces_Rigid *rigid, const ces_RigidInput *input)
{
    const ces_Islands *islands = input->islands;
    size_t most = input->mechanism->drive_count;
    for (size_t i = 0; i < islands->count; i++) {
        const ces_Island *island = &islands->list[i];
        if (!island->packed) {
            most += island->pair_last - island->pair_first + island->surface_last - island->surface_first;
        }
    }
    rigid->input = *input;
    rigid->block_count = rigid->row_count = rigid->diagonal_count = rigid->scratch_count = 0;
    if (!ces_pool_reserve(&rigid->island_pool, islands->count, sizeof(ces_RigidIsland)) ||
        !ces_pool_reserve(&rigid->body_pool, input->rows + input->mechanism->part_count, sizeof(ces_RigidBody)) ||
        !ces_pool_reserve(&rigid->list_pool, most, sizeof(ces_RigidRow)) ||
        !ces_pool_reserve(&rigid->block_pool, most, sizeof(ces_ConeBlock)) ||
        !ces_pool_reserve(&rigid->diagonal_pool, most, CES_BLOCK_ROWS * CES_BLOCK_ROWS * sizeof(double)) ||
        !ces_pool_reserve(&rigid->impulse_pool, most, CES_BLOCK_ROWS * sizeof(double)) ||
        !ces_pool_reserve(&rigid->bound_pool, most, 2 * CES_BLOCK_ROWS * sizeof(double))) {
        return false;
    }
    rigid->islands = rigid->island_pool.data;
    rigid->bodies = rigid->body_pool.data;
    rigid->list = rigid->list_pool.data;
    rigid->blocks = rigid->block_pool.data;
    rigid->diagonal = rigid->diagonal_pool.data;
    rigid->impulse = rigid->impulse_pool.data;
    rigid->least = rigid->bound_pool.data;
    rigid->most = rigid->least + CES_BLOCK_ROWS * most;
    for (size_t i = 0; i < islands->count; i++) {
        const ces_Island *island = &islands->list[i];
        ces_RigidIsland *own = &rigid->islands[i];
        *own = (ces_RigidIsland){.first_block = (uint32_t)rigid->block_count,
                                 .first_row = (uint32_t)rigid->row_count,
                                 .first_diagonal = rigid->diagonal_count};
        if (island->packed) {
            continue;
        }
        for (uint32_t k = island->pair_first; k < island->pair_last; k++) {
            add_contact(rigid, own, islands->pair_order[k], true);
        }
        for (uint32_t k = island->surface_first; k < island->surface_last; k++) {
            add_contact(rigid, own, islands->surface_order[k], false);
        }
        for (uint32_t k = island->assembly_first; k < island->assembly_last; k++) {
            add_assembly(rigid, own, &input->mechanism->assemblies[islands->assembly_order[k]]);
        }
        const ces_ConeProblem problem = problem_of(rigid, own);
        own->first_scratch = rigid->scratch_count;
        rigid->scratch_count += input->solver->scratch(&problem);
    }
    double *diagonal = rigid->diagonal;
    for (size_t k = 0; k < rigid->block_count; k++) {
        fill_diagonal(rigid, &rigid->list[k], diagonal);
        diagonal += rigid->list[k].rows * rigid->list[k].rows;
    }
    if (!ces_pool_reserve(&rigid->scratch_pool, rigid->scratch_count, sizeof(double))) {
        return false;
    }
    rigid->scratch = rigid->scratch_pool.data;
    return true;
}

/* ---- the operator ------------------------------------------------------------------------------------------------------ */

/* One island: its rows, under the block numbers that its solver uses. */
typedef struct View {
    const ces_Rigid *rigid;
    const ces_Island *island;
    const ces_RigidRow *list;
    uint32_t count;
} View;

static void reset(void *self)
{
    const View *view = self;
    const ces_Rigid *rigid = view->rigid;
    const ces_Mechanism *mechanism = rigid->input.mechanism;
    for (uint32_t k = 0; k < view->count; k++) {
        const ces_RigidRow *row = &view->list[k];
        if (row->drive == NULL) {
            start_again(&rigid->bodies[row->a]);
            if (row->b < rigid->input.rows) {
                start_again(&rigid->bodies[row->b]);
            }
        }
    }
    for (uint32_t k = view->island->assembly_first; k < view->island->assembly_last; k++) {
        const ces_Assembly *assembly = &mechanism->assemblies[rigid->input.islands->assembly_order[k]];
        for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
            start_again(&rigid->bodies[rigid->input.rows + assembly->parts[slot]]);
        }
    }
}

static void push(void *self, uint32_t block, const double *change)
{
    const View *view = self;
    const ces_Rigid *rigid = view->rigid;
    const ces_RigidRow *row = &view->list[block];
    double impulse[3], moment[3], dv[3], dw[3];
    if (row->drive != NULL) {
        ces_push_drive(rigid, row->drive, change[0]);
        return;
    }
    to_world(row, change, impulse, moment);
    ces_RigidBody *a = &rigid->bodies[row->a];
    respond(a, row->arm_a, impulse, moment, dv, dw);
    ces_add_scaled(a->v, 1.0, dv);
    ces_add_scaled(a->w, 1.0, dw);
    if (row->b < rigid->input.rows) {
        ces_RigidBody *b = &rigid->bodies[row->b];
        respond(b, row->arm_b, impulse, moment, dv, dw);
        ces_add_scaled(b->v, -1.0, dv);
        ces_add_scaled(b->w, -1.0, dw);
    } else if (row->b != CES_NO_BODY) {
        double both[6];
        ces_gather_push(row->arm_b, impulse, moment, both);
        ces_push_part(rigid, row->b - (uint32_t)rigid->input.rows, -1.0, both);
    }
}

static void slip(const void *self, uint32_t block, double *u)
{
    const View *view = self;
    const ces_Rigid *rigid = view->rigid;
    const ces_RigidRow *row = &view->list[block];
    if (row->drive != NULL) {
        u[0] = ces_slip_drive(rigid, row->drive);
        return;
    }
    memcpy(u, row->offset, row->rows * sizeof *u);
    const ces_RigidBody *a = &rigid->bodies[row->a];
    add_motion(row, 1.0, a->v, a->w, row->arm_a, u);
    if (row->b != CES_NO_BODY) {
        const ces_RigidBody *b = &rigid->bodies[row->b];
        add_motion(row, -1.0, b->v, b->w, row->arm_b, u);
    }
}

static ces_ConeProblem stated(ces_Rigid *rigid, size_t index, View *view)
{
    const ces_RigidIsland *island = &rigid->islands[index];
    *view = (View){rigid, &rigid->input.islands->list[index], &rigid->list[island->first_block], island->block_count};
    ces_ConeProblem problem = problem_of(rigid, island);
    problem.op = (ces_Operator){view, reset, push, slip};
    problem.scratch = &rigid->scratch[island->first_scratch];
    return problem;
}

/* A drum is heavy: what its motor misses within the tolerance would be a torque above that of the grains. So the drives have
 * the last word, and what that does to the contacts is measured. */
static ces_ConeReport settle_drives(const ces_ConeProblem *problem, const View *view, double tolerance,
                                    ces_ConeReport report)
{
    for (uint32_t round = 0; round < DRIVE_ROUNDS; round++) {
        bool moved = false;
        for (uint32_t i = 0; i < view->count; i++) {
            if (view->list[i].drive == NULL) {
                continue;
            }
            double u, *gamma = &problem->impulse[problem->blocks[i].first], change[CES_BLOCK_ROWS];
            slip(view, i, &u);
            ces_block_solve(problem, &problem->blocks[i], gamma, &u, change);
            change[0] -= gamma[0];
            gamma[0] += change[0];
            moved = moved || change[0] != 0.0;
            problem->op.push(problem->op.self, i, change);
        }
        if (!moved) {
            break;
        }
    }
    report.residual = ces_cone_residual(problem);
    report.converged = report.residual <= tolerance;
    return report;
}

ces_ConeReport ces_rigid_solve(ces_Rigid *rigid, size_t index)
{
    View view;
    ces_ConeProblem problem = stated(rigid, index, &view);
    if (view.count == 0) { /* an assembly whose drives are held in this pose */
        return (ces_ConeReport){.converged = true, .name = rigid->input.solver->name};
    }
    const bool driven = view.list[view.count - 1].drive != NULL;
    if (!driven) {
        return rigid->input.solver->solve(&problem);
    }
    problem.tolerance *= 0.5;
    return settle_drives(&problem, &view, rigid->input.tolerance, rigid->input.solver->solve(&problem));
}

double ces_rigid_objective(ces_Rigid *rigid, size_t index)
{
    View view;
    const ces_ConeProblem problem = stated(rigid, index, &view);
    return ces_cone_objective(&problem);
}

/* ---- results ------------------------------------------------------------------------------------------------------------ */

static void write_body(const ces_Rigid *rigid, uint32_t index, ces_Body *bodies)
{
    const double radius = 0.5 * rigid->input.particles->diameter[index];
    const ces_RigidBody *body = &rigid->bodies[index];
    for (int k = 0; k < 3; k++) {
        bodies[index].v[k] = body->v[k];
        bodies[index].s[k] = radius * body->w[k];
    }
}

void ces_rigid_finish(const ces_Rigid *rigid, ces_Contacts *contacts, ces_Body *bodies)
{
    const double *gamma = rigid->impulse;
    for (size_t k = 0; k < rigid->block_count; k++) {
        const ces_RigidRow *row = &rigid->list[k];
        if (row->drive != NULL) {
            row->drive->impulse = *gamma++;
            continue;
        }
        ces_Contact *contact = &contacts->list[row->contact];
        double moment[3];
        to_world(row, gamma, contact->impulse, moment);
        for (int axis = 0; axis < 3; axis++) {
            contact->roll_impulse[axis] =
                row->rows == 6 ? gamma[5] * row->frame[1][axis] - gamma[4] * row->frame[2][axis] : 0.0;
        }
        contact->spin_impulse = row->rows == 6 ? gamma[3] : 0.0;
        write_body(rigid, row->a, bodies);
        if (row->b < rigid->input.rows) {
            write_body(rigid, row->b, bodies);
        }
        gamma += row->rows;
    }
}

void ces_rigid_free(ces_Rigid *rigid)
{
    ces_Pool *const pools[] = {&rigid->body_pool,    &rigid->list_pool,    &rigid->block_pool,  &rigid->diagonal_pool,
                               &rigid->impulse_pool, &rigid->scratch_pool, &rigid->island_pool, &rigid->bound_pool};
    for (size_t k = 0; k < sizeof pools / sizeof pools[0]; k++) {
        ces_pool_free(pools[k]);
    }
}
