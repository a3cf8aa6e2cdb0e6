/*
 * scene/snapshot.c - the whole state of a scene as named blocks of numbers: saved, restored and hashed by one table.
 * What the definition gives is not state. Small blocks are assembled here; the columns of the grains go as they are.
 */
#include <math.h>
#include <string.h>

#include "../base/status.h"
#include "../base/vec3.h"
#include "scene.h"
#include "snapshot_lists.h"

enum { COUNTERS = 16, MEASURES = 4, USE_INTS = 4 };

typedef struct BlockRow {
    const char *name;
    ces_ColumnType type;
    uint32_t width;
    size_t (*count)(const ces_Scene *scene);
    void (*save)(const ces_Scene *scene, void *data);
    void (*load)(ces_Scene *scene, const void *data, size_t count);
} BlockRow;

/* ---- counters ------------------------------------------------------------------------------------------------------- */

static size_t one(const ces_Scene *scene)
{
    (void)scene;
    return 1;
}

static void put_units(ces_Int128 units, int64_t out[2])
{
    out[0] = (int64_t)(units >> 62);
    out[1] = (int64_t)(units & (((ces_Int128)1 << 62) - 1));
}

static ces_Int128 get_units(const int64_t in[2])
{
    return ((ces_Int128)in[0] << 62) + in[1];
}

static void save_counters(const ces_Scene *scene, void *data)
{
    int64_t *out = data;
    const ces_Health *health = &scene->health;
    const uint64_t counts[] = {scene->step_index,       (uint64_t)scene->particles.next_id,
                               health->steps,           health->contact_rows,
                               health->active_contacts, health->iterations,
                               health->islands,         health->unconverged};
    for (size_t k = 0; k < 8; k++) {
        out[k] = (int64_t)counts[k];
    }
    out[8] = (int64_t)health->last_contacts;
    out[9] = (int64_t)health->last_iterations;
    out[10] = (int64_t)scene->ledger.fed_count;
    out[11] = (int64_t)scene->ledger.landed_count;
    out[12] = (int64_t)scene->ledger.lost_count;
    out[13] = (int64_t)scene->contacts.pair_count;
    out[14] = (int64_t)health->visits;
    out[15] = (int64_t)health->limited_charges;
}

static void load_counters(ces_Scene *scene, const void *data, size_t count)
{
    (void)count;
    const int64_t *in = data;
    ces_Health *health = &scene->health;
    uint64_t *const counts[] = {&health->steps,         &health->contact_rows,   &health->active_contacts,
                                &health->iterations,    &health->islands,        &health->unconverged,
                                &health->last_contacts, &health->last_iterations};
    scene->step_index = (uint64_t)in[0];
    scene->particles.next_id = in[1];
    for (size_t k = 0; k < 8; k++) {
        *counts[k] = (uint64_t)in[2 + k];
    }
    scene->ledger.fed_count = (uint64_t)in[10];
    scene->ledger.landed_count = (uint64_t)in[11];
    scene->ledger.lost_count = (uint64_t)in[12];
    scene->contacts.pair_count = (size_t)in[13];
    health->visits = (uint64_t)in[14];
    health->limited_charges = (uint64_t)in[15];
}

static void save_ledger(const ces_Scene *scene, void *data)
{
    int64_t *out = data;
    put_units(scene->ledger.fed, &out[0]);
    put_units(scene->ledger.landed, &out[2]);
    put_units(scene->ledger.lost, &out[4]);
}

static void load_ledger(ces_Scene *scene, const void *data, size_t count)
{
    (void)count;
    const int64_t *in = data;
    scene->ledger.fed = get_units(&in[0]);
    scene->ledger.landed = get_units(&in[2]);
    scene->ledger.lost = get_units(&in[4]);
}

static void save_measures(const ces_Scene *scene, void *data)
{
    const ces_Health *health = &scene->health;
    const double values[MEASURES] = {health->last_residual, health->residual, health->last_penetration,
                                     health->penetration};
    memcpy(data, values, sizeof values);
    ((double *)data)[MEASURES] = health->penetration_ratio;
    ((double *)data)[MEASURES + 1] = health->joint_drift;
    ((double *)data)[MEASURES + 2] = health->pair_force;
    ((double *)data)[MEASURES + 3] = health->pair_defect;
    ((double *)data)[MEASURES + 4] = health->turn;
}

