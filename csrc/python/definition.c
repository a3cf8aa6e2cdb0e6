/* python/definition.c - a scene's definition from a dict of plain SI numbers: one table of fields per struct. */
#include "convert.h"

#include <math.h>

#include "../effects/laws.h"

const char *const material_kinds[] = {"conductor", "insulator", "middling", NULL};
static const char *const shape_kinds[] = {"sphere", "cluster", "convex", NULL};
static const char *const surface_shapes[] = {"plane", "box", "cylinder", "mesh", NULL};
static const char *const joint_kinds[] = {"revolute", "prismatic", "fixed", "spherical", NULL};
static const char *const surface_roles[] = {"inert", "ground", "brush", NULL};
static const char *const contact_laws[] = {"coulomb", "ccp", NULL};

/* clang-format off */
#define AT(type, member) offsetof(type, member)
static const FieldSpec scene_fields[] = {
    {"step", NUMBER, AT(ces_SceneDef, step), 1, NULL},
    {"gravity", NUMBER, AT(ces_SceneDef, gravity), 3, NULL},
    {"drum_axis", NUMBER, AT(ces_SceneDef, drum_axis), 2, NULL},
    {"drum_radius", NUMBER, AT(ces_SceneDef, drum_radius), 1, NULL},
    {"contact_law", CHOICE, AT(ces_SceneDef, contact_law), 1, contact_laws},
    {"solver", TEXT, AT(ces_SceneDef, solver), 1, NULL},
    {"tolerance", NUMBER, AT(ces_SceneDef, tolerance), 1, NULL},
    {"reference_speed", NUMBER, AT(ces_SceneDef, reference_speed), 1, NULL},
    {"max_iterations", WHOLE32, AT(ces_SceneDef, max_iterations), 1, NULL},
    {"grain_contact", BOOLEAN, AT(ces_SceneDef, grain_contact), 1, NULL},
    {"rotation", BOOLEAN, AT(ces_SceneDef, rotation), 1, NULL},
    {"gyroscopic", BOOLEAN, AT(ces_SceneDef, gyroscopic), 1, NULL},
    {"landing_height", NUMBER, AT(ces_SceneDef, landing_height), 1, NULL},
    {"lower", NUMBER, AT(ces_SceneDef, lower), 3, NULL},
    {"upper", NUMBER, AT(ces_SceneDef, upper), 3, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec material_fields[] = {
    {"kind", CHOICE, AT(ces_MaterialDef, kind), 1, material_kinds},
    {"density", NUMBER, AT(ces_MaterialDef, density), 1, NULL},
    {"permittivity", NUMBER, AT(ces_MaterialDef, permittivity), 1, NULL},
    {"decay_time", NUMBER, AT(ces_MaterialDef, decay_time), 1, NULL},
    {"conducting", NUMBER, AT(ces_MaterialDef, conducting), 1, NULL},
    {"conductor_share", NUMBER, AT(ces_MaterialDef, conductor_share), 1, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec shape_fields[] = {
    {"name", TEXT, AT(ces_ShapeDef, name), 1, NULL},
    {"kind", CHOICE, AT(ces_ShapeDef, kind), 1, shape_kinds},
    {"moments", NUMBER, AT(ces_ShapeDef, moments), 3, NULL},
    {"sphericity", NUMBER, AT(ces_ShapeDef, sphericity), 1, NULL},
    {"contact_charge", NUMBER, AT(ces_ShapeDef, contact_charge), 3, NULL},
    {"contact_force", NUMBER, AT(ces_ShapeDef, contact_force), 3, NULL},
    {"semi_axes", NUMBER, AT(ces_ShapeDef, semi_axes), 3, NULL},
    {"depolarization", NUMBER, AT(ces_ShapeDef, depolarization), 3, NULL},
    {"material", INDEX, AT(ces_ShapeDef, material), 1, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec phase_fields[] = {
    {"volume", NUMBER, AT(ces_PhaseDef, volume), 1, NULL},
    {"mass", NUMBER, AT(ces_PhaseDef, mass), 1, NULL},
    {"center", NUMBER, AT(ces_PhaseDef, center), 3, NULL},
    {"orientation", NUMBER, AT(ces_PhaseDef, orientation), 4, NULL},
    {"sphericity", NUMBER, AT(ces_PhaseDef, sphericity), 1, NULL},
    {"contact_charge", NUMBER, AT(ces_PhaseDef, contact_charge), 3, NULL},
    {"contact_force", NUMBER, AT(ces_PhaseDef, contact_force), 3, NULL},
    {"semi_axes", NUMBER, AT(ces_PhaseDef, semi_axes), 3, NULL},
    {"depolarization", NUMBER, AT(ces_PhaseDef, depolarization), 3, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec surface_fields[] = {
    {"name", TEXT, AT(ces_SurfaceDef, name), 1, NULL},
    {"shape", CHOICE, AT(ces_SurfaceDef, shape), 1, surface_shapes},
    {"role", CHOICE, AT(ces_SurfaceDef, role), 1, surface_roles},
    {"position", NUMBER, AT(ces_SurfaceDef, position), 3, NULL},
    {"orientation", NUMBER, AT(ces_SurfaceDef, orientation), 4, NULL},
    {"size", NUMBER, AT(ces_SurfaceDef, size), 3, NULL},
    {"angular_speed", NUMBER, AT(ces_SurfaceDef, angular_speed), 1, NULL},
    {"belt_velocity", NUMBER, AT(ces_SurfaceDef, belt_velocity), 3, NULL},
    {"vibration", NUMBER, AT(ces_SurfaceDef, vibration), 3, NULL},
    {"vibration_frequency", NUMBER, AT(ces_SurfaceDef, vibration_frequency), 1, NULL},
    {"part", INDEX, AT(ces_SurfaceDef, part), 1, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec part_fields[] = {
    {"name", TEXT, AT(ces_PartDef, name), 1, NULL},
    {"mass", NUMBER, AT(ces_PartDef, mass), 1, NULL},
    {"inertia", NUMBER, AT(ces_PartDef, inertia), 3, NULL},
    {"position", NUMBER, AT(ces_PartDef, position), 3, NULL},
    {"orientation", NUMBER, AT(ces_PartDef, orientation), 4, NULL},
    {"velocity", NUMBER, AT(ces_PartDef, velocity), 3, NULL},
    {"angular_velocity", NUMBER, AT(ces_PartDef, angular_velocity), 3, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec joint_fields[] = {
    {"name", TEXT, AT(ces_JointDef, name), 1, NULL},
    {"kind", CHOICE, AT(ces_JointDef, kind), 1, joint_kinds},
    {"part_a", INDEX, AT(ces_JointDef, part_a), 1, NULL},
    {"part_b", INDEX, AT(ces_JointDef, part_b), 1, NULL},
    {"anchor_a", NUMBER, AT(ces_JointDef, anchor_a), 3, NULL},
    {"anchor_b", NUMBER, AT(ces_JointDef, anchor_b), 3, NULL},
    {"axis", NUMBER, AT(ces_JointDef, axis), 3, NULL},
    {"limit", NUMBER, AT(ces_JointDef, limit), 1, NULL},
    {"least_travel", NUMBER, AT(ces_JointDef, least_travel), 1, NULL},
    {"most_travel", NUMBER, AT(ces_JointDef, most_travel), 1, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
/* clang-format on */

/* ---- the parts of a scene ----------------------------------------------------------------------------------------------- */

static const char *const nothing_elsewhere[] = {NULL};

static int parse_materials(const ModuleState *state, PyObject *source, Definition *definition)
{
    PyObject *list = hold_sequence(state, definition, source, "materials", &definition->def.material_count);
    ces_MaterialDef *materials =
        list == NULL ? NULL : hold(definition, definition->def.material_count, sizeof *materials);
    if (materials == NULL) {
        return -1;
    }
    definition->def.materials = materials;
    for (size_t k = 0; k < definition->def.material_count; k++) {
        materials[k].permittivity = 1.0;
        if (parse_struct(state, PyTuple_GET_ITEM(list, (Py_ssize_t)k), "a material", material_fields, nothing_elsewhere,
                         &materials[k]) < 0) {
            return -1;
        }
    }
    return 0;
}

/* An array (rows, width) of doubles that the definition keeps; nothing where there is none. */
int hold_rows(const ModuleState *state, PyObject *source, const char *what, npy_intp width, Definition *definition,
              const double **place, size_t *count)
{
    if (source == NULL) {
        return 0;
    }
    PyArrayObject *array = array_of(state, source, NPY_DOUBLE, what, 2, -1, width);
    if (array == NULL || PyList_Append(definition->holders, (PyObject *)array) < 0) {
        Py_XDECREF(array);
        return -1;
    }
    Py_DECREF(array);
    *place = PyArray_DATA(array);
    *count = (size_t)PyArray_DIM(array, 0);
    return 0;
}

/* Indices (count) that the definition holds. */
static int hold_indices(const ModuleState *state, PyObject *source, const char *what, size_t count,
                        Definition *definition, const uint32_t **place)
{
    PyArrayObject *indices = array_of(state, source, NPY_UINT32, what, 1, (npy_intp)count, 0);
    if (indices == NULL || PyList_Append(definition->holders, (PyObject *)indices) < 0) {
        Py_XDECREF(indices);
        return -1;
    }
    Py_DECREF(indices);
    *place = PyArray_DATA(indices);
    return 0;
}

/* What a cluster of several materials has more than another. */
static int parse_composite(const ModuleState *state, PyObject *source, ces_ShapeDef *shape, Definition *definition)
{
    PyObject *materials = item(source, "sphere_materials");
    if (materials == NULL) {
        return 0;
    }
    size_t count = 0;
    PyObject *phases = hold_sequence(state, definition, item(source, "phases"), "phases", &count);
    if (phases == NULL) {
        return -1;
    }
    if (count != CES_PHASES) {
        return fail(state, "shape '%s' has other than two phases%s", shape->name, "");
    }
    for (Py_ssize_t f = 0; f < CES_PHASES; f++) {
        if (parse_struct(state, PyTuple_GET_ITEM(phases, f), "a phase", phase_fields, nothing_elsewhere,
                         &shape->phases[f]) < 0) {
            return -1;
        }
    }
    return hold_indices(state, materials, "sphere_materials", shape->sphere_count, definition,
                        &shape->sphere_materials);
}

static int parse_shapes(const ModuleState *state, PyObject *source, Definition *definition)
{
    static const char *const elsewhere[] = {"spheres", "vertices", "sphere_materials", "phases", NULL};
    if (source == NULL) {
        return 0;
    }
    PyObject *list = hold_sequence(state, definition, source, "shapes", &definition->def.shape_count);
    ces_ShapeDef *shapes = list == NULL ? NULL : hold(definition, definition->def.shape_count, sizeof *shapes);
    if (shapes == NULL) {
        return -1;
    }
    definition->def.shapes = shapes;
    for (size_t k = 0; k < definition->def.shape_count; k++) {
        PyObject *shape = PyTuple_GET_ITEM(list, (Py_ssize_t)k);
        shapes[k].sphericity = 1.0;
        for (int axis = 0; axis < 3; axis++) { /* those of a sphere */
            shapes[k].contact_charge[axis] = CES_SPHERE_K_Q;
            shapes[k].contact_force[axis] = CES_SPHERE_K_F / CES_SPHERE_K_Q;
            shapes[k].semi_axes[axis] = 0.5;
            shapes[k].depolarization[axis] = 1.0 / 3.0;
        }
        if (parse_struct(state, shape, "a shape", shape_fields, elsewhere, &shapes[k]) < 0 ||
            hold_rows(state, item(shape, "spheres"), "spheres", 4, definition, &shapes[k].spheres,
                      &shapes[k].sphere_count) < 0 ||
            hold_rows(state, item(shape, "vertices"), "vertices", 3, definition, &shapes[k].vertices,
                      &shapes[k].vertex_count) < 0 ||
            parse_composite(state, shape, &shapes[k], definition) < 0) {
            return -1;
        }
    }
    return 0;
}

/* The arrays of a mesh, which the definition keeps; other surfaces have none. */
static int parse_mesh(const ModuleState *state, PyObject *source, ces_SurfaceDef *surface, Definition *definition)
{
    PyObject *vertices = item(source, "vertices"), *triangles = item(source, "triangles");
    if (surface->shape != CES_MESH) {
        return vertices == NULL && triangles == NULL
                   ? 0
                   : fail(state, "surface '%s' has vertices or triangles, only a mesh has%s", surface->name, "");
    }
    if (vertices == NULL || triangles == NULL) {
        return fail(state, "surface '%s' is a mesh and has no vertices or no triangles%s", surface->name, "");
    }
    if (hold_rows(state, vertices, "vertices", 3, definition, &surface->vertices, &surface->vertex_count) < 0) {
        return -1;
    }
    PyArrayObject *indices = array_of(state, triangles, NPY_UINT32, "triangles", 2, -1, 3);
    if (indices == NULL || PyList_Append(definition->holders, (PyObject *)indices) < 0) {
        Py_XDECREF(indices);
        return -1;
    }
    Py_DECREF(indices);
    surface->triangles = PyArray_DATA(indices);
    surface->triangle_count = (size_t)PyArray_DIM(indices, 0);
    return 0;
}

static int parse_surfaces(const ModuleState *state, PyObject *source, Definition *definition)
{
    static const char *const elsewhere[] = {"vertices", "triangles", NULL};
    PyObject *list = hold_sequence(state, definition, source, "surfaces", &definition->def.surface_count);
    ces_SurfaceDef *surfaces = list == NULL ? NULL : hold(definition, definition->def.surface_count, sizeof *surfaces);
    if (surfaces == NULL) {
        return -1;
    }
    definition->def.surfaces = surfaces;
    for (size_t k = 0; k < definition->def.surface_count; k++) {
        PyObject *surface = PyTuple_GET_ITEM(list, (Py_ssize_t)k);
        surfaces[k].orientation[0] = 1.0;
        surfaces[k].part = -1;
        if (parse_struct(state, surface, "a surface", surface_fields, elsewhere, &surfaces[k]) < 0 ||
            parse_mesh(state, surface, &surfaces[k], definition) < 0) {
            return -1;
        }
    }
    return 0;
}

static int parse_parts(const ModuleState *state, PyObject *source, Definition *definition)
{
    if (source == NULL) {
        return 0;
    }
    PyObject *list = hold_sequence(state, definition, source, "parts", &definition->def.part_count);
    ces_PartDef *parts = list == NULL ? NULL : hold(definition, definition->def.part_count, sizeof *parts);
    if (parts == NULL) {
        return -1;
    }
    definition->def.parts = parts;
    for (size_t k = 0; k < definition->def.part_count; k++) {
        parts[k].orientation[0] = 1.0;
        if (parse_struct(state, PyTuple_GET_ITEM(list, (Py_ssize_t)k), "a part", part_fields, nothing_elsewhere,
                         &parts[k]) < 0) {
            return -1;
        }
    }
    return 0;
}

static int parse_joints(const ModuleState *state, PyObject *source, Definition *definition)
{
    static const char *const elsewhere[] = {"law", NULL};
    if (source == NULL) {
        return 0;
    }
    PyObject *list = hold_sequence(state, definition, source, "joints", &definition->def.joint_count);
    ces_JointDef *joints = list == NULL ? NULL : hold(definition, definition->def.joint_count, sizeof *joints);
    if (joints == NULL) {
        return -1;
    }
    definition->def.joints = joints;
    for (size_t k = 0; k < definition->def.joint_count; k++) {
        PyObject *joint = PyTuple_GET_ITEM(list, (Py_ssize_t)k);
        joints[k].part_a = joints[k].part_b = -1;
        joints[k].limit = joints[k].most_travel = HUGE_VAL;
        joints[k].least_travel = -HUGE_VAL;
        if (parse_struct(state, joint, "a joint", joint_fields, elsewhere, &joints[k]) < 0 ||
            hold_rows(state, item(joint, "law"), "law", 2, definition, &joints[k].law, &joints[k].law_count) < 0) {
            return -1;
        }
    }
    return 0;
}

static int parse_coefficients(const ModuleState *state, PyObject *source, Definition *definition)
{
    ces_SceneDef *def = &definition->def;
    const struct {
        const char *key;
        size_t rows;
        const double **place;
    } parts[] = {
        {"grain_friction", def->material_count, &def->grain_friction},
        {"grain_restitution", def->material_count, &def->grain_restitution},
        {"grain_rolling", def->material_count, &def->grain_rolling},
        {"grain_spinning", def->material_count, &def->grain_spinning},
        {"surface_friction", def->surface_count, &def->surface_friction},
        {"surface_restitution", def->surface_count, &def->surface_restitution},
        {"surface_rolling", def->surface_count, &def->surface_rolling},
        {"surface_spinning", def->surface_count, &def->surface_spinning},
    };
    for (size_t k = 0; k < sizeof parts / sizeof parts[0]; k++) {
        PyObject *value = item(source, parts[k].key);
        if (value == NULL) {
            *parts[k].place = hold(definition, parts[k].rows * def->material_count, sizeof(double));
            if (*parts[k].place == NULL) {
                return -1;
            }
            continue;
        }
        PyArrayObject *array;
        if (parts[k].rows == 0) {
            array = (PyArrayObject *)PyArray_FROM_OTF(value, NPY_DOUBLE, NPY_ARRAY_IN_ARRAY);
        } else {
            array = array_of(state, value, NPY_DOUBLE, parts[k].key, 2, (npy_intp)parts[k].rows,
                             (npy_intp)def->material_count);
        }
        if (array == NULL || PyList_Append(definition->holders, (PyObject *)array) < 0) {
            Py_XDECREF(array);
            return -1;
        }
        Py_DECREF(array);
        *parts[k].place = PyArray_DATA(array);
    }
    return 0;
}

int effect_parameters_parse(const ModuleState *state, PyObject *source, const ces_Effect *row, double *values)
{
    const char *names[CES_MAX_EFFECT_PARAMETERS + 1] = {NULL};
    double presets[CES_MAX_EFFECT_PARAMETERS];
    for (size_t k = 0; k < CES_MAX_EFFECT_PARAMETERS && row->parameters[k].name != NULL; k++) {
        names[k] = row->parameters[k].name;
        presets[k] = row->parameters[k].preset;
    }
    return parameters_parse(state, source, row->name, names, presets, values);
}

static int parse_effect(const ModuleState *state, PyObject *source, Definition *definition, ces_EffectDef *effect)
{
    static const FieldSpec fields[] = {{"name", TEXT, AT(ces_EffectDef, name), 1, NULL}, {NULL, NUMBER, 0, 0, NULL}};
    static const char *const elsewhere[] = {"parameters", "table", NULL};
    if (parse_struct(state, source, "an effect", fields, elsewhere, effect) < 0 ||
        hold_rows(state, item(source, "table"), "table", 3, definition, &effect->table, &effect->table_count) < 0) {
        return -1;
    }
    const ces_Effect *row = ces_effect_find(effect->name);
    if (row == NULL) {
        return fail(state, "effects has '%s', no such effect%s", effect->name, "");
    }
    return effect_parameters_parse(state, item(source, "parameters"), row, effect->parameters);
}

static int parse_effects(const ModuleState *state, PyObject *source, Definition *definition)
{
    PyObject *list = hold_sequence(state, definition, source, "effects", &definition->def.effect_count);
    ces_EffectDef *effects = list == NULL ? NULL : hold(definition, definition->def.effect_count, sizeof *effects);
    if (effects == NULL) {
        return -1;
    }
    definition->def.effects = effects;
    for (size_t k = 0; k < definition->def.effect_count; k++) {
        if (parse_effect(state, PyTuple_GET_ITEM(list, (Py_ssize_t)k), definition, &effects[k]) < 0) {
            return -1;
        }
    }
    return 0;
}

static int start(Definition *definition)
{
    definition->def = ces_default_scene_def();
    definition->holders = PyList_New(0);
    return definition->holders == NULL ? -1 : 0;
}

int definition_parse(const ModuleState *state, PyObject *source, Definition *definition)
{
    static const char *const elsewhere[] = {"materials",
                                            "surfaces",
                                            "effects",
                                            "field",
                                            "feed",
                                            "grain_friction",
                                            "grain_restitution",
                                            "grain_rolling",
                                            "grain_spinning",
                                            "surface_friction",
                                            "surface_restitution",
                                            "surface_rolling",
                                            "surface_spinning",
                                            "shapes",
                                            "parts",
                                            "joints",
                                            NULL};
    if (start(definition) < 0 ||
        parse_struct(state, source, "definition", scene_fields, elsewhere, &definition->def) < 0 ||
        parse_materials(state, item(source, "materials"), definition) < 0 ||
        parse_shapes(state, item(source, "shapes"), definition) < 0 ||
        parse_surfaces(state, item(source, "surfaces"), definition) < 0 ||
        parse_parts(state, item(source, "parts"), definition) < 0 ||
        parse_joints(state, item(source, "joints"), definition) < 0 ||
        parse_coefficients(state, source, definition) < 0 ||
        definition_add_field(state, item(source, "field"), definition) < 0 ||
        parse_effects(state, item(source, "effects"), definition) < 0 ||
        definition_add_feed(state, item(source, "feed"), definition) < 0) {
        definition_free(definition);
        return -1;
    }
    return 0;
}

int definition_parse_feed(const ModuleState *state, PyObject *feed, PyObject *materials, PyObject *shapes,
                          Definition *definition)
{
    if (start(definition) < 0 || parse_shapes(state, shapes == Py_None ? NULL : shapes, definition) < 0 ||
        parse_materials(state, materials, definition) < 0 || definition_add_feed(state, feed, definition) < 0) {
        definition_free(definition);
        return -1;
    }
    return 0;
}

int definition_parse_field(const ModuleState *state, PyObject *field, Definition *definition)
{
    if (start(definition) < 0 || definition_add_field(state, field, definition) < 0) {
        definition_free(definition);
        return -1;
    }
    return 0;
}

void definition_free(Definition *definition)
{
    Py_CLEAR(definition->holders);
}
