/*
 * A potential on equidistant nodes, interpolated by the cubic spline through them: C. de Boor, A Practical Guide to Splines,
 * Springer 1978, chapter IX, with the not-a-knot condition at the ends. A cubic is met exactly; else the error is of order
 * h^4 in the potential and h^3 in the field.
 *
 * The field is the gradient of one potential, so it has no curl and no energy drifts in; it is itself continuously
 * differentiable. Beyond the grid the potential is that of the nearest point of its border: finite, and still one potential.
 */
#include "field.h"

#include "../base/memory.h"
#include "../base/status.h"

#include <math.h>

enum { LEAST_NODES = 4, MOST_NODES = 50000000 };
#define FARTHEST 1e3   /* m, from the origin */
#define FINEST 1e-7    /* m, spacing */
#define MOST_VOLTS 1e7 /* V */

typedef struct Grid {
    double origin[3];            /* m */
    double per_spacing[3];       /* 1/m */
    size_t counts[3], stride[3]; /* nodes; of the coefficients, which are one more on either side */
    double drum_center[2];       /* m */
    double drum_radius;          /* m, 0: none */
    double *coefficient;         /* V, of the B-splines */
} Grid;

/* ---- creation ---------------------------------------------------------------------------------------------------------- */

static ces_Status check(const ces_FieldDef *def, ces_Error *error)
{
    static const char axes[] = "xyz";
    double nodes = 1.0;
    for (int k = 0; k < 3; k++) {
        const uint32_t n = def->counts[k];
        const bool flat = k == 2 && n == 1;
        const double far = fabs(def->origin[k]) + (double)n * def->spacing[k];
        if (n < LEAST_NODES && !flat) {
            return ces_fail(error, CES_INPUT, "field.values have %u nodes along %c, must be %d at least%s", n, axes[k],
                            LEAST_NODES, k == 2 ? ", or 1" : "");
        }
        if (!flat && !(def->spacing[k] >= FINEST && far <= FARTHEST)) {
            return ces_fail(
                error, CES_INPUT,
                "the grid of field begins at %c = %g m with a spacing of %g m, must lie within %g m and the "
                "spacing be %g m at least",
                axes[k], def->origin[k], def->spacing[k], FARTHEST, FINEST);
        }
        nodes *= n;
    }
    if (nodes > MOST_NODES) {
        return ces_fail(error, CES_INPUT, "field.values have %g nodes, at most %d may be", nodes, MOST_NODES);
    }
    for (size_t k = 0; k < (size_t)nodes; k++) {
        if (!(fabs(def->values[k]) <= MOST_VOLTS)) {
            return ces_fail(error, CES_INPUT, "field.values[%zu] is %g V, outside [%g, %g] V", k, def->values[k],
                            -MOST_VOLTS, MOST_VOLTS);
        }
    }
    return ces_check_range(error, "field.drum_radius", def->drum_radius, 0.0, FARTHEST, "m");
}

/*
 * From n values to n + 2 coefficients c with (c[i-1] + 4 c[i] + c[i+1])/6 = v[i]. Not-a-knot: the fourth difference of c around
 * c[1] is zero. Put into the equations of v[0], v[1] and v[2] that is 6 c[1] = 8 v[1] - v[0] - v[2]; the same at the other end
 * leaves a tridiagonal system, whose multipliers are in ratio (n).
 */
