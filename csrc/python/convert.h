/* python/convert.h - from Python values to C ones, by tables of fields; what does not fit is an InputError. */
#ifndef CES_CONVERT_H
#define CES_CONVERT_H

#include "module.h"

typedef enum Kind { NUMBER, WHOLE32, INDEX, BOOLEAN, TEXT, CHOICE } Kind; /* INDEX: int32, -1 for none */

/* One key of a dict and its place in a struct. */
typedef struct FieldSpec {
    const char *key;
    Kind kind;
    size_t offset;
    int count;                  /* numbers: 1, or the length of a vector */
    const char *const *choices; /* CHOICE: names in the order of the enum, ends with NULL */
} FieldSpec;

extern const char *const material_kinds[]; /* in the order of ces_MaterialKind */

PyObject *item(PyObject *dict, const char *key); /* borrowed; NULL where it is missing or None */
int fail(const ModuleState *state, const char *format, const char *one, const char *other); /* -1 */

/* Fills base from a dict; unknown keys are refused, those in elsewhere (ends with NULL) are left to the caller. */
int parse_struct(const ModuleState *state, PyObject *source, const char *what, const FieldSpec *fields,
                 const char *const *elsewhere, void *base);

/* An array (n, width) of doubles that the definition holds; nothing where source is NULL. */
int hold_rows(const ModuleState *state, PyObject *source, const char *what, npy_intp width, Definition *definition,
              const double **place, size_t *count);

/* Puts the field of a dict, NULL for none, into a definition. */
int definition_add_field(const ModuleState *state, PyObject *source, Definition *definition);

/* Zeroed memory, and a list as a tuple (borrowed, its length in *count): both live as long as the definition. */
void *hold(Definition *definition, size_t count, size_t size);
PyObject *hold_sequence(const ModuleState *state, Definition *definition, PyObject *source, const char *what,
                        size_t *count);

/* feed_definition.c: the feed, where there is one. */
int definition_add_feed(const ModuleState *state, PyObject *source, Definition *definition);

#endif
