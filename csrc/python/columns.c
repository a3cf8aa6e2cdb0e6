/* python/columns.c - the engine's memory as NumPy arrays: views that hold their buffer, and the dtypes of its records. */
#include "columns.h"

static void release_buffer(PyObject *capsule)
{
    ces_buffer_release(PyCapsule_GetPointer(capsule, "cesim.buffer"));
}

static int numpy_type(ces_ColumnType type)
{
    return type == CES_DOUBLE ? NPY_DOUBLE : type == CES_INT32 ? NPY_INT32 : NPY_INT64;
}

PyObject *column_view(const ces_Scene *scene, ces_ColumnName name)
{
    const ces_ColumnInfo *info = ces_column_info(name);
    ces_Buffer *buffer = ces_scene_column(scene, name);
    const npy_intp shape[2] = {(npy_intp)ces_scene_count(scene), (npy_intp)info->width};
    if (buffer == NULL) { /* nothing in the scene calls for it */
        return PyArray_ZEROS(info->width > 1 ? 2 : 1, shape, numpy_type(info->type), 0);
    }
    PyObject *array = PyArray_New(&PyArray_Type, info->width > 1 ? 2 : 1, shape, numpy_type(info->type), NULL,
                                  ces_buffer_data(buffer), 0, NPY_ARRAY_CARRAY, NULL);
    if (array == NULL) {
        return NULL;
    }
    /* The view holds the buffer, not the scene: it may be stale, it never dangles. */
    PyObject *capsule = PyCapsule_New(buffer, "cesim.buffer", release_buffer);
    if (capsule == NULL) {
        Py_DECREF(array);
        return NULL;
    }
    ces_buffer_retain(buffer);
    if (PyArray_SetBaseObject((PyArrayObject *)array, capsule) < 0) {
        Py_DECREF(array);
        return NULL;
    }
    if (!info->writable) {
        PyArray_CLEARFLAGS((PyArrayObject *)array, NPY_ARRAY_WRITEABLE);
    }
    return array;
}

PyObject *block_array(const ces_Block *block)
{
    const npy_intp shape[2] = {(npy_intp)block->count, (npy_intp)block->width};
    PyObject *array = PyArray_SimpleNew(block->width > 1 ? 2 : 1, shape, numpy_type(block->type));
    if (array != NULL && block->count > 0) {
        memcpy(PyArray_DATA((PyArrayObject *)array), block->data, (size_t)PyArray_NBYTES((PyArrayObject *)array));
    }
    return array;
}

PyObject *record_array(PyObject *dtype, const void *data, size_t count)
{
    const npy_intp shape[1] = {(npy_intp)count};
    Py_INCREF(dtype); /* stolen */
    PyObject *array = PyArray_NewFromDescr(&PyArray_Type, (PyArray_Descr *)dtype, 1, shape, NULL, NULL, 0, NULL);
    if (array != NULL && count > 0 && data != NULL) {
        memcpy(PyArray_DATA((PyArrayObject *)array), data, (size_t)PyArray_NBYTES((PyArrayObject *)array));
    }
    return array;
}

PyObject *parts_array(const ces_Scene *scene, const ModuleState *state)
{
    PyObject *array = record_array(state->part_type, NULL, ces_scene_part_count(scene));
    if (array != NULL) {
        ces_scene_parts(scene, PyArray_DATA((PyArrayObject *)array));
    }
    return array;
}

PyObject *joints_array(const ces_Scene *scene, const ModuleState *state)
{
    PyObject *array = record_array(state->joint_type, NULL, ces_scene_joint_count(scene));
    if (array != NULL) {
        ces_scene_joints(scene, PyArray_DATA((PyArrayObject *)array));
    }
    return array;
}

/* One member of a C record. */
typedef struct Member {
    const char *name, *format;
    size_t offset;
} Member;

