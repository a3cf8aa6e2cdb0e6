/*
 * python/scene_type.c - engine.Scene. Its equivalent in Python:
 *
 *     class Scene:
 *         def __init__(self, definition: dict, *, seed=1, threads=1): ...   # InputError, MemoryError
 *         def add(self, position, velocity, angular_velocity, material, diameter, charge, orientation=None, shape=None): ...   # -> ids
 *         def step(self, n=1): ...        # -> n; SimulationError, KeyboardInterrupt; the state is always one of a whole step
 *         def try_solver(self, solver, max_iterations=10000, tolerance=0, cold=False): ...   # -> dict; no step is made
 *         def landings(self, start=0): ...
 *         def state(self): ...            # -> dict of arrays; restore(state) is its inverse, bit for bit
 *         time, step_index, step_size, tolerance, count, threads, health, balance, contacts, stage_seconds, landing_count
 *         id, position, velocity, ...     # views of the columns
 */
#include "scene_object.h"

#include <time.h>

#define SIGNAL_INTERVAL 0.02 /* s between looks at the signals */

static double monotonic(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

static PyObject *scene_new(PyTypeObject *type, PyObject *args, PyObject *kwargs)
{
    static char *keywords[] = {"definition", "seed", "threads", NULL};
    PyObject *source, *seed = NULL;
    int threads = 1;
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "O|$Oi:Scene", keywords, &source, &seed, &threads)) {
        return NULL;
    }
    const ModuleState *state = PyType_GetModuleState(type);
    Definition definition;
    if (definition_parse(state, source, &definition) < 0) {
        return NULL;
    }
    definition.def.threads = threads;
    definition.def.clock = monotonic;
    if (seed != NULL) {
        definition.def.seed = PyLong_Check(seed) ? PyLong_AsUnsignedLongLong(seed) : 0;
        if (!PyLong_Check(seed) || PyErr_Occurred()) {
            PyErr_Clear();
            definition_free(&definition);
            return PyErr_Format(state->input_error, "seed is %R, must be a whole number from 0 to 2^64 - 1", seed);
        }
    }
    SceneObject *self = (SceneObject *)type->tp_alloc(type, 0);
    ces_Error error;
    if (self != NULL) {
        const ces_Status status = ces_scene_create(&definition.def, &self->scene, &error);
        if (status != CES_OK) {
            raise_status(state, status, &error);
            Py_CLEAR(self);
        }
    }
    definition_free(&definition);
    return (PyObject *)self;
}

static void scene_dealloc(SceneObject *self)
{
    PyTypeObject *type = Py_TYPE(self);
    ces_scene_destroy(self->scene);
    type->tp_free(self);
    Py_DECREF(type);
}

/* ---- verbs ----------------------------------------------------------------------------------------------------------------- */

static PyObject *scene_add(SceneObject *self, PyObject *args, PyObject *kwargs)
{
    enum { COLUMNS = 8 };
    static char *keywords[] = {
        "position", "velocity", "angular_velocity", "material", "diameter", "charge", "orientation", "shape", NULL};
    static const struct {
        int type, dimensions;
        npy_intp width;
    } forms[COLUMNS] = {{NPY_DOUBLE, 2, 3}, {NPY_DOUBLE, 2, 3}, {NPY_DOUBLE, 2, 3}, {NPY_INT32, 1, 0},
                        {NPY_DOUBLE, 1, 0}, {NPY_DOUBLE, 1, 0}, {NPY_DOUBLE, 2, 4}, {NPY_INT32, 1, 0}};
    PyObject *sources[COLUMNS] = {NULL}, *ids = NULL;
    PyArrayObject *arrays[COLUMNS] = {NULL};
    if (!scene_is_free(self) ||
        !PyArg_ParseTupleAndKeywords(args, kwargs, "OOOOOO|OO:add", keywords, &sources[0], &sources[1], &sources[2],
                                     &sources[3], &sources[4], &sources[5], &sources[6], &sources[7])) {
        return NULL;
    }
    const ModuleState *state = module_state_of((PyObject *)self);
    npy_intp count = -1;
    for (int k = 0; k < COLUMNS; k++) {
        if (sources[k] == NULL) {
            continue;
        }
        arrays[k] = array_of(state, sources[k], forms[k].type, keywords[k], forms[k].dimensions, count, forms[k].width);
        if (arrays[k] == NULL) {
            goto done;
        }
        count = PyArray_DIM(arrays[k], 0);
    }
    ids = PyArray_SimpleNew(1, &count, NPY_INT64);
    if (ids != NULL) {
        const ces_GrainsDef grains = {
            .position = PyArray_DATA(arrays[0]),
            .velocity = PyArray_DATA(arrays[1]),
            .angular_velocity = PyArray_DATA(arrays[2]),
            .material = PyArray_DATA(arrays[3]),
            .diameter = PyArray_DATA(arrays[4]),
            .charge = PyArray_DATA(arrays[5]),
            .orientation = arrays[6] != NULL ? PyArray_DATA(arrays[6]) : NULL,
            .shape = arrays[7] != NULL ? PyArray_DATA(arrays[7]) : NULL,
        };
        ces_Error error;
        const ces_Status status =
            ces_scene_add(self->scene, (size_t)count, &grains, PyArray_DATA((PyArrayObject *)ids), &error);
        if (status != CES_OK) {
            Py_CLEAR(ids);
            raise_status(state, status, &error);
        }
    }
done:
    for (int k = 0; k < COLUMNS; k++) {
        Py_XDECREF(arrays[k]);
    }
    return ids;
}

