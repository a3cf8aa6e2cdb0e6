/* python/crowd_functions.c - the forces of charged grains on each other by themselves: to try a method, and to check it. */
#include "module.h"

#include "../base/memory.h"
#include "../base/status.h"

/* The arrays of a crowd, as long as each other. */
typedef struct CrowdArrays {
    PyArrayObject *position, *charge, *diameter;
} CrowdArrays;

static bool take_arrays(const ModuleState *state, PyObject *position, PyObject *charge, PyObject *diameter,
                        CrowdArrays *arrays)
{
    arrays->position = array_of(state, position, NPY_DOUBLE, "position", 2, -1, 3);
    const npy_intp count = arrays->position != NULL ? PyArray_DIM(arrays->position, 0) : 0;
    arrays->charge = arrays->position != NULL ? array_of(state, charge, NPY_DOUBLE, "charge", 1, count, 0) : NULL;
    arrays->diameter = arrays->charge != NULL ? array_of(state, diameter, NPY_DOUBLE, "diameter", 1, count, 0) : NULL;
    return arrays->diameter != NULL;
}

static void drop_arrays(CrowdArrays *arrays)
{
    Py_XDECREF(arrays->position);
    Py_XDECREF(arrays->charge);
    Py_XDECREF(arrays->diameter);
}

/* The forces, and the error on the sample of this step. */
static PyObject *forces_of(const void *effect_state, const CrowdArrays *arrays, int threads, uint64_t step)
{
    PyObject *force = PyArray_ZEROS(2, PyArray_DIMS(arrays->position), NPY_DOUBLE, 0);
    if (force == NULL) {
        return NULL;
    }
    const ces_Crowd crowd = {
        .count = (size_t)PyArray_DIM(arrays->position, 0),
        .position = PyArray_DATA(arrays->position),
        .charge = PyArray_DATA(arrays->charge),
        .diameter = PyArray_DATA(arrays->diameter),
        .step = step,
        .threads = threads,
    };
    double *out = PyArray_DATA((PyArrayObject *)force);
    ces_Pool pools[CES_CROWD_POOLS] = {{0}};
    ces_CrowdError crowd_error = {0.0, 0.0};
    bool enough;
    Py_BEGIN_ALLOW_THREADS;
    enough = ces_pair_coulomb.prepare(effect_state, &crowd, pools, out, &crowd_error);
    Py_END_ALLOW_THREADS;
    for (size_t k = 0; k < CES_CROWD_POOLS; k++) {
        ces_pool_free(&pools[k]);
    }
    if (!enough) {
        Py_DECREF(force);
        return PyErr_NoMemory();
    }
    const double relative = crowd_error.force > 0.0 ? sqrt(crowd_error.defect / crowd_error.force) : 0.0;
    return Py_BuildValue("Nd", force, relative);
}

static PyObject *pair_forces(PyObject *module, PyObject *args, PyObject *kwargs)
{
    static char *keywords[] = {"position",    "charge",  "diameter", "parameters", "drum_axis",
                               "drum_radius", "threads", "step",     NULL};
    PyObject *position, *charge, *diameter, *parameters = NULL;
    ces_SceneDef def = {.drum_radius = 0.0};
    int threads = 1;
    unsigned long long step = 0;
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "OOO|O(dd)diK:pair_forces", keywords, &position, &charge, &diameter,
                                     &parameters, &def.drum_axis[0], &def.drum_axis[1], &def.drum_radius, &threads,
                                     &step)) {
        return NULL;
    }
    const ModuleState *state = PyModule_GetState(module);
    const ces_Effect *effect = &ces_pair_coulomb;
    double values[CES_MAX_EFFECT_PARAMETERS];
    if (effect_parameters_parse(state, parameters, effect, values) < 0) {
        return NULL;
    }
    ces_Error error;
    void *effect_state = ces_alloc(1, effect->state_size);
    CrowdArrays arrays = {NULL, NULL, NULL};
    PyObject *answer = NULL;
    ces_Status status =
        effect_state == NULL ? CES_MEMORY : ces_check_range(&error, "threads", threads, 1.0, 1024.0, "");
    if (status == CES_OK) {
        status = ces_effect_check(effect, &def, values, &error);
    }
    if (status == CES_OK) {
        status = effect->start(&def, values, effect_state, &error);
    }
    if (status != CES_OK) {
        raise_status(state, status, &error);
    } else if (take_arrays(state, position, charge, diameter, &arrays)) {
        answer = forces_of(effect_state, &arrays, threads, step);
    }
    drop_arrays(&arrays);
    ces_free(effect_state);
    return answer;
}

PyMethodDef crowd_functions[] = {
    {"pair_forces", (PyCFunction)(void (*)(void))pair_forces, METH_VARARGS | METH_KEYWORDS,
     "pair_forces(position, charge, diameter, parameters=None, drum_axis=(0, 0), drum_radius=0, threads=1, step=0) -> "
     "((n, 3) N, relative error on a sample): of charged spheres on each other, as the effect pair_coulomb has them"},
    {NULL, NULL, 0, NULL},
};
