/*
 * contact/mesh_contact.h - where a sphere's free path meets a triangle mesh: one contact for each direction that it meets.
 *
 * The distance to a mesh is not convex, that to one of its triangles is. So each triangle is approached by itself, and
 * two things keep the seams from being felt:
 *   - a contact at an edge or a corner counts only where it is the nearest point of all triangles that meet there, that
 *     is, where its normal lies in the cone that none of their faces claims: never inside a plane or in a valley;
 *   - behind the first triangle that it hits the path does not go on through the mesh but along it, as the grain will,
 *     and further contacts are looked for there. So what lies hidden behind a face is not met.
 * All vectors are in the frame of the mesh.
 */
#ifndef CES_MESH_CONTACT_H
#define CES_MESH_CONTACT_H

#include "../data/mesh.h"
#include "narrow_phase.h"

enum { CES_MESH_CONTACTS = 16 }; /* of one sphere with one mesh; the nearest ones */

typedef struct ces_MeshContact {
    ces_Approach approach; /* gap and fraction are those of the plane of the contact along the whole free path */
    uint32_t triangle;
    ces_TriangleFeature feature;
    double plane_gap; /* m, at the start of the path, from the plane through the contact */
} ces_MeshContact;

typedef struct ces_MeshPath {
    double center[3];   /* m, of the sphere at the start */
    double path[3];     /* m, in the step */
    double radius;      /* m */
    double margin;      /* m: what passes nearer than this counts */
    double restitution; /* how far the path turns back where it hits */
    bool touched;       /* see ces_approach_surface */
} ces_MeshPath;

/*
 * Turns what is left of a path (rest) away from the plane of normals (last + 1, 3) that it ran into last, with restitution, and from the
 * planes before that one: along the line where two of them meet, if need be. False: it ends here, or is shorter than a
 * trifle of size. For spheres and convex bodies alike.
 */
bool ces_turn_aside(const double *normals, int last, double restitution, double size, double rest[3]);

/* Fills contacts in ascending order of triangles; gives their number. */
size_t ces_mesh_contacts(const ces_Mesh *mesh, const ces_MeshPath *path, ces_MeshContact contacts[CES_MESH_CONTACTS]);

#endif
