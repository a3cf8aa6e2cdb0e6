/*
 * python/field_type.c - engine.Field. Its equivalent in Python:
 *
 *     class Field:
 *         def __init__(self, definition: dict): ...   # InputError
 *         def field(self, points): ...                # (n, 3) m -> (n, 3) V/m
 *         def potential(self, points): ...            # (n, 3) m -> (n,) V
 */
#include "module.h"

#include "../base/memory.h"
#include "../field/field.h"

typedef struct FieldObject {
    PyObject_HEAD const ces_FieldRow *row;
    void *state;
} FieldObject;

static PyObject *start(const ModuleState *state, PyTypeObject *type, const ces_FieldDef *def)
{
    const ces_FieldRow *row = ces_field_find(def->kind);
    if (row == NULL) {
        return PyErr_Format(state->input_error, "field.kind is '%s', no such field", def->kind);
    }
    FieldObject *self = (FieldObject *)type->tp_alloc(type, 0);
    if (self == NULL) {
        return NULL;
    }
    self->row = row;
    self->state = ces_alloc(1, row->state_size);
    ces_Error error;
    const ces_Status status = self->state == NULL ? CES_MEMORY : row->start(def, self->state, &error);
    if (status != CES_OK) {
        Py_DECREF(self);
        return raise_status(state, status, &error);
    }
    return (PyObject *)self;
}

static PyObject *field_new(PyTypeObject *type, PyObject *args, PyObject *kwargs)
{
    static char *keywords[] = {"definition", NULL};
    PyObject *source;
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "O:Field", keywords, &source)) {
        return NULL;
    }
    const ModuleState *state = PyType_GetModuleState(type);
    Definition definition;
    if (definition_parse_field(state, source, &definition) < 0) {
        return NULL;
    }
    PyObject *self = start(state, type, &definition.def.field);
    definition_free(&definition);
    return self;
}

static void field_dealloc(FieldObject *self)
{
    PyTypeObject *type = Py_TYPE(self);
    if (self->state != NULL && self->row->stop != NULL) {
        self->row->stop(self->state);
    }
    ces_free(self->state);
    type->tp_free(self);
    Py_DECREF(type);
}

static PyObject *field_field(FieldObject *self, PyObject *source)
{
    PyArrayObject *points = array_of(module_state_of((PyObject *)self), source, NPY_DOUBLE, "points", 2, -1, 3);
    if (points == NULL) {
        return NULL;
    }
    PyObject *values = PyArray_SimpleNew(2, PyArray_DIMS(points), NPY_DOUBLE);
    for (npy_intp k = 0; values != NULL && k < PyArray_DIM(points, 0); k++) {
        self->row->field(self->state, PyArray_GETPTR2(points, k, 0), PyArray_GETPTR2((PyArrayObject *)values, k, 0));
    }
    Py_DECREF(points);
    return values;
}

static PyObject *field_potential(FieldObject *self, PyObject *source)
{
    PyArrayObject *points = array_of(module_state_of((PyObject *)self), source, NPY_DOUBLE, "points", 2, -1, 3);
    if (points == NULL) {
        return NULL;
    }
    PyObject *values = PyArray_SimpleNew(1, PyArray_DIMS(points), NPY_DOUBLE);
    for (npy_intp k = 0; values != NULL && k < PyArray_DIM(points, 0); k++) {
        *(double *)PyArray_GETPTR1((PyArrayObject *)values, k) =
            self->row->potential(self->state, PyArray_GETPTR2(points, k, 0));
    }
    Py_DECREF(points);
    return values;
}

static PyMethodDef field_methods[] = {
    {"field", (PyCFunction)field_field, METH_O, "field(points): (n, 3) m -> (n, 3) V/m"},
    {"potential", (PyCFunction)field_potential, METH_O, "potential(points): (n, 3) m -> (n,) V"},
    {NULL, NULL, 0, NULL},
};

static PyType_Slot field_slots[] = {
    {Py_tp_doc, "Field(definition): the electric field and its potential at points."},
    {Py_tp_new, field_new},
    {Py_tp_dealloc, field_dealloc},
    {Py_tp_methods, field_methods},
    {0, NULL},
};

PyType_Spec field_spec = {
    .name = "cesim.engine.Field",
    .basicsize = sizeof(FieldObject),
    .flags = Py_TPFLAGS_DEFAULT | Py_TPFLAGS_IMMUTABLETYPE,
    .slots = field_slots,
};
