#include "mesh.h"

#include <math.h>
#include <string.h>

#include "../base/memory.h"
#include "../base/status.h"
#include "../base/vec3.h"

enum { LEAF = 4, MOST_TRIANGLES = 10000000 };
#define FARTHEST 1e3 /* m, from the mesh's own origin */
#define THINNEST                                                                                                       \
    1e-10 /* height over longest edge: below it a triangle is a line, rounding decides where its plane lies */

/* ---- creation ---------------------------------------------------------------------------------------------------------- */

static ces_Status check(const char *name, const double *vertices, size_t vertex_count, const uint32_t *triangles,
                        size_t triangle_count, ces_Error *error)
{
    if (triangle_count == 0 || triangle_count > MOST_TRIANGLES) {
        return ces_fail(error, CES_INPUT, "surface '%s': the number of triangles is %zu, outside [1, %d]", name,
                        triangle_count, MOST_TRIANGLES);
    }
    if (vertex_count == 0 || vertex_count > 3 * (size_t)MOST_TRIANGLES) {
        return ces_fail(error, CES_INPUT, "surface '%s': the number of vertices is %zu, outside [1, %d]", name,
                        vertex_count, 3 * MOST_TRIANGLES);
    }
    for (size_t k = 0; k < 3 * vertex_count; k++) {
        if (!(fabs(vertices[k]) <= FARTHEST)) {
            return ces_fail(error, CES_INPUT, "surface '%s': vertices[%zu, %zu] is %g m, outside [%g, %g] m", name,
                            k / 3, k % 3, vertices[k], -FARTHEST, FARTHEST);
        }
    }
    for (size_t k = 0; k < 3 * triangle_count; k++) {
        if (triangles[k] >= vertex_count) {
            return ces_fail(error, CES_INPUT, "surface '%s': triangles[%zu, %zu] is %lu, outside [0, %zu]", name, k / 3,
                            k % 3, (unsigned long)triangles[k], vertex_count - 1);
        }
    }
    return CES_OK;
}

/* False for a triangle without an area. */
static bool find_normal(const double *const corner[3], double normal[3])
{
    double edge[3][3], longest = 0.0;
    for (int k = 0; k < 3; k++) {
        ces_subtract(corner[(k + 1) % 3], corner[k], edge[k]);
        longest = ces_max(longest, ces_dot(edge[k], edge[k]));
    }
    ces_cross(edge[0], edge[1], normal);
    const double area = ces_norm(normal); /* twice the triangle's */
    if (!(area > THINNEST * longest)) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        normal[k] /= area;
    }
    return true;
}

static void find_extent(ces_Mesh *mesh)
{
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        const double *x = &mesh->vertices[3 * v];
        for (int k = 0; k < 3; k++) {
            mesh->half[k] = ces_max(mesh->half[k], fabs(x[k]));
        }
        mesh->spread = ces_max(mesh->spread, sqrt(x[0] * x[0] + x[1] * x[1]));
    }
}

/* ---- the tree ------------------------------------------------------------------------------------------------------------ */

static const double *corner_of(const ces_Mesh *mesh, uint32_t triangle, size_t corner)
{
    return &mesh->vertices[3 * (size_t)mesh->triangles[3 * (size_t)triangle + corner]];
}

/* Three times the centre of a triangle along an axis. */
static double key_of(const ces_Mesh *mesh, uint32_t triangle, int axis)
{
    return corner_of(mesh, triangle, 0)[axis] + corner_of(mesh, triangle, 1)[axis] + corner_of(mesh, triangle, 2)[axis];
}

/* A total order: the tree depends on the mesh alone. */
static bool precedes(const ces_Mesh *mesh, int axis, uint32_t one, uint32_t other)
{
    const double a = key_of(mesh, one, axis), b = key_of(mesh, other, axis);
    return a < b || (a == b && one < other);
}

