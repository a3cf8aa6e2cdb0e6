#include "reach.h"

#include <math.h>

#include "../base/vec3.h"

enum { ROUNDS = 3 };
#define SKIN 0.01 /* of a radius: nearer counts as touching, whatever the paths */

/* How far a grain may come off its free path by a hit, m: the part of the path that is cut off, and what bounces back. Where
 * a hit turns the grain, too, no other part of it is thrown farther than the one that was hit. */
static void raise_one(const ces_DetectInput *input, double *reach, const ces_Candidate *candidate, bool is_pair)
{
    if (!candidate->approach.hit) {
        return;
    }
    const double cut = -(1.0 + input->most_restitution) * ces_dot(candidate->approach.normal, candidate->path);
    reach[candidate->a] = ces_max(reach[candidate->a], cut);
    if (is_pair) {
        reach[candidate->b] = ces_max(reach[candidate->b], cut);
    }
}

void ces_reach_raise(const ces_DetectInput *input, double *reach, const ces_Candidate *candidates, size_t count,
                     bool is_pair)
{
    for (size_t k = 0; k < count; k++) {
        raise_one(input, reach, &candidates[k], is_pair);
    }
}

/* What lies between the free path of a part and the velocity that the contact problem sees at its end, m. */
static double skin_of(const ces_DetectInput *input, size_t row)
{
    double drift = 0.0;
    for (size_t k = 0; k < 3; k++) {
        drift += fabs(input->step * input->free_velocity[3 * row + k] - input->displacement[3 * row + k]);
    }
    if (!input->only_spheres) {
        const ces_Shape *shape = &input->shapes[input->particles->shape[row]];
        /* An arm that turns by an angle leaves its tangent by half of the angle's square. */
        const double angle = input->step * ces_norm(&input->particles->angular_velocity[3 * row]);
        drift += shape->reach * input->particles->diameter[row] * ces_min(angle * angle, 2.0 + angle);
    }
    return SKIN * 0.5 * input->particles->diameter[row] + drift;
}

bool ces_is_near(const ces_DetectInput *input, const double *reach, const ces_Candidate *candidate, bool is_pair)
{
    if (candidate->approach.hit) {
        return true;
    }
    double near = reach[candidate->a] + skin_of(input, candidate->a);
    if (is_pair) {
        near += reach[candidate->b] + skin_of(input, candidate->b);
    } else {
        near += input->surfaces[candidate->b].carriage.skin;
    }
    return candidate->approach.least_gap <= near;
}

void ces_reach_spread(const ces_DetectInput *input, double *reach, const ces_Candidate *pairs, size_t count)
{
    for (int round = 0; round < ROUNDS; round++) {
        bool spread = false;
        for (size_t k = 0; k < count; k++) {
            const uint32_t a = pairs[k].a, b = pairs[k].b;
            if (reach[a] != reach[b] && ces_is_near(input, reach, &pairs[k], true)) {
                reach[a] = reach[b] = ces_max(reach[a], reach[b]);
                spread = true;
            }
        }
        if (!spread) {
            return;
        }
    }
}
