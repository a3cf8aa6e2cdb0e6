/* python/scene_attributes.c - what engine.Scene tells: its attributes. */
#include "scene_object.h"

bool scene_is_free(const SceneObject *self)
{
    if (self->busy) {
        PyErr_SetString(PyExc_RuntimeError, "the scene is stepping in another thread");
    }
    return !self->busy;
}

static PyObject *get_column(SceneObject *self, void *name)
{
    return scene_is_free(self) ? column_view(self->scene, (ces_ColumnName)(intptr_t)name) : NULL;
}

static PyObject *get_time(SceneObject *self, void *unused)
{
    (void)unused;
    return scene_is_free(self) ? PyFloat_FromDouble(ces_scene_time(self->scene)) : NULL;
}

static PyObject *get_step_index(SceneObject *self, void *unused)
{
    (void)unused;
    return scene_is_free(self) ? PyLong_FromUnsignedLongLong(ces_scene_step_index(self->scene)) : NULL;
}

static PyObject *get_step_size(SceneObject *self, void *unused)
{
    (void)unused;
    return PyFloat_FromDouble(ces_scene_step_size(self->scene));
}

static PyObject *get_tolerance(SceneObject *self, void *unused)
{
    (void)unused;
    return PyFloat_FromDouble(ces_scene_tolerance(self->scene));
}

static PyObject *get_count(SceneObject *self, void *unused)
{
    (void)unused;
    return scene_is_free(self) ? PyLong_FromSize_t(ces_scene_count(self->scene)) : NULL;
}

static PyObject *get_threads(SceneObject *self, void *unused)
{
    (void)unused;
    return PyLong_FromLong(ces_scene_threads(self->scene));
}

static PyObject *get_landing_count(SceneObject *self, void *unused)
{
    (void)unused;
    return scene_is_free(self) ? PyLong_FromSize_t(ces_scene_landing_count(self->scene)) : NULL;
}

static PyObject *get_contacts(SceneObject *self, void *unused)
{
    (void)unused;
    if (!scene_is_free(self)) {
        return NULL;
    }
    PyObject *array =
        record_array(module_state_of((PyObject *)self)->contact_type, NULL, ces_scene_contact_count(self->scene));
    if (array != NULL) {
        ces_scene_contacts(self->scene, PyArray_DATA((PyArrayObject *)array));
    }
    return array;
}

static PyObject *get_parts(SceneObject *self, void *unused)
{
    (void)unused;
    return scene_is_free(self) ? parts_array(self->scene, module_state_of((PyObject *)self)) : NULL;
}

static PyObject *get_joints(SceneObject *self, void *unused)
{
    (void)unused;
    return scene_is_free(self) ? joints_array(self->scene, module_state_of((PyObject *)self)) : NULL;
}

/* name -> what it did; those that did nothing are left out */
static PyObject *solver_uses(const ces_Health *health)
{
    PyObject *uses = PyDict_New();
    for (int k = 0; uses != NULL && k < CES_SOLVER_COUNT; k++) {
        const ces_SolverUse *use = &health->solvers[k];
        if (use->islands == 0) {
            continue;
        }
        PyObject *row = Py_BuildValue("{sKsKsKsKsdsd}", "islands", use->islands, "contacts", use->contacts,
                                      "iterations", use->iterations, "unconverged", use->unconverged, "residual",
                                      use->residual, "seconds", use->seconds);
        if (row == NULL || PyDict_SetItemString(uses, ces_solver_name(k), row) < 0) {
            Py_CLEAR(uses);
        }
        Py_XDECREF(row);
    }
    return uses;
}

static PyObject *get_health(SceneObject *self, void *unused)
{
    (void)unused;
    if (!scene_is_free(self)) {
        return NULL;
    }
    const ces_Health h = ces_scene_health(self->scene);
    PyObject *solvers = solver_uses(&h);
    if (solvers == NULL) {
        return NULL;
    }
    return Py_BuildValue("{sNsKsKsKsKsKsKsKsKsKsdsdsdsdsdsdsKsdsdsdsdsK}", "solvers", solvers, "steps", h.steps,
                         "contact_rows", h.contact_rows, "active_contacts", h.active_contacts, "iterations",
                         h.iterations, "visits", h.visits, "islands", h.islands, "unconverged", h.unconverged,
                         "last_contacts", h.last_contacts, "last_iterations", h.last_iterations, "last_residual",
                         h.last_residual, "residual", h.residual, "last_penetration", h.last_penetration, "penetration",
                         h.penetration, "penetration_ratio", h.penetration_ratio, "kinetic_energy", h.kinetic_energy,
                         "redundant_rows", h.redundant_rows, "joint_drift", h.joint_drift, "pair_force", h.pair_force,
                         "pair_defect", h.pair_defect, "turn", h.turn, "limited_charges", h.limited_charges);
}

