/* python/field_definition.c - the electric field of a definition from a dict. */
#include "convert.h"

#define AT(type, member) offsetof(type, member)
/* clang-format off */
static const FieldSpec electric_fields[] = {
    {"kind", TEXT, AT(ces_FieldDef, kind), 1, NULL},
    {"drum_radius", NUMBER, AT(ces_FieldDef, drum_radius), 1, NULL},
    {"electrode_radius", NUMBER, AT(ces_FieldDef, electrode_radius), 1, NULL},
    {"distance", NUMBER, AT(ces_FieldDef, distance), 1, NULL},
    {"angle", NUMBER, AT(ces_FieldDef, angle), 1, NULL},
    {"voltage", NUMBER, AT(ces_FieldDef, voltage), 1, NULL},
    {"drum_center", NUMBER, AT(ces_FieldDef, drum_center), 2, NULL},
    {"origin", NUMBER, AT(ces_FieldDef, origin), 3, NULL},
    {"spacing", NUMBER, AT(ces_FieldDef, spacing), 3, NULL},
    {"constant", NUMBER, AT(ces_FieldDef, constant), 1, NULL},
    {"box", NUMBER, AT(ces_FieldDef, box), 4, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
/* clang-format on */

/* The potential of a grid, (nx, ny, nz) V, which the definition keeps. */
static int parse_grid(const ModuleState *state, PyObject *source, Definition *definition)
{
    ces_FieldDef *field = &definition->def.field;
    if (source == NULL) {
        return 0;
    }
    PyArrayObject *array = (PyArrayObject *)PyArray_FROM_OTF(source, NPY_DOUBLE, NPY_ARRAY_IN_ARRAY);
    if (array == NULL || PyList_Append(definition->holders, (PyObject *)array) < 0) {
        Py_XDECREF(array);
        return -1;
    }
    Py_DECREF(array);
    if (PyArray_NDIM(array) != 3) {
        return fail(state, "field.values must have three axes, x, y and z%s%s", "", "");
    }
    for (int k = 0; k < 3; k++) {
        const npy_intp count = PyArray_DIM(array, k);
        field->counts[k] = count > UINT32_MAX ? UINT32_MAX : (uint32_t)count;
    }
    field->values = PyArray_DATA(array);
    return 0;
}

int definition_add_field(const ModuleState *state, PyObject *source, Definition *definition)
{
    static const char *const elsewhere[] = {"values", "circles", "poles", "series", "terms", NULL};
    if (source == NULL) {
        return 0;
    }
    if (parse_struct(state, source, "field", electric_fields, elsewhere, &definition->def.field) < 0) {
        return -1;
    }
    ces_FieldDef *field = &definition->def.field;
    const struct {
        const char *key;
        npy_intp width;
        const double **place;
        size_t *count;
    } tables[] = {
        {"circles", 4, &field->circles, &field->circle_count},
        {"poles", 3, &field->poles, &field->pole_count},
        {"series", 5, &field->series, &field->series_count},
        {"terms", 2, &field->terms, &field->term_count},
    };
    for (size_t k = 0; k < sizeof tables / sizeof tables[0]; k++) {
        if (hold_rows(state, item(source, tables[k].key), tables[k].key, tables[k].width, definition, tables[k].place,
                      tables[k].count) < 0) {
            return -1;
        }
    }
    return parse_grid(state, item(source, "values"), definition);
}