static void load_measures(ces_Scene *scene, const void *data, size_t count)
{
    (void)count;
    const double *in = data;
    scene->health.last_residual = in[0];
    scene->health.residual = in[1];
    scene->health.last_penetration = in[2];
    scene->health.penetration = in[3];
    scene->health.penetration_ratio = in[4];
    scene->health.joint_drift = in[5];
    scene->health.pair_force = in[6];
    scene->health.pair_defect = in[7];
    scene->health.turn = in[8];
}

/* ---- solvers: the time they took is no state ---------------------------------------------------------------------------- */

static size_t solver_count(const ces_Scene *scene)
{
    (void)scene;
    return CES_SOLVER_COUNT;
}

static void save_use_ints(const ces_Scene *scene, void *data)
{
    int64_t *out = data;
    for (size_t k = 0; k < CES_SOLVER_COUNT; k++) {
        const ces_SolverUse *use = &scene->health.solvers[k];
        const int64_t row[USE_INTS] = {(int64_t)use->islands, (int64_t)use->contacts, (int64_t)use->iterations,
                                       (int64_t)use->unconverged};
        memcpy(&out[USE_INTS * k], row, sizeof row);
    }
}

static void load_use_ints(ces_Scene *scene, const void *data, size_t count)
{
    const int64_t *in = data;
    for (size_t k = 0; k < count && k < CES_SOLVER_COUNT; k++, in += USE_INTS) {
        scene->health.solvers[k] = (ces_SolverUse){.islands = (uint64_t)in[0],
                                                   .contacts = (uint64_t)in[1],
                                                   .iterations = (uint64_t)in[2],
                                                   .unconverged = (uint64_t)in[3]};
    }
}

static void save_use_residuals(const ces_Scene *scene, void *data)
{
    for (size_t k = 0; k < CES_SOLVER_COUNT; k++) {
        ((double *)data)[k] = scene->health.solvers[k].residual;
    }
}

static void load_use_residuals(ces_Scene *scene, const void *data, size_t count)
{
    for (size_t k = 0; k < count && k < CES_SOLVER_COUNT; k++) {
        scene->health.solvers[k].residual = ((const double *)data)[k];
    }
}

/* ---- feeder ----------------------------------------------------------------------------------------------------------- */

static ces_FeederState feeder_state(const ces_Scene *scene)
{
    return scene->feeder != NULL ? ces_feeder_state(scene->feeder) : (ces_FeederState){0};
}

static void save_feeder(const ces_Scene *scene, void *data)
{
    const ces_FeederState state = feeder_state(scene);
    /* A count of births stays below 2^53, where a double is exact. */
    ((double *)data)[0] = (double)state.next;
    ((double *)data)[1] = state.mass;
}

static size_t recent_count(const ces_Scene *scene)
{
    return feeder_state(scene).recent_count;
}

static void save_recent(const ces_Scene *scene, void *data)
{
    const ces_FeederState state = feeder_state(scene);
    if (state.recent_count > 0) {
        memcpy(data, state.recent, state.recent_count * CES_RECENT_WIDTH * sizeof(double));
    }
}

/* ---- the table: the columns of the grains come first, then these rows -------------------------------------------------- */

enum {
    BLOCK_COUNTERS,
    BLOCK_LEDGER,
    BLOCK_MEASURES,
    BLOCK_USE_INTS,
    BLOCK_USE_RESIDUALS,
    BLOCK_CONTACT_INTS,
    BLOCK_CONTACT_DOUBLES,
    BLOCK_LANDING_INTS,
    BLOCK_LANDING_DOUBLES,
    BLOCK_PARTS,
    BLOCK_JOINTS,
    BLOCK_FEEDER,
    BLOCK_RECENT,
    BLOCK_COUNT
};

