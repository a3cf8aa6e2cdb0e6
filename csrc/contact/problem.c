#include "problem.h"

#include <math.h>

static size_t packs_for(size_t contacts)
{
    return (contacts + CES_LANES - 1) / CES_LANES;
}

static bool reserve(ces_Problem *problem, size_t rows, size_t pairs, size_t surfaces, bool rolling)
{
    if (!ces_pool_reserve(&problem->body_pool, rows, sizeof(ces_Body)) ||
        !ces_pool_reserve(&problem->pair_pool, packs_for(pairs), sizeof(ces_Pack)) ||
        !ces_pool_reserve(&problem->surface_pool, packs_for(surfaces), sizeof(ces_Pack)) ||
        !ces_pool_reserve(&problem->motion_pool, packs_for(surfaces), sizeof(ces_SurfacePack)) ||
        (rolling && (!ces_pool_reserve(&problem->pair_roll_pool, packs_for(pairs), sizeof(ces_RollPack)) ||
                     !ces_pool_reserve(&problem->surface_roll_pool, packs_for(surfaces), sizeof(ces_RollPack))))) {
        return false;
    }
    problem->bodies = problem->body_pool.data;
    problem->pairs = problem->pair_pool.data;
    problem->surfaces = problem->surface_pool.data;
    problem->surface_motion = problem->motion_pool.data;
    problem->pair_roll = rolling ? problem->pair_roll_pool.data : NULL;
    problem->surface_roll = rolling ? problem->surface_roll_pool.data : NULL;
    return true;
}

static void fill_body(ces_Problem *problem, const ces_Particles *particles, size_t row, const double *free_velocity)
{
    ces_Body *body = &problem->bodies[row];
    const double radius = 0.5 * particles->diameter[row];
    for (size_t k = 0; k < 3; k++) {
        body->v[k] = free_velocity[3 * row + k];
        body->s[k] = radius * particles->angular_velocity[3 * row + k];
    }
    body->inverse_mass = 1.0 / particles->mass[row];
    body->moved = -1.0;
}

static void fill_roll(ces_RollPack *pack, size_t lane, const ces_Contact *contact)
{
    for (int k = 0; k < 3; k++) {
        pack->k[k][lane] = contact->roll_impulse[k];
        pack->velocity[k][lane] = contact->surface_roll[k];
    }
    pack->limit[lane] = contact->rolling;
    pack->ratio_a[lane] = contact->ratio_a;
    pack->ratio_b[lane] = contact->ratio_b;
}

static void fill_pack(ces_Pack *pack, size_t lane, const ces_Contact *contact)
{
    for (int k = 0; k < 3; k++) {
        pack->n[k][lane] = contact->normal[k];
        pack->p[k][lane] = contact->impulse[k];
    }
    pack->bias[lane] = contact->bias;
    pack->mu[lane] = contact->friction;
    pack->a[lane] = contact->a;
    pack->b[lane] = contact->b;
}

/* The start impulses act on the bodies before the first sweep. */
static void push(const ces_Problem *problem, ces_Body *body, double sign, double ratio, const ces_Contact *contact)
{
    double turn[3], roll[3];
    ces_cross(contact->normal, contact->impulse, turn);
    ces_cross(contact->normal, contact->roll_impulse, roll);
    ces_add_scaled(body->v, sign * body->inverse_mass, contact->impulse);
    ces_add_scaled(body->s, -problem->spin_mobility * body->inverse_mass, turn);
    ces_add_scaled(body->s, sign * ratio * problem->spin_mobility * body->inverse_mass, roll);
}

