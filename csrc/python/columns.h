/* python/columns.h - the engine's memory as NumPy arrays. */
#ifndef CES_COLUMNS_H
#define CES_COLUMNS_H

#include "module.h"

#include "../scene/feeder.h"

PyObject *column_view(const ces_Scene *scene, ces_ColumnName name);      /* shares memory with the scene */
PyObject *block_array(const ces_Block *block);                           /* a copy */
PyObject *record_array(PyObject *dtype, const void *data, size_t count); /* a copy; data NULL: not filled */
PyObject *parts_array(const ces_Scene *scene, const ModuleState *state);
PyObject *joints_array(const ces_Scene *scene, const ModuleState *state);

#endif
