/* python/feed_definition.c - the feed of a definition from a dict. */
#include "convert.h"

#include <math.h>

#include "../scene/distribution.h"

static const char *const rate_kinds[] = {"mass", "count", NULL};

#define AT(type, member) offsetof(type, member)
/* clang-format off */
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
    {"shape", WHOLE32, AT(ces_FamilyDef, shape), 1, NULL},
    {"mass_fraction", NUMBER, AT(ces_FamilyDef, mass_fraction), 1, NULL},
    {"distribution", TEXT, AT(ces_FamilyDef, distribution), 1, NULL},
    {"least", NUMBER, AT(ces_FamilyDef, least), 1, NULL},
    {"most", NUMBER, AT(ces_FamilyDef, most), 1, NULL},
    {"charge", TEXT, AT(ces_FamilyDef, charge), 1, NULL},
    {"charge_per_surface", BOOLEAN, AT(ces_FamilyDef, charge_per_surface), 1, NULL},
    {NULL, NUMBER, 0, 0, NULL},
};
/* clang-format on */

/* The parameters of a family's law of charges, in the order of the law of diameters of that name. */
static int parse_charge(const ModuleState *state, PyObject *source, ces_FamilyDef *family)
{
    const ces_Distribution *row = family->charge[0] != '\0' ? ces_distribution_find(family->charge) : NULL;
    if (row == NULL) {
        return 0; /* no law, or an unknown one, which the feeder refuses */
    }
    PyArrayObject *values =
        array_of(state, item(source, "charge_parameters"), NPY_DOUBLE, "charge_parameters", 1, -1, 0);
    if (values == NULL) {
        return -1;
    }
    const npy_intp count = PyArray_DIM(values, 0);
    for (npy_intp k = 0; k < count && k < CES_MAX_DISTRIBUTION_PARAMETERS; k++) {
        family->charge_parameters[k] = *(const double *)PyArray_GETPTR1(values, k);
    }
    Py_DECREF(values);
    return 0;
}

static int parse_family(const ModuleState *state, PyObject *source, ces_FamilyDef *family, Definition *definition)
{
    static const char *const elsewhere[] = {"parameters", "table", "charge_parameters", "charge_table", NULL};
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
    if (hold_rows(state, item(source, "table"), "table", 2, definition, &family->table, &family->table_count) < 0 ||
        hold_rows(state, item(source, "charge_table"), "charge_table", 2, definition, &family->charge_table,
                  &family->charge_table_count) < 0) {
        return -1;
    }
    return parse_charge(state, source, family);
}

int definition_add_feed(const ModuleState *state, PyObject *source, Definition *definition)
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
