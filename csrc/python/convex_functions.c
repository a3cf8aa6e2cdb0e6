/*
 * python/convex_functions.c - the geometry of convex bodies as functions, for whoever wants to check it.
 *
 * A body is a tuple (vertices (n, 3), position (3,), orientation (4,), scale, rounding), a surface a tuple (shape, position,
 * orientation, size): "plane", "box" or "cylinder", as in a definition.
 */
#include "module.h"

#include <string.h>

#include "../contact/narrow_phase.h"

/* A convex body, or the surface that takes the place of the second one. */
typedef struct Body {
    ces_Convex convex;
    ces_Surface surface;
    bool is_surface;
    PyArrayObject *vertices; /* holds the memory of convex */
} Body;

static bool three(const ModuleState *state, PyObject *source, const char *what, npy_intp count, double *out)
{
    PyArrayObject *array = array_of(state, source, NPY_DOUBLE, what, 1, count, 0);
    if (array == NULL) {
        return false;
    }
    memcpy(out, PyArray_DATA(array), (size_t)count * sizeof *out);
    Py_DECREF(array);
    return true;
}

static bool is_finite(const double *numbers, size_t count)
{
    for (size_t k = 0; k < count; k++) {
        if (!isfinite(numbers[k])) {
            return false;
        }
    }
    return true;
}

static bool parse_convex(const ModuleState *state, PyObject *source, Body *body)
{
    PyObject *vertices, *position, *orientation;
    double scale, rounding, place[3], turn[4];
    if (!PyArg_ParseTuple(source, "OOOdd:body", &vertices, &position, &orientation, &scale, &rounding) ||
        !three(state, position, "position", 3, place) || !three(state, orientation, "orientation", 4, turn)) {
        return false;
    }
    body->vertices = array_of(state, vertices, NPY_DOUBLE, "vertices", 2, -1, 3);
    if (body->vertices == NULL) {
        return false;
    }
    const size_t count = (size_t)PyArray_DIM(body->vertices, 0);
    const double *data = PyArray_DATA(body->vertices);
    const double norm = turn[0] * turn[0] + turn[1] * turn[1] + turn[2] * turn[2] + turn[3] * turn[3];
    if (count < 1 || count > CES_CONVEX_VERTICES) {
        PyErr_Format(state->input_error, "a convex body has %zu vertices, must have 1 to %d", count,
                     CES_CONVEX_VERTICES);
        return false;
    }
    if (!is_finite(data, 3 * count) || !is_finite(place, 3) || !(fabs(norm - 1.0) < 1e-9) || !(scale > 0.0) ||
        !(rounding >= 0.0) || !isfinite(scale + rounding)) {
        PyErr_SetString(state->input_error,
                        "a convex body must have finite vertices and position in m, an orientation of norm 1, "
                        "a scale above 0 m and a rounding of at least 0 m");
        return false;
    }
    ces_convex_place(&body->convex, data, count, scale, rounding, place, turn);
    return true;
}

static bool parse_surface(const ModuleState *state, PyObject *source, Body *body)
{
    static const char *const shapes[] = {"plane", "box", "cylinder"};
    const char *shape;
    PyObject *position, *orientation, *size;
    ces_SurfaceDef def = {.name = "surface"};
    if (!PyArg_ParseTuple(source, "sOOO:surface", &shape, &position, &orientation, &size) ||
        !three(state, position, "position", 3, def.position) ||
        !three(state, orientation, "orientation", 4, def.orientation) || !three(state, size, "size", 3, def.size)) {
        return false;
    }
    int row = 0;
    while (row < 3 && strcmp(shape, shapes[row]) != 0) {
        row++;
    }
    if (row == 3) {
        PyErr_Format(state->input_error, "shape is '%s', must be plane, box or cylinder", shape);
        return false;
    }
    def.shape = (ces_SurfaceShape)row;
    ces_Error error;
    const ces_Status status = ces_surface_create(&def, &body->surface, &error);
    if (status != CES_OK) {
        raise_status(state, status, &error);
        return false;
    }
    ces_surface_place(&body->surface, 0.0, 1.0);
    body->is_surface = true;
    return true;
}

