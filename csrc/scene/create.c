/* scene/create.c - from a definition to a scene: all checks first, then all or nothing. */
#include <math.h>
#include <string.h>

#include "../base/status.h"
#include "../base/vec3.h"
#include "composite.h"

enum { AUTO_SWEEPS = 200 }; /* of the kernel for spheres, before "auto" hands an island over to the table of solvers */

ces_SceneDef ces_default_scene_def(void)
{
    return (ces_SceneDef){
        .step = 1e-3,
        .gravity = {0.0, -9.81, 0.0},
        .contact_law = CES_COULOMB,
        .solver = "auto",
        .max_iterations = 1000,
        .grain_contact = true,
        .rotation = true,
        .gyroscopic = true,
        .threads = 1,
        .seed = 1,
        .landing_height = -HUGE_VAL,
        .lower = {-10.0, -10.0, -10.0},
        .upper = {10.0, 10.0, 10.0},
    };
}

static ces_Status check_numbers(const ces_SceneDef *def, ces_Error *error)
{
    const struct {
        const char *what;
        double value, least, most;
        const char *unit;
    } rows[] = {
        {"step", def->step, 1e-9, 1.0, "s"},
        {"gravity[0]", def->gravity[0], -1e3, 1e3, "m/s2"},
        {"gravity[1]", def->gravity[1], -1e3, 1e3, "m/s2"},
        {"gravity[2]", def->gravity[2], -1e3, 1e3, "m/s2"},
        {"drum_axis[0]", def->drum_axis[0], -1e3, 1e3, "m"},
        {"drum_axis[1]", def->drum_axis[1], -1e3, 1e3, "m"},
        {"drum_radius", def->drum_radius, 0.0, 1e2, "m"},
        {"tolerance", def->tolerance, 0.0, 1e2, "m/s"},
        {"reference_speed", def->reference_speed, 0.0, 1e4, "m/s"},
        {"max_iterations", (double)def->max_iterations, 1.0, 1e6, ""},
        {"threads", (double)def->threads, 1.0, 1024.0, ""},
    };
    for (size_t k = 0; k < sizeof rows / sizeof rows[0]; k++) {
        const ces_Status status =
            ces_check_range(error, rows[k].what, rows[k].value, rows[k].least, rows[k].most, rows[k].unit);
        if (status != CES_OK) {
            return status;
        }
    }
    for (int k = 0; k < 3; k++) {
        if (!(def->lower[k] < def->upper[k]) || fabs(def->lower[k]) > CES_FARTHEST ||
            fabs(def->upper[k]) > CES_FARTHEST) {
            return ces_fail(error, CES_INPUT, "bounds[%d] are [%g, %g] m, must rise and lie inside [%g, %g] m", k,
                            def->lower[k], def->upper[k], -CES_FARTHEST, CES_FARTHEST);
        }
    }
    if (isnan(def->landing_height)) {
        return ces_fail(error, CES_INPUT, "landing_height is nan m, must be a number or -infinity");
    }
    return CES_OK;
}

static ces_Status check_materials(const ces_SceneDef *def, ces_Error *error)
{
    if (def->material_count == 0 || def->material_count > 4096) {
        return ces_fail(error, CES_INPUT, "the number of materials is %zu, outside [1, 4096]", def->material_count);
    }
    for (size_t m = 0; m < def->material_count; m++) {
        const ces_MaterialDef *material = &def->materials[m];
        ces_Status status = ces_check_range(error, "density of a material", material->density, 1e-3, 1e5, "kg/m3");
        if (status == CES_OK && material->kind != CES_CONDUCTOR) {
            status = ces_check_range(error, "permittivity of a material", material->permittivity, 1.0, 1e4, "");
        }
        if (status == CES_OK && material->kind == CES_MIDDLING) {
            status = ces_check_range(error, "decay_time of a material", material->decay_time, 1e-12, 1e12, "s");
            status = status != CES_OK
                         ? status
                         : ces_check_range(error, "conducting of a material", material->conducting, 0.0, 1.0, "");
        }
        if (status != CES_OK) {
            return status;
        }
        const double share = material->conductor_share;
        if (!(share >= 0.0 && share < 1.0) || (share > 0.0 && material->kind == CES_CONDUCTOR)) {
            return ces_fail(error, CES_INPUT,
                            "conductor_share of a material is %g, outside [0, 1), or it is a conductor itself", share);
        }
    }
    return CES_OK;
}

