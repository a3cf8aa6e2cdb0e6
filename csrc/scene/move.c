/* scene/move.c - the stage "move": the step takes effect, and nothing can fail any more. */
#include <string.h>

#include "../base/parallel.h"
#include "../base/vec3.h"
#include "../contact/correction.h"
#include "composite.h"

enum { ROW_BLOCK = 256, ISLAND_BLOCK = 32 };

static void move_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    ces_Scene *scene = context;
    const double *displacement = scene->displacement.data, *velocity = scene->free_velocity.data;
    for (size_t i = 3 * first; i < 3 * last; i++) {
        scene->particles.position[i] += displacement[i];
        scene->particles.velocity[i] = velocity[i];
    }
}

/* The same of its orientation: it turns freely up to the collision, takes the angular momentum that the impulses gave it, and
 * turns freely from there. spin: what it came to in the solver, for the inertia of the start of the step. */
static inline void redirect_turn(ces_Scene *scene, uint32_t row, double moved, const double spin[3], bool composite)
{
    const ces_Particles *particles = &scene->particles;
    const double *moments = scene->shapes.list[particles->shape[row]].def.moments;
    const double *start = &particles->orientation[4 * (size_t)row];
    double *orientation = &((double *)scene->free_orientation.data)[4 * (size_t)row];
    double *free_spin = &((double *)scene->free_spin.data)[3 * (size_t)row];
    const double until = moved * scene->def.step;
    const bool gyroscopic = scene->def.gyroscopic;
    double w[3], gained[3];
    if (!scene->def.rotation) {
        return;
    }
    ces_subtract(spin, free_spin, gained);
    ces_copy(&particles->angular_velocity[3 * (size_t)row], w);
    memcpy(orientation, start, 4 * sizeof *orientation);
    if (composite) {
        ces_kick_half(scene, row, orientation, w);
    }
    ces_rotate_alone(moments, gyroscopic, until, orientation, w);
    if (gyroscopic) {
        ces_carry_spin(moments, start, orientation, gained);
    }
    ces_add_scaled(w, 1.0, gained);
    ces_rotate_alone(moments, gyroscopic, scene->def.step - until, orientation, w);
    if (composite) {
        ces_kick_half(scene, row, orientation, w);
    }
    ces_copy(w, free_spin);
}

/* A grain that was pushed follows its free path to its first collision, and its new velocity from there. */
static inline void redirect(ces_Scene *scene, uint32_t row, bool composites)
{
    ces_Body *body = &scene->problem.bodies[row];
    if (body->moved < 0.0) {
        return;
    }
    ces_Particles *particles = &scene->particles;
    const double *displacement = &((const double *)scene->displacement.data)[3 * (size_t)row];
    const double *start = &((const double *)scene->start_position.data)[3 * (size_t)row];
    const double h = scene->def.step, inverse_radius = 2.0 / particles->diameter[row];
    double spin[3];
    for (size_t k = 0; k < 3; k++) {
        const size_t i = 3 * (size_t)row + k;
        spin[k] = body->s[k] * inverse_radius;
        particles->velocity[i] = body->v[k];
        particles->position[i] = start[k] + body->moved * displacement[k] + (1.0 - body->moved) * h * body->v[k];
    }
    if (ces_is_sphere(scene, row)) {
        ces_copy(spin, &particles->angular_velocity[3 * (size_t)row]);
    } else {
        redirect_turn(scene, row, body->moved, spin, composites && ces_is_composite(scene, row));
    }
    body->moved = -1.0; /* done, however many contacts it has */
}

static inline void redirect_all(ces_Scene *scene, bool composites)
{
    const ces_Contacts *contacts = &scene->contacts;
    for (size_t k = 0; k < contacts->count; k++) {
        redirect(scene, contacts->list[k].a, composites);
        if (k < contacts->pair_count) {
            redirect(scene, contacts->list[k].b, composites);
        }
    }
}

/* Spheres turn with the spin they leave the step with; the other grains take over what their rotation has come to. */
static void turn_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    ces_Scene *scene = context;
    ces_Particles *particles = &scene->particles;
    const double h = scene->def.step;
    for (size_t row = first; row < last; row++) {
        double *spin = &particles->angular_velocity[3 * row], *orientation = &particles->orientation[4 * row];
        if (!ces_is_sphere(scene, (uint32_t)row)) {
            memcpy(orientation, &((const double *)scene->free_orientation.data)[4 * row], 4 * sizeof *orientation);
            ces_copy(&((const double *)scene->free_spin.data)[3 * row], spin);
            continue;
        }
        const double turn[3] = {h * spin[0], h * spin[1], h * spin[2]};
        if (scene->def.rotation && ces_dot(turn, turn) > 0.0) {
            ces_turn(orientation, turn);
        }
    }
}

