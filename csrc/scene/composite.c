/* scene/composite.c - grains of several materials: what is checked of them, what pushes them, what they touch. */
#include "composite.h"

#include "../base/status.h"

ces_Status ces_check_composite(const ces_Shapes *shapes, size_t shape, size_t material, const char *what,
                               ces_Error *error)
{
    const ces_ShapeDef *def = &shapes->list[shape].def;
    if (def->sphere_materials != NULL && (size_t)def->material != material) {
        return ces_fail(error, CES_INPUT, "%s has the shape '%s', a composite, and material %zu; must be material %d",
                        what, def->name, material, (int)def->material);
    }
    return CES_OK;
}

ces_Status ces_check_composites(const ces_Scene *scene, ces_Error *error)
{
    const size_t count = scene->def.material_count;
    for (size_t s = 0; s < scene->shapes.count; s++) {
        const ces_ShapeDef *def = &scene->shapes.list[s].def;
        if (def->sphere_materials == NULL) {
            continue;
        }
        if (def->material < 0 || (size_t)def->material >= count) {
            return ces_fail(error, CES_INPUT, "shape '%s' is of material %d, outside [0, %zu]", def->name,
                            (int)def->material, count - 1);
        }
        for (size_t k = 0; k < def->sphere_count; k++) {
            if (def->sphere_materials[k] >= count) {
                return ces_fail(error, CES_INPUT, "shape '%s': sphere %zu is of material %u, outside [0, %zu]",
                                def->name, k, (unsigned)def->sphere_materials[k], count - 1);
            }
        }
    }
    return CES_OK;
}

/*
 * Each phase is pushed as a grain of its own would be: weight, fields and images at its own centre. The weights have no moment
 * about the centre of mass; what is shared by mass (the pull of what the grain touches) has none either.
 */
void ces_push_composite(const ces_Scene *scene, size_t row, const ces_Grain *whole, double conducted, double force[3],
                        double moment[3])
{
    const ces_Hooks *hooks = &scene->hooks;
    const ces_PhaseDef *phases = scene->shapes.list[scene->particles.shape[row]].def.phases;
    moment[0] = moment[1] = moment[2] = 0.0;
    for (int f = 0; f < CES_PHASES; f++) {
        ces_Phase phase;
        if (!ces_phase_of(scene, row, f, whole, whole->orientation, conducted, &phase)) {
            continue;
        }
        double push[3] = {0.0, 0.0, 0.0}, turn[3];
        for (int k = 0; k < 3; k++) {
            phase.grain.touch[k] = phases[f].mass * whole->touch[k];
        }
        ces_sample(scene, hooks->force_needs, &phase.grain);
        for (size_t k = 0; k < hooks->force_count; k++) {
            hooks->force[k].effect->force(hooks->force[k].state, &phase.grain, push);
        }
        ces_cross(phase.arm, push, turn);
        ces_add_scaled(force, 1.0, push);
        ces_add_scaled(moment, 1.0, turn);
    }
}

void ces_kick_half(const ces_Scene *scene, size_t row, const double orientation[4], double spin[3])
{
    const ces_Particles *particles = &scene->particles;
    const double *moment = &((const double *)scene->moment.data)[3 * row];
    double inverse[9];
    ces_inverse_inertia(&scene->shapes.list[particles->shape[row]], particles->mass[row], particles->diameter[row],
                        orientation, inverse);
    for (int k = 0; k < 3; k++) {
        spin[k] += 0.5 * scene->def.step * ces_dot(&inverse[3 * k], moment);
    }
}

void ces_rotate_composite(const ces_Scene *scene, size_t row, double orientation[4], double spin[3])
{
    ces_kick_half(scene, row, orientation, spin);
    ces_rotate_alone(scene->shapes.list[scene->particles.shape[row]].def.moments, scene->def.gyroscopic,
                     scene->def.step, orientation, spin);
    ces_kick_half(scene, row, orientation, spin);
}

void ces_note_phase_touches(ces_Scene *scene)
{
    ces_Particles *particles = &scene->particles;
    const ces_Contacts *contacts = &scene->contacts;
    for (size_t k = contacts->pair_count; k < contacts->count; k++) {
        const ces_Contact *contact = &contacts->list[k];
        const ces_ShapeDef *shape = &scene->shapes.list[particles->shape[contact->a]].def;
        if (shape->sphere_materials == NULL || !(ces_contact_push(contact) > 0.0)) {
            continue;
        }
        const ces_MaterialDef *material = &scene->materials[shape->sphere_materials[contact->part_a]];
        const unsigned phase = material->kind == CES_CONDUCTOR ? 0 : 1;
        const unsigned role = (unsigned)scene->surfaces[contact->b].def.role;
        particles->touched[contact->a] |= (int32_t)(1u << (CES_PHASE_BITS * (phase + 1u) + role));
    }
}