static ces_Status check_coefficients(const char *what, const double *values, size_t count, double most,
                                     ces_Error *error)
{
    for (size_t k = 0; k < count; k++) {
        const ces_Status status = ces_check_range(error, what, values[k], 0.0, most, "");
        if (status != CES_OK) {
            return status;
        }
    }
    return CES_OK;
}

static ces_Status copy_table(ces_Scene *scene, ces_Error *error)
{
    const ces_SceneDef *def = &scene->def;
    const size_t grains = def->material_count * def->material_count;
    const size_t surfaces = def->surface_count * def->material_count;
    const struct {
        const char *what;
        const double *values;
        size_t count;
        double most;
        const double **place;
    } parts[] = {
        {"friction between grains", def->grain_friction, grains, 1000.0, &scene->table.grain_friction},
        {"restitution between grains", def->grain_restitution, grains, 1.0, &scene->table.grain_restitution},
        {"rolling friction between grains", def->grain_rolling, grains, 1000.0, &scene->table.grain_rolling},
        {"friction on a surface", def->surface_friction, surfaces, 1000.0, &scene->table.surface_friction},
        {"restitution on a surface", def->surface_restitution, surfaces, 1.0, &scene->table.surface_restitution},
        {"rolling friction on a surface", def->surface_rolling, surfaces, 1000.0, &scene->table.surface_rolling},
        {"spinning friction between grains", def->grain_spinning, grains, 1000.0, &scene->table.grain_spinning},
        {"spinning friction on a surface", def->surface_spinning, surfaces, 1000.0, &scene->table.surface_spinning},
    };
    scene->coefficients = ces_alloc(4 * (grains + surfaces), sizeof(double));
    if (scene->coefficients == NULL) {
        return ces_fail(error, CES_MEMORY, "no memory for the pair coefficients");
    }
    double *place = scene->coefficients;
    for (size_t k = 0; k < sizeof parts / sizeof parts[0]; k++) {
        const ces_Status status =
            check_coefficients(parts[k].what, parts[k].values, parts[k].count, parts[k].most, error);
        if (status != CES_OK) {
            return status;
        }
        memcpy(place, parts[k].values, parts[k].count * sizeof(double));
        *parts[k].place = place;
        place += parts[k].count;
    }
    scene->table.material_count = def->material_count;
    for (size_t k = 0; k < grains + surfaces; k++) {
        const double rolling = k < grains ? def->grain_rolling[k] : def->surface_rolling[k - grains];
        const double spinning = k < grains ? def->grain_spinning[k] : def->surface_spinning[k - grains];
        const double restitution = k < grains ? def->grain_restitution[k] : def->surface_restitution[k - grains];
        scene->rolling = scene->rolling || rolling > 0.0;
        scene->spinning = scene->spinning || spinning > 0.0;
        scene->most_restitution = ces_max(scene->most_restitution, restitution);
    }
    scene->rolling = scene->rolling && def->rotation;
    scene->spinning = scene->spinning && def->rotation;
    return CES_OK;
}

static ces_Status copy_machine(ces_Scene *scene, ces_Error *error)
{
    const ces_SceneDef *def = &scene->def;
    scene->materials = ces_alloc(def->material_count, sizeof *scene->materials);
    scene->surfaces = ces_alloc(def->surface_count, sizeof *scene->surfaces);
    if (scene->materials == NULL || scene->surfaces == NULL) {
        return ces_fail(error, CES_MEMORY, "no memory for %zu surfaces", def->surface_count);
    }
    memcpy(scene->materials, def->materials, def->material_count * sizeof *scene->materials);
    const ces_Status shaped = ces_shapes_create(&scene->shapes, def->shapes, def->shape_count, error);
    if (shaped != CES_OK) {
        return shaped;
    }
    for (size_t s = 0; s < def->surface_count; s++) {
        const ces_Status status = ces_surface_create(&def->surfaces[s], &scene->surfaces[s], error);
        if (status != CES_OK) {
            return status;
        }
    }
    return copy_table(scene, error);
}