static PyObject *record_type(const Member *members, size_t count, size_t size)
{
    PyObject *names = PyList_New(0), *formats = PyList_New(0), *offsets = PyList_New(0), *spec = NULL;
    PyArray_Descr *dtype = NULL;
    int status = names == NULL || formats == NULL || offsets == NULL ? -1 : 0;
    for (size_t k = 0; k < count && status == 0; k++) {
        PyObject *name = PyUnicode_FromString(members[k].name), *format = PyUnicode_FromString(members[k].format);
        PyObject *offset = PyLong_FromSize_t(members[k].offset);
        if (name == NULL || format == NULL || offset == NULL || PyList_Append(names, name) < 0 ||
            PyList_Append(formats, format) < 0 || PyList_Append(offsets, offset) < 0) {
            status = -1;
        }
        Py_XDECREF(name);
        Py_XDECREF(format);
        Py_XDECREF(offset);
    }
    if (status == 0) {
        spec = Py_BuildValue("{s:O,s:O,s:O,s:n}", "names", names, "formats", formats, "offsets", offsets, "itemsize",
                             (Py_ssize_t)size);
        if (spec != NULL) {
            PyArray_DescrConverter(spec, &dtype);
        }
    }
    Py_XDECREF(names);
    Py_XDECREF(formats);
    Py_XDECREF(offsets);
    Py_XDECREF(spec);
    return (PyObject *)dtype;
}

#define AT(type, member, format)                                                                                       \
    {                                                                                                                  \
#member, format, offsetof(type, member)                                                                        \
    }

int fill_dtypes(ModuleState *state)
{
    static const Member landing[] = {
        AT(ces_Landing, id, "i8"),        AT(ces_Landing, time, "f8"),       AT(ces_Landing, birth, "f8"),
        AT(ces_Landing, position, "3f8"), AT(ces_Landing, velocity, "3f8"),  AT(ces_Landing, charge, "f8"),
        AT(ces_Landing, mass, "f8"),      AT(ces_Landing, diameter, "f8"),   AT(ces_Landing, material, "i4"),
        AT(ces_Landing, surface, "i4"),   AT(ces_Landing, collisions, "i4"), AT(ces_Landing, lost, "i4"),
    };
    static const Member contact[] = {
        AT(ces_ContactInfo, a, "i8"),      AT(ces_ContactInfo, b, "i8"),        AT(ces_ContactInfo, part_a, "i4"),
        AT(ces_ContactInfo, part_b, "i4"), AT(ces_ContactInfo, point, "3f8"),   AT(ces_ContactInfo, normal, "3f8"),
        AT(ces_ContactInfo, gap, "f8"),    AT(ces_ContactInfo, impulse, "3f8"),
    };
    static const Member birth[] = {
        AT(ces_Birth, time, "f8"),         AT(ces_Birth, position, "3f8"), AT(ces_Birth, velocity, "3f8"),
        AT(ces_Birth, orientation, "4f8"), AT(ces_Birth, diameter, "f8"),  AT(ces_Birth, family, "u4"),
        AT(ces_Birth, material, "i4"),     AT(ces_Birth, shape, "i4"),     AT(ces_Birth, charge, "f8"),
        AT(ces_Birth, limited, "i4"),
    };
    static const Member part[] = {
        AT(ces_PartInfo, position, "3f8"),
        AT(ces_PartInfo, orientation, "4f8"),
        AT(ces_PartInfo, velocity, "3f8"),
        AT(ces_PartInfo, angular_velocity, "3f8"),
    };
    static const Member joint[] = {
        AT(ces_JointInfo, travel, "f8"),  AT(ces_JointInfo, speed, "f8"),   AT(ces_JointInfo, effort, "f8"),
        AT(ces_JointInfo, power, "f8"),   AT(ces_JointInfo, energy, "f8"),  AT(ces_JointInfo, impulse, "f8"),
        AT(ces_JointInfo, force, "3f8"),  AT(ces_JointInfo, moment, "3f8"), AT(ces_JointInfo, at_limit, "i4"),
        AT(ces_JointInfo, at_stop, "i4"),
    };
    state->part_type = record_type(part, sizeof part / sizeof part[0], sizeof(ces_PartInfo));
    state->joint_type = record_type(joint, sizeof joint / sizeof joint[0], sizeof(ces_JointInfo));
    state->landing_type = record_type(landing, sizeof landing / sizeof landing[0], sizeof(ces_Landing));
    state->contact_type = record_type(contact, sizeof contact / sizeof contact[0], sizeof(ces_ContactInfo));
    state->birth_type = record_type(birth, sizeof birth / sizeof birth[0], sizeof(ces_Birth));
    return state->landing_type == NULL || state->contact_type == NULL || state->birth_type == NULL ||
                   state->part_type == NULL || state->joint_type == NULL
               ? -1
               : 0;
}