static PyObject *scene_step(SceneObject *self, PyObject *args, PyObject *kwargs)
{
    static char *keywords[] = {"n", NULL};
    Py_ssize_t n = 1;
    if (!scene_is_free(self) || !PyArg_ParseTupleAndKeywords(args, kwargs, "|n:step", keywords, &n)) {
        return NULL;
    }
    const ModuleState *state = module_state_of((PyObject *)self);
    if (n < 0) {
        return PyErr_Format(state->input_error, "n is %zd steps, must not be negative", n);
    }
    for (Py_ssize_t done = 0; done < n;) {
        ces_Status status = CES_OK;
        ces_Error error;
        self->busy = true;
        Py_BEGIN_ALLOW_THREADS const double start = monotonic();
        while (status == CES_OK && done < n && monotonic() - start < SIGNAL_INTERVAL) {
            status = ces_scene_step(self->scene, &error);
            done += status == CES_OK;
        }
        Py_END_ALLOW_THREADS self->busy = false;
        if (status != CES_OK) {
            return raise_status(state, status, &error);
        }
        if (PyErr_CheckSignals() < 0) {
            return NULL;
        }
    }
    return PyLong_FromSsize_t(n);
}

static PyObject *scene_try_solver(SceneObject *self, PyObject *args, PyObject *kwargs)
{
    static char *keywords[] = {"solver", "max_iterations", "tolerance", "cold", NULL};
    const char *name;
    unsigned int max_iterations = 10000;
    double tolerance = 0.0;
    int cold = 0;
    if (!scene_is_free(self) || !PyArg_ParseTupleAndKeywords(args, kwargs, "s|Idp:try_solver", keywords, &name,
                                                             &max_iterations, &tolerance, &cold)) {
        return NULL;
    }
    ces_Trial trial;
    ces_Error error;
    ces_Status status;
    self->busy = true;
    Py_BEGIN_ALLOW_THREADS status =
        ces_scene_try_solver(self->scene, name, max_iterations, tolerance, cold != 0, &trial, &error);
    Py_END_ALLOW_THREADS self->busy = false;
    if (status != CES_OK) {
        return raise_status(module_state_of((PyObject *)self), status, &error);
    }
    return Py_BuildValue("{sKsKsdsdsdsO}", "contacts", trial.contacts, "iterations", trial.iterations, "residual",
                         trial.residual, "objective", trial.objective, "seconds", trial.seconds, "converged",
                         trial.converged ? Py_True : Py_False);
}

static PyObject *scene_landings(SceneObject *self, PyObject *args, PyObject *kwargs)
{
    static char *keywords[] = {"start", NULL};
    Py_ssize_t start = 0;
    if (!scene_is_free(self) || !PyArg_ParseTupleAndKeywords(args, kwargs, "|n:landings", keywords, &start)) {
        return NULL;
    }
    const ModuleState *state = module_state_of((PyObject *)self);
    const size_t count = ces_scene_landing_count(self->scene);
    if (start < 0 || (size_t)start > count) {
        return PyErr_Format(state->input_error, "start is %zd, outside [0, %zu]", start, count);
    }
    const ces_Landing *landings = ces_scene_landings(self->scene);
    return record_array(state->landing_type, landings == NULL ? NULL : landings + start, count - (size_t)start);
}

static PyObject *scene_state_hash(SceneObject *self, PyObject *unused)
{
    (void)unused;
    return scene_is_free(self) ? PyLong_FromUnsignedLongLong(ces_scene_state_hash(self->scene)) : NULL;
}