/* The limits of the law of relaxation have their numbers, too; and a mixture is two materials that share its grains. */
static ces_Status start_materials(ces_Scene *scene, ces_Error *error)
{
    const size_t count = scene->def.material_count;
    for (size_t m = 0; m < count; m++) {
        ces_MaterialDef *material = &scene->materials[m];
        scene->mixed = scene->mixed || material->conductor_share > 0.0;
        if (material->kind != CES_MIDDLING) {
            material->conducting = material->kind == CES_CONDUCTOR ? 1.0 : 0.0;
            material->decay_time = material->kind == CES_CONDUCTOR ? 0.0 : HUGE_VAL;
        }
    }
    const ces_Status status = ces_check_composites(scene, error);
    if (status != CES_OK) {
        return status;
    }
    scene->mixed = scene->mixed || scene->shapes.composites;
    scene->particles.mixed = scene->mixed;
    if (!scene->mixed) {
        return CES_OK;
    }
    scene->faces = ces_alloc(2 * count, sizeof *scene->faces);
    if (scene->faces == NULL) {
        return ces_fail(error, CES_MEMORY, "no memory for %zu materials", count);
    }
    for (size_t m = 0; m < count; m++) {
        const ces_MaterialDef *whole = &scene->materials[m];
        scene->faces[2 * m] =
            (ces_MaterialDef){.kind = CES_CONDUCTOR, .density = whole->density, .permittivity = 1.0, .conducting = 1.0};
        scene->faces[2 * m + 1] = *whole;
        scene->faces[2 * m + 1].conductor_share = 0.0;
    }
    return CES_OK;
}

/* Weight is an effect: it acts on parts where it acts on grains. */
static ces_Status start_mechanism(ces_Scene *scene, ces_Error *error)
{
    const ces_SceneDef *def = &scene->def;
    ces_MechanismDef machine = {
        .parts = def->parts, .joints = def->joints, .part_count = def->part_count, .joint_count = def->joint_count};
    if (ces_effect_def(def, "gravity") != NULL) {
        ces_copy(def->gravity, machine.gravity);
    }
    ces_Status status = ces_mechanism_create(&scene->mechanism, &machine, error);
    for (size_t s = 0; s < def->surface_count && status == CES_OK; s++) {
        const int32_t part = def->surfaces[s].part;
        if (part < -1 || part >= (int64_t)def->part_count) {
            return ces_fail(error, CES_INPUT, "surface '%s' belongs to part %d, outside [-1, %lld]",
                            def->surfaces[s].name, (int)part, (long long)def->part_count - 1);
        }
        if (part >= 0) {
            const uint32_t assembly = scene->mechanism.assembly_of[part];
            status = ces_surface_attach(&scene->surfaces[s], &def->parts[part],
                                        scene->mechanism.assemblies[assembly].yields, error);
        }
    }
    scene->health.redundant_rows = scene->mechanism.redundant_rows;
    return status;
}

static ces_Status start_field(ces_Scene *scene, ces_Error *error)
{
    const ces_FieldDef *def = &scene->def.field;
    if (def->kind[0] == '\0') {
        return CES_OK;
    }
    scene->field = ces_field_find(def->kind);
    if (scene->field == NULL) {
        return ces_fail(error, CES_INPUT, "field.kind is '%s', no such field", def->kind);
    }
    scene->field_state = ces_alloc(1, scene->field->state_size);
    if (scene->field_state == NULL) {
        return ces_fail(error, CES_MEMORY, "no memory for the field");
    }
    return scene->field->start(def, scene->field_state, error);
}

