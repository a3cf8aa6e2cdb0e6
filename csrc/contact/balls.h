/*
 * contact/balls.h - what the search for contacts looks at: spheres that move on chords through the step. A sphere is one ball,
 * a cluster is its spheres, and a convex body is searched by the ball around it.
 */
#ifndef CES_BALLS_H
#define CES_BALLS_H

#include "../data/particles.h"
#include "../data/shapes.h"

typedef struct ces_Balls {
    const double *center;   /* m, (count, 3) at the start of the step */
    const double *path;     /* m, (count, 3) in the step, if nothing is in the way */
    const double *diameter; /* m, (count) */
    const uint32_t *first;  /* (rows + 1): the balls of a grain; NULL: ball i is grain i */
    size_t count;
    ces_Pool center_pool, path_pool, diameter_pool, first_pool;
} ces_Balls;

typedef struct ces_BallsInput {
    const ces_Particles *particles;
    const ces_Shape *shapes;
    bool only_spheres;
    size_t rows;
    const double *displacement;     /* m, (rows, 3) */
    const double *free_orientation; /* (rows, 4) at the end of the step; NULL where there are spheres only */
    int threads;
} ces_BallsInput;

/* Where all grains are spheres nothing is copied: the balls are the columns. False: out of memory. */
bool ces_balls_build(ces_Balls *balls, const ces_BallsInput *input);
void ces_balls_free(ces_Balls *balls);

static inline size_t ces_first_ball(const ces_Balls *balls, size_t row)
{
    return balls->first != NULL ? balls->first[row] : row;
}

#endif
