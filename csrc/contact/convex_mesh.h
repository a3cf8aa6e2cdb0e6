/*
 * contact/convex_mesh.h - where the free path of a convex body meets a triangle mesh.
 *
 * Each triangle is a convex body of its own. As for balls (mesh_contact.h) two things keep the seams from being felt: what is
 * met at an edge or corner of a triangle counts only where no triangle that meets there stands out before the contact; and
 * behind the first triangle that it hits the body does not go on through the mesh but along it, as the grain will, and what
 * it meets there it may come up to, and no farther. All vectors are in the frame of the mesh.
 */
#ifndef CES_CONVEX_MESH_H
#define CES_CONVEX_MESH_H

#include "narrow_phase.h"

enum { CES_CONVEX_MESH_POINTS = 16, CES_MESH_PARTS = 8 }; /* the latter of a triangle: it, its corners, its edges */

typedef struct ces_ConvexMeshPath {
    ces_Convex body;    /* at the start */
    double path[3];     /* m, in the step */
    double margin;      /* m: what passes nearer than this counts */
    double sweep;       /* m: no point of the body turns farther in the step */
    double restitution; /* how far the path turns back where it hits */
} ces_ConvexMeshPath;

/* A point of contact. Its place is that of the body at a fraction of the path. */
typedef struct ces_ConvexMeshPoint {
    double arm[3], normal[3]; /* m, from the body's centre; towards the body */
    double gap;               /* m, at that fraction */
    double fraction;
    bool held; /* met behind the first hit: from the fraction on it may close its gap, and no more */
    uint32_t part_body, part_mesh; /* feature; CES_MESH_PARTS triangle + feature of it */
} ces_ConvexMeshPoint;

/* Fills points in the order of (part_body, part_mesh); gives their number. */
size_t ces_convex_mesh_points(const ces_Mesh *mesh, const ces_ConvexMeshPath *path,
                              ces_ConvexMeshPoint points[CES_CONVEX_MESH_POINTS]);
/* How deep a body is in a triangle along the normal that it was met with: none where they are apart. */
void ces_convex_triangle_manifold(const ces_Mesh *mesh, uint32_t triangle, const ces_Convex *body,
                                  const double normal[3], ces_Manifold *manifold);

#endif
