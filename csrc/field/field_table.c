#include "field.h"

#include <assert.h>
#include <string.h>

static const ces_FieldRow *const rows[] = {
    &ces_two_cylinders_row,
};

size_t ces_field_count(void)
{
    return sizeof rows / sizeof rows[0];
}

const ces_FieldRow *ces_field_at(size_t index)
{
    assert(index < ces_field_count());
    return rows[index];
}

const ces_FieldRow *ces_field_find(const char *name)
{
    for (size_t index = 0; index < ces_field_count(); index++) {
        if (strcmp(rows[index]->name, name) == 0) {
            return rows[index];
        }
    }
    return NULL;
}
