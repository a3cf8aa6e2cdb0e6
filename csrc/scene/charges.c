/* scene/charges.c - the stage "charge": what ions, contacts and decay make of the charges. */
#include "../base/parallel.h"
#include "../base/status.h"
#include "../effects/laws.h"
#include "composite.h"

enum { ROW_BLOCK = 256 };

/* The charge after the step of a grain that is sampled. */
static double charge_after(const ces_Scene *scene, ces_Grain grain)
{
    const ces_Hooks *hooks = &scene->hooks;
    const double step = scene->def.step;
    ces_ChargeFlow flow = {.decay_time = HUGE_VAL};
    for (size_t k = 0; k < hooks->flow_count; k++) {
        hooks->flow[k].effect->flow(hooks->flow[k].state, &grain, &flow);
    }
    grain.charge = ces_charge_after(grain.charge, &flow, step);
    for (size_t k = 0; k < hooks->charge_count; k++) {
        grain.charge = hooks->charge[k].effect->charge(hooks->charge[k].state, &grain, step);
    }
    return grain.charge;
}

/* Whether ions have brought it to the most that air can hold: the limit itself is the ions' (corona_charging). */
static bool reaches_limit(const ces_Grain *grain, double before, double after)
{
    const double most = ces_breakdown_charge(grain->radius) / grain->shape->sphericity * (1.0 - 1e-9);
    return fabs(after) >= most && fabs(before) < most;
}

static void charge_block(void *context, size_t block, size_t first, size_t last)
{
    ces_Scene *scene = context;
    double *charge = scene->charge.data;
    uint32_t limited = 0;
    for (size_t row = first; row < last; row++) {
        ces_Grain grain = ces_grain_at(scene, row, scene->particles.charge[row]);
        ces_sample(scene, scene->hooks.charge_needs, &grain);
        charge[row] = charge_after(scene, grain);
        limited += reaches_limit(&grain, grain.charge, charge[row]);
    }
    ((uint32_t *)scene->limited.data)[block] = limited;
}

/* Gives how many of its charges reach the limit. */
static inline uint32_t charge_mixture(ces_Scene *scene, size_t row)
{
    double *charge = scene->charge.data, *conducted = charge + scene->rows;
    ces_Face faces[2];
    ces_Grain grain = ces_grain_at(scene, row, scene->particles.charge[row]);
    ces_sample(scene, scene->hooks.charge_needs, &grain);
    ces_faces_of(scene, row, grain.charge, scene->particles.conducted[row], faces);
    double parts[2] = {0.0, 0.0};
    uint32_t limited = 0;
    for (int f = 0; f < 2; f++) {
        if (faces[f].share > 0.0) {
            grain.material = faces[f].material;
            grain.charge = faces[f].charge;
            const double after = charge_after(scene, grain);
            limited += reaches_limit(&grain, grain.charge, after);
            parts[f] = faces[f].share * after;
        }
    }
    conducted[row] = parts[0];
    charge[row] = parts[0] + parts[1];
    return limited;
}

static void charge_mixed_block(void *context, size_t block, size_t first, size_t last)
{
    ces_Scene *scene = context;
    uint32_t limited = 0;
    for (size_t row = first; row < last; row++) {
        limited += charge_mixture(scene, row);
    }
    ((uint32_t *)scene->limited.data)[block] = limited;
}

static void charge_composites_block(void *context, size_t block, size_t first, size_t last)
{
    ces_Scene *scene = context;
    const ces_Particles *particles = &scene->particles;
    double *charge = scene->charge.data, *conducted = charge + scene->rows;
    uint32_t limited = 0;
    for (size_t row = first; row < last; row++) {
        if (!ces_is_composite(scene, row)) {
            limited += charge_mixture(scene, row);
            continue;
        }
        const ces_Grain whole = ces_grain_at(scene, row, particles->charge[row]);
        double parts[CES_PHASES] = {0.0, 0.0};
        for (int f = 0; f < CES_PHASES; f++) {
            ces_Phase phase;
            if (ces_phase_of(scene, row, f, &whole, whole.orientation, particles->conducted[row], &phase)) {
                ces_sample(scene, scene->hooks.charge_needs, &phase.grain);
                parts[f] = charge_after(scene, phase.grain);
                limited += reaches_limit(&phase.grain, phase.grain.charge, parts[f]);
            }
        }
        conducted[row] = parts[0];
        charge[row] = parts[0] + parts[1];
    }
    ((uint32_t *)scene->limited.data)[block] = limited;
}

ces_Status ces_stage_charge(ces_Scene *scene, ces_Error *error)
{
    if (!scene->hooks.charges) {
        return CES_OK;
    }
    if (!ces_pool_reserve(&scene->charge, scene->rows, (scene->mixed ? 2 : 1) * sizeof(double)) ||
        !ces_pool_reserve(&scene->limited, ces_block_count(scene->rows, ROW_BLOCK), sizeof(uint32_t))) {
        return ces_fail(error, CES_MEMORY, "no memory for the charges of %zu grains", scene->rows);
    }
    ces_Span *const span = scene->shapes.composites ? charge_composites_block
                           : scene->mixed           ? charge_mixed_block
                                                    : charge_block;
    ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, span, scene);
    return CES_OK;
}

/* Nothing is cut off in silence: before the new charges take the old ones' place. */
void ces_count_limited_charges(ces_Scene *scene)
{
    for (size_t k = 0; k < scene->born; k++) {
        scene->health.limited_charges += scene->births[k].limited != 0;
    }
    const uint32_t *limited = scene->limited.data;
    for (size_t block = 0; scene->hooks.charges && block < ces_block_count(scene->rows, ROW_BLOCK); block++) {
        scene->health.limited_charges += limited[block];
    }
}
