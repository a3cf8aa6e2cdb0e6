#include "balls.h"

#include "../base/parallel.h"

enum { ROW_BLOCK = 256 };

typedef struct Task {
    const ces_BallsInput *input;
    const uint32_t *first;
    double *center, *path, *diameter;
} Task;

static size_t ball_count(const ces_Shape *shape)
{
    return shape->def.kind == CES_CLUSTER ? shape->def.sphere_count : 1;
}

/* A ball of a cluster, by its place in the body (over d). */
static void write_ball(const Task *task, size_t row, size_t ball, const double place[3], double radius)
{
    const ces_BallsInput *input = task->input;
    const double d = input->particles->diameter[row];
    double start[3], end[3];
    ces_rotate(&input->particles->orientation[4 * row], place, start);
    ces_rotate(&input->free_orientation[4 * row], place, end);
    for (size_t k = 0; k < 3; k++) {
        task->center[3 * ball + k] = input->particles->position[3 * row + k] + d * start[k];
        task->path[3 * ball + k] = input->displacement[3 * row + k] + d * (end[k] - start[k]);
    }
    task->diameter[ball] = 2.0 * radius * d;
}

static void ball_block(void *context, size_t block, size_t first, size_t last)
{
    (void)block;
    const Task *task = context;
    static const double middle[3] = {0.0, 0.0, 0.0};
    for (size_t row = first; row < last; row++) {
        const ces_Shape *shape = &task->input->shapes[task->input->particles->shape[row]];
        const size_t ball = task->first[row];
        if (shape->def.kind == CES_CLUSTER) {
            for (size_t k = 0; k < shape->def.sphere_count; k++) {
                write_ball(task, row, ball + k, &shape->def.spheres[4 * k], shape->def.spheres[4 * k + 3]);
            }
        } else {
            write_ball(task, row, ball, middle, shape->reach);
        }
    }
}

bool ces_balls_build(ces_Balls *balls, const ces_BallsInput *input)
{
    const ces_Particles *particles = input->particles;
    if (input->only_spheres) {
        balls->center = particles->position;
        balls->path = input->displacement;
        balls->diameter = particles->diameter;
        balls->first = NULL;
        balls->count = input->rows;
        return true;
    }
    if (!ces_pool_reserve(&balls->first_pool, input->rows + 1, sizeof(uint32_t))) {
        return false;
    }
    uint32_t *first = balls->first_pool.data, sum = 0;
    for (size_t row = 0; row < input->rows; row++) {
        first[row] = sum;
        sum += (uint32_t)ball_count(&input->shapes[particles->shape[row]]);
    }
    first[input->rows] = sum;
    if (!ces_pool_reserve(&balls->center_pool, sum, 3 * sizeof(double)) ||
        !ces_pool_reserve(&balls->path_pool, sum, 3 * sizeof(double)) ||
        !ces_pool_reserve(&balls->diameter_pool, sum, sizeof(double))) {
        return false;
    }
    Task task = {.input = input,
                 .first = first,
                 .center = balls->center_pool.data,
                 .path = balls->path_pool.data,
                 .diameter = balls->diameter_pool.data};
    ces_parallel_for(input->rows, ROW_BLOCK, input->threads, ball_block, &task);
    balls->center = task.center;
    balls->path = task.path;
    balls->diameter = task.diameter;
    balls->first = first;
    balls->count = sum;
    return true;
}

void ces_balls_free(ces_Balls *balls)
{
    ces_Pool *const pools[] = {&balls->center_pool, &balls->path_pool, &balls->diameter_pool, &balls->first_pool};
    for (size_t k = 0; k < sizeof pools / sizeof pools[0]; k++) {
        ces_pool_free(pools[k]);
    }
}