static bool parse_bodies(const ModuleState *state, PyObject *first, PyObject *second, Body *a, Body *b)
{
    memset(a, 0, sizeof *a);
    memset(b, 0, sizeof *b);
    if (!PyTuple_Check(first) || !PyTuple_Check(second)) {
        PyErr_SetString(state->input_error,
                        "a body must be a tuple (vertices, position, orientation, scale, rounding)");
        return false;
    }
    const bool is_surface = PyTuple_GET_SIZE(second) == 4;
    const bool good = parse_convex(state, first, a) &&
                      (is_surface ? parse_surface(state, second, b) : parse_convex(state, second, b));
    if (!good) {
        Py_CLEAR(a->vertices);
        Py_CLEAR(b->vertices);
    }
    return good;
}

PyObject *convex_distance(PyObject *module, PyObject *args)
{
    PyObject *first, *second;
    Body a, b;
    if (!PyArg_ParseTuple(args, "OO:convex_distance", &first, &second) ||
        !parse_bodies(PyModule_GetState(module), first, second, &a, &b)) {
        return NULL;
    }
    double n[3], p[3], q[3], gap;
    if (b.is_surface) {
        gap = ces_convex_surface_distance(&a.convex, &b.surface, a.convex.position, n, p);
        for (int k = 0; k < 3; k++) {
            q[k] = p[k] - gap * n[k];
        }
    } else {
        gap = ces_convex_distance(&a.convex, &b.convex, n, p, q);
    }
    Py_XDECREF(a.vertices);
    Py_XDECREF(b.vertices);
    return Py_BuildValue("d(ddd)(ddd)(ddd)", gap, n[0], n[1], n[2], p[0], p[1], p[2], q[0], q[1], q[2]);
}

PyObject *convex_manifold(PyObject *module, PyObject *args)
{
    PyObject *first, *second;
    double margin = 0.0;
    Body a, b;
    if (!PyArg_ParseTuple(args, "OO|d:convex_manifold", &first, &second, &margin) ||
        !parse_bodies(PyModule_GetState(module), first, second, &a, &b)) {
        return NULL;
    }
    ces_Manifold manifold;
    if (b.is_surface) {
        ces_convex_surface_manifold(&a.convex, &b.surface, margin, &manifold);
    } else {
        ces_convex_grains_manifold(&a.convex, &b.convex, margin, &manifold);
    }
    Py_XDECREF(a.vertices);
    Py_XDECREF(b.vertices);
    PyObject *list = PyList_New(manifold.count);
    for (int k = 0; list != NULL && k < manifold.count; k++) {
        const ces_ManifoldPoint *m = &manifold.points[k];
        PyObject *entry =
            Py_BuildValue("(ddd)(ddd)dII", m->point[0], m->point[1], m->point[2], m->normal[0], m->normal[1],
                          m->normal[2], m->gap, (unsigned int)m->sub_a, (unsigned int)m->sub_b);
        if (entry == NULL) {
            Py_CLEAR(list);
        } else {
            PyList_SET_ITEM(list, k, entry);
        }
    }
    return list;
}

PyObject *convex_approach(PyObject *module, PyObject *args)
{
    PyObject *first, *second, *way;
    const ModuleState *state = PyModule_GetState(module);
    double path[3];
    Body a, b;
    if (!PyArg_ParseTuple(args, "OOO:convex_approach", &first, &second, &way) || !three(state, way, "path", 3, path) ||
        !parse_bodies(state, first, second, &a, &b)) {
        return NULL;
    }
    ces_Approach approach;
    if (b.is_surface) {
        ces_approach_convex_surface(&a.convex, &b.surface, path, false, &approach);
    } else {
        ces_approach_convex(&a.convex, &b.convex, path, &approach);
    }
    Py_XDECREF(a.vertices);
    Py_XDECREF(b.vertices);
    return Py_BuildValue("{sOsdsdsdsdsN}", "hit", approach.hit ? Py_True : Py_False, "fraction", approach.fraction,
                         "gap", approach.gap, "start_gap", approach.start_gap, "least_gap", approach.least_gap,
                         "normal", Py_BuildValue("(ddd)", approach.normal[0], approach.normal[1], approach.normal[2]));
}
