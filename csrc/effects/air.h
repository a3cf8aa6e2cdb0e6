/* effects/air.h - what the effects of the air's flow share: the air itself, and the choice between a law and its limit. */
#ifndef CES_AIR_H
#define CES_AIR_H

#include "effect.h"

#include "../base/status.h"

enum { CES_AIR_LAW, CES_AIR_DENSITY, CES_AIR_VISCOSITY };
enum { CES_AIR_GENERAL_LAW, CES_AIR_LOW_REYNOLDS };

/* The last two of the three parameters, which every such effect has. */
/* clang-format off */
#define CES_AIR_PARAMETERS                                \
    {"density",   "kg/m3", 1.204,   0.0,  1e3, "of the air"}, \
    {"viscosity", "Pa s",  1.81e-5, 1e-9, 1e3, "dynamic, of the air"}
/* clang-format on */

typedef struct ces_Air {
    double density;   /* kg/m3 */
    double viscosity; /* Pa s, dynamic */
    bool low;         /* the law of low Reynolds numbers, whatever they are */
} ces_Air;

static inline ces_Air ces_air(const double *parameters)
{
    return (ces_Air){
        .density = parameters[CES_AIR_DENSITY],
        .viscosity = parameters[CES_AIR_VISCOSITY],
        .low = parameters[CES_AIR_LAW] == CES_AIR_LOW_REYNOLDS,
    };
}

/* Of a sphere of this radius, m, at this speed, m/s. */
static inline double ces_reynolds(const ces_Air *air, double speed, double radius)
{
    return air->density * speed * 2.0 * radius / air->viscosity;
}

/* Starts a state that is a ces_Air. laws: how an error names the two, "0 (..) or 1 (..)". */
static inline ces_Status ces_air_start(const double *parameters, const char *effect, const char *laws, void *state,
                                       ces_Error *error)
{
    if (parameters[CES_AIR_LAW] != CES_AIR_GENERAL_LAW && parameters[CES_AIR_LAW] != CES_AIR_LOW_REYNOLDS) {
        return ces_fail(error, CES_INPUT, "%s.law is %g, must be %s", effect, parameters[CES_AIR_LAW], laws);
    }
    *(ces_Air *)state = ces_air(parameters);
    return CES_OK;
}

#endif
