/* scene/feeder.c - the stream of births: when, where and what, from random numbers of their own. */
#include <math.h>
#include <string.h>

#include "../base/memory.h"
#include "../base/random.h"
#include "../base/status.h"
#include "../base/vec3.h"
#include "feeder_parts.h"

enum {
    FEED_STREAM = 1, /* of the random numbers; the id is the number of the birth */
    DRAW_FAMILY = 0,
    DRAW_DIAMETER = 1,
    DRAW_PLACE = 2, /* two a candidate */
    MOST_CANDIDATES = 4096,
    DRAW_TURN = DRAW_PLACE + 2 * MOST_CANDIDATES, /* three */
    DRAW_CHARGE = DRAW_TURN + 3,
};

double ces_sphere_mass(double density, double diameter)
{
    return density * (CES_PI / 6.0) * diameter * diameter * diameter;
}

void ces_birth_at(const ces_Birth *birth, const double gravity[3], double time, double position[3], double velocity[3])
{
    const double age = time - birth->time;
    for (int k = 0; k < 3; k++) {
        position[k] = birth->position[k] + age * (birth->velocity[k] + 0.5 * age * gravity[k]);
        velocity[k] = birth->velocity[k] + age * gravity[k];
    }
}

/* ---- the stream ---------------------------------------------------------------------------------------------------- */

static double birth_time(const ces_Feeder *feeder, int64_t number, double mass)
{
    if (feeder->rate == 0.0) {
        return HUGE_VAL;
    }
    const double fed = feeder->rate_kind == CES_RATE_MASS ? mass : (double)number;
    const double time = feeder->start + fed / feeder->rate;
    return time < feeder->stop ? time : HUGE_VAL;
}

double ces_feeder_next_time(const ces_Feeder *feeder)
{
    return birth_time(feeder, feeder->next, feeder->mass);
}

/* Its largest width, m. */
static double extent_of(const ces_Feeder *feeder, const ces_Birth *birth)
{
    return birth->diameter * feeder->families[birth->family].width;
}

static bool is_clear_of(const ces_Feeder *feeder, const ces_Birth *birth, double time, const double position[3],
                        double extent)
{
    double distance[3], moved[3];
    ces_outlet_flight(&feeder->outlet, birth->time - time, moved);
    ces_subtract(birth->position, position, distance);
    ces_subtract(distance, moved, distance);
    /* A trifle more than touching, so that rounding elsewhere does not make an overlap of it. */
    const double reach = 0.5 * (extent_of(feeder, birth) + extent) * (1.0 + 1e-9);
    return ces_dot(distance, distance) >= reach * reach;
}

/* Whether birth keeps clear of the births before it: newest first, since they are the nearest. */
static bool is_clear(const ces_Feeder *feeder, const ces_Birth *birth)
{
    const ces_Birth *planned = feeder->planned.data;
    for (size_t i = feeder->planned_count; i-- > 0;) {
        if (birth->time - planned[i].time > feeder->horizon) {
            return true;
        }
        if (!is_clear_of(feeder, birth, planned[i].time, planned[i].position, extent_of(feeder, &planned[i]))) {
            return false;
        }
    }
    const ces_RecentBirth *recent = feeder->recent.data;
    for (size_t i = feeder->recent_count; i-- > 0;) {
        if (birth->time - recent[i].time > feeder->horizon) {
            return true;
        }
        if (!is_clear_of(feeder, birth, recent[i].time, recent[i].position, recent[i].extent)) {
            return false;
        }
    }
    return true;
}