/* Puts the middle-th of [first, last) in its place, what precedes it before it (quickselect). */
static void select_middle(ces_Mesh *mesh, int axis, size_t first, size_t middle, size_t last)
{
    uint32_t *order = mesh->order;
    while (last - first > 1) {
        const uint32_t pivot = order[first + (last - first) / 2];
        size_t low = first, high = last - 1;
        while (low <= high) {
            while (precedes(mesh, axis, order[low], pivot)) {
                low++;
            }
            while (precedes(mesh, axis, pivot, order[high])) {
                high--;
            }
            if (low <= high) {
                const uint32_t swap = order[low];
                order[low++] = order[high];
                order[high] = swap;
                if (high == 0) {
                    break;
                }
                high--;
            }
        }
        if (middle <= high && high < last) {
            last = high + 1;
        } else if (middle >= low) {
            first = low;
        } else {
            return;
        }
    }
}

static int longest_axis(const ces_Mesh *mesh, size_t first, size_t last)
{
    double lower[3], upper[3];
    int longest = 0;
    for (int axis = 0; axis < 3; axis++) {
        lower[axis] = HUGE_VAL;
        upper[axis] = -HUGE_VAL;
        for (size_t k = first; k < last; k++) {
            const double key = key_of(mesh, mesh->order[k], axis);
            lower[axis] = ces_min(lower[axis], key);
            upper[axis] = ces_max(upper[axis], key);
        }
        if (upper[axis] - lower[axis] > upper[longest] - lower[longest]) {
            longest = axis;
        }
    }
    return longest;
}

/* Halves at every level, so the recursion is at most 24 deep. */
static void build(ces_Mesh *mesh, size_t first, size_t last)
{
    ces_MeshNode *node = &mesh->nodes[mesh->node_count++];
    for (int axis = 0; axis < 3; axis++) {
        node->lower[axis] = HUGE_VAL;
        node->upper[axis] = -HUGE_VAL;
        for (size_t k = 3 * first; k < 3 * last; k++) {
            const double x = corner_of(mesh, mesh->order[k / 3], k % 3)[axis];
            node->lower[axis] = ces_min(node->lower[axis], x);
            node->upper[axis] = ces_max(node->upper[axis], x);
        }
    }
    if (last - first <= LEAF) {
        node->first = (uint32_t)first;
        node->last = (uint32_t)last;
    } else {
        const size_t middle = first + (last - first) / 2;
        select_middle(mesh, longest_axis(mesh, first, last), first, middle, last);
        build(mesh, first, middle);
        build(mesh, middle, last);
    }
    node->next = (uint32_t)mesh->node_count;
}

ces_Status ces_mesh_create(const char *name, const double *vertices, size_t vertex_count, const uint32_t *triangles,
                           size_t triangle_count, ces_Mesh **mesh, ces_Error *error)
{
    *mesh = NULL;
    const ces_Status status = check(name, vertices, vertex_count, triangles, triangle_count, error);
    if (status != CES_OK) {
        return status;
    }
    ces_Mesh *made = ces_alloc(1, sizeof *made);
    if (made != NULL) {
        made->vertices = ces_alloc(vertex_count, 3 * sizeof(double));
        made->triangles = ces_alloc(triangle_count, 3 * sizeof(uint32_t));
        made->normals = ces_alloc(triangle_count, 3 * sizeof(double));
        made->order = ces_alloc(triangle_count, sizeof(uint32_t));
        made->nodes =
            ces_alloc(triangle_count, sizeof(ces_MeshNode)); /* a leaf has two triangles or is the only node */
    }
    if (made == NULL || made->vertices == NULL || made->triangles == NULL || made->normals == NULL ||
        made->order == NULL || made->nodes == NULL) {
        ces_mesh_destroy(made);
        return ces_fail(error, CES_MEMORY, "no memory for the %zu triangles of surface '%s'", triangle_count, name);
    }
    memcpy(made->vertices, vertices, vertex_count * 3 * sizeof(double));
    memcpy(made->triangles, triangles, triangle_count * 3 * sizeof(uint32_t));
    made->vertex_count = vertex_count;
    made->triangle_count = triangle_count;
    for (uint32_t t = 0; t < (uint32_t)triangle_count; t++) {
        const double *const corner[3] = {corner_of(made, t, 0), corner_of(made, t, 1), corner_of(made, t, 2)};
        if (find_normal(corner, &made->normals[3 * (size_t)t])) {
            made->order[made->kept++] = t;
        }
    }
    if (made->kept == 0) {
        ces_mesh_destroy(made);
        return ces_fail(error, CES_INPUT, "surface '%s': none of the %zu triangles has an area", name, triangle_count);
    }
    find_extent(made);
    build(made, 0, made->kept);
    *mesh = made;
    return CES_OK;
}

