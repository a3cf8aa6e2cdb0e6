/* python/tables.c - the module's functions: the engine's tables as dicts, and its pure functions. */
#include "columns.h"
#include "convert.h"

#include <math.h>
#include <string.h>

#include "../base/memory.h"
#include "../base/parallel.h"
#include "../base/random.h"
#include "../base/status.h"
#include "../effects/laws.h"
#include "../scene/distribution.h"

static const ModuleState *state_of(PyObject *module)
{
    return PyModule_GetState(module);
}

/* Appends a new reference to a list; false with an exception. */
static bool append(PyObject *list, PyObject *element)
{
    const bool good = element != NULL && PyList_Append(list, element) == 0;
    Py_XDECREF(element);
    return good;
}

/* ---- effects ------------------------------------------------------------------------------------------------------------- */

static PyObject *effect_parameters(const ces_Effect *effect)
{
    PyObject *list = PyList_New(0);
    for (size_t k = 0; list != NULL && k < CES_MAX_EFFECT_PARAMETERS && effect->parameters[k].name != NULL; k++) {
        const ces_EffectParameter *p = &effect->parameters[k];
        if (!append(list, Py_BuildValue("{sssssdsdsdss}", "name", p->name, "unit", p->unit, "default", p->preset,
                                        "least", p->least, "most", p->most, "doc", p->doc))) {
            Py_CLEAR(list);
        }
    }
    return list;
}

static PyObject *effect_hooks(const ces_Effect *effect)
{
    const struct {
        const char *name;
        bool has;
    } hooks[] = {
        {"flow", effect->flow != NULL},       {"charge", effect->charge != NULL}, {"force", effect->force != NULL},
        {"damping", effect->damping != NULL}, {"air", effect->air != NULL},       {"prepare", effect->prepare != NULL},
    };
    PyObject *list = PyList_New(0);
    for (size_t k = 0; list != NULL && k < sizeof hooks / sizeof hooks[0]; k++) {
        if (hooks[k].has && !append(list, PyUnicode_FromString(hooks[k].name))) {
            Py_CLEAR(list);
        }
    }
    return list;
}

static PyObject *effects(PyObject *module, PyObject *unused)
{
    (void)module;
    (void)unused;
    PyObject *list = PyList_New(0);
    for (size_t row = 0; list != NULL && row < ces_effect_count(); row++) {
        const ces_Effect *effect = ces_effect_at(row);
        PyObject *entry = Py_BuildValue("{sssssssssIsNsN}", "name", effect->name, "doc", effect->doc, "source",
                                        effect->source, "size_formula", effect->size_formula, "needs", effect->needs,
                                        "parameters", effect_parameters(effect), "hooks", effect_hooks(effect));
        if (!append(list, entry)) {
            Py_CLEAR(list);
        }
    }
    return list;
}