static PyObject *get_balance(SceneObject *self, void *unused)
{
    (void)unused;
    if (!scene_is_free(self)) {
        return NULL;
    }
    const ces_Balance b = ces_scene_balance(self->scene);
    return Py_BuildValue("{sKsKsKsKsdsdsdsdsO}", "fed_count", b.fed_count, "landed_count", b.landed_count,
                         "resident_count", b.resident_count, "lost_count", b.lost_count, "fed_mass", b.fed_mass,
                         "landed_mass", b.landed_mass, "resident_mass", b.resident_mass, "lost_mass", b.lost_mass,
                         "closed", b.closed ? Py_True : Py_False);
}

static PyObject *get_stage_seconds(SceneObject *self, void *unused)
{
    (void)unused;
    PyObject *seconds = scene_is_free(self) ? PyDict_New() : NULL;
    for (int stage = 0; seconds != NULL && stage < CES_STAGE_COUNT; stage++) {
        PyObject *value = PyFloat_FromDouble(ces_scene_stage_seconds(self->scene, stage));
        if (value == NULL || PyDict_SetItemString(seconds, ces_stage_name(stage), value) < 0) {
            Py_CLEAR(seconds);
        }
        Py_XDECREF(value);
    }
    return seconds;
}

#define COLUMN(name, column, doc)                                                                                      \
    {                                                                                                                  \
        name, (getter)get_column, NULL, doc, (void *)(intptr_t)(column)                                                \
    }
PyGetSetDef scene_attributes[] = {
    {"time", (getter)get_time, NULL, "s", NULL},
    {"step_index", (getter)get_step_index, NULL, "steps made", NULL},
    {"step_size", (getter)get_step_size, NULL, "s", NULL},
    {"tolerance", (getter)get_tolerance, NULL, "m/s, residual at which a contact problem counts as solved", NULL},
    {"count", (getter)get_count, NULL, "grains present", NULL},
    {"threads", (getter)get_threads, NULL, "threads of a step", NULL},
    {"landing_count", (getter)get_landing_count, NULL, "grains landed or lost so far", NULL},
    {"contacts", (getter)get_contacts, NULL, "structured array, the contacts of the last step", NULL},
    {"parts", (getter)get_parts, NULL, "structured array, where the dynamic parts are", NULL},
    {"joints", (getter)get_joints, NULL, "structured array, what the joints do", NULL},
    {"health", (getter)get_health, NULL, "dict, how well the steps went", NULL},
    {"balance", (getter)get_balance, NULL, "dict, fed = landed + resident + lost, count and kg", NULL},
    {"stage_seconds", (getter)get_stage_seconds, NULL, "dict, wall time per stage, s", NULL},
    COLUMN("conducted", CES_CONDUCTED, "(count,) C, charge on the conducting share; zeros where no mixture is"),
    COLUMN("id", CES_ID, "(count,) int64"),
    COLUMN("position", CES_POSITION, "(count, 3) m"),
    COLUMN("velocity", CES_VELOCITY, "(count, 3) m/s"),
    COLUMN("angular_velocity", CES_ANGULAR_VELOCITY, "(count, 3) rad/s"),
    COLUMN("orientation", CES_ORIENTATION, "(count, 4) unit quaternion (w, x, y, z)"),
    COLUMN("charge", CES_CHARGE, "(count,) C"),
    COLUMN("mass", CES_MASS, "(count,) kg"),
    COLUMN("diameter", CES_DIAMETER, "(count,) m"),
    COLUMN("material", CES_MATERIAL, "(count,) int32, index of the material"),
    COLUMN("shape", CES_SHAPE, "(count,) int32, index of the shape"),
    COLUMN("birth", CES_BIRTH, "(count,) s"),
    COLUMN("collisions", CES_COLLISIONS, "(count,) int32, contacts that began"),
    COLUMN("surface", CES_SURFACE, "(count,) int32, surface touched last, -1: none"),
    {NULL, NULL, NULL, NULL, NULL},
};
