/*
 * A scene in C for benchmarks/effect_costs.py: steps with the effects that are named as arguments, counted by callgrind.
 *
 *     effect_costs STEPS [EFFECT ...]
 *
 * Grains of a metal, a plastic and a middling, spheres and pairs of spheres, ride on a drum, fly before it and touch a
 * brush, so that every effect has something to act on.
 */
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "../csrc/effects/effect.h"

enum { MATERIALS = 3, SURFACES = 2, GRAINS = 240, MOST_EFFECTS = 64 };

#define RADIUS 0.16   /* m, of the drum */
#define SPEED 4.69    /* rad/s */
#define DIAMETER 1e-3 /* m, of a grain */

static int fail(const ces_Error *error)
{
    fprintf(stderr, "%s\n", error->text);
    return 1;
}

static ces_EffectDef effect_def(const char *name)
{
    ces_EffectDef def = {0};
    snprintf(def.name, sizeof def.name, "%s", name);
    const ces_Effect *row = ces_effect_find(name);
    for (int k = 0; row != NULL && k < CES_MAX_EFFECT_PARAMETERS && row->parameters[k].name != NULL; k++) {
        def.parameters[k] = row->parameters[k].preset;
    }
    if (strcmp(name, "wind") == 0) {
        def.parameters[0] = SPEED;
    }
    return def;
}

static ces_Status add_grains(ces_Scene *scene, ces_Error *error)
{
    static double position[3 * GRAINS], velocity[3 * GRAINS], spin[3 * GRAINS], diameter[GRAINS], charge[GRAINS];
    static int32_t material[GRAINS], shape[GRAINS];
    static int64_t ids[GRAINS];
    for (int k = 0; k < GRAINS; k++) {
        const double angle = 0.02 * (k / 3 % 40), z = -0.05 + 0.002 * (k / 120) + 0.003 * (k % 3);
        const double rho = RADIUS + (k % 2 == 0 ? 0.5 * DIAMETER : 0.004 + 1e-4 * k);
        position[3 * k] = rho * sin(angle);
        position[3 * k + 1] = rho * cos(angle);
        position[3 * k + 2] = z;
        velocity[3 * k] = SPEED * rho * cos(angle);
        velocity[3 * k + 1] = -SPEED * rho * sin(angle);
        spin[3 * k + 2] = -SPEED - 300.0 * (k % 2);
        diameter[k] = DIAMETER;
        material[k] = k % MATERIALS;
        shape[k] = k % 4 == 3;
        charge[k] = k % MATERIALS == 0 ? 0.0 : -2e-12;
    }
    const ces_GrainsDef grains = {.position = position,
                                  .velocity = velocity,
                                  .angular_velocity = spin,
                                  .material = material,
                                  .shape = shape,
                                  .diameter = diameter,
                                  .charge = charge};
    return ces_scene_add(scene, GRAINS, &grains, ids, error);
}

int main(int count, char **arguments)
{
    static const ces_MaterialDef materials[MATERIALS] = {
        {.kind = CES_CONDUCTOR, .density = 8960.0, .permittivity = 1.0},
        {.kind = CES_INSULATOR, .density = 1050.0, .permittivity = 2.9},
        {.kind = CES_MIDDLING, .density = 1900.0, .permittivity = 4.5, .decay_time = 0.3, .conducting = 0.5},
    };
    static const double pair[] = {0.25, 0.0, 0.0, 0.4, -0.25, 0.0, 0.0, 0.4};
    static const ces_ShapeDef shapes[] = {
        {.name = "sphere",
         .kind = CES_SPHERE,
         .moments = {0.1, 0.1, 0.1},
         .sphericity = 1.0,
         .contact_charge = {1.645, 1.645, 1.645},
         .contact_force = {0.832, 0.832, 0.832},
         .semi_axes = {0.5, 0.5, 0.5}},
        {.name = "pair",
         .kind = CES_CLUSTER,
         .moments = {0.09, 0.13, 0.13},
         .sphericity = 0.9,
         .contact_charge = {1.645, 1.645, 1.645},
         .contact_force = {0.832, 0.832, 0.832},
         .semi_axes = {0.5, 0.5, 0.5},
         .spheres = pair,
         .sphere_count = 2},
    };
    static const ces_SurfaceDef surfaces[SURFACES] = {
        {.name = "drum",
         .shape = CES_CYLINDER,
         .role = CES_GROUND,
         .orientation = {1.0, 0.0, 0.0, 0.0},
         .size = {RADIUS, RADIUS, 0.3},
         .angular_speed = -SPEED,
         .part = -1},
        {.name = "brush",
         .shape = CES_CYLINDER,
         .role = CES_BRUSH,
         .position = {0.0, RADIUS + 0.0519, 0.0},
         .orientation = {1.0, 0.0, 0.0, 0.0},
         .size = {0.05, 0.05, 0.3},
         .part = -1},
    };
    static const double half[MATERIALS * MATERIALS] = {0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3};
    static const double none[MATERIALS * MATERIALS] = {0.0};
    static ces_EffectDef effects[MOST_EFFECTS];
    if (count < 2 || count - 2 > MOST_EFFECTS) {
        fprintf(stderr, "effect_costs STEPS [EFFECT ...]\n");
        return 2;
    }
    for (int k = 2; k < count; k++) {
        effects[k - 2] = effect_def(arguments[k]);
    }
    ces_SceneDef def = ces_default_scene_def();
    def.step = 1e-4;
    def.drum_radius = RADIUS;
    def.materials = materials;
    def.material_count = MATERIALS;
    def.shapes = shapes;
    def.shape_count = sizeof shapes / sizeof shapes[0];
    def.surfaces = surfaces;
    def.surface_count = SURFACES;
    def.grain_friction = def.surface_friction = half;
    def.grain_restitution = def.grain_rolling = def.grain_spinning = none;
    def.surface_restitution = def.surface_rolling = def.surface_spinning = none;
    def.field = (ces_FieldDef){.kind = "two_cylinders",
                               .drum_radius = RADIUS,
                               .electrode_radius = 0.019,
                               .distance = 0.267,
                               .angle = 0.5236,
                               .voltage = -35e3};
    def.effects = effects;
    def.effect_count = (size_t)(count - 2);

    ces_Error error;
    ces_Scene *scene = NULL;
    if (ces_scene_create(&def, &scene, &error) != CES_OK || add_grains(scene, &error) != CES_OK) {
        return fail(&error);
    }
    for (long steps = strtol(arguments[1], NULL, 10); steps > 0; steps--) {
        if (ces_scene_step(scene, &error) != CES_OK) {
            return fail(&error);
        }
    }
    printf("%016llx\n", (unsigned long long)ces_scene_state_hash(scene));
    ces_scene_destroy(scene);
    return 0;
}