/* A scale from a dict; what is missing is 0. */
static const FieldSpec scale_fields[] = {
    {"gravity", NUMBER, offsetof(ces_EffectScale, gravity), 1, NULL},
    {"voltage", NUMBER, offsetof(ces_EffectScale, voltage), 1, NULL},
    {"field", NUMBER, offsetof(ces_EffectScale, field), 1, NULL},
    {"speed", NUMBER, offsetof(ces_EffectScale, speed), 1, NULL},
    {"surface_speed", NUMBER, offsetof(ces_EffectScale, surface_speed), 1, NULL},
    {"rolling_speed", NUMBER, offsetof(ces_EffectScale, rolling_speed), 1, NULL},
    {"sphericity", NUMBER, offsetof(ces_EffectScale, sphericity), 1, NULL},
    {"square_gradient", NUMBER, offsetof(ces_EffectScale, square_gradient), 1, NULL},
    {"has_drum", BOOLEAN, offsetof(ces_EffectScale, has_drum), 1, NULL},
    {"has_brush", BOOLEAN, offsetof(ces_EffectScale, has_brush), 1, NULL},
    {"has_corona", BOOLEAN, offsetof(ces_EffectScale, has_corona), 1, NULL},
    {"kind", CHOICE, offsetof(ces_EffectScale, material.kind), 1, material_kinds},
    {"density", NUMBER, offsetof(ces_EffectScale, material.density), 1, NULL},
    {"permittivity", NUMBER, offsetof(ces_EffectScale, material.permittivity), 1, NULL},
    {"decay_time", NUMBER, offsetof(ces_EffectScale, material.decay_time), 1, NULL},
    {"conducting", NUMBER, offsetof(ces_EffectScale, material.conducting), 1, NULL},
    {"residence", NUMBER, offsetof(ces_EffectScale, residence), 1, NULL},
    {"radius", NUMBER, offsetof(ces_EffectScale, radius), 1, NULL},
    {"coverage", NUMBER, offsetof(ces_EffectScale, coverage), 1, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};

static PyObject *effect_size(PyObject *module, PyObject *args)
{
    const char *name;
    PyObject *scale_source, *parameter_source = NULL;
    if (!PyArg_ParseTuple(args, "sO|O:effect_size", &name, &scale_source, &parameter_source)) {
        return NULL;
    }
    const ModuleState *state = state_of(module);
    const ces_Effect *effect = ces_effect_find(name);
    if (effect == NULL) {
        return PyErr_Format(state->input_error, "effects has '%s', no such effect", name);
    }
    double values[CES_MAX_EFFECT_PARAMETERS];
    static const char *const nothing_elsewhere[] = {NULL};
    ces_EffectScale scale = {0};
    if (parse_struct(state, scale_source, "scale", scale_fields, nothing_elsewhere, &scale) < 0 ||
        effect_parameters_parse(state, parameter_source, effect, values) < 0) {
        return NULL;
    }
    return PyFloat_FromDouble(effect->size(&scale, values));
}

static PyObject *charge_after(PyObject *module, PyObject *args)
{
    (void)module;
    double charge, step;
    ces_ChargeFlow flow = {.decay_time = HUGE_VAL};
    if (!PyArg_ParseTuple(args, "dd|dddd:charge_after", &charge, &step, &flow.saturation, &flow.ion_time, &flow.rest,
                          &flow.decay_time)) {
        return NULL;
    }
    return PyFloat_FromDouble(ces_charge_after(charge, &flow, step));
}

/* ---- laws: pure functions of one or two numbers --------------------------------------------------------------------- */

static const struct {
    const char *name;
    double (*of_one)(double);
    double (*of_two)(double, double);
} laws[] = {
    {"drag_coefficient_schiller_naumann", ces_drag_coefficient_schiller_naumann, NULL},
    {"drag_coefficient_haider_levenspiel", NULL, ces_drag_coefficient_haider_levenspiel},
    {"spin_lift_factor", NULL, ces_spin_lift_factor},
    {"rotating_cylinder_friction", ces_rotating_cylinder_friction, NULL},
    {"wall_law", ces_wall_law, NULL},
};

static PyObject *law(PyObject *module, PyObject *args)
{
    const char *name;
    double x, y = (double)NAN;
    if (!PyArg_ParseTuple(args, "sd|d:law", &name, &x, &y)) {
        return NULL;
    }
    for (size_t k = 0; k < sizeof laws / sizeof laws[0]; k++) {
        if (strcmp(laws[k].name, name) == 0 && (laws[k].of_two != NULL) == !isnan(y)) {
            return PyFloat_FromDouble(laws[k].of_two != NULL ? laws[k].of_two(x, y) : laws[k].of_one(x));
        }
    }
    return PyErr_Format(state_of(module)->input_error, "laws has no '%s' of so many numbers", name);
}

static PyObject *sphere_plane_factors(PyObject *module, PyObject *source)
{
    const ModuleState *state = state_of(module);
    PyArrayObject *distances = array_of(state, source, NPY_DOUBLE, "distance_over_radius", 1, -1, 0);
    void *table = distances == NULL ? NULL : ces_alloc(1, ces_sphere_plane.state_size);
    PyObject *factors = NULL;
    if (table != NULL) {
        const npy_intp shape[2] = {PyArray_DIM(distances, 0), 3};
        ces_sphere_plane.start(NULL, NULL, table, NULL);
        factors = PyArray_SimpleNew(2, shape, NPY_DOUBLE);
        for (npy_intp k = 0; factors != NULL && k < shape[0]; k++) {
            ces_sphere_plane_factors(table, *(const double *)PyArray_GETPTR1(distances, k),
                                     PyArray_GETPTR2((PyArrayObject *)factors, k, 0));
        }
    } else if (distances != NULL) {
        PyErr_NoMemory();
    }
    ces_free(table);
    Py_XDECREF(distances);
    return factors;
}

/* ---- feeder -------------------------------------------------------------------------------------------------------------- */

static PyObject *distributions(PyObject *module, PyObject *unused)
{
    (void)module;
    (void)unused;
    PyObject *list = PyList_New(0);
    for (size_t row = 0; list != NULL && row < ces_distribution_count(); row++) {
        const ces_Distribution *distribution = ces_distribution_at(row);
        PyObject *parameters = PyList_New(0);
        for (const ces_DistributionParameter *p = distribution->parameters; parameters != NULL && p->name != NULL;
             p++) {
            if (!append(parameters, Py_BuildValue("{sssssdsdss}", "name", p->name, "unit", p->unit, "least", p->least,
                                                  "most", p->most, "doc", p->doc))) {
                Py_CLEAR(parameters);
            }
        }
        if (parameters == NULL || !append(list, Py_BuildValue("{sssssN}", "name", distribution->name, "doc",
                                                              distribution->doc, "parameters", parameters))) {
            Py_CLEAR(list);
        }
    }
    return list;
}

/* The parameters of a distribution from an array; what is not given is 0. */
static bool read_parameters(const ModuleState *state, PyObject *source, const char *name,
                            double values[CES_MAX_DISTRIBUTION_PARAMETERS])
{
    PyArrayObject *given = array_of(state, source, NPY_DOUBLE, "parameters", 1, -1, 0);
    if (given == NULL) {
        return false;
    }
    const npy_intp count = PyArray_DIM(given, 0);
    if (count > CES_MAX_DISTRIBUTION_PARAMETERS) {
        PyErr_Format(state->input_error, "parameters of %s are %zd, at most %d may be", name, (Py_ssize_t)count,
                     CES_MAX_DISTRIBUTION_PARAMETERS);
    } else {
        memcpy(values, PyArray_DATA(given), (size_t)count * sizeof *values);
    }
    Py_DECREF(given);
    return count <= CES_MAX_DISTRIBUTION_PARAMETERS;
}

static PyObject *quantile(PyObject *module, PyObject *args)
{
    const char *name;
    PyObject *source, *table_source = NULL;
    double u;
    if (!PyArg_ParseTuple(args, "sOd|O:quantile", &name, &source, &u, &table_source)) {
        return NULL;
    }
    const ModuleState *state = state_of(module);
    const ces_Distribution *row = ces_distribution_find(name);
    if (row == NULL) {
        return PyErr_Format(state->input_error, "distribution is '%s', no such distribution", name);
    }
    if (!(u > 0.0 && u < 1.0)) {
        ces_Error error;
        return raise_status(state, ces_fail(&error, CES_INPUT, "u is %g, must lie inside (0, 1)", u), &error);
    }
    double values[CES_MAX_DISTRIBUTION_PARAMETERS] = {0.0};
    if (!read_parameters(state, source, name, values)) {
        return NULL;
    }
    PyArrayObject *rows = NULL;
    PyObject *answer = NULL;
    ces_Table table = {0};
    if (table_source != NULL && table_source != Py_None) {
        rows = array_of(state, table_source, NPY_DOUBLE, "table", 2, -1, 2);
        table = rows == NULL ? table : (ces_Table){PyArray_DATA(rows), (size_t)PyArray_DIM(rows, 0)};
    }
    if (!PyErr_Occurred()) {
        ces_Error error;
        const ces_Status status = ces_distribution_check(row, values, &table, name, &error);
        answer = status == CES_OK ? PyFloat_FromDouble(row->quantile(values, &table, u))
                                  : raise_status(state, status, &error);
    }
    Py_XDECREF(rows);
    return answer;
}

static PyObject *random_number(PyObject *module, PyObject *args)
{
    (void)module;
    unsigned long long seed, id;
    unsigned int stream, draw;
    if (!PyArg_ParseTuple(args, "KIKI:random", &seed, &stream, &id, &draw)) {
        return NULL;
    }
    return PyFloat_FromDouble(ces_random(seed, stream, id, draw));
}

static PyObject *planned_births(const ModuleState *state, ces_Feeder *feeder, size_t count)
{
    const ces_Birth *births = NULL;
    size_t planned = 0;
    ces_Error error;
    const ces_Status status = ces_feeder_plan(feeder, HUGE_VAL, count, &births, &planned, &error);
    return status == CES_OK ? record_array(state->birth_type, births, planned) : raise_status(state, status, &error);
}

static PyObject *feed_stream(PyObject *module, PyObject *args, PyObject *kwargs)
{
    static char *keywords[] = {"feed", "materials", "gravity", "seed", "count", "shapes", NULL};
    PyObject *feed, *materials, *gravity, *shape_list = NULL;
    unsigned long long seed;
    Py_ssize_t count;
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "OOOKn|O:feed_stream", keywords, &feed, &materials, &gravity, &seed,
                                     &count, &shape_list)) {
        return NULL;
    }
    const ModuleState *state = state_of(module);
    if (count < 0) {
        return PyErr_Format(state->input_error, "count is %zd births, must not be negative", count);
    }
    Definition definition;
    if (definition_parse_feed(state, feed, materials, shape_list, &definition) < 0) {
        return NULL;
    }
    PyObject *stream = NULL;
    PyArrayObject *g = array_of(state, gravity, NPY_DOUBLE, "gravity", 1, 3, 0);
    if (g != NULL) {
        ces_Feeder *feeder = NULL;
        ces_Shapes shapes = {0};
        ces_Error error;
        ces_Status status = ces_shapes_create(&shapes, definition.def.shapes, definition.def.shape_count, &error);
        if (status == CES_OK) {
            status = ces_feeder_create(&definition.def.feed, definition.def.materials, definition.def.material_count,
                                       &shapes, PyArray_DATA(g), seed, &feeder, &error);
        }
        stream = status == CES_OK ? planned_births(state, feeder, (size_t)count) : raise_status(state, status, &error);
        ces_feeder_destroy(feeder);
        ces_shapes_free(&shapes);
        Py_DECREF(g);
    }
    definition_free(&definition);
    return stream;
}

