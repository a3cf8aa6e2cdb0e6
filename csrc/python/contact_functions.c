/* python/contact_functions.c - a cone problem given as W and q, and the table of its solvers. */
#include "module.h"

#include "../base/memory.h"
#include "../contact/cone_solver.h"
#include "../contact/given_problem.h"

static PyObject *contact_solvers(PyObject *module, PyObject *unused)
{
    (void)module;
    (void)unused;
    PyObject *list = PyList_New(0);
    for (size_t row = 0; list != NULL && row < ces_cone_solver_count(); row++) {
        const ces_ConeSolver *solver = ces_cone_solver_at(row);
        PyObject *entry = Py_BuildValue("{ssss}", "name", solver->name, "doc", solver->doc);
        if (entry == NULL || PyList_Append(list, entry) < 0) {
            Py_CLEAR(list);
        }
        Py_XDECREF(entry);
    }
    return list;
}

/* ---- the arrays of a given problem ---------------------------------------------------------------------------------------- */

enum { ROW_START, COLUMN, VALUE, Q, BLOCK_ROWS, LIMITS, LEAST, MOST, START, ARRAYS };

typedef struct Given {
    PyObject *source[ARRAYS];
    PyArrayObject *array[ARRAYS];
    ces_ConeBlock *blocks;
    double *diagonal, *scratch;
    ces_GivenProblem given;
    ces_ConeProblem problem;
} Given;

static const double *numbers(const Given *g, int which)
{
    return PyArray_DATA(g->array[which]);
}

/* Takes the arrays with the lengths they must have among each other. */
static int take_arrays(const ModuleState *state, Given *g)
{
    static const char *const names[ARRAYS] = {"row_start", "column", "value", "q",    "rows",
                                              "limits",    "least",  "most",  "start"};
    static const int types[ARRAYS] = {NPY_INT64,  NPY_INT32,  NPY_DOUBLE, NPY_DOUBLE, NPY_INT32,
                                      NPY_DOUBLE, NPY_DOUBLE, NPY_DOUBLE, NPY_DOUBLE};
    npy_intp rows = -1, blocks = -1, entries = -1;
    for (int k = 0; k < ARRAYS; k++) {
        const npy_intp lengths[ARRAYS] = {-1, -1, entries, rows, -1, blocks, rows, rows, rows};
        g->array[k] = array_of(state, g->source[k], types[k], names[k], k == LIMITS ? 2 : 1, lengths[k], 3);
        if (g->array[k] == NULL) {
            return -1;
        }
        const npy_intp length = PyArray_DIM(g->array[k], 0);
        rows = k == ROW_START ? length - 1 : rows;
        entries = k == COLUMN ? length : entries;
        blocks = k == BLOCK_ROWS ? length : blocks;
    }
    return 0;
}

static int refuse(const ModuleState *state, const char *text)
{
    PyErr_SetString(state->input_error, text);
    return -1;
}

/* Indices that stay inside the arrays: the only thing about W that could hurt. */
static int check_matrix(const ModuleState *state, const Given *g)
{
    const int64_t *row_start = PyArray_DATA(g->array[ROW_START]);
    const int32_t *column = PyArray_DATA(g->array[COLUMN]);
    const npy_intp rows = PyArray_DIM(g->array[Q], 0), entries = PyArray_DIM(g->array[COLUMN], 0);
    if (rows > INT32_MAX || row_start[0] != 0 || row_start[rows] != entries) {
        return refuse(state, "row_start does not fit column");
    }
    for (npy_intp row = 0; row < rows; row++) {
        if (row_start[row + 1] < row_start[row]) {
            return refuse(state, "row_start must not fall");
        }
    }
    for (npy_intp e = 0; e < entries; e++) {
        if (column[e] < 0 || column[e] >= rows) {
            return refuse(state, "column is outside the matrix");
        }
    }
    return 0;
}