static const BlockRow rows[BLOCK_COUNT] = {
    [BLOCK_COUNTERS] = {"counters", CES_INT64, COUNTERS, one, save_counters, load_counters},
    [BLOCK_LEDGER] = {"ledger", CES_INT64, 6, one, save_ledger, load_ledger},
    [BLOCK_MEASURES] = {"measures", CES_DOUBLE, MEASURES + 5, one, save_measures, load_measures},
    [BLOCK_USE_INTS] = {"solver_counts", CES_INT64, USE_INTS, solver_count, save_use_ints, load_use_ints},
    [BLOCK_USE_RESIDUALS] = {"solver_residuals", CES_DOUBLE, 1, solver_count, save_use_residuals, load_use_residuals},
    [BLOCK_CONTACT_INTS] = {"contact_ids", CES_INT64, CES_CONTACT_INTS, ces_contact_count, ces_save_contact_ints,
                            ces_load_contact_ints},
    [BLOCK_CONTACT_DOUBLES] = {"contact_impulses", CES_DOUBLE, CES_CONTACT_DOUBLES, ces_contact_count,
                               ces_save_contact_doubles, ces_load_contact_doubles},
    [BLOCK_LANDING_INTS] = {"landing_ids", CES_INT64, CES_LANDING_INTS, ces_scene_landing_count, ces_save_landing_ints,
                            ces_load_landing_ints},
    [BLOCK_LANDING_DOUBLES] = {"landing_states", CES_DOUBLE, CES_LANDING_DOUBLES, ces_scene_landing_count,
                               ces_save_landing_doubles, ces_load_landing_doubles},
    [BLOCK_PARTS] = {"parts", CES_DOUBLE, CES_PART_DOUBLES, ces_part_count, ces_save_parts, ces_load_parts},
    [BLOCK_JOINTS] = {"joints", CES_DOUBLE, CES_JOINT_DOUBLES, ces_joint_count, ces_save_joints, ces_load_joints},
    [BLOCK_FEEDER] = {"feeder", CES_DOUBLE, 2, one, save_feeder, NULL},
    [BLOCK_RECENT] = {"feeder_recent", CES_DOUBLE, CES_RECENT_WIDTH, recent_count, save_recent, NULL},
};

static size_t number_size(ces_ColumnType type)
{
    return type == CES_INT32 ? sizeof(int32_t) : sizeof(double);
}

size_t ces_scene_block_count(const ces_Scene *scene)
{
    (void)scene;
    return CES_COLUMN_COUNT + BLOCK_COUNT;
}

ces_Status ces_scene_block(ces_Scene *scene, size_t index, ces_Block *block, ces_Error *error)
{
    if (index >= ces_scene_block_count(scene)) {
        return ces_fail(error, CES_INPUT, "block is %zu, outside [0, %zu]", index, ces_scene_block_count(scene) - 1);
    }
    if (index < CES_COLUMN_COUNT) {
        const ces_ColumnInfo *info = ces_column_info((ces_ColumnName)index);
        const bool there = ces_particles_have(&scene->particles, (ces_ColumnName)index);
        const void *data = there ? ces_buffer_data(scene->particles.columns[index]) : NULL;
        *block = (ces_Block){info->name, info->type, info->width, there ? scene->particles.count : 0, data};
        return CES_OK;
    }
    const BlockRow *row = &rows[index - CES_COLUMN_COUNT];
    const size_t count = row->count(scene);
    if (!ces_pool_reserve(&scene->snapshot, count, row->width * number_size(row->type))) {
        return ces_fail(error, CES_MEMORY, "no memory for block '%s'", row->name);
    }
    row->save(scene, scene->snapshot.data);
    *block = (ces_Block){row->name, row->type, row->width, count, scene->snapshot.data};
    return CES_OK;
}

/* ---- restore: everything is checked before anything changes --------------------------------------------------------------- */

/* What block k of a state is: a column of the particles, or a row of the table above. */
typedef struct Form {
    const char *name;
    ces_ColumnType type;
    uint32_t width;
} Form;

static Form form_of(size_t k)
{
    if (k < CES_COLUMN_COUNT) {
        const ces_ColumnInfo *info = ces_column_info((ces_ColumnName)k);
        return (Form){info->name, info->type, info->width};
    }
    const BlockRow *row = &rows[k - CES_COLUMN_COUNT];
    return (Form){row->name, row->type, row->width};
}