static void fill_island(ces_Problem *problem, const ces_Contacts *contacts, const ces_Island *island, bool rolling)
{
    for (size_t k = island->pair_first; k < island->pair_last; k++) {
        const ces_Contact *contact = &contacts->list[problem->islands->pair_order[k]];
        fill_pack(&problem->pairs[k / CES_LANES], k % CES_LANES, contact);
        if (rolling) {
            fill_roll(&problem->pair_roll[k / CES_LANES], k % CES_LANES, contact);
        }
        push(problem, &problem->bodies[contact->a], 1.0, contact->ratio_a, contact);
        push(problem, &problem->bodies[contact->b], -1.0, contact->ratio_b, contact);
    }
    for (size_t k = island->surface_first; k < island->surface_last; k++) {
        const ces_Contact *contact = &contacts->list[problem->islands->surface_order[k]];
        fill_pack(&problem->surfaces[k / CES_LANES], k % CES_LANES, contact);
        for (int axis = 0; axis < 3; axis++) {
            problem->surface_motion[k / CES_LANES].velocity[axis][k % CES_LANES] = contact->surface[axis];
        }
        if (rolling) {
            fill_roll(&problem->surface_roll[k / CES_LANES], k % CES_LANES, contact);
        }
        push(problem, &problem->bodies[contact->a], 1.0, contact->ratio_a, contact);
    }
}

bool ces_problem_build(ces_Problem *problem, const ces_Contacts *contacts, const ces_Islands *islands,
                       const ces_Particles *particles, size_t rows, const double *free_velocity, bool rolling)
{
    const size_t surface_count = contacts->count - contacts->pair_count;
    problem->islands = islands;
    if (!reserve(problem, rows, contacts->pair_count, surface_count, rolling)) {
        return false;
    }
    for (size_t k = 0; k < contacts->count; k++) {
        fill_body(problem, particles, contacts->list[k].a, free_velocity);
        if (k < contacts->pair_count) {
            fill_body(problem, particles, contacts->list[k].b, free_velocity);
        }
    }
    for (size_t i = 0; i < islands->count; i++) {
        if (islands->list[i].packed) {
            fill_island(problem, contacts, &islands->list[i], rolling);
        }
    }
    return true;
}

/* A body keeps to its free path until the first contact that pushed it. */
static void mark(ces_Body *body, const ces_Contact *contact)
{
    const double fraction = contact->impact ? contact->fraction : 0.0;
    body->moved = body->moved < 0.0 ? fraction : ces_min(body->moved, fraction);
}

static void finish_part(ces_Contacts *contacts, const uint32_t *order, size_t first, size_t last, const ces_Pack *packs,
                        const ces_RollPack *rolls)
{
    for (size_t k = first; k < last; k++) {
        ces_Contact *contact = &contacts->list[order[k]];
        for (int axis = 0; axis < 3; axis++) {
            contact->impulse[axis] = packs[k / CES_LANES].p[axis][k % CES_LANES];
            contact->roll_impulse[axis] = rolls == NULL ? 0.0 : rolls[k / CES_LANES].k[axis][k % CES_LANES];
        }
    }
}

void ces_problem_finish(const ces_Problem *problem, ces_Contacts *contacts)
{
    const ces_Islands *islands = problem->islands;
    for (size_t i = 0; i < islands->count; i++) {
        const ces_Island *island = &islands->list[i];
        if (island->packed) {
            finish_part(contacts, islands->pair_order, island->pair_first, island->pair_last, problem->pairs,
                        problem->pair_roll);
            finish_part(contacts, islands->surface_order, island->surface_first, island->surface_last,
                        problem->surfaces, problem->surface_roll);
        }
    }
}

void ces_problem_mark(ces_Problem *problem, const ces_Contacts *contacts)
{
    for (size_t k = 0; k < contacts->count; k++) {
        const ces_Contact *contact = &contacts->list[k];
        if (ces_contact_push(contact) > 0.0) {
            mark(&problem->bodies[contact->a], contact);
            if (k < contacts->pair_count) {
                mark(&problem->bodies[contact->b], contact);
            }
        }
    }
}

void ces_problem_free(ces_Problem *problem)
{
    ces_Pool *const pools[] = {&problem->body_pool,   &problem->pair_pool,      &problem->surface_pool,
                               &problem->motion_pool, &problem->pair_roll_pool, &problem->surface_roll_pool};
    for (size_t k = 0; k < sizeof pools / sizeof pools[0]; k++) {
        ces_pool_free(pools[k]);
    }
}
