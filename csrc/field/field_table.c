#include "field.h"

#include <assert.h>
#include <math.h>
#include <string.h>

static const ces_FieldRow *const rows[] = {
    &ces_two_cylinders_row,
    &ces_conductors_row,
    &ces_grid_row,
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

void ces_field_leave_cylinder(double radius, double facing, double from_axis[2])
{
    const double x = from_axis[0], y = from_axis[1];
    const double square = x * x + y * y;
    if (square >= radius * radius) {
        return;
    }
    const double length = sqrt(square);
    from_axis[0] = length > 0.0 ? x * (radius / length) : facing * radius;
    from_axis[1] = length > 0.0 ? y * (radius / length) : 0.0;
}