/* Puts birth in the first of its candidate places that is free. */
static ces_Status place(const ces_Feeder *feeder, uint64_t number, ces_Birth *birth, ces_Error *error)
{
    for (uint32_t i = 0; i < MOST_CANDIDATES; i++) {
        const double u = ces_random(feeder->seed, FEED_STREAM, number, DRAW_PLACE + 2 * i);
        const double v = ces_random(feeder->seed, FEED_STREAM, number, DRAW_PLACE + 2 * i + 1);
        ces_outlet_point(&feeder->outlet, extent_of(feeder, birth), u, v, birth->position);
        if (is_clear(feeder, birth)) {
            return CES_OK;
        }
    }
    return ces_fail(error, CES_FEED,
                    "feed.rate, %g %s, does not fit through its outlet of %g m x %g m: at %g s grain %llu (%g m) found "
                    "no free place in %d tries; about %.2g %s fit",
                    feeder->rate, ces_feed_rate_unit(feeder), feeder->outlet.edge[0], feeder->outlet.edge[1],
                    birth->time, (unsigned long long)number, extent_of(feeder, birth), MOST_CANDIDATES,
                    fmin(feeder->fitting_rate, 0.9 * feeder->rate), ces_feed_rate_unit(feeder));
}

/* Uniform over all orientations: Shoemake, "Uniform random rotations", Graphics Gems III (1992) 124. */
static void draw_orientation(const ces_Feeder *feeder, uint64_t number, double orientation[4])
{
    const double u = ces_random(feeder->seed, FEED_STREAM, number, DRAW_TURN);
    const double v = 2.0 * CES_PI * ces_random(feeder->seed, FEED_STREAM, number, DRAW_TURN + 1);
    const double w = 2.0 * CES_PI * ces_random(feeder->seed, FEED_STREAM, number, DRAW_TURN + 2);
    const double low = sqrt(1.0 - u), high = sqrt(u);
    orientation[0] = high * cos(w);
    orientation[1] = low * sin(v);
    orientation[2] = low * cos(v);
    orientation[3] = high * sin(w);
}

static void draw_grain(const ces_Feeder *feeder, uint64_t number, ces_Birth *birth)
{
    const double u = ces_random(feeder->seed, FEED_STREAM, number, DRAW_FAMILY);
    size_t index = 0;
    while (index + 1 < feeder->family_count && u >= feeder->families[index].cumulative) {
        index++;
    }
    const ces_FeedFamily *family = &feeder->families[index];
    ces_copy(feeder->outlet.velocity, birth->velocity);
    birth->diameter = ces_law_quantile(&family->law, ces_random(feeder->seed, FEED_STREAM, number, DRAW_DIAMETER));
    bool limited = false;
    if (family->charge.row != NULL) {
        birth->charge =
            ces_charge_law_draw(&family->charge, ces_sphere_mass(family->density, birth->diameter), birth->diameter,
                                ces_random(feeder->seed, FEED_STREAM, number, DRAW_CHARGE), &limited);
    }
    birth->limited = limited;
    birth->family = (uint32_t)index;
    birth->material = family->material;
    birth->shape = family->shape;
    birth->orientation[0] = 1.0;
    birth->orientation[1] = birth->orientation[2] = birth->orientation[3] = 0.0;
    if (family->turned) {
        draw_orientation(feeder, number, birth->orientation);
    }
}

ces_Status ces_feeder_plan(ces_Feeder *feeder, double until, size_t most, const ces_Birth **births, size_t *count,
                           ces_Error *error)
{
    int64_t number = feeder->next;
    double mass = feeder->mass;
    double time;
    feeder->planned_count = 0;
    while (feeder->planned_count < most && (time = birth_time(feeder, number, mass)) <= until && time < HUGE_VAL) {
        const size_t planned = feeder->planned_count;
        if (!ces_pool_grow(&feeder->planned, planned + 1, sizeof(ces_Birth), planned * sizeof(ces_Birth)) ||
            !ces_pool_grow(&feeder->recent, feeder->recent_count + planned + 1, sizeof(ces_RecentBirth),
                           feeder->recent_count * sizeof(ces_RecentBirth))) {
            feeder->planned_count = 0;
            return ces_fail(error, CES_MEMORY, "out of memory for %zu births of the feed", planned + 1);
        }
        ces_Birth *birth = (ces_Birth *)feeder->planned.data + planned;
        *birth = (ces_Birth){.time = time};
        draw_grain(feeder, (uint64_t)number, birth);
        const ces_Status status = place(feeder, (uint64_t)number, birth, error);
        if (status != CES_OK) {
            feeder->planned_count = 0;
            return status;
        }
        mass += ces_sphere_mass(feeder->families[birth->family].density, birth->diameter);
        number++;
        feeder->planned_count++;
    }
    feeder->planned_mass = mass;
    *births = feeder->planned.data;
    *count = feeder->planned_count;
    return CES_OK;
}

