/*
 * scene/outlet.h - the rectangle a feed comes out of, and how long grains that leave it one after the other, all at the
 * same velocity and then in free flight, are in each other's way.
 */
#ifndef CES_OUTLET_H
#define CES_OUTLET_H

#include "../cesim.h"

typedef struct ces_Outlet {
    double center[3];   /* m */
    double axis[3][3];  /* unit vectors: along its edges, and normal to it */
    double edge[2];     /* m, lengths of the edges */
    double velocity[3]; /* m/s, of a grain that leaves */
    double gravity[3];  /* m/s2 */
} ces_Outlet;

ces_Status ces_outlet_start(const ces_FeedDef *def, const double gravity[3], ces_Outlet *outlet, ces_Error *error);

/* A point for the centre of a grain wholly inside, for (u, v) in the unit square. */
void ces_outlet_point(const ces_Outlet *outlet, double diameter, double u, double v, double position[3]);
bool ces_outlet_contains(const ces_Outlet *outlet, const double position[3]);

/* s, after which a grain of this diameter touches no equal one that is just leaving: for the first time, or for ever
 * (a grain thrown up comes back). Infinity if that is never. */
double ces_outlet_first_clear(const ces_Outlet *outlet, double diameter);
double ces_outlet_last_clear(const ces_Outlet *outlet, double diameter);

/* m, where a grain has moved in age seconds of free flight. */
void ces_outlet_flight(const ces_Outlet *outlet, double age, double moved[3]);

#endif