static PyObject *scene_state(SceneObject *self, PyObject *unused)
{
    (void)unused;
    if (!scene_is_free(self)) {
        return NULL;
    }
    PyObject *blocks = PyDict_New();
    for (size_t k = 0; blocks != NULL && k < ces_scene_block_count(self->scene); k++) {
        ces_Block block;
        ces_Error error;
        const ces_Status status = ces_scene_block(self->scene, k, &block, &error);
        if (status != CES_OK) {
            Py_DECREF(blocks);
            return raise_status(module_state_of((PyObject *)self), status, &error);
        }
        PyObject *array = block_array(&block);
        if (array == NULL || PyDict_SetItemString(blocks, block.name, array) < 0) {
            Py_CLEAR(blocks);
        }
        Py_XDECREF(array);
    }
    return blocks;
}

/* The blocks of a state in the order of the scene; the arrays come in holders, which owns them. */
static bool gather_blocks(const SceneObject *self, const ModuleState *state, PyObject *source, PyObject *holders,
                          ces_Block *blocks)
{
    for (size_t k = 0; k < ces_scene_block_count(self->scene); k++) {
        ces_Error error;
        const ces_Status status = ces_scene_block(self->scene, k, &blocks[k], &error);
        if (status != CES_OK) {
            raise_status(state, status, &error);
            return false;
        }
        PyObject *value = PyDict_GetItemString(source, blocks[k].name);
        if (value == NULL) {
            PyErr_Format(state->input_error, "the state has no block '%s'", blocks[k].name);
            return false;
        }
        const int type = blocks[k].type == CES_DOUBLE  ? NPY_DOUBLE
                         : blocks[k].type == CES_INT32 ? NPY_INT32
                                                       : NPY_INT64;
        PyArrayObject *array =
            array_of(state, value, type, blocks[k].name, blocks[k].width > 1 ? 2 : 1, -1, (npy_intp)blocks[k].width);
        if (array == NULL) {
            return false;
        }
        const int added = PyList_Append(holders, (PyObject *)array);
        Py_DECREF(array);
        if (added < 0) {
            return false;
        }
        blocks[k].count = (size_t)PyArray_DIM(array, 0);
        blocks[k].data = PyArray_DATA(array);
    }
    return true;
}

static PyObject *scene_restore(SceneObject *self, PyObject *source)
{
    if (!scene_is_free(self)) {
        return NULL;
    }
    const ModuleState *state = module_state_of((PyObject *)self);
    if (!PyDict_Check(source)) {
        return PyErr_Format(state->input_error, "a state is a dict of arrays, not a %s", Py_TYPE(source)->tp_name);
    }
    const size_t count = ces_scene_block_count(self->scene);
    ces_Block *blocks = PyMem_Calloc(count, sizeof *blocks);
    PyObject *holders = PyList_New(0), *answer = NULL;
    if (blocks == NULL || holders == NULL) {
        PyErr_NoMemory();
    } else if (gather_blocks(self, state, source, holders, blocks)) {
        ces_Error error;
        const ces_Status status = ces_scene_restore(self->scene, blocks, count, &error);
        answer = status == CES_OK ? Py_NewRef(Py_None) : raise_status(state, status, &error);
    }
    PyMem_Free(blocks);
    Py_XDECREF(holders);
    return answer;
}

static PyMethodDef scene_methods[] = {
    {"add", (PyCFunction)(void (*)(void))scene_add, METH_VARARGS | METH_KEYWORDS,
     "add(position, velocity, angular_velocity, material, diameter, charge, orientation=None, shape=None) -> ids, all or none"},
    {"step", (PyCFunction)(void (*)(void))scene_step, METH_VARARGS | METH_KEYWORDS, "step(n=1) -> n"},
    {"try_solver", (PyCFunction)(void (*)(void))scene_try_solver, METH_VARARGS | METH_KEYWORDS,
     "try_solver(solver, max_iterations=10000, tolerance=0, cold=False) -> dict: how it does on the contacts of the next "
     "step, which is not made"},
    {"landings", (PyCFunction)(void (*)(void))scene_landings, METH_VARARGS | METH_KEYWORDS,
     "landings(start=0) -> structured array, what landed or was lost so far"},
    {"state_hash", (PyCFunction)scene_state_hash, METH_NOARGS, "state_hash() -> int, of every bit of the state"},
    {"state", (PyCFunction)scene_state, METH_NOARGS, "state() -> dict of arrays, the whole state"},
    {"restore", (PyCFunction)scene_restore, METH_O,
     "restore(state): the inverse of state(), bit for bit; all or nothing"},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot scene_slots[] = {
    {Py_tp_doc, "Scene(definition, *, seed=1, threads=1): grains, machine and field, stepped by the engine."},
    {Py_tp_new, scene_new},
    {Py_tp_dealloc, scene_dealloc},
    {Py_tp_methods, scene_methods},
    {Py_tp_getset, scene_attributes},
    {0, NULL},
};

PyType_Spec scene_spec = {
    .name = "cesim.engine.Scene",
    .basicsize = sizeof(SceneObject),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE,
    .slots = scene_slots,
};