static void correct_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    ces_Scene *scene = context;
    const ces_CorrectionInput input = {
        .islands = &scene->islands,
        .contacts = &scene->contacts,
        .surfaces = scene->surfaces,
        .shapes = scene->shapes.list,
        .rotation = scene->def.rotation,
        .particles = &scene->particles,
        .moved_in = scene->moved_in.data,
    };
    for (size_t i = first; i < last; i++) {
        ces_correct_island(&input, &scene->islands.list[i]);
    }
}

/* Births count from here on. */
static void count_births(ces_Scene *scene)
{
    ces_Particles *particles = &scene->particles;
    for (size_t row = particles->count; row < scene->rows; row++) {
        scene->ledger.fed_count++;
        scene->ledger.fed += ces_mass_units(particles->mass[row]);
    }
    particles->next_id += (int64_t)(scene->rows - particles->count);
    particles->count = scene->rows;
    if (scene->feeder != NULL) {
        ces_feeder_commit(scene->feeder);
    }
}

/*
 * A grain that rode on a cylinder and that nothing presses any more has left it. Riding it went along chords, each with the
 * velocity of its middle; flight starts from that of the end, half a step later. Left out, that moves a landing point to first
 * order in the step (docs/decisions/014).
 */
static void leave(ces_Scene *scene, size_t row)
{
    const double *start = &((const double *)scene->start_velocity.data)[3 * row];
    double *velocity = &scene->particles.velocity[3 * row];
    if (scene->surfaces[scene->particles.surface[row]].def.shape == CES_CYLINDER) {
        for (int k = 0; k < 3; k++) {
            velocity[k] += 0.5 * (velocity[k] - start[k]);
        }
    }
}

static void note_touches(ces_Scene *scene)
{
    enum { LEFT = 1 << 29 };
    ces_Particles *particles = &scene->particles;
    const ces_Contacts *contacts = &scene->contacts;
    for (size_t row = 0; row < particles->count; row++) {
        particles->touched[row] = particles->touched[row] & CES_RODE ? LEFT : 0;
    }
    for (size_t k = 0; k < contacts->count; k++) {
        const ces_Contact *contact = &contacts->list[k];
        const bool begins = !contact->lasting;
        if (!(ces_contact_push(contact) > 0.0)) {
            continue;
        }
        particles->collisions[contact->a] += begins;
        particles->touched[contact->a] &= ~LEFT;
        if (k < contacts->pair_count) {
            particles->collisions[contact->b] += begins;
            particles->touched[contact->b] &= ~LEFT;
        } else {
            const int role = 1 << scene->surfaces[contact->b].def.role;
            particles->surface[contact->a] = (int32_t)contact->b;
            particles->touched[contact->a] |= role | (contact->lasting && !contact->impact ? CES_RODE : 0);
        }
    }
    for (size_t row = 0; row < particles->count; row++) {
        if (particles->touched[row] & LEFT) {
            particles->touched[row] &= ~LEFT;
            leave(scene, row);
        }
    }
}

ces_Status ces_stage_move(ces_Scene *scene, ces_Error *error)
{
    (void)error;
    ces_Particles *particles = &scene->particles;
    const ces_Contacts old = scene->contacts;
    scene->contacts = scene->next_contacts;
    scene->next_contacts = old;
    count_births(scene);
    ces_count_limited_charges(scene);
    if (scene->hooks.charges) {
        const double *charge = scene->charge.data;
        memcpy(particles->charge, charge, particles->count * sizeof(double));
        if (scene->mixed) {
            memcpy(particles->conducted, charge + scene->rows, particles->count * sizeof(double));
        }
    }
    memcpy(scene->start_position.data, particles->position, 3 * particles->count * sizeof(double));
    memcpy(scene->start_velocity.data, particles->velocity, 3 * particles->count * sizeof(double));

    ces_parallel_for(particles->count, ROW_BLOCK, scene->def.threads, move_block, scene);
    if (scene->shapes.composites) {
        redirect_all(scene, true);
    } else {
        redirect_all(scene, false);
    }
    if (scene->def.rotation || !scene->shapes.only_spheres) {
        ces_parallel_for(particles->count, ROW_BLOCK, scene->def.threads, turn_block, scene);
    }
    ces_mechanism_commit(&scene->mechanism);
    note_touches(scene);
    if (scene->shapes.composites) {
        ces_note_phase_touches(scene);
    }
    ces_note_health(scene);

    scene->step_index++;
    ces_place_surfaces(scene, ces_scene_time(scene), scene->mechanism.now);
    ces_parallel_for(scene->islands.count, ISLAND_BLOCK, scene->def.threads, correct_block, scene);
    return CES_OK;
}
