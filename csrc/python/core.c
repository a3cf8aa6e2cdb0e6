/*
 * python/core.c - the module cesim.engine: scene, feeder, field and step functions, NumPy arrays in and out.
 *
 *     class Scene; class Field                       # scene_type.c, field_type.c
 *     class InputError(ValueError); class SimulationError(RuntimeError)
 *     effects(), effect_size(), distributions(), quantile(), ...      # tables.c
 *     contact_solvers(), solve_cone()                                 # contact_functions.c
 *     mesh_contacts(), mesh_distance(), mesh_query()                  # mesh.c
 */
#define CES_MODULE_MAIN
#include "module.h"

static struct PyModuleDef module_def;

static int module_exec(PyObject *module)
{
    if (PyArray_ImportNumPyAPI() < 0) {
        return -1;
    }
    ModuleState *state = PyModule_GetState(module);
    state->input_error =
        PyErr_NewExceptionWithDoc("cesim.engine.InputError", "Input outside what it may be.", PyExc_ValueError, NULL);
    state->simulation_error = PyErr_NewExceptionWithDoc("cesim.engine.SimulationError",
                                                        "A step could not be made; the state is the one before it.",
                                                        PyExc_RuntimeError, NULL);
    state->scene_type = (PyTypeObject *)PyType_FromModuleAndSpec(module, &scene_spec, NULL);
    state->field_type = (PyTypeObject *)PyType_FromModuleAndSpec(module, &field_spec, NULL);
    if (fill_dtypes(state) < 0 || PyModule_AddObjectRef(module, "InputError", state->input_error) < 0 ||
        PyModule_AddObjectRef(module, "SimulationError", state->simulation_error) < 0 || state->scene_type == NULL ||
        state->field_type == NULL || PyModule_AddType(module, state->scene_type) < 0 ||
        PyModule_AddType(module, state->field_type) < 0 || PyModule_AddFunctions(module, contact_functions) < 0 ||
        PyModule_AddFunctions(module, mesh_functions) < 0 || PyModule_AddFunctions(module, crowd_functions) < 0) {
        return -1;
    }
    return 0;
}

static int module_traverse(PyObject *module, visitproc visit, void *arg)
{
    ModuleState *state = PyModule_GetState(module);
    Py_VISIT(state->input_error);
    Py_VISIT(state->simulation_error);
    Py_VISIT(state->part_type);
    Py_VISIT(state->joint_type);
    Py_VISIT(state->landing_type);
    Py_VISIT(state->contact_type);
    Py_VISIT(state->birth_type);
    Py_VISIT(state->scene_type);
    Py_VISIT(state->field_type);
    return 0;
}

static int module_clear(PyObject *module)
{
    ModuleState *state = PyModule_GetState(module);
    Py_CLEAR(state->input_error);
    Py_CLEAR(state->simulation_error);
    Py_CLEAR(state->part_type);
    Py_CLEAR(state->joint_type);
    Py_CLEAR(state->landing_type);
    Py_CLEAR(state->contact_type);
    Py_CLEAR(state->birth_type);
    Py_CLEAR(state->scene_type);
    Py_CLEAR(state->field_type);
    return 0;
}

static void module_free(void *module)
{
    module_clear(module);
}

ModuleState *module_state_of(PyObject *object)
{
    return PyType_GetModuleState(Py_TYPE(object));
}

PyObject *raise_status(const ModuleState *state, ces_Status status, const ces_Error *error)
{
    switch (status) {
    case CES_OK:
        break;
    case CES_INPUT:
        PyErr_SetString(state->input_error, error->text);
        break;
    case CES_MEMORY:
        PyErr_NoMemory();
        break;
    case CES_DIVERGED:
    case CES_FEED:
        PyErr_SetString(state->simulation_error, error->text);
        break;
    }
    return NULL;
}

static PyModuleDef_Slot module_slots[] = {
    {Py_mod_exec, module_exec},
    {0, NULL},
};

static struct PyModuleDef module_def = {
    PyModuleDef_HEAD_INIT,
    .m_name = "cesim.engine",
    .m_doc = "The C engine: NumPy arrays in SI units in, NumPy arrays out.",
    .m_size = sizeof(ModuleState),
    .m_methods = module_functions,
    .m_slots = module_slots,
    .m_traverse = module_traverse,
    .m_clear = module_clear,
    .m_free = module_free,
};

PyMODINIT_FUNC PyInit_engine(void);

PyMODINIT_FUNC PyInit_engine(void)
{
    return PyModuleDef_Init(&module_def);
}
