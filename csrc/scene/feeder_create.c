/* scene/feeder_create.c - a feeder from its definition, with all checks. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "../base/memory.h"
#include "../base/status.h"
#include "../base/vec3.h"
#include "composite.h"
#include "feeder_parts.h"

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
    const ces_Status fits =
        shapes != NULL ? ces_check_composite(shapes, def->shape, def->material, what, error) : CES_OK;
    if (fits != CES_OK) {
        return fits;
    }
    snprintf(name, sizeof name, "%s.mass_fraction", what);
    ces_Status status = ces_check_range(error, name, def->mass_fraction, 0.0, 1.0, "of the mass");
    snprintf(name, sizeof name, "materials[%u].density", (unsigned)def->material);
    const double density = materials[def->material].density;
    status = status != CES_OK ? status : ces_check_range(error, name, density, 1e-6, 1e6, "kg/m3");
    ces_FeedFamily *family = &feeder->families[index];
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

const char *ces_feed_rate_unit(const ces_Feeder *feeder)
{
    return feeder->rate_kind == CES_RATE_MASS ? "kg/s" : "1/s";
}

/* The part by number of a family is its part by mass over the mean mass of its grains. */
static void set_probabilities(ces_Feeder *feeder, const ces_FeedDef *def)
{
    double births = 0.0; /* a kg */
    double largest = 0.0;
    for (size_t i = 0; i < feeder->family_count; i++) {
        ces_FeedFamily *family = &feeder->families[i];
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
        const ces_FeedFamily *family = &feeder->families[i];
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
        feeder->rate, ces_feed_rate_unit(feeder), most, ces_feed_rate_unit(feeder), feeder->fitting_rate,
        ces_feed_rate_unit(feeder), edge[0], edge[1], typical, residence);
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
