/*
 * scene/feeder.h - the stream of grains that a feed gives: when, where, how large, of what.
 *
 * The stream depends on the definition and the seed alone. Birth k happens when the mass (or the number) of the births
 * before it has been fed, so that births are as regular as the rate. Planning changes nothing that lasts: a step plans the
 * births it is due, makes room for them, and commits when it has succeeded; a step that fails just does not commit.
 */
#ifndef CES_FEEDER_H
#define CES_FEEDER_H

#include "../data/shapes.h"

typedef struct ces_Birth {
    double time;           /* s */
    double position[3];    /* m, in the outlet */
    double velocity[3];    /* m/s */
    double orientation[4]; /* unit quaternion: every one as likely; a sphere is not turned */
    double diameter;       /* m */
    double charge;         /* C */
    uint32_t family;       /* index */
    int32_t material;      /* index */
    int32_t shape;         /* index */
    int32_t limited;       /* its law asked for more charge than air can hold */
} ces_Birth;

typedef struct ces_Feeder ces_Feeder;

/* shapes: NULL for spheres only. gravity (m/s2, (3)) is the acceleration of a grain on its first way, on which it keeps clear of the ones before it. */
ces_Status ces_feeder_create(const ces_FeedDef *def, const ces_MaterialDef *materials, size_t material_count,
                             const ces_Shapes *shapes, const double gravity[3], uint64_t seed, ces_Feeder **feeder,
                             ces_Error *error);
void ces_feeder_destroy(ces_Feeder *feeder);

/* The births with time <= until that were not committed yet, at most `most` of them; good until the next call. */
ces_Status ces_feeder_plan(ces_Feeder *feeder, double until, size_t most, const ces_Birth **births, size_t *count,
                           ces_Error *error);
/* The planned births have happened. Cannot fail. */
void ces_feeder_commit(ces_Feeder *feeder);

double ces_feeder_next_time(const ces_Feeder *feeder); /* s, of the next birth; infinity: none */

/* Where a grain is, and how fast, at time >= birth->time if nothing but gravity has met it since. A grain born inside a
 * step enters at the end of it in this state, so that its path does not depend on the step. */
void ces_birth_at(const ces_Birth *birth, const double gravity[3], double time, double position[3], double velocity[3]);

double ces_sphere_mass(double density, double diameter); /* kg/m3, m -> kg */

/* The committed state, for snapshots: what it points to is good until the next commit. */
enum { CES_RECENT_WIDTH = 5 };
typedef struct ces_FeederState {
    int64_t next;         /* births so far */
    double mass;          /* kg, fed so far */
    const double *recent; /* (recent_count, CES_RECENT_WIDTH): time, position (3), extent of the births still near */
    size_t recent_count;
} ces_FeederState;

ces_FeederState ces_feeder_state(const ces_Feeder *feeder);
/* Checks a state and makes room for it; the stream goes on as if nothing had been asked. */
ces_Status ces_feeder_check_state(ces_Feeder *feeder, const ces_FeederState *state, ces_Error *error);
/* Takes over a checked state. Cannot fail. */
void ces_feeder_set_state(ces_Feeder *feeder, const ces_FeederState *state);

#endif