/* How many rows block k must have; as many as it has where the machine does not say. */
static size_t rows_wanted(const ces_Scene *scene, const ces_Block *blocks, size_t k)
{
    if (k < CES_COLUMN_COUNT) {
        return ces_particles_have(&scene->particles, (ces_ColumnName)k) ? blocks[0].count : 0;
    }
    const BlockRow *row = &rows[k - CES_COLUMN_COUNT];
    const bool said = row->count == one || row->count == ces_part_count || row->count == ces_joint_count;
    return said ? row->count(scene) : blocks[k].count;
}

static ces_Status check_finite(const ces_Block *block, ces_Error *error)
{
    const double *values = block->data;
    for (size_t i = 0; i < block->count * block->width; i++) {
        if (!isfinite(values[i])) {
            return ces_fail(error, CES_INPUT, "block '%s' of the state has %g in row %zu", block->name, values[i],
                            i / block->width);
        }
    }
    return CES_OK;
}

static ces_Status check_form(const ces_Scene *scene, const ces_Block *blocks, size_t count, ces_Error *error)
{
    if (count != ces_scene_block_count(scene)) {
        return ces_fail(error, CES_INPUT, "a state has %zu blocks, this one %zu", ces_scene_block_count(scene), count);
    }
    ces_Status status = CES_OK;
    for (size_t k = 0; k < count && status == CES_OK; k++) {
        const Form form = form_of(k);
        if (strcmp(blocks[k].name, form.name) != 0 || blocks[k].type != form.type || blocks[k].width != form.width) {
            return ces_fail(error, CES_INPUT, "block %zu of the state is '%s', must be '%s' with %u numbers a row", k,
                            blocks[k].name, form.name, (unsigned)form.width);
        }
        const size_t wanted = rows_wanted(scene, blocks, k);
        if (blocks[k].count != wanted) {
            return ces_fail(error, CES_INPUT, "block '%s' of the state has %zu rows, this machine has %zu", form.name,
                            blocks[k].count, wanted);
        }
        status = form.type == CES_DOUBLE ? check_finite(&blocks[k], error) : CES_OK;
    }
    return status;
}

static ces_Status check_grains(const ces_Scene *scene, const ces_Block *blocks, ces_Error *error)
{
    const int64_t *id = blocks[CES_ID].data;
    const int32_t *material = blocks[CES_MATERIAL].data, *surface = blocks[CES_SURFACE].data;
    const int32_t *shape = blocks[CES_SHAPE].data;
    const double *diameter = blocks[CES_DIAMETER].data, *mass = blocks[CES_MASS].data;
    const int64_t next_id = ((const int64_t *)blocks[CES_COLUMN_COUNT + BLOCK_COUNTERS].data)[1];
    for (size_t row = 0; row < blocks[CES_ID].count; row++) {
        const bool ordered = id[row] >= (row > 0 ? id[row - 1] + 1 : 0) && id[row] < next_id;
        const bool known = material[row] >= 0 && (size_t)material[row] < scene->def.material_count &&
                           surface[row] >= -1 && surface[row] < (int64_t)scene->def.surface_count && shape[row] >= 0 &&
                           (size_t)shape[row] < scene->shapes.count;
        if (!ordered || !known || !(diameter[row] > 0.0) || !(mass[row] > 0.0)) {
            return ces_fail(error, CES_INPUT,
                            "row %zu of the state is no grain of this scene (id %lld, material %d, diameter %g m)", row,
                            (long long)id[row], (int)material[row], diameter[row]);
        }
    }
    return CES_OK;
}