static void hook(ces_Hooks *hooks, const ces_Effect *effect, void *state)
{
    const ces_Hook row = {.effect = effect, .state = state};
    if (effect->flow != NULL) {
        hooks->flow[hooks->flow_count++] = row;
        hooks->charge_needs |= effect->needs;
        hooks->charges = true;
    }
    if (effect->charge != NULL) {
        hooks->charges = true;
        hooks->charge[hooks->charge_count++] = row;
        hooks->charge_needs |= effect->needs;
    }
    if (effect->force != NULL) {
        hooks->force[hooks->force_count++] = row;
        hooks->force_needs |= effect->needs;
    }
    if (effect->damping != NULL) {
        hooks->damping[hooks->damping_count++] = row;
        hooks->force_needs |= effect->needs;
    }
    if (effect->air != NULL) {
        hooks->air[hooks->air_count++] = row;
        hooks->air_needs |= effect->needs;
    }
    if (effect->prepare != NULL) {
        hooks->prepare[hooks->prepare_count++] = row;
    }
}

/* The called-for rows, in the order of the table whatever the order of the definition. */
static ces_Status start_effects(ces_Scene *scene, ces_Error *error)
{
    const ces_SceneDef *def = &scene->def;
    for (size_t e = 0; e < def->effect_count; e++) {
        if (ces_effect_find(def->effects[e].name) == NULL) {
            return ces_fail(error, CES_INPUT, "effects has '%s', no such effect", def->effects[e].name);
        }
    }
    for (size_t row = 0; row < ces_effect_count(); row++) {
        const ces_Effect *effect = ces_effect_at(row);
        for (size_t e = 0; e < def->effect_count; e++) {
            if (strcmp(def->effects[e].name, effect->name) != 0) {
                continue;
            }
            if (scene->effect_states[row] != NULL) {
                return ces_fail(error, CES_INPUT, "effects has '%s' twice", effect->name);
            }
            const size_t table_size = 3 * def->effects[e].table_count * sizeof(double);
            if (table_size > 0 && effect->table == NULL) {
                return ces_fail(error, CES_INPUT, "effect '%s' takes no table", effect->name);
            }
            scene->effect_states[row] = ces_alloc(1, effect->state_size + table_size);
            if (scene->effect_states[row] == NULL) {
                return ces_fail(error, CES_MEMORY, "no memory for effect '%s'", effect->name);
            }
            ces_Status status = ces_effect_check(effect, def, def->effects[e].parameters, error);
            if (status == CES_OK && effect->start != NULL) {
                status = effect->start(def, def->effects[e].parameters, scene->effect_states[row], error);
            }
            if (status != CES_OK) {
                return status;
            }
            hook(&scene->hooks, effect, scene->effect_states[row]);
        }
    }
    return CES_OK;
}

static ces_Status start_solver(ces_Scene *scene, ces_Error *error)
{
    const ces_SceneDef *def = &scene->def;
    scene->solver = ces_cone_solver_find(def->solver);
    scene->packs = strcmp(def->solver, "pgs") == 0 || strcmp(def->solver, "auto") == 0;
    if (scene->solver == NULL) {
        return ces_fail(error, CES_INPUT, "numerics.solver is '%s', no such solver", def->solver);
    }
    /* From physics, never a count (docs/numerics.md 2). Where nothing falls and nothing turns no speed scales it. */
    const double scale = fmax(ces_norm(def->gravity) * def->step, 0.01 * def->reference_speed);
    scene->tolerance = def->tolerance > 0.0 ? def->tolerance : scale > 0.0 ? 1e-3 * scale : 1e-9;
    scene->problem.law = def->contact_law;
    scene->problem.spin_mobility = def->rotation ? CES_SPHERE_SPIN : 0.0;
    scene->problem.tolerance = scene->tolerance;
    const bool chooses = strcmp(def->solver, "auto") == 0;
    scene->problem.max_iterations = chooses && def->max_iterations > AUTO_SWEEPS ? AUTO_SWEEPS : def->max_iterations;
    return CES_OK;
}

static ces_Status start_feed(ces_Scene *scene, ces_Error *error)
{
    const ces_SceneDef *def = &scene->def;
    if (def->feed.family_count == 0) {
        return CES_OK;
    }
    return ces_feeder_create(&def->feed, def->materials, def->material_count, &scene->shapes, def->gravity, def->seed,
                             &scene->feeder, error);
}