static void solve_line(double *line, size_t stride, size_t n, double *ratio)
{
#define C(i) line[((i) + 1) * stride] /* v[i] before, c[i] after */
    const double v0 = C(0), v1 = C(1), w0 = C(n - 1), w1 = C(n - 2);
    C(1) = (8.0 * v1 - v0 - C(2)) / 6.0;
    if (n > LEAST_NODES) {
        C(n - 2) = (8.0 * w1 - w0 - C(n - 3)) / 6.0;
        ratio[1] = 0.0;
        for (size_t i = 2; i < n - 2; i++) {
            const double below = i + 1 == n - 2 ? C(n - 2) : 0.0;
            ratio[i] = 1.0 / (4.0 - ratio[i - 1]);
            C(i) = (6.0 * C(i) - below - C(i - 1)) * ratio[i];
        }
        for (size_t i = n - 4; i >= 2; i--) {
            C(i) -= ratio[i] * C(i + 1);
        }
    } else {
        C(2) = (8.0 * w1 - w0 - v1) / 6.0;
    }
    C(0) = 6.0 * v1 - 4.0 * C(1) - C(2);
    line[0] = 6.0 * v0 - 4.0 * C(0) - C(1);
    C(n - 1) = 6.0 * w1 - 4.0 * C(n - 2) - C(n - 3);
    C(n) = 6.0 * w0 - 4.0 * C(n - 1) - C(n - 2);
#undef C
}

static void solve_axis(Grid *grid, int axis, double *ratio)
{
    const int a = axis == 0 ? 1 : 0, b = axis == 2 ? 1 : 2;
    const size_t first = grid->counts[a] > 1 ? grid->counts[a] + 2 : 1;
    const size_t second = grid->counts[b] > 1 ? grid->counts[b] + 2 : 1;
    for (size_t i = 0; i < first; i++) {
        for (size_t j = 0; j < second; j++) {
            solve_line(grid->coefficient + i * grid->stride[a] + j * grid->stride[b], grid->stride[axis],
                       grid->counts[axis], ratio);
        }
    }
}

/* Counts, strides and scales, z fastest; returns the number of coefficients: one more than nodes at either end of an axis
 * that has several. */
static size_t lay_out(Grid *grid, const ces_FieldDef *def)
{
    size_t size = 1;
    for (int k = 2; k >= 0; k--) {
        const size_t n = def->counts[k];
        grid->counts[k] = n;
        grid->stride[k] = size;
        grid->origin[k] = def->origin[k];
        grid->per_spacing[k] = n > 1 ? 1.0 / def->spacing[k] : 0.0;
        size *= n > 1 ? n + 2 : 1;
    }
    return size;
}

static void copy_values(Grid *grid, const double *value)
{
    const size_t margin = grid->counts[2] > 1 ? 1 : 0;
    for (size_t i = 0; i < grid->counts[0]; i++) {
        for (size_t j = 0; j < grid->counts[1]; j++) {
            double *row = grid->coefficient + (i + 1) * grid->stride[0] + (j + 1) * grid->stride[1] + margin;
            for (size_t k = 0; k < grid->counts[2]; k++) {
                row[k] = *value++;
            }
        }
    }
}

static ces_Status start(const ces_FieldDef *def, void *state, ces_Error *error)
{
    Grid *grid = state;
    *grid = (Grid){.drum_radius = def->drum_radius, .drum_center = {def->drum_center[0], def->drum_center[1]}};
    if (def->values == NULL) {
        return ces_fail(error, CES_INPUT, "field.values are missing, the grid needs a potential at each node");
    }
    const ces_Status status = check(def, error);
    if (status != CES_OK) {
        return status;
    }
    const size_t size = lay_out(grid, def);
    size_t longest = 0;
    for (int k = 0; k < 3; k++) {
        longest = grid->counts[k] > longest ? grid->counts[k] : longest;
    }
    grid->coefficient = ces_alloc(size, sizeof(double));
    double *ratio = ces_alloc(longest, sizeof(double));
    if (grid->coefficient == NULL || ratio == NULL) {
        ces_free(ratio);
        return ces_fail(error, CES_MEMORY, "no memory for a grid of %zu nodes", size);
    }
    copy_values(grid, def->values);
    for (int axis = 0; axis < 3; axis++) {
        if (grid->counts[axis] > 1) {
            solve_axis(grid, axis, ratio);
        }
    }
    ces_free(ratio);
    return CES_OK;
}