void ces_feeder_commit(ces_Feeder *feeder)
{
    if (feeder->planned_count == 0) {
        return;
    }
    const ces_Birth *planned = feeder->planned.data;
    ces_RecentBirth *recent = feeder->recent.data;
    for (size_t i = 0; i < feeder->planned_count; i++) {
        ces_RecentBirth *row = &recent[feeder->recent_count++];
        row->time = planned[i].time;
        ces_copy(planned[i].position, row->position);
        row->extent = extent_of(feeder, &planned[i]);
    }
    /* What is kept depends on the last birth, not on when the step ended: a snapshot must not either. */
    const double now = planned[feeder->planned_count - 1].time;
    size_t old = 0;
    while (now - recent[old].time > feeder->horizon) {
        old++;
    }
    feeder->recent_count -= old;
    memmove(recent, recent + old, feeder->recent_count * sizeof *recent);
    feeder->next += (int64_t)feeder->planned_count;
    feeder->mass = feeder->planned_mass;
    feeder->planned_count = 0;
}

/* ---- snapshots ----------------------------------------------------------------------------------------------------- */

ces_FeederState ces_feeder_state(const ces_Feeder *feeder)
{
    return (ces_FeederState){feeder->next, feeder->mass, feeder->recent.data, feeder->recent_count};
}

static ces_Status check_recent(const ces_Feeder *feeder, const ces_FeederState *state, ces_Error *error)
{
    double before = feeder->start;
    for (size_t i = 0; i < state->recent_count; i++) {
        const double *row = state->recent + i * CES_RECENT_WIDTH;
        if (!(row[0] >= before && row[0] < feeder->stop && ces_outlet_contains(&feeder->outlet, row + 1) &&
              row[4] > 0.0 && row[4] <= feeder->outlet.edge[0])) {
            return ces_fail(error, CES_INPUT,
                            "the snapshot's recent birth %zu is not one of this feed: time %g s, position (%g, %g, %g) "
                            "m, diameter %g m",
                            i, row[0], row[1], row[2], row[3], row[4]);
        }
        before = row[0];
    }
    return CES_OK;
}

ces_Status ces_feeder_check_state(ces_Feeder *feeder, const ces_FeederState *state, ces_Error *error)
{
    const bool fed = state->next > 0;
    if (state->next < 0 || !(state->mass >= 0.0 && state->mass < HUGE_VAL) || (state->mass > 0.0) != fed ||
        (state->recent_count > 0) != fed || state->recent_count > (uint64_t)state->next ||
        (fed && feeder->rate == 0.0)) {
        return ces_fail(error, CES_INPUT,
                        "the snapshot's feed of %lld births, %g kg, %zu of them recent is not one of this feed",
                        (long long)state->next, state->mass, state->recent_count);
    }
    const ces_Status status = check_recent(feeder, state, error);
    if (status != CES_OK) {
        return status;
    }
    if (!ces_pool_grow(&feeder->recent, state->recent_count, sizeof(ces_RecentBirth),
                       feeder->recent_count * sizeof(ces_RecentBirth))) {
        return ces_fail(error, CES_MEMORY, "out of memory for %zu recent births", state->recent_count);
    }
    return CES_OK;
}

void ces_feeder_set_state(ces_Feeder *feeder, const ces_FeederState *state)
{
    feeder->next = state->next;
    feeder->mass = state->mass;
    feeder->recent_count = state->recent_count;
    feeder->planned_count = 0;
    if (state->recent_count > 0) {
        memmove(feeder->recent.data, state->recent, state->recent_count * sizeof(ces_RecentBirth));
    }
}