/* ---- the build ------------------------------------------------------------------------------------------------------------ */

static PyObject *build_info(PyObject *module, PyObject *unused)
{
    (void)module;
    (void)unused;
#if defined(__clang__)
    const char *compiler = "clang " __clang_version__;
#elif defined(__GNUC__)
    const char *compiler = "gcc " __VERSION__;
#else
    const char *compiler = "unknown";
#endif
    return Py_BuildValue("{sssisi}", "compiler", compiler, "openmp", ces_openmp_version(), "processors",
                         ces_processor_count());
}

PyMethodDef module_functions[] = {
    {"effects", effects, METH_NOARGS, "effects() -> list of dicts, the rows of the table of effects"},
    {"law", law, METH_VARARGS, "law(name, x, y=...) -> the physical law of that name, of one or two numbers"},
    {"effect_size", effect_size, METH_VARARGS,
     "effect_size(name, scale, parameters=None) -> size over weight in such a scene"},
    {"charge_after", charge_after, METH_VARARGS,
     "charge_after(charge, step, saturation=0, ion_time=0, rest=0, decay_time=inf) -> charge a step later"},
    {"sphere_plane_factors", sphere_plane_factors, METH_O,
     "sphere_plane_factors(distance_over_radius): (n,) -> (n, 3), a, b, c of the force on a conducting sphere at a plane"},
    {"distributions", distributions, METH_NOARGS, "distributions() -> list of dicts, the laws a diameter may follow"},
    {"quantile", quantile, METH_VARARGS, "quantile(distribution, parameters, u, table=None) -> m"},
    {"random", random_number, METH_VARARGS, "random(seed, stream, id, draw) -> float in [0, 1)"},
    {"feed_stream", (PyCFunction)(void (*)(void))feed_stream, METH_VARARGS | METH_KEYWORDS,
     "feed_stream(feed, materials, gravity, seed, count, shapes=None) -> structured array, the first births of a feed"},
    {"convex_distance", convex_distance, METH_VARARGS,
     "convex_distance(a, b) -> (gap, normal, point_a, point_b); a: (vertices, position, orientation, scale, rounding), "
     "b: the same, or a surface (shape, position, orientation, size)"},
    {"convex_manifold", convex_manifold, METH_VARARGS,
     "convex_manifold(a, b, margin=0.0) -> list of (point, normal, gap, sub_a, sub_b)"},
    {"convex_approach", convex_approach, METH_VARARGS,
     "convex_approach(a, b, path) -> dict: where a's path relative to b first touches, or how near it comes"},
    {"build_info", build_info, METH_NOARGS, "build_info() -> dict: compiler, openmp (0: none), processors"},
    {NULL, NULL, 0, NULL},
};