/* Blocks of 3 rows are contacts, of 6 rows contacts that roll; of -1 to -6 rows, joints. */
static int make_blocks(const ModuleState *state, Given *g)
{
    const npy_intp count = PyArray_DIM(g->array[BLOCK_ROWS], 0);
    const int32_t *rows = PyArray_DATA(g->array[BLOCK_ROWS]);
    const double *limits = numbers(g, LIMITS);
    g->blocks = ces_alloc((size_t)count, sizeof *g->blocks);
    if (g->blocks == NULL) {
        PyErr_NoMemory();
        return -1;
    }
    size_t first = 0, diagonal = 0;
    for (npy_intp i = 0; i < count; i++) {
        const bool joint = rows[i] < 0 && rows[i] >= -CES_BLOCK_ROWS;
        if (!joint && rows[i] != 3 && rows[i] != 6) {
            return refuse(state, "rows must be 3 or 6, or -1 to -6 for a joint");
        }
        g->blocks[i] = (ces_ConeBlock){
            .kind = joint          ? CES_JOINT_BLOCK
                    : rows[i] == 3 ? CES_CONTACT_BLOCK
                                   : CES_ROLLING_BLOCK,
            .rows = (uint32_t)(joint ? -rows[i] : rows[i]),
            .first = (uint32_t)first,
            .diagonal = diagonal,
            .friction = joint ? 0.0 : limits[3 * i],
            .spinning = rows[i] == 6 ? limits[3 * i + 1] : 0.0,
            .rolling = rows[i] == 6 ? limits[3 * i + 2] : 0.0,
        };
        first += g->blocks[i].rows;
        diagonal += g->blocks[i].rows * g->blocks[i].rows;
        if (first > (size_t)PyArray_DIM(g->array[Q], 0)) {
            break;
        }
    }
    if (first != (size_t)PyArray_DIM(g->array[Q], 0)) {
        return refuse(state, "rows do not add up to the rows of q");
    }
    g->problem.block_count = (uint32_t)count;
    g->problem.rows = (uint32_t)first;
    g->diagonal = ces_alloc(diagonal, sizeof(double));
    return g->diagonal != NULL ? 0 : (PyErr_NoMemory(), -1);
}

static int make_problem(const ModuleState *state, Given *g, const ces_ConeSolver *solver, PyArrayObject *impulse,
                        PyArrayObject *velocity)
{
    g->given = (ces_GivenProblem){
        .blocks = g->blocks,
        .rows = g->problem.rows,
        .row_start = PyArray_DATA(g->array[ROW_START]),
        .column = PyArray_DATA(g->array[COLUMN]),
        .value = numbers(g, VALUE),
        .q = numbers(g, Q),
        .u = PyArray_DATA(velocity),
    };
    ces_given_diagonal(&g->given, g->problem.block_count, g->diagonal);
    g->problem.blocks = g->blocks;
    g->problem.diagonal = g->diagonal;
    g->problem.least = numbers(g, LEAST);
    g->problem.most = numbers(g, MOST);
    g->problem.op = ces_given_operator(&g->given);
    g->problem.impulse = PyArray_DATA(impulse);
    for (uint32_t i = 0; i < g->problem.block_count; i++) {
        const double step = ces_block_step(&g->problem, &g->blocks[i]);
        if (!(step > 0.0 && step < HUGE_VAL)) {
            return refuse(state, "value has a diagonal block without a positive trace");
        }
    }
    g->scratch = ces_alloc(solver->scratch(&g->problem), sizeof(double));
    g->problem.scratch = g->scratch;
    return g->scratch != NULL ? 0 : (PyErr_NoMemory(), -1);
}

static PyObject *solve_given(const ModuleState *state, Given *g, const ces_ConeSolver *solver)
{
    if (take_arrays(state, g) < 0 || check_matrix(state, g) < 0 || make_blocks(state, g) < 0) {
        return NULL;
    }
    PyArrayObject *impulse = (PyArrayObject *)PyArray_NewCopy(g->array[START], NPY_CORDER);
    PyArrayObject *velocity = (PyArrayObject *)PyArray_NewCopy(g->array[Q], NPY_CORDER);
    PyObject *answer = NULL;
    if (impulse != NULL && velocity != NULL && make_problem(state, g, solver, impulse, velocity) == 0) {
        ces_ConeReport report;
        double natural_map, objective;
        Py_BEGIN_ALLOW_THREADS;
        report = solver->solve(&g->problem);
        natural_map = ces_given_natural_map(&g->given, &g->problem);
        objective = ces_cone_objective(&g->problem);
        Py_END_ALLOW_THREADS;
        answer = Py_BuildValue("{sOsOsdsdsdsIsOss}", "impulse", impulse, "velocity", velocity, "residual",
                               report.residual, "natural_map", natural_map, "objective", objective, "iterations",
                               (unsigned int)report.iterations, "converged", report.converged ? Py_True : Py_False,
                               "solver", report.name);
    }
    Py_XDECREF(impulse);
    Py_XDECREF(velocity);
    return answer;
}

