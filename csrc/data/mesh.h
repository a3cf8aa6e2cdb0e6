/*
 * data/mesh.h - a triangle mesh as a thin surface in a frame of its own, and the search for its triangles.
 *
 * It need not be closed, nor have neighbours that share their corners: what lies next to what is asked by distance
 * (contact/mesh_contact.h), so a corner in the middle of another triangle's edge is as good as a shared one.
 */
#ifndef CES_MESH_H
#define CES_MESH_H

#include "../cesim.h"
#include "triangle.h"

/* Nodes stand in the order of a walk that enters every box; what a box holds ends before the node next. */
typedef struct ces_MeshNode {
    double lower[3], upper[3]; /* m */
    uint32_t first, last;      /* of the mesh's order; a leaf's own triangles, else first = last */
    uint32_t next;
} ces_MeshNode;

typedef struct ces_Mesh {
    double *vertices;    /* m (vertex_count, 3) */
    uint32_t *triangles; /* (triangle_count, 3), as they were given */
    double *normals;     /* (triangle_count, 3) */
    uint32_t *order;     /* (kept): the triangles that have an area, leaf by leaf */
    ces_MeshNode *nodes; /* (node_count) */
    size_t vertex_count, triangle_count, node_count;
    size_t kept;    /* triangles; the others have no area, and are not there */
    double half[3]; /* m, of the box round the origin that holds all */
    double spread;  /* m, greatest distance of a vertex from the z axis */
} ces_Mesh;

/* Copies and checks; NULL in *mesh on failure. name is for the message. */
ces_Status ces_mesh_create(const char *name, const double *vertices, size_t vertex_count, const uint32_t *triangles,
                           size_t triangle_count, ces_Mesh **mesh, ces_Error *error);
void ces_mesh_destroy(ces_Mesh *mesh);

ces_Triangle ces_mesh_triangle(const ces_Mesh *mesh, uint32_t triangle);

/* Called for every triangle whose box overlaps a box, in one order. */
typedef void ces_MeshVisit(void *context, uint32_t triangle);
void ces_mesh_query(const ces_Mesh *mesh, const double lower[3], const double upper[3], ces_MeshVisit *visit,
                    void *context);

/* How many there are, counted up to most. */
size_t ces_mesh_count(const ces_Mesh *mesh, const double lower[3], const double upper[3], size_t most);

/* Distance of a point, m, from the nearest triangle, and the direction from there to it; most where none is nearer. */
double ces_mesh_distance(const ces_Mesh *mesh, const double point[3], double most, double normal[3]);

#endif
