#include "feeder.h"

#include <assert.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../base/memory.h"
#include "../base/random.h"
#include "../base/status.h"
#include "../base/vec3.h"
#include "charge_law.h"
#include "outlet.h"

enum {
    FEED_STREAM = 1, /* of the random numbers; the id is the number of the birth */
    DRAW_FAMILY = 0,
    DRAW_DIAMETER = 1,
    DRAW_PLACE = 2, /* two a candidate */
    MOST_CANDIDATES = 4096,
    DRAW_TURN = DRAW_PLACE + 2 * MOST_CANDIDATES, /* three */
    DRAW_CHARGE = DRAW_TURN + 3,
};

typedef struct Family {
    ces_Law law;
    ces_ChargeLaw charge;
    double density;    /* kg/m3 */
    double cumulative; /* probability by number of this family or one before it */
    double width;      /* of a grain in any direction at the most, over its diameter */
    int32_t material, shape;
    bool turned; /* its orientation is drawn */
} Family;

/* A birth that the next ones must keep clear of; a row of ces_FeederState.recent. */
typedef struct Recent {
    double time;        /* s */
    double position[3]; /* m */
    double extent;      /* m, its largest width */
} Recent;

static_assert(sizeof(Recent) == CES_RECENT_WIDTH * sizeof(double), "a snapshot keeps recent births as plain doubles");

struct ces_Feeder {
    uint64_t seed;
    ces_RateKind rate_kind;
    double rate;        /* kg/s or 1/s */
    double start, stop; /* s */
    ces_Outlet outlet;
    Family *families;
    double *tables; /* the families' tables, one after the other */
    size_t family_count;
    double births_per_rate; /* 1/s a rate of 1: 1/kg, or 1 */
    double horizon;         /* s, after which a grain is clear of the outlet for ever */
    double fitting_rate;    /* as rate; an estimate of the largest that fits */