static PyObject *solve_cone(PyObject *module, PyObject *args, PyObject *keywords)
{
    static char *names[] = {"row_start", "column", "value", "q",      "rows",      "limits",         "least",
                            "most",      "start",  "law",   "solver", "tolerance", "max_iterations", NULL};
    Given g = {0};
    const char *law, *name;
    PyObject **s = g.source;
    if (!PyArg_ParseTupleAndKeywords(args, keywords, "OOOOOOOOOssdI:solve_cone", names, &s[ROW_START], &s[COLUMN],
                                     &s[VALUE], &s[Q], &s[BLOCK_ROWS], &s[LIMITS], &s[LEAST], &s[MOST], &s[START], &law,
                                     &name, &g.problem.tolerance, &g.problem.max_iterations)) {
        return NULL;
    }
    const ModuleState *state = PyModule_GetState(module);
    const ces_ConeSolver *solver = ces_cone_solver_find(name);
    g.problem.law = strcmp(law, "ccp") == 0 ? CES_CCP : CES_COULOMB;
    PyObject *answer = NULL;
    if (solver == NULL) {
        PyErr_Format(state->input_error, "solver is '%s', no such solver", name);
    } else if (g.problem.law == CES_COULOMB && strcmp(law, "coulomb") != 0) {
        PyErr_Format(state->input_error, "law is '%s', must be coulomb or ccp", law);
    } else {
        answer = solve_given(state, &g, solver);
    }
    for (int k = 0; k < ARRAYS; k++) {
        Py_XDECREF(g.array[k]);
    }
    ces_free(g.blocks);
    ces_free(g.diagonal);
    ces_free(g.scratch);
    return answer;
}

static PyObject *project_cone(PyObject *module, PyObject *args)
{
    const ModuleState *state = PyModule_GetState(module);
    double friction, spinning, rolling;
    PyObject *source;
    if (!PyArg_ParseTuple(args, "dddO:project_cone", &friction, &spinning, &rolling, &source)) {
        return NULL;
    }
    PyArrayObject *given = array_of(state, source, NPY_DOUBLE, "impulse", 1, -1, 0);
    if (given == NULL) {
        return NULL;
    }
    PyObject *answer = NULL;
    const npy_intp rows = PyArray_DIM(given, 0);
    if (rows == 3 || rows == 6) {
        const ces_ConeBlock block = {
            .kind = rows == 3 ? CES_CONTACT_BLOCK : CES_ROLLING_BLOCK,
            .rows = (uint32_t)rows,
            .friction = friction,
            .spinning = spinning,
            .rolling = rolling,
        };
        answer = PyArray_NewCopy(given, NPY_CORDER);
        if (answer != NULL) {
            ces_block_project(&(ces_ConeProblem){0}, &block, PyArray_DATA((PyArrayObject *)answer));
        }
    } else {
        PyErr_SetString(state->input_error, "impulse must have 3 or 6 rows");
    }
    Py_DECREF(given);
    return answer;
}

PyMethodDef contact_functions[] = {
    {"project_cone", project_cone, METH_VARARGS,
     "project_cone(friction, spinning, rolling, impulse): (3,) or (6,) -> the nearest impulse that a contact can give"},
    {"contact_solvers", contact_solvers, METH_NOARGS, "contact_solvers() -> list of dicts: name, doc"},
    {"solve_cone", (PyCFunction)(void (*)(void))solve_cone, METH_VARARGS | METH_KEYWORDS,
     "solve_cone(row_start, column, value, q, rows, limits, least, most, start, law, solver, tolerance, "
     "max_iterations) -> dict\n\nW in compressed rows; rows (blocks): 3, 6, or -1 to -6 for a joint; limits (blocks, 3): "
     "friction, spinning, rolling."},
    {NULL, NULL, 0, NULL},
};