static void stop(void *state)
{
    ces_free(((Grid *)state)->coefficient);
}

/* ---- sampling ------------------------------------------------------------------------------------------------------------ */

/* Where a point lies along an axis: the first of four coefficients, their weights in the potential and in its derivative. */
typedef struct Place {
    size_t first;
    double weight[4], slope[4];
} Place;

static void find_place(const Grid *grid, int axis, double x, Place *place)
{
    const double last = (double)(grid->counts[axis] - 1), per = grid->per_spacing[axis];
    double u = (x - grid->origin[axis]) * per;
    const bool inside = u >= 0.0 && u <= last;
    u = u > 0.0 ? fmin(u, last) : 0.0;
    const size_t cell = u < last ? (size_t)u : grid->counts[axis] - 2;
    const double t = u - (double)cell, s = 1.0 - t;
    const double scale = inside ? 0.5 * per : 0.0; /* along an axis on which the point is beyond, nothing changes */
    place->first = cell;
    place->weight[0] = s * s * s / 6.0;
    place->weight[1] = (4.0 + 3.0 * t * t * (t - 2.0)) / 6.0;
    place->weight[2] = (4.0 + 3.0 * s * s * (s - 2.0)) / 6.0;
    place->weight[3] = t * t * t / 6.0;
    place->slope[0] = -scale * s * s;
    place->slope[1] = scale * t * (3.0 * t - 4.0);
    place->slope[2] = -scale * s * (3.0 * s - 4.0);
    place->slope[3] = scale * t * t;
}

static void one_node(Place *place)
{
    *place = (Place){.weight = {1.0}};
}

/* The gradient (V/m) and the potential (V), the fourth. */
static void sample(const Grid *grid, const double position[3], double out[4])
{
    double local[2] = {position[0] - grid->drum_center[0], position[1] - grid->drum_center[1]};
    ces_field_leave_cylinder(grid->drum_radius, 1.0, local);
    Place x, y, z;
    find_place(grid, 0, grid->drum_center[0] + local[0], &x);
    find_place(grid, 1, grid->drum_center[1] + local[1], &y);
    const int depth = grid->counts[2] > 1 ? 4 : 1;
    if (depth == 4) {
        find_place(grid, 2, position[2], &z);
    } else {
        one_node(&z);
    }
    const double *corner = grid->coefficient + x.first * grid->stride[0] + y.first * grid->stride[1] + z.first;
    out[0] = out[1] = out[2] = out[3] = 0.0;
    for (int i = 0; i < 4; i++) {
        double along_y = 0.0, along_z = 0.0, value = 0.0; /* of the plane i: derivatives and potential */
        for (int j = 0; j < 4; j++) {
            const double *row = corner + (size_t)i * grid->stride[0] + (size_t)j * grid->stride[1];
            double sum = 0.0, slope = 0.0;
            for (int k = 0; k < depth; k++) {
                sum += z.weight[k] * row[k];
                slope += z.slope[k] * row[k];
            }
            value += y.weight[j] * sum;
            along_y += y.slope[j] * sum;
            along_z += y.weight[j] * slope;
        }
        out[0] += x.slope[i] * value;
        out[1] += x.weight[i] * along_y;
        out[2] += x.weight[i] * along_z;
        out[3] += x.weight[i] * value;
    }
}

static void field_at(const void *state, const double position[3], double field[3])
{
    double found[4];
    sample(state, position, found);
    for (int k = 0; k < 3; k++) {
        field[k] = -found[k];
    }
}

static double potential_at(const void *state, const double position[3])
{
    double found[4];
    sample(state, position, found);
    return found[3];
}

const ces_FieldRow ces_grid_row = {
    .name = "grid",
    .doc = "a potential on equidistant nodes in two or three dimensions, interpolated by a cubic spline",
    .state_size = sizeof(Grid),
    .start = start,
    .field = field_at,
    .potential = potential_at,
    .stop = stop,
};