    int64_t next;    /* number of the next birth */
    double mass;     /* kg, of the births before */
    ces_Pool recent; /* Recent (recent_count), oldest first, none older than the horizon */
    size_t recent_count;
    ces_Pool planned; /* ces_Birth (planned_count) */
    size_t planned_count;
    double planned_mass; /* kg, fed when the planned births have happened */
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

/* ---- creation: all checks ------------------------------------------------------------------------------------------ */

static ces_Status set_rate(ces_Feeder *feeder, const ces_FeedDef *def, ces_Error *error)
{
    if (def->rate_kind != CES_RATE_MASS && def->rate_kind != CES_RATE_COUNT) {
        return ces_fail(error, CES_INPUT, "feed.rate_kind is %d, neither mass (0) nor count (1)", (int)def->rate_kind);
    }
    const char *unit = def->rate_kind == CES_RATE_MASS ? "kg/s" : "1/s";
    ces_Status status = ces_check_range(error, "feed.rate", def->rate, 0.0, 1e12, unit);
    status = status != CES_OK ? status : ces_check_range(error, "feed.start", def->start, 0.0, 1e12, "s");
    if (status != CES_OK) {
        return status;
    }
    if (!(def->stop >= def->start)) {
        return ces_fail(error, CES_INPUT, "feed.stop is %g s, outside [%g, inf] s: it may not be before feed.start",
                        def->stop, def->start);
    }
    feeder->rate_kind = def->rate_kind;
    feeder->rate = def->rate;
    feeder->start = def->start;
    feeder->stop = def->stop;
    return CES_OK;
}

static ces_Status set_family(ces_Feeder *feeder, const ces_FamilyDef *def, size_t index,
                             const ces_MaterialDef *materials, size_t material_count, const ces_Shapes *shapes,
                             ces_Error *error)
{
    char what[48];
    char name[96];
    snprintf(what, sizeof what, "feed.families[%zu]", index);
    if (def->material >= material_count) {
        return ces_fail(error, CES_INPUT, "%s.material is %u, not one of the %zu materials", what,
                        (unsigned)def->material, material_count);
    }
    const size_t shape_count = shapes != NULL ? shapes->count : 1;
    if (def->shape >= shape_count) {
        return ces_fail(error, CES_INPUT, "%s.shape is %u, not one of the %zu shapes", what, (unsigned)def->shape,
                        shape_count);
    }
    snprintf(name, sizeof name, "%s.mass_fraction", what);
    ces_Status status = ces_check_range(error, name, def->mass_fraction, 0.0, 1.0, "of the mass");
    snprintf(name, sizeof name, "materials[%u].density", (unsigned)def->material);
    const double density = materials[def->material].density;
    status = status != CES_OK ? status : ces_check_range(error, name, density, 1e-6, 1e6, "kg/m3");
    Family *family = &feeder->families[index];
    status = status != CES_OK ? status : ces_law_start(def, what, &family->law, error);
    status = status != CES_OK ? status : ces_charge_law_start(def, what, &family->charge, error);
    if (status != CES_OK) {
        return status;
    }
    family->density = density;
    family->material = (int32_t)def->material;
    family->shape = (int32_t)def->shape;
    family->turned = def->shape > 0 && shapes->list[def->shape].def.kind != CES_SPHERE;
    family->width = family->turned ? 2.0 * shapes->list[def->shape].reach : 1.0;
    const double shorter = fmin(feeder->outlet.edge[0], feeder->outlet.edge[1]);
    if (family->law.most * family->width > shorter) {
        return ces_fail(error, CES_INPUT,
                        "%s: the law \"%s\" reaches up to grains of %g m, outside (0, %g] m: larger than the "
                        "outlet's shorter edge; widen the outlet or truncate the law by least and most",
                        what, def->distribution, family->law.most * family->width, shorter);
    }
    return CES_OK;
}

/* Copies a table to a place of our own; the next free place. */
static double *keep_table(const double **rows, size_t count, double *place)
{
    if (*rows == NULL || count == 0) {
        return place;
    }
    memcpy(place, *rows, 2 * count * sizeof *place);
    *rows = place;
    return place + 2 * count;
}

/* Copies the tables, then makes the laws, which borrow them. */
static ces_Status set_families(ces_Feeder *feeder, const ces_FeedDef *def, const ces_MaterialDef *materials,
                               size_t material_count, const ces_Shapes *shapes, ces_Error *error)
{
    if (def->families == NULL || def->family_count == 0) {
        return ces_fail(error, CES_INPUT, "feed.families is empty; a feed needs at least one family");
    }
    size_t rows = 0;
    double fractions = 0.0;
    for (size_t i = 0; i < def->family_count; i++) {
        rows += def->families[i].table != NULL ? def->families[i].table_count : 0;
        rows += def->families[i].charge_table != NULL ? def->families[i].charge_table_count : 0;
        fractions += def->families[i].mass_fraction;
    }
    feeder->family_count = def->family_count;
    feeder->families = ces_alloc(def->family_count, sizeof *feeder->families);
    feeder->tables = ces_alloc(rows, 2 * sizeof *feeder->tables);
    if (feeder->families == NULL || feeder->tables == NULL) {
        return ces_fail(error, CES_MEMORY, "out of memory for %zu families of the feed", def->family_count);
    }
    double *table = feeder->tables;
    for (size_t i = 0; i < def->family_count; i++) {
        ces_FamilyDef family = def->families[i];
        table = keep_table(&family.table, family.table_count, table);
        table = keep_table(&family.charge_table, family.charge_table_count, table);
        const ces_Status status = set_family(feeder, &family, i, materials, material_count, shapes, error);
        if (status != CES_OK) {
            return status;
        }
    }
    if (!(fabs(fractions - 1.0) <= 1e-9)) {
        return ces_fail(error, CES_INPUT, "the mass fractions of feed.families sum to %.12g, outside 1 +- 1e-09",
                        fractions);
    }
    return CES_OK;
}

static const char *rate_unit(const ces_Feeder *feeder)
{
    return feeder->rate_kind == CES_RATE_MASS ? "kg/s" : "1/s";
}

/* The part by number of a family is its part by mass over the mean mass of its grains. */
static void set_probabilities(ces_Feeder *feeder, const ces_FeedDef *def)
{
    double births = 0.0; /* a kg */
    double largest = 0.0;
    for (size_t i = 0; i < feeder->family_count; i++) {
        Family *family = &feeder->families[i];
        const double mean_mass = family->density * (CES_PI / 6.0) * ces_law_moment(&family->law, 3);
        births += def->families[i].mass_fraction / mean_mass;
        family->cumulative = births;
        largest = fmax(largest, family->law.most * family->width);
    }
    for (size_t i = 0; i < feeder->family_count; i++) {
        feeder->families[i].cumulative /= births;
    }
    feeder->births_per_rate = feeder->rate_kind == CES_RATE_MASS ? births : 1.0;
    feeder->horizon = ces_outlet_last_clear(&feeder->outlet, largest);
}

/* Disks strewn one by one over an area, each where it overlaps no other, cover 0.547 of it when no more find room (Feder,
 * J. Theor. Biol. 87 (1980) 237); here every grain covers its disk until it is clear of the outlet. Measured: from 0.55
 * (laws of broad sizes) to 1.35 times as many fit, hence the margin. */
static ces_Status check_capacity(ces_Feeder *feeder, ces_Error *error)
{
    double square = 0.0; /* m2, mean of diameter^2 by number */
    double cube = 0.0;   /* m3 */
    double before = 0.0;
    for (size_t i = 0; i < feeder->family_count; i++) {
        const Family *family = &feeder->families[i];
        const double part = family->cumulative - before;
        square += part * ces_law_moment(&family->law, 2) * family->width * family->width;
        cube += part * ces_law_moment(&family->law, 3) * family->width * family->width * family->width;
        before = family->cumulative;
    }
    const double *edge = feeder->outlet.edge;
    const double typical = cube / square; /* m, the mean diameter of Sauter: where the area and the time are */
    const double residence = fmin(ces_outlet_first_clear(&feeder->outlet, typical), feeder->stop - feeder->start);
    const double room = 0.547 * (edge[0] + 0.2 * typical) * (edge[1] + 0.2 * typical);
    const double covered = residence * (CES_PI / 4.0) * square; /* m2, times births a second */
    feeder->fitting_rate = room / (covered * feeder->births_per_rate);
    const double most = 1.5 * feeder->fitting_rate;
    if (feeder->rate <= most) {
        return CES_OK;
    }
    return ces_fail(
        error, CES_INPUT,
        "feed.rate is %g %s, outside [0, %.3g] %s: about %.2g %s fit through an outlet of %g m x %g m that a "
        "grain of %g m needs %g s to clear",
        feeder->rate, rate_unit(feeder), most, rate_unit(feeder), feeder->fitting_rate, rate_unit(feeder), edge[0],
        edge[1], typical, residence);
}

ces_Status ces_feeder_create(const ces_FeedDef *def, const ces_MaterialDef *materials, size_t material_count,
                             const ces_Shapes *shapes, const double gravity[3], uint64_t seed, ces_Feeder **feeder,
                             ces_Error *error)
{
    ces_Feeder *made = ces_alloc(1, sizeof *made);
    if (made == NULL) {
        return ces_fail(error, CES_MEMORY, "out of memory for a feeder");
    }
    made->seed = seed;
    ces_Status status = set_rate(made, def, error);
    if (status == CES_OK && made->rate > 0.0) { /* without a rate nothing else has a meaning */
        status = ces_outlet_start(def, gravity, &made->outlet, error);
        status = status != CES_OK ? status : set_families(made, def, materials, material_count, shapes, error);
        if (status == CES_OK) {
            set_probabilities(made, def);
            status = check_capacity(made, error);
        }
    }
    if (status != CES_OK) {
        ces_feeder_destroy(made);
        return status;
    }
    *feeder = made;
    return CES_OK;
}

void ces_feeder_destroy(ces_Feeder *feeder)
{
    if (feeder == NULL) {
        return;
    }
    ces_pool_free(&feeder->planned);
    ces_pool_free(&feeder->recent);
    ces_free(feeder->tables);
    ces_free(feeder->families);
    ces_free(feeder);
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
    const Recent *recent = feeder->recent.data;
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
                    feeder->rate, rate_unit(feeder), feeder->outlet.edge[0], feeder->outlet.edge[1], birth->time,
                    (unsigned long long)number, extent_of(feeder, birth), MOST_CANDIDATES,
                    fmin(feeder->fitting_rate, 0.9 * feeder->rate), rate_unit(feeder));
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
    const Family *family = &feeder->families[index];
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
            !ces_pool_grow(&feeder->recent, feeder->recent_count + planned + 1, sizeof(Recent),
                           feeder->recent_count * sizeof(Recent))) {
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
    Recent *recent = feeder->recent.data;
    for (size_t i = 0; i < feeder->planned_count; i++) {
        Recent *row = &recent[feeder->recent_count++];
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
    if (!ces_pool_grow(&feeder->recent, state->recent_count, sizeof(Recent), feeder->recent_count * sizeof(Recent))) {
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
        memmove(feeder->recent.data, state->recent, state->recent_count * sizeof(Recent));
    }
}
