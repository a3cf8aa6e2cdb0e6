/* python/convert.c - from Python values to C ones: numbers, texts, choices, arrays, and dicts by a table of fields. */
#include "convert.h"

#include <math.h>

/* ---- one value ------------------------------------------------------------------------------------------------------- */

int fail(const ModuleState *state, const char *format, const char *one, const char *other)
{
    PyErr_Format(state->input_error, format, one, other);
    return -1;
}

static int parse_number(const ModuleState *state, PyObject *value, const char *key, double *out)
{
    if (PyBool_Check(value) ||
        !(PyFloat_Check(value) || PyLong_Check(value) || PyIndex_Check(value) || PyArray_IsScalar(value, Floating))) {
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

static int parse_choice(const ModuleState *state, PyObject *value, const char *key, const char *const *choices,
                        int *out)
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
    case INDEX:
        if (parse_number(state, value, field->key, &number) < 0) {
            return -1;
        }
        if (!(number >= -1.0 && number <= 2147483647.0 && number == floor(number))) {
            return fail(state, "%s must be a whole number from -1 to 2147483647%s", field->key, "");
        }
        *(int32_t *)place = (int32_t)number;
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
int parse_struct(const ModuleState *state, PyObject *source, const char *what, const FieldSpec *fields,
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

PyObject *item(PyObject *dict, const char *key)
{
    PyObject *value = PyDict_GetItemString(dict, key);
    return value == Py_None ? NULL : value;
}

/* Memory that lives as long as the definition. */
void *hold(Definition *definition, size_t count, size_t size)
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
PyObject *hold_sequence(const ModuleState *state, Definition *definition, PyObject *source, const char *what,
                        size_t *count)
{
    PyObject *tuple = source == NULL                                  ? PyTuple_New(0)
                      : PyList_Check(source) || PyTuple_Check(source) ? PySequence_Tuple(source)
                                                                      : NULL;
    if (tuple == NULL) {
        PyErr_Format(state->input_error, "%s must be a list", what);
        return NULL;
    }
    const int status = PyList_Append(definition->holders, tuple);
    Py_DECREF(tuple);
    *count = (size_t)PyTuple_GET_SIZE(tuple);
    return status == 0 ? tuple : NULL;
}

PyArrayObject *array_of(const ModuleState *state, PyObject *source, int type, const char *what, int dimensions,
                        npy_intp first, npy_intp second)
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
            values[k] = (double)NAN;
        } else if (parse_number(state, value, names[k], &values[k]) < 0) {
            return -1;
        }
    }
    return 0;
}
