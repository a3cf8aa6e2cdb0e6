/* data/machine.h - the surfaces of the machine: analytic ones and meshes, with a motion that is prescribed or that of a dynamic part. */
#ifndef CES_MACHINE_H
#define CES_MACHINE_H

#include "../cesim.h"
#include "joints.h"
#include "mesh.h"

/* What a surface has from the dynamic part that it belongs to. */
typedef struct ces_Carriage {
    double position[3], orientation[4]; /* of the surface, in the part's frame */
    double turn[3];                     /* rad, of its frame in the coming step */
    double skin;                        /* m, between its path and its velocity at the end of the step */
    ces_Motion start, end;              /* of the part, at the start and at the end of the free step */
    bool yields;                        /* the part's joints leave it some freedom */
} ces_Carriage;

typedef struct ces_Surface {
    ces_SurfaceDef def;
    double rotation[3][3]; /* local to world, now; row k is world axis k */
    double half[3];   /* m: box half edges; cylinder (radius, radius, half length); mesh: of the box round its origin */
    double bounds[3]; /* m, half edges of its box in the world; unused for a plane */
    double center[3]; /* m, now */
    double displacement[3]; /* m, of the shape in the coming step */
    double velocity[3];     /* m/s, of the shape, its mean in the coming step */
    double travel;          /* m, no point of it moves farther in the coming step */
    double spin[3];         /* rad/s, world; of a mesh the mean in the coming step: a chord, not an arc */
    ces_Mesh *mesh;         /* NULL unless the shape is a mesh */
    bool turns;             /* its frame turns in the coming step */
    double rest[3][3];      /* of a mesh that turns by itself: its rotation at time 0; */
    double middle[3][3];    /* of all that turn, their rotation halfway through the coming step, */
    double end[3][3];       /* and at its end */
    ces_Carriage carriage;  /* of a surface that belongs to a dynamic part */
} ces_Surface;

ces_Status ces_surface_create(const ces_SurfaceDef *def, ces_Surface *surface, ces_Error *error);
void ces_surface_free(ces_Surface *surface);
/* Fixes the surface to the dynamic part that its definition names, where both are at time 0. */
ces_Status ces_surface_attach(ces_Surface *surface, const ces_PartDef *part, bool yields, ces_Error *error);

/* Puts the surface where it is at time, ready for a step of this size. */
void ces_surface_place(ces_Surface *surface, double time, double step);

/* The same for one that belongs to a part, which moves from start to end in the step. */
void ces_surface_follow(ces_Surface *surface, const ces_Motion *start, const ces_Motion *end, double step);

/* The path of a point that moves by path in the world while the surface moves, as seen from it, in the directions of the start
 * of the step. */
void ces_surface_path(const ces_Surface *surface, const double point[3], const double path[3], double relative[3]);
/* A direction that belongs to the surface as it points at a fraction of the step. */
void ces_surface_turn(const ces_Surface *surface, double fraction, double direction[3]);

/* Signed distance of a point, m, and the outward normal there. Outside it is exact, so it is convex along any line;
 * that of a mesh is neither signed nor convex. */
double ces_surface_distance(const ces_Surface *surface, const double point[3], double normal[3]);

/* Into the frame of a mesh and out of it. The path is that of a point that moves by path in the world while the mesh moves. */
void ces_surface_to_mesh(const ces_Surface *surface, const double point[3], const double path[3], double local[3],
                         double local_path[3]);
/* A direction in the mesh, as it points in the world halfway through the step. */
void ces_surface_from_mesh(const ces_Surface *surface, const double direction[3], double world[3]);

/* Velocity of the shape at a point of it, m/s: what a surface that moves in itself does not have. Mean in the coming step. */
void ces_surface_shape_velocity(const ces_Surface *surface, const double point[3], double velocity[3]);

/* Velocity of the surface's matter at a point of it, m/s. */
void ces_surface_velocity(const ces_Surface *surface, const double point[3], double velocity[3]);

/* Velocity of a part's matter at the end of an arm from its centre of mass, m/s. */
void ces_matter_velocity(const ces_Motion *part, const double arm[3], double velocity[3]);

/* False when no part of the surface is within reach of the point (a cheap test; true promises nothing). */
static inline bool ces_surface_within(const ces_Surface *surface, const double point[3], double reach)
{
    if (surface->def.shape == CES_PLANE) {
        const double(*r)[3] = surface->rotation; /* the normal is its column 1 */
        const double *c = surface->center;
        return r[0][1] * (point[0] - c[0]) + r[1][1] * (point[1] - c[1]) + r[2][1] * (point[2] - c[2]) <= reach;
    }
    for (int k = 0; k < 3; k++) {
        const double off = point[k] - surface->center[k];
        if (off > surface->bounds[k] + reach || -off > surface->bounds[k] + reach) {
            return false;
        }
    }
    return true;
}

#endif
