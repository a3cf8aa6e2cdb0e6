/* python/module.h - what the files of the CPython module share. */
#ifndef CES_MODULE_H
#define CES_MODULE_H

#define PY_SSIZE_T_CLEAN
#include <Python.h>

#define NPY_NO_DEPRECATED_API NPY_2_0_API_VERSION
#define PY_ARRAY_UNIQUE_SYMBOL cesim_array_api
#ifndef CES_MODULE_MAIN
#define NO_IMPORT_ARRAY
#endif
#include <numpy/arrayobject.h>

#include "../effects/effect.h"

typedef struct ModuleState {
    PyObject *input_error;      /* ValueError: a definition or an argument is outside what it may be */
    PyObject *simulation_error; /* RuntimeError: a step could not be made; the state is the one before it */
    PyObject *landing_type, *contact_type, *birth_type, *part_type, *joint_type; /* numpy.dtype */
    PyTypeObject *scene_type, *field_type;
} ModuleState;

ModuleState *module_state_of(PyObject *object); /* of an object whose type is the module's */
int fill_dtypes(ModuleState *state);            /* 0, or -1 with an exception */

/* Turns a status that is not CES_OK into its exception; gives NULL. */
PyObject *raise_status(const ModuleState *state, ces_Status status, const ces_Error *error);

extern PyType_Spec scene_spec, field_spec;

/* ---- convert.c: from Python to definitions ------------------------------------------------------------------------ */

/* A definition, and what holds the arrays that it borrows. */
typedef struct Definition {
    ces_SceneDef def;
    PyObject *holders; /* list */
} Definition;

int definition_parse(const ModuleState *state, PyObject *source, Definition *definition);
int definition_parse_field(const ModuleState *state, PyObject *field, Definition *definition);
int definition_parse_feed(const ModuleState *state, PyObject *feed, PyObject *materials, PyObject *shapes,
                          Definition *definition);
void definition_free(Definition *definition);

/* A fresh or borrowed C-contiguous array of this type and shape (-1: any length); NULL with InputError. */
PyArrayObject *array_of(const ModuleState *state, PyObject *source, int type, const char *what, int dimensions,
                        npy_intp first, npy_intp second);
/* Parameters by name, in the order of names (ends with NULL); presets where one is missing. */
int parameters_parse(const ModuleState *state, PyObject *source, const char *owner, const char *const *names,
                     const double *presets, double *values);

/* The parameters of an effect, in the order of its row. */
int effect_parameters_parse(const ModuleState *state, PyObject *source, const ces_Effect *row, double *values);

/* ---- tables.c: module functions --------------------------------------------------------------------------------------- */

extern PyMethodDef module_functions[];

/* ---- contact_functions.c: a contact problem by itself -------------------------------------------------------------------- */

extern PyMethodDef contact_functions[];

/* ---- crowd_functions.c: forces between grains by themselves --------------------------------------------------------------- */

extern PyMethodDef crowd_functions[];

/* ---- convex_functions.c ------------------------------------------------------------------------------------------------ */

PyObject *convex_distance(PyObject *module, PyObject *args);
PyObject *convex_manifold(PyObject *module, PyObject *args);
PyObject *convex_approach(PyObject *module, PyObject *args);
/* ---- mesh.c: a mesh by itself ------------------------------------------------------------------------------------------- */

extern PyMethodDef mesh_functions[];

#endif
