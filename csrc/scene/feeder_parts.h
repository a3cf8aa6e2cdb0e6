/* scene/feeder_parts.h - what a feeder is made of; seen by csrc/scene/feeder*.c only. */
#ifndef CES_FEEDER_PARTS_H
#define CES_FEEDER_PARTS_H

#include <assert.h>

#include "charge_law.h"
#include "feeder.h"
#include "outlet.h"

typedef struct ces_FeedFamily {
    ces_Law law;
    ces_ChargeLaw charge;
    double density;    /* kg/m3 */
    double cumulative; /* probability by number of this family or one before it */
    double width;      /* of a grain in any direction at the most, over its diameter */
    int32_t material, shape;
    bool turned; /* its orientation is drawn */
} ces_FeedFamily;

/* A birth that the next ones must keep clear of; a row of ces_FeederState.recent. */
typedef struct ces_RecentBirth {
    double time;        /* s */
    double position[3]; /* m */
    double extent;      /* m, its largest width */
} ces_RecentBirth;

static_assert(sizeof(ces_RecentBirth) == CES_RECENT_WIDTH * sizeof(double),
              "a snapshot keeps recent births as plain doubles");

struct ces_Feeder {
    uint64_t seed;
    ces_RateKind rate_kind;
    double rate;        /* kg/s or 1/s */
    double start, stop; /* s */
    ces_Outlet outlet;
    ces_FeedFamily *families;
    double *tables; /* the families' tables, one after the other */
    size_t family_count;
    double births_per_rate; /* 1/s a rate of 1: 1/kg, or 1 */
    double horizon;         /* s, after which a grain is clear of the outlet for ever */
    double fitting_rate;    /* as rate; an estimate of the largest that fits */

    int64_t next;    /* number of the next birth */
    double mass;     /* kg, of the births before */
    ces_Pool recent; /* ces_RecentBirth (recent_count), oldest first, none older than the horizon */
    size_t recent_count;
    ces_Pool planned; /* ces_Birth (planned_count) */
    size_t planned_count;
    double planned_mass; /* kg, fed when the planned births have happened */
};

const char *ces_feed_rate_unit(const ces_Feeder *feeder); /* "kg/s" or "1/s" */

#endif
