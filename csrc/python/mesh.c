/* python/mesh.c - triangle meshes as pure functions: what spheres on their paths meet of one, and how far points are. */
#include "columns.h"

#include <math.h>

#include "../base/memory.h"
#include "../base/vec3.h"
#include "../contact/mesh_contact.h"

/* One contact as a row of a structured array; every member has eight bytes, so there are no gaps. */
typedef struct MeshRow {
    int64_t sphere, triangle;
    int64_t feature; /* 0 face, 1 edge, 2 corner */
    int64_t hit;
    double fraction;
    double gap;       /* m, at the start of the path */
    double plane_gap; /* m, at the start of the path, from the plane of the contact */
    double least_gap; /* m, no more than the gap at either end of the path */
    double normal[3];
} MeshRow;

static PyObject *row_type(void)
{
    PyObject *spec = Py_BuildValue("[(ss)(ss)(ss)(ss)(ss)(ss)(ss)(ss)(ss(i))]", "sphere", "i8", "triangle", "i8",
                                   "feature", "i8", "hit", "i8", "fraction", "f8", "gap", "f8", "plane_gap", "f8",
                                   "least_gap", "f8", "normal", "f8", 3);
    PyArray_Descr *dtype = NULL;
    if (spec != NULL) {
        PyArray_DescrConverter(spec, &dtype);
        Py_DECREF(spec);
    }
    return (PyObject *)dtype;
}

/* The mesh of two arrays; NULL with an exception. */
static ces_Mesh *mesh_of(const ModuleState *state, PyObject *vertices, PyObject *triangles)
{
    PyArrayObject *corners = array_of(state, vertices, NPY_DOUBLE, "vertices", 2, -1, 3);
    PyArrayObject *indices = corners == NULL ? NULL : array_of(state, triangles, NPY_UINT32, "triangles", 2, -1, 3);
    ces_Mesh *mesh = NULL;
    if (indices != NULL) {
        ces_Error error;
        const ces_Status status =
            ces_mesh_create("mesh", PyArray_DATA(corners), (size_t)PyArray_DIM(corners, 0), PyArray_DATA(indices),
                            (size_t)PyArray_DIM(indices, 0), &mesh, &error);
        if (status != CES_OK) {
            raise_status(state, status, &error);
        }
    }
    Py_XDECREF(corners);
    Py_XDECREF(indices);
    return mesh;
}

static PyObject *contacts_of(const ces_Mesh *mesh, ces_MeshPath path, const double *centers, const double *paths,
                             size_t count)
{
    ces_Pool pool = {0};
    size_t found = 0;
    for (size_t sphere = 0; sphere < count; sphere++) {
        ces_MeshContact contacts[CES_MESH_CONTACTS];
        ces_copy(&centers[3 * sphere], path.center);
        ces_copy(&paths[3 * sphere], path.path);
        const size_t more = ces_mesh_contacts(mesh, &path, contacts);
        if (!ces_pool_grow(&pool, found + more, sizeof(MeshRow), found * sizeof(MeshRow))) {
            ces_pool_free(&pool);
            return PyErr_NoMemory();
        }
        MeshRow *rows = pool.data;
        for (size_t k = 0; k < more; k++) {
            const ces_Approach *approach = &contacts[k].approach;
            rows[found] = (MeshRow){
                .sphere = (int64_t)sphere,
                .triangle = (int64_t)contacts[k].triangle,
                .feature = (int64_t)contacts[k].feature,
                .hit = approach->hit,
                .fraction = approach->fraction,
                .gap = approach->start_gap,
                .plane_gap = contacts[k].plane_gap,
                .least_gap = approach->least_gap,
            };
            ces_copy(approach->normal, rows[found++].normal);
        }
    }
    PyObject *dtype = row_type();
    PyObject *array = dtype == NULL ? NULL : record_array(dtype, pool.data, found);
    Py_XDECREF(dtype);
    ces_pool_free(&pool);
    return array;
}

