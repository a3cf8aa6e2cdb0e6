/* scene/crowd.c - forces between grains: of all effects that have them, before the stage "force" looks at one by one. */
#include <string.h>

#include "../base/parallel.h"
#include "../base/status.h"
#include "scene.h"

enum { ROW_BLOCK = 256 };

static void middle_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    ces_Scene *scene = context;
    double *position = scene->crowd.position.data;
    for (size_t row = first; row < last; row++) {
        ces_middle_of_path(scene, row, &position[3 * row]);
    }
}

/* False: out of memory. */
static bool sum_up(ces_Scene *scene)
{
    ces_CrowdWork *work = &scene->crowd;
    if (!ces_pool_reserve(&work->position, scene->rows, 3 * sizeof(double)) ||
        !ces_pool_reserve(&work->force, scene->rows, 3 * sizeof(double))) {
        return false;
    }
    memset(work->force.data, 0, scene->rows * 3 * sizeof(double));
    ces_parallel_for(scene->rows, ROW_BLOCK, scene->def.threads, middle_block, scene);
    const ces_Crowd crowd = {
        .count = scene->rows,
        .position = work->position.data,
        .charge = scene->hooks.charges ? scene->charge.data : scene->particles.charge,
        .diameter = scene->particles.diameter,
        .step = scene->step_index,
        .threads = scene->def.threads,
    };
    bool enough = true;
    for (size_t k = 0; k < scene->hooks.prepare_count && enough; k++) {
        const ces_Hook *hook = &scene->hooks.prepare[k];
        ces_CrowdError own = {0.0, 0.0};
        enough = hook->effect->prepare(hook->state, &crowd, work->pools[k], work->force.data, &own);
        work->error.defect += own.defect;
        work->error.force += own.force;
    }
    work->given = work->force.data;
    work->stride = 3;
    return enough;
}

ces_Status ces_crowd_prepare(ces_Scene *scene, ces_Error *error)
{
    static const double nothing[3] = {0.0, 0.0, 0.0};
    scene->crowd.error = (ces_CrowdError){0.0, 0.0};
    scene->crowd.given = nothing;
    scene->crowd.stride = 0;
    if (scene->hooks.prepare_count > 0 && !sum_up(scene)) {
        return ces_fail(error, CES_MEMORY, "no memory for the forces between %zu grains", scene->rows);
    }
    return CES_OK;
}
