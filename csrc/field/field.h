/*
 * field/field.h - the electric field at a point. One file per source, one row each in field_table.c.
 *
 * A field is a const row and a block of memory of row->state_size bytes that the scene owns; sampling reads it only. What
 * start takes beyond that block (a grid's numbers) stop gives back.
 */
#ifndef CES_FIELD_H
#define CES_FIELD_H

#include "../cesim.h"

typedef struct ces_FieldRow {
    const char *name, *doc;
    size_t state_size;
    ces_Status (*start)(const ces_FieldDef *def, void *state, ces_Error *error);
    void (*field)(const void *state, const double position[3], double field[3]); /* m -> V/m, finite everywhere */
    double (*potential)(const void *state, const double position[3]);            /* m -> V */
    /* Of the square of the field, m -> V2/m3; NULL: those who need it take a difference. */
    void (*square_gradient)(const void *state, const double position[3], double gradient[3]);
    void (*stop)(void *state); /* frees what start took, also after a start that failed; NULL: it took nothing */
} ces_FieldRow;

extern const ces_FieldRow ces_two_cylinders_row, ces_grid_row, ces_conductors_row;

/* A conductor has no field inside, but a grain pressed a micrometre into the drum must feel the surface's. So a point inside a
 * cylinder, given from its axis, is moved radially to the surface; from the very axis, along (facing, 0). */
void ces_field_leave_cylinder(double radius, double facing, double from_axis[2]);

const ces_FieldRow *ces_field_find(const char *name); /* NULL: no such row */
size_t ces_field_count(void);
const ces_FieldRow *ces_field_at(size_t index);

#endif