static PyObject *mesh_contacts(PyObject *module, PyObject *args, PyObject *kwargs)
{
    static char *keywords[] = {"vertices", "triangles", "center", "path", "radius", "margin", "restitution", NULL};
    PyObject *vertices, *triangles, *center, *path;
    ces_MeshPath input = {.margin = 0.0};
    if (!PyArg_ParseTupleAndKeywords(args, kwargs, "OOOOd|dd:mesh_contacts", keywords, &vertices, &triangles, &center,
                                     &path, &input.radius, &input.margin, &input.restitution)) {
        return NULL;
    }
    const ModuleState *state = PyModule_GetState(module);
    if (!(input.radius > 0.0 && input.margin >= 0.0 && input.restitution >= 0.0 && input.restitution <= 1.0)) {
        return PyErr_Format(state->input_error, "radius must be positive, margin not negative, restitution in [0, 1]");
    }
    PyArrayObject *centers = array_of(state, center, NPY_DOUBLE, "center", 2, -1, 3);
    PyArrayObject *paths =
        centers == NULL ? NULL : array_of(state, path, NPY_DOUBLE, "path", 2, PyArray_DIM(centers, 0), 3);
    ces_Mesh *mesh = paths == NULL ? NULL : mesh_of(state, vertices, triangles);
    PyObject *array = mesh == NULL ? NULL
                                   : contacts_of(mesh, input, PyArray_DATA(centers), PyArray_DATA(paths),
                                                 (size_t)PyArray_DIM(centers, 0));
    ces_mesh_destroy(mesh);
    Py_XDECREF(centers);
    Py_XDECREF(paths);
    return array;
}

static PyObject *mesh_distance(PyObject *module, PyObject *args)
{
    PyObject *vertices, *triangles, *source;
    if (!PyArg_ParseTuple(args, "OOO:mesh_distance", &vertices, &triangles, &source)) {
        return NULL;
    }
    const ModuleState *state = PyModule_GetState(module);
    PyArrayObject *points = array_of(state, source, NPY_DOUBLE, "points", 2, -1, 3);
    ces_Mesh *mesh = points == NULL ? NULL : mesh_of(state, vertices, triangles);
    PyObject *distances = NULL;
    if (mesh != NULL) {
        const npy_intp shape[1] = {PyArray_DIM(points, 0)};
        distances = PyArray_SimpleNew(1, shape, NPY_DOUBLE);
        for (npy_intp k = 0; distances != NULL && k < shape[0]; k++) {
            double normal[3];
            *(double *)PyArray_GETPTR1((PyArrayObject *)distances, k) =
                ces_mesh_distance(mesh, PyArray_GETPTR2(points, k, 0), HUGE_VAL, normal);
        }
    }
    ces_mesh_destroy(mesh);
    Py_XDECREF(points);
    return distances;
}

typedef struct Found {
    PyObject *list;
    bool failed;
} Found;

static void note(void *context, uint32_t triangle)
{
    Found *found = context;
    PyObject *number = found->failed ? NULL : PyLong_FromUnsignedLong(triangle);
    found->failed = number == NULL || PyList_Append(found->list, number) < 0;
    Py_XDECREF(number);
}

static PyObject *mesh_query(PyObject *module, PyObject *args)
{
    PyObject *vertices, *triangles;
    double lower[3], upper[3];
    if (!PyArg_ParseTuple(args, "OO(ddd)(ddd):mesh_query", &vertices, &triangles, &lower[0], &lower[1], &lower[2],
                          &upper[0], &upper[1], &upper[2])) {
        return NULL;
    }
    ces_Mesh *mesh = mesh_of(PyModule_GetState(module), vertices, triangles);
    if (mesh == NULL) {
        return NULL;
    }
    Found found = {.list = PyList_New(0)};
    if (found.list != NULL) {
        ces_mesh_query(mesh, lower, upper, note, &found);
    }
    ces_mesh_destroy(mesh);
    if (found.failed || (found.list != NULL && PyList_Sort(found.list) < 0)) {
        Py_CLEAR(found.list);
    }
    return found.list;
}

PyMethodDef mesh_functions[] = {
    {"mesh_contacts", (PyCFunction)(void (*)(void))mesh_contacts, METH_VARARGS | METH_KEYWORDS,
     "mesh_contacts(vertices, triangles, center, path, radius, margin=0, restitution=0) -> structured array: what "
     "spheres (n, 3) that move along paths (n, 3) meet of a mesh"},
    {"mesh_distance", mesh_distance, METH_VARARGS,
     "mesh_distance(vertices, triangles, points): (n, 3) -> (n,), m, from the nearest triangle"},
    {"mesh_query", mesh_query, METH_VARARGS,
     "mesh_query(vertices, triangles, lower, upper) -> list of the triangles whose boxes overlap a box, ascending"},
    {NULL, NULL, 0, NULL},
};