void ces_mesh_destroy(ces_Mesh *mesh)
{
    if (mesh == NULL) {
        return;
    }
    ces_free(mesh->vertices);
    ces_free(mesh->triangles);
    ces_free(mesh->normals);
    ces_free(mesh->order);
    ces_free(mesh->nodes);
    ces_free(mesh);
}

/* ---- the search ---------------------------------------------------------------------------------------------------------- */

ces_Triangle ces_mesh_triangle(const ces_Mesh *mesh, uint32_t triangle)
{
    ces_Triangle result;
    for (size_t k = 0; k < 3; k++) {
        ces_copy(corner_of(mesh, triangle, k), result.corner[k]);
    }
    ces_copy(&mesh->normals[3 * (size_t)triangle], result.normal);
    return result;
}

static bool overlap(const double lower[3], const double upper[3], const double other_lower[3],
                    const double other_upper[3])
{
    return lower[0] <= other_upper[0] && other_lower[0] <= upper[0] && lower[1] <= other_upper[1] &&
           other_lower[1] <= upper[1] && lower[2] <= other_upper[2] && other_lower[2] <= upper[2];
}

static bool triangle_overlaps(const ces_Mesh *mesh, uint32_t triangle, const double lower[3], const double upper[3])
{
    const double *a = corner_of(mesh, triangle, 0), *b = corner_of(mesh, triangle, 1),
                 *c = corner_of(mesh, triangle, 2);
    for (int k = 0; k < 3; k++) {
        if (ces_min(a[k], ces_min(b[k], c[k])) > upper[k] || ces_max(a[k], ces_max(b[k], c[k])) < lower[k]) {
            return false;
        }
    }
    return true;
}

void ces_mesh_query(const ces_Mesh *mesh, const double lower[3], const double upper[3], ces_MeshVisit *visit,
                    void *context)
{
    for (size_t n = 0; n < mesh->node_count;) {
        const ces_MeshNode *node = &mesh->nodes[n];
        if (!overlap(node->lower, node->upper, lower, upper)) {
            n = node->next;
            continue;
        }
        for (size_t k = node->first; k < node->last; k++) {
            if (triangle_overlaps(mesh, mesh->order[k], lower, upper)) {
                visit(context, mesh->order[k]);
            }
        }
        n++;
    }
}

size_t ces_mesh_count(const ces_Mesh *mesh, const double lower[3], const double upper[3], size_t most)
{
    size_t count = 0;
    for (size_t n = 0; n < mesh->node_count && count < most;) {
        const ces_MeshNode *node = &mesh->nodes[n];
        if (!overlap(node->lower, node->upper, lower, upper)) {
            n = node->next;
            continue;
        }
        for (size_t k = node->first; k < node->last; k++) {
            count += triangle_overlaps(mesh, mesh->order[k], lower, upper);
        }
        n++;
    }
    return count < most ? count : most;
}

double ces_mesh_distance(const ces_Mesh *mesh, const double point[3], double most, double normal[3])
{
    double least = most;
    for (size_t n = 0; n < mesh->node_count;) {
        const ces_MeshNode *node = &mesh->nodes[n];
        double off = 0.0; /* m2, from the box */
        for (int k = 0; k < 3; k++) {
            const double beyond = ces_max(ces_max(node->lower[k] - point[k], point[k] - node->upper[k]), 0.0);
            off += beyond * beyond;
        }
        if (off >= least * least) {
            n = node->next;
            continue;
        }
        for (size_t k = node->first; k < node->last; k++) {
            const ces_Triangle triangle = ces_mesh_triangle(mesh, mesh->order[k]);
            double direction[3];
            const double distance = ces_triangle_distance(&triangle, point, direction);
            if (distance < least) {
                least = distance;
                ces_copy(direction, normal);
            }
        }
        n++;
    }
    return least;
}