/* After creation the definition's own arrays are not looked at again. */
static void forget_borrowed(ces_SceneDef *def)
{
    def->materials = NULL;
    def->surfaces = NULL;
    def->parts = NULL;
    def->joints = NULL;
    def->shapes = NULL;
    def->effects = NULL;
    def->field.values = def->field.circles = def->field.poles = def->field.series = def->field.terms = NULL;
    def->feed.families = NULL;
    def->grain_friction = def->grain_restitution = def->grain_rolling = def->grain_spinning = NULL;
    def->surface_friction = def->surface_restitution = def->surface_rolling = def->surface_spinning = NULL;
}

ces_Status ces_scene_create(const ces_SceneDef *def, ces_Scene **scene, ces_Error *error)
{
    typedef ces_Status Part(ces_Scene *, ces_Error *);
    static Part *const parts[] = {copy_machine,  start_materials, start_mechanism, start_field,
                                  start_effects, start_solver,    start_feed};

    *scene = NULL;
    ces_Status status = check_numbers(def, error);
    if (status == CES_OK) {
        status = check_materials(def, error);
    }
    if (status != CES_OK) {
        return status;
    }
    ces_Scene *fresh = ces_alloc(1, sizeof *fresh);
    if (fresh == NULL) {
        return ces_fail(error, CES_MEMORY, "no memory for a scene");
    }
    fresh->def = *def;
    for (size_t k = 0; k < sizeof parts / sizeof parts[0] && status == CES_OK; k++) {
        status = parts[k](fresh, error);
    }
    if (status == CES_OK && !ces_particles_reserve(&fresh->particles, 1)) {
        status = ces_fail(error, CES_MEMORY, "no memory for the first grain");
    }
    if (status != CES_OK) {
        ces_scene_destroy(fresh);
        return status;
    }
    forget_borrowed(&fresh->def);
    *scene = fresh;
    return CES_OK;
}

void ces_scene_destroy(ces_Scene *scene)
{
    if (scene == NULL) {
        return;
    }
    ces_Pool *const pools[] = {
        &scene->landing_pool,   &scene->displacement,     &scene->free_velocity, &scene->charge,
        &scene->start_position, &scene->start_velocity,   &scene->gone,          &scene->reports,
        &scene->snapshot,       &scene->free_orientation, &scene->free_spin,     &scene->crowd.position,
        &scene->crowd.force,    &scene->limited,          &scene->touch,         &scene->moment,
        &scene->moved_in};
    for (size_t k = 0; k < sizeof pools / sizeof pools[0]; k++) {
        ces_pool_free(pools[k]);
    }
    for (size_t k = 0; k < CES_MAX_HOOKS * CES_CROWD_POOLS; k++) {
        ces_pool_free(&scene->crowd.pools[k / CES_CROWD_POOLS][k % CES_CROWD_POOLS]);
    }
    for (size_t k = 0; k < CES_MAX_HOOKS; k++) {
        ces_free(scene->effect_states[k]);
    }
    ces_feeder_destroy(scene->feeder);
    ces_problem_free(&scene->problem);
    ces_rigid_free(&scene->rigid);
    ces_mechanism_free(&scene->mechanism);
    ces_islands_free(&scene->islands);
    ces_detector_free(&scene->detector);
    ces_contacts_free(&scene->contacts);
    ces_contacts_free(&scene->next_contacts);
    ces_particles_free(&scene->particles);
    ces_shapes_free(&scene->shapes);
    if (scene->field_state != NULL && scene->field->stop != NULL) {
        scene->field->stop(scene->field_state);
    }
    ces_free(scene->field_state);
    for (size_t s = 0; scene->surfaces != NULL && s < scene->def.surface_count; s++) {
        ces_surface_free(&scene->surfaces[s]);
    }
    ces_free(scene->surfaces);
    ces_free(scene->coefficients);
    ces_free(scene->materials);
    ces_free(scene->faces);
    ces_free(scene);
}