static ces_Status check_lists(const ces_Block *blocks, ces_Error *error)
{
    const ces_Block *table = &blocks[CES_COLUMN_COUNT];
    const int64_t *counters = table[BLOCK_COUNTERS].data;
    if (table[BLOCK_CONTACT_INTS].count != table[BLOCK_CONTACT_DOUBLES].count ||
        table[BLOCK_LANDING_INTS].count != table[BLOCK_LANDING_DOUBLES].count) {
        return ces_fail(error, CES_INPUT, "the state's contacts or landings have blocks of different length");
    }
    for (size_t k = 0; k < COUNTERS; k++) {
        if (counters[k] < 0) {
            return ces_fail(error, CES_INPUT, "counter %zu of the state is %lld, must not be negative", k,
                            (long long)counters[k]);
        }
    }
    if ((size_t)counters[13] > table[BLOCK_CONTACT_INTS].count) {
        return ces_fail(error, CES_INPUT, "the state has %zu contacts, of which %lld between grains",
                        table[BLOCK_CONTACT_INTS].count, (long long)counters[13]);
    }
    return CES_OK;
}

static ces_FeederState given_feeder(const ces_Block *blocks)
{
    const double *feeder = blocks[CES_COLUMN_COUNT + BLOCK_FEEDER].data;
    const ces_Block *recent = &blocks[CES_COLUMN_COUNT + BLOCK_RECENT];
    return (ces_FeederState){
        .next = fabs(feeder[0]) < 0x1p53 ? (int64_t)feeder[0] : -1,
        .mass = feeder[1],
        .recent = recent->data,
        .recent_count = recent->count,
    };
}

static ces_Status check_state(ces_Scene *scene, const ces_Block *blocks, size_t count, ces_Error *error)
{
    ces_Status status = check_form(scene, blocks, count, error);
    if (status == CES_OK) {
        status = check_lists(blocks, error);
    }
    if (status == CES_OK) {
        status = check_grains(scene, blocks, error);
    }
    if (status == CES_OK && scene->feeder != NULL) {
        const ces_FeederState state = given_feeder(blocks);
        status = ces_feeder_check_state(scene->feeder, &state, error);
    }
    return status;
}

ces_Status ces_scene_restore(ces_Scene *scene, const ces_Block *blocks, size_t count, ces_Error *error)
{
    const ces_Status status = check_state(scene, blocks, count, error);
    if (status != CES_OK) {
        return status;
    }
    const ces_Block *table = &blocks[CES_COLUMN_COUNT];
    if (!ces_particles_reserve(&scene->particles, blocks[CES_ID].count) ||
        !ces_contacts_reserve(&scene->contacts, table[BLOCK_CONTACT_INTS].count) ||
        !ces_pool_grow(&scene->landing_pool, table[BLOCK_LANDING_INTS].count, sizeof(ces_Landing),
                       scene->landing_count * sizeof(ces_Landing))) {
        return ces_fail(error, CES_MEMORY, "no memory for the state of %zu grains", blocks[CES_ID].count);
    }
    scene->particles.count = blocks[CES_ID].count;
    for (size_t name = 0; name < CES_COLUMN_COUNT; name++) {
        if (blocks[name].count > 0) {
            memcpy(ces_buffer_data(scene->particles.columns[name]), blocks[name].data,
                   blocks[name].count * ces_column_size((ces_ColumnName)name));
        }
    }
    for (size_t k = 0; k < BLOCK_COUNT; k++) {
        if (rows[k].load != NULL) {
            rows[k].load(scene, table[k].data, table[k].count);
        }
    }
    if (scene->feeder != NULL) {
        const ces_FeederState state = given_feeder(blocks);
        ces_feeder_set_state(scene->feeder, &state);
    }
    return CES_OK;
}

/* ---- hash --------------------------------------------------------------------------------------------------------------- */

/* FNV-1a: not for secrets, for telling states apart. */
static uint64_t mix(uint64_t hash, const void *data, size_t bytes)
{
    const unsigned char *byte = data;
    for (size_t k = 0; k < bytes; k++) {
        hash = (hash ^ byte[k]) * 0x100000001b3U;
    }
    return hash;
}

uint64_t ces_scene_state_hash(ces_Scene *scene)
{
    uint64_t hash = 0xcbf29ce484222325U;
    for (size_t k = 0; k < ces_scene_block_count(scene); k++) {
        ces_Block block;
        ces_Error error;
        if (ces_scene_block(scene, k, &block, &error) != CES_OK) {
            return 0; /* out of memory: no state hashes to this but by a chance of 2^-64 */
        }
        hash = mix(hash, block.data, block.count * block.width * number_size(block.type));
    }
    return hash;
}
