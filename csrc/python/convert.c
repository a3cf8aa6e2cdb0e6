/* python/convert.c - from dicts of plain SI numbers to definitions: one table of fields per struct, unknown keys refused. */
#include <math.h>
#include <stddef.h>
#include <string.h>

#include "../effects/effect.h"
#include "../scene/distribution.h"
#include "module.h"

typedef enum Kind { NUMBER, WHOLE32, BOOLEAN, TEXT, CHOICE } Kind;

/* One key of a dict and its place in a struct. */
typedef struct FieldSpec {
    const char *key;
    Kind kind;
    size_t offset;
    int count;                  /* numbers: 1, or the length of a vector */
    const char *const *choices; /* CHOICE: names in the order of the enum, ends with NULL */
} FieldSpec;

static const char *const material_kinds[] = {"conductor", "insulator", NULL};
static const char *const surface_shapes[] = {"plane", "box", "cylinder", NULL};
static const char *const surface_roles[] = {"inert", "ground", "brush", NULL};
static const char *const contact_laws[] = {"coulomb", "ccp", NULL};
static const char *const rate_kinds[] = {"mass", "count", NULL};

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
    {"landing_height", NUMBER, AT(ces_SceneDef, landing_height), 1, NULL},
    {"lower", NUMBER, AT(ces_SceneDef, lower), 3, NULL},
    {"upper", NUMBER, AT(ces_SceneDef, upper), 3, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec material_fields[] = {
    {"kind", CHOICE, AT(ces_MaterialDef, kind), 1, material_kinds},
    {"density", NUMBER, AT(ces_MaterialDef, density), 1, NULL},
    {"permittivity", NUMBER, AT(ces_MaterialDef, permittivity), 1, NULL},
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
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec electric_fields[] = {
    {"kind", TEXT, AT(ces_FieldDef, kind), 1, NULL},
    {"drum_radius", NUMBER, AT(ces_FieldDef, drum_radius), 1, NULL},
    {"electrode_radius", NUMBER, AT(ces_FieldDef, electrode_radius), 1, NULL},
    {"distance", NUMBER, AT(ces_FieldDef, distance), 1, NULL},
    {"angle", NUMBER, AT(ces_FieldDef, angle), 1, NULL},
    {"voltage", NUMBER, AT(ces_FieldDef, voltage), 1, NULL},
    {"drum_center", NUMBER, AT(ces_FieldDef, drum_center), 2, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec feed_fields[] = {
    {"rate_kind", CHOICE, AT(ces_FeedDef, rate_kind), 1, rate_kinds},
    {"rate", NUMBER, AT(ces_FeedDef, rate), 1, NULL},
    {"start", NUMBER, AT(ces_FeedDef, start), 1, NULL},
    {"stop", NUMBER, AT(ces_FeedDef, stop), 1, NULL},
    {"center", NUMBER, AT(ces_FeedDef, center), 3, NULL},
    {"edge_u", NUMBER, AT(ces_FeedDef, edge_u), 3, NULL},
    {"edge_v", NUMBER, AT(ces_FeedDef, edge_v), 3, NULL},
    {"velocity", NUMBER, AT(ces_FeedDef, velocity), 3, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
static const FieldSpec family_fields[] = {
    {"material", WHOLE32, AT(ces_FamilyDef, material), 1, NULL},
    {"mass_fraction", NUMBER, AT(ces_FamilyDef, mass_fraction), 1, NULL},
    {"distribution", TEXT, AT(ces_FamilyDef, distribution), 1, NULL},
    {"least", NUMBER, AT(ces_FamilyDef, least), 1, NULL},
    {"most", NUMBER, AT(ces_FamilyDef, most), 1, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
/* clang-format on */

/* ---- one value ------------------------------------------------------------------------------------------------------- */

static int fail(const ModuleState *state, const char *format, const char *one, const char *other)
{
    PyErr_Format(state->input_error, format, one, other);
    return -1;
}

static int parse_number(const ModuleState *state, PyObject *value, const char *key, double *out)
{
    if (PyBool_Check(value) || !(PyFloat_Check(value) || PyLong_Check(value) || PyIndex_Check(value) ||
                                 PyArray_IsScalar(value, Floating))) {
        return fail(state, "%s is a %s, must be a number", key, Py_TYPE(value)->tp_name);
    }
    *out = PyFloat_AsDouble(value);
    if (*out == -1.0 && PyErr_Occurred()) {
        PyErr_Clear();
        return fail(state, "%s is too large for a number%s", key, "");
    }
    if (isnan(*out)) {
        return fail(state, "%s is nan, must be a number%s", key, "");
    }
    return 0;
}

static int parse_vector(const ModuleState *state, PyObject *value, const char *key, int count, double *out)
{
    PyObject *sequence = PySequence_Fast(value, "");
    if (sequence == NULL || PySequence_Fast_GET_SIZE(sequence) != count) {
        PyErr_Clear();
        Py_XDECREF(sequence);
        PyErr_Format(state->input_error, "%s must have %d numbers", key, count);
        return -1;
    }
    int status = 0;
    for (int k = 0; k < count && status == 0; k++) {
        status = parse_number(state, PySequence_Fast_GET_ITEM(sequence, k), key, &out[k]);
    }
    Py_DECREF(sequence);
    return status;
}

static int parse_text(const ModuleState *state, PyObject *value, const char *key, char *out)
{
    Py_ssize_t length = 0;
    const char *text = PyUnicode_Check(value) ? PyUnicode_AsUTF8AndSize(value, &length) : NULL;
    if (text == NULL || length >= CES_NAME_LENGTH || strlen(text) != (size_t)length) {
        PyErr_Clear();
        PyErr_Format(state->input_error, "%s must be a text of at most %d bytes", key, CES_NAME_LENGTH - 1);
        return -1;
    }
    memcpy(out, text, (size_t)length + 1);
    return 0;
}

static int parse_choice(const ModuleState *state, PyObject *value, const char *key, const char *const *choices, int *out)
{
    for (int k = 0; choices[k] != NULL; k++) {
        if (PyUnicode_Check(value) && PyUnicode_CompareWithASCIIString(value, choices[k]) == 0) {
            *out = k;
            return 0;
        }
    }
    PyErr_Format(state->input_error, "%s is %R, no such choice", key, value);
    return -1;
}

static int parse_one(const ModuleState *state, PyObject *value, const FieldSpec *field, char *place)
{
    double number;
    switch (field->kind) {
    case NUMBER:
        return field->count == 1 ? parse_number(state, value, field->key, (double *)place)
                                 : parse_vector(state, value, field->key, field->count, (double *)place);
    case WHOLE32:
        if (parse_number(state, value, field->key, &number) < 0) {
            return -1;
        }
        if (!(number >= 0.0 && number <= 4294967295.0 && number == floor(number))) {
            return fail(state, "%s must be a whole number from 0 to 4294967295%s", field->key, "");
        }
        *(uint32_t *)place = (uint32_t)number;
        return 0;
    case BOOLEAN:
        if (!PyBool_Check(value)) {
            return fail(state, "%s is a %s, must be True or False", field->key, Py_TYPE(value)->tp_name);
        }
        *(bool *)place = value == Py_True;
        return 0;
    case TEXT:
        return parse_text(state, value, field->key, place);
    case CHOICE: {
        int choice = 0;
        if (parse_choice(state, value, field->key, field->choices, &choice) < 0) {
            return -1;
        }
        memcpy(place, &choice, sizeof choice); /* an enum of ours is an int */
        return 0;
    }
    }
    return -1;
}

/* ---- structs ---------------------------------------------------------------------------------------------------------- */

static const FieldSpec *find_field(const FieldSpec *fields, PyObject *key)
{
    for (; fields->key != NULL; fields++) {
        if (PyUnicode_Check(key) && PyUnicode_CompareWithASCIIString(key, fields->key) == 0) {
            return fields;
        }
    }
    return NULL;
}

static bool is_listed(const char *const *keys, PyObject *key)
{
    for (; *keys != NULL; keys++) {
        if (PyUnicode_Check(key) && PyUnicode_CompareWithASCIIString(key, *keys) == 0) {
            return true;
        }
    }
    return false;
}

/* Fills base from a dict; keys in elsewhere are left to the caller. */
static int parse_struct(const ModuleState *state, PyObject *source, const char *what, const FieldSpec *fields,
                        const char *const *elsewhere, void *base)
{
    if (!PyDict_Check(source)) {
        return fail(state, "%s is a %s, must be a dict", what, Py_TYPE(source)->tp_name);
    }
    PyObject *key, *value;
    Py_ssize_t position = 0;
    while (PyDict_Next(source, &position, &key, &value)) {
        const FieldSpec *field = find_field(fields, key);
        if (field == NULL && is_listed(elsewhere, key)) {
            continue;
        }
        if (field == NULL) {
            PyErr_Format(state->input_error, "%s has %R, no such key", what, key);
            return -1;
        }
        if (parse_one(state, value, field, (char *)base + field->offset) < 0) {
            return -1;
        }
    }
    return 0;
}

static PyObject *item(PyObject *dict, const char *key)
{
    PyObject *value = PyDict_GetItemString(dict, key);
    return value == Py_None ? NULL : value;
}

/* Memory that lives as long as the definition. */
static void *hold(Definition *definition, size_t count, size_t size)
{
    PyObject *bytes = PyBytes_FromStringAndSize(NULL, (Py_ssize_t)((count + 1) * size));
    if (bytes == NULL || PyList_Append(definition->holders, bytes) < 0) {
        Py_XDECREF(bytes);
        return NULL;
    }
    Py_DECREF(bytes); /* the list holds it */
    memset(PyBytes_AS_STRING(bytes), 0, (count + 1) * size);
    return PyBytes_AS_STRING(bytes);
}

/* A list as a tuple that the definition holds; its length comes in *count. */
static PyObject *hold_sequence(const ModuleState *state, Definition *definition, PyObject *source, const char *what, size_t *count)
{
    PyObject *tuple = source == NULL ? PyTuple_New(0) : PyList_Check(source) || PyTuple_Check(source) ? PySequence_Tuple(source) : NULL;
    if (tuple == NULL) {
        PyErr_Format(state->input_error, "%s must be a list", what);
        return NULL;
    }
    const int status = PyList_Append(definition->holders, tuple);
    Py_DECREF(tuple);
    *count = (size_t)PyTuple_GET_SIZE(tuple);
    return status == 0 ? tuple : NULL;
}

PyArrayObject *array_of(const ModuleState *state, PyObject *source, int type, const char *what, int dimensions, npy_intp first,
                        npy_intp second)
{
    PyArrayObject *array = (PyArrayObject *)PyArray_FROM_OTF(source, type, NPY_ARRAY_IN_ARRAY);
    if (array == NULL) {
        PyErr_Clear();
        PyErr_Format(state->input_error, "%s is no array of numbers", what);
        return NULL;
    }
    const npy_intp wanted[2] = {first, second};
    bool fits = PyArray_NDIM(array) == dimensions;
    for (int k = 0; k < dimensions && fits; k++) {
        fits = wanted[k] < 0 || PyArray_DIM(array, k) == wanted[k];
    }
    if (!fits) {
        Py_DECREF(array);
        PyErr_Format(state->input_error, "%s does not have the shape it must have", what);
        return NULL;
    }
    return array;
}

int parameters_parse(const ModuleState *state, PyObject *source, const char *owner, const char *const *names,
                     const double *presets, double *values)
{
    size_t count = 0;
    for (; names[count] != NULL; count++) {
        values[count] = presets[count];
    }
    if (source == NULL || source == Py_None) {
        return 0;
    }
    if (!PyDict_Check(source)) {
        return fail(state, "parameters of %s are a %s, must be a dict", owner, Py_TYPE(source)->tp_name);
    }
    PyObject *key, *value;
    Py_ssize_t position = 0;
    while (PyDict_Next(source, &position, &key, &value)) {
        size_t k = 0;
        while (k < count && !(PyUnicode_Check(key) && PyUnicode_CompareWithASCIIString(key, names[k]) == 0)) {
            k++;
        }
        if (k == count) {
            PyErr_Format(state->input_error, "%s has no parameter %R", owner, key);
            return -1;
        }
        /* nan says: decided from the scene, where the row's own preset says so. */
        const bool open = isnan(presets[k]) && PyFloat_Check(value) && isnan(PyFloat_AS_DOUBLE(value));
        if (open) {
            values[k] = NAN;
        } else if (parse_number(state, value, names[k], &values[k]) < 0) {
            return -1;
        }
    }
    return 0;
}

/* ---- the parts of a scene ----------------------------------------------------------------------------------------------- */

static const char *const nothing_elsewhere[] = {NULL};

static int parse_materials(const ModuleState *state, PyObject *source, Definition *definition)
{
    PyObject *list = hold_sequence(state, definition, source, "materials", &definition->def.material_count);
    ces_MaterialDef *materials = list == NULL ? NULL : hold(definition, definition->def.material_count, sizeof *materials);
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

static int parse_surfaces(const ModuleState *state, PyObject *source, Definition *definition)
{
    PyObject *list = hold_sequence(state, definition, source, "surfaces", &definition->def.surface_count);
    ces_SurfaceDef *surfaces = list == NULL ? NULL : hold(definition, definition->def.surface_count, sizeof *surfaces);
    if (surfaces == NULL) {
        return -1;
    }
    definition->def.surfaces = surfaces;
    for (size_t k = 0; k < definition->def.surface_count; k++) {
        surfaces[k].orientation[0] = 1.0;
        if (parse_struct(state, PyTuple_GET_ITEM(list, (Py_ssize_t)k), "a surface", surface_fields, nothing_elsewhere,
                         &surfaces[k]) < 0) {
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
        {"surface_friction", def->surface_count, &def->surface_friction},
        {"surface_restitution", def->surface_count, &def->surface_restitution},
        {"surface_rolling", def->surface_count, &def->surface_rolling},
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
            array = array_of(state, value, NPY_DOUBLE, parts[k].key, 2, (npy_intp)parts[k].rows, (npy_intp)def->material_count);
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

static int parse_effect(const ModuleState *state, PyObject *source, ces_EffectDef *effect)
{
    static const FieldSpec fields[] = {{"name", TEXT, AT(ces_EffectDef, name), 1, NULL}, {NULL, NUMBER, 0, 0, NULL}};
    static const char *const elsewhere[] = {"parameters", NULL};
    if (parse_struct(state, source, "an effect", fields, elsewhere, effect) < 0) {
        return -1;
    }
    const ces_Effect *row = ces_effect_find(effect->name);
    if (row == NULL) {
        return fail(state, "effects has '%s', no such effect%s", effect->name, "");
    }
    const char *names[CES_MAX_EFFECT_PARAMETERS + 1] = {NULL};
    double presets[CES_MAX_EFFECT_PARAMETERS];
    for (size_t k = 0; k < CES_MAX_EFFECT_PARAMETERS && row->parameters[k].name != NULL; k++) {
        names[k] = row->parameters[k].name;
        presets[k] = row->parameters[k].preset;
    }
    return parameters_parse(state, item(source, "parameters"), row->name, names, presets, effect->parameters);
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
        if (parse_effect(state, PyTuple_GET_ITEM(list, (Py_ssize_t)k), &effects[k]) < 0) {
            return -1;
        }
    }
    return 0;
}

static int parse_family(const ModuleState *state, PyObject *source, ces_FamilyDef *family, Definition *definition)
{
    static const char *const elsewhere[] = {"parameters", "table", NULL};
    if (parse_struct(state, source, "a family", family_fields, elsewhere, family) < 0) {
        return -1;
    }
    const ces_Distribution *row = ces_distribution_find(family->distribution);
    if (row == NULL) {
        return fail(state, "distribution is '%s', no such distribution%s", family->distribution, "");
    }
    const char *names[CES_MAX_DISTRIBUTION_PARAMETERS + 1] = {NULL};
    const double presets[CES_MAX_DISTRIBUTION_PARAMETERS] = {0.0}; /* outside every range: a missing one is refused */
    for (size_t k = 0; k < CES_MAX_DISTRIBUTION_PARAMETERS && row->parameters[k].name != NULL; k++) {
        names[k] = row->parameters[k].name;
    }
    if (parameters_parse(state, item(source, "parameters"), row->name, names, presets, family->parameters) < 0) {
        return -1;
    }
    PyObject *table = item(source, "table");
    if (table == NULL) {
        return 0;
    }
    PyArrayObject *array = array_of(state, table, NPY_DOUBLE, "table", 2, -1, 2);
    if (array == NULL || PyList_Append(definition->holders, (PyObject *)array) < 0) {
        Py_XDECREF(array);
        return -1;
    }
    Py_DECREF(array);
    family->table = PyArray_DATA(array);
    family->table_count = (size_t)PyArray_DIM(array, 0);
    return 0;
}

static int parse_feed(const ModuleState *state, PyObject *source, Definition *definition)
{
    ces_FeedDef *feed = &definition->def.feed;
    if (source == NULL) {
        return 0;
    }
    static const char *const elsewhere[] = {"families", NULL};
    feed->stop = HUGE_VAL;
    if (parse_struct(state, source, "feed", feed_fields, elsewhere, feed) < 0) {
        return -1;
    }
    PyObject *list = hold_sequence(state, definition, item(source, "families"), "families", &feed->family_count);
    ces_FamilyDef *families = list == NULL ? NULL : hold(definition, feed->family_count, sizeof *families);
    if (families == NULL) {
        return -1;
    }
    feed->families = families;
    for (size_t k = 0; k < feed->family_count; k++) {
        if (parse_family(state, PyTuple_GET_ITEM(list, (Py_ssize_t)k), &families[k], definition) < 0) {
            return -1;
        }
    }
    return 0;
}

int definition_parse_field(const ModuleState *state, PyObject *source, ces_FieldDef *field)
{
    return source == NULL ? 0 : parse_struct(state, source, "field", electric_fields, nothing_elsewhere, field);
}

static int start(Definition *definition)
{
    definition->def = ces_default_scene_def();
    definition->holders = PyList_New(0);
    return definition->holders == NULL ? -1 : 0;
}

int definition_parse(const ModuleState *state, PyObject *source, Definition *definition)
{
    static const char *const elsewhere[] = {
        "materials",        "surfaces",            "effects",         "field", "feed", "grain_friction", "grain_restitution",
        "grain_rolling",    "surface_friction",    "surface_restitution", "surface_rolling", NULL};
    if (start(definition) < 0 || parse_struct(state, source, "definition", scene_fields, elsewhere, &definition->def) < 0 ||
        parse_materials(state, item(source, "materials"), definition) < 0 ||
        parse_surfaces(state, item(source, "surfaces"), definition) < 0 || parse_coefficients(state, source, definition) < 0 ||
        definition_parse_field(state, item(source, "field"), &definition->def.field) < 0 ||
        parse_effects(state, item(source, "effects"), definition) < 0 || parse_feed(state, item(source, "feed"), definition) < 0) {
        definition_free(definition);
        return -1;
    }
    return 0;
}

int definition_parse_feed(const ModuleState *state, PyObject *feed, PyObject *materials, Definition *definition)
{
    if (start(definition) < 0 || parse_materials(state, materials, definition) < 0 || parse_feed(state, feed, definition) < 0) {
        definition_free(definition);
        return -1;
    }
    return 0;
}

void definition_free(Definition *definition)
{
    Py_CLEAR(definition->holders);
}
