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

/* A triangle while the tree is built: side by side in memory, since all levels of the tree walk over them. */
typedef struct Item {
    double center[3]; /* three times it, m */
    uint32_t triangle;
} Item;

/* A total order: the tree depends on the mesh alone. */
static bool precedes(const Item *one, const Item *other, int axis)
{
    return one->center[axis] < other->center[axis] ||
           (one->center[axis] == other->center[axis] && one->triangle < other->triangle);
}

/* Some number that depends on both, for pivots: triangles of a file come in patterns, for which a fixed place is a bad one. */
static uint64_t scatter(size_t first, size_t last)
{
    const uint64_t mixed = ((uint64_t)first * 0x9E3779B97F4A7C15u) ^ ((uint64_t)last * 0xC2B2AE3D27D4EB4Fu);
    return (mixed ^ (mixed >> 29)) >> 3;
}

/* Puts the middle-th of [first, last) in its place, what precedes it before it: quickselect with Hoare's partition. */
static void select_middle(Item *items, int axis, size_t first, size_t middle, size_t last)
{
    while (last - first > 1) {
        const Item pivot = items[first + scatter(first, last) % (last - first - 1)]; /* any but the last */
        size_t low = first, end = last;
        for (;;) {
            while (precedes(&items[low], &pivot, axis)) {
                low++;
            }
            while (precedes(&pivot, &items[end - 1], axis)) {
                end--;
            }
            if (low + 1 >= end) {
                break;
            }
            const Item swap = items[low];
            items[low++] = items[--end];
            items[end] = swap;
        }
        /* None of [first, end) comes after any of [end, last), and neither is empty. */
        if (middle < end) {
            last = end;
        } else {
            first = end;
        }
    }
}

static int longest_axis(const Item *items, size_t first, size_t last)
{
    double lower[3] = {HUGE_VAL, HUGE_VAL, HUGE_VAL}, upper[3] = {-HUGE_VAL, -HUGE_VAL, -HUGE_VAL};
    for (size_t k = first; k < last; k++) {
        for (int axis = 0; axis < 3; axis++) {
            lower[axis] = ces_min(lower[axis], items[k].center[axis]);
            upper[axis] = ces_max(upper[axis], items[k].center[axis]);
        }
    }
    int longest = 0;
    for (int axis = 1; axis < 3; axis++) {
        longest = upper[axis] - lower[axis] > upper[longest] - lower[longest] ? axis : longest;
    }
    return longest;
}

/* The node of one leaf; its triangles are put in order. */
static void make_leaf(ces_Mesh *mesh, const Item *items, size_t first, size_t last, ces_MeshNode *node)
{
    node->first = (uint32_t)first;
    node->last = (uint32_t)last;
    for (size_t k = first; k < last; k++) {
        mesh->order[k] = items[k].triangle;
        for (size_t corner = 0; corner < 3; corner++) {
            const double *x = corner_of(mesh, items[k].triangle, corner);
            for (int axis = 0; axis < 3; axis++) {
                node->lower[axis] = ces_min(node->lower[axis], x[axis]);
                node->upper[axis] = ces_max(node->upper[axis], x[axis]);
            }
        }
    }
}

/* Halves at every level, so the recursion is at most 24 deep. Gives the node that holds all of [first, last). */
static const ces_MeshNode *build(ces_Mesh *mesh, Item *items, size_t first, size_t last)
{
    ces_MeshNode *node = &mesh->nodes[mesh->node_count++];
    for (int axis = 0; axis < 3; axis++) {
        node->lower[axis] = HUGE_VAL;
        node->upper[axis] = -HUGE_VAL;
    }
    if (last - first <= LEAF) {
        make_leaf(mesh, items, first, last, node);
    } else {
        const size_t middle = first + (last - first) / 2;
        select_middle(items, longest_axis(items, first, last), first, middle, last);
        const ces_MeshNode *const halves[2] = {build(mesh, items, first, middle), build(mesh, items, middle, last)};
        for (int axis = 0; axis < 3; axis++) {
            node->lower[axis] = ces_min(halves[0]->lower[axis], halves[1]->lower[axis]);
            node->upper[axis] = ces_max(halves[0]->upper[axis], halves[1]->upper[axis]);
        }
    }
    node->next = (uint32_t)mesh->node_count;
    return node;
}

/* The triangles that have an area, with their normals and the tree over them. False: out of memory. */
static bool build_tree(ces_Mesh *mesh)
{
    Item *items = ces_alloc(mesh->triangle_count, sizeof *items);
    if (items == NULL) {
        return false;
    }
    for (uint32_t t = 0; t < (uint32_t)mesh->triangle_count; t++) {
        const double *const corner[3] = {corner_of(mesh, t, 0), corner_of(mesh, t, 1), corner_of(mesh, t, 2)};
        if (find_normal(corner, &mesh->normals[3 * (size_t)t])) {
            Item *item = &items[mesh->kept++];
            item->triangle = t;
            for (int axis = 0; axis < 3; axis++) {
                item->center[axis] = corner[0][axis] + corner[1][axis] + corner[2][axis];
            }
        }
    }
    if (mesh->kept > 0) {
        build(mesh, items, 0, mesh->kept);
    }
    ces_free(items);
    return true;
}

static ces_Status no_memory(const char *name, size_t triangle_count, ces_Error *error)
{
    return ces_fail(error, CES_MEMORY, "no memory for the %zu triangles of surface '%s'", triangle_count, name);
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
        return no_memory(name, triangle_count, error);
    }
    memcpy(made->vertices, vertices, vertex_count * 3 * sizeof(double));
    memcpy(made->triangles, triangles, triangle_count * 3 * sizeof(uint32_t));
    made->vertex_count = vertex_count;
    made->triangle_count = triangle_count;
    if (!build_tree(made)) {
        ces_mesh_destroy(made);
        return no_memory(name, triangle_count, error);
    }
    if (made->kept == 0) {
        ces_mesh_destroy(made);
        return ces_fail(error, CES_INPUT, "surface '%s': none of the %zu triangles has an area", name, triangle_count);
    }
    find_extent(made);
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
