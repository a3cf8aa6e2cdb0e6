/* python/scene_object.h - what the files of engine.Scene share. */
#ifndef CES_SCENE_OBJECT_H
#define CES_SCENE_OBJECT_H

#include "columns.h"

typedef struct SceneObject {
    PyObject_HEAD ces_Scene *scene;
    bool busy; /* a step runs without the GIL; set and read with it */
} SceneObject;

bool scene_is_free(const SceneObject *self); /* false with RuntimeError: another thread is stepping it */

extern PyGetSetDef scene_attributes[];

#endif
