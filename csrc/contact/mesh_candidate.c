#include "mesh_candidate.h"

#include <math.h>

#include "../base/vec3.h"
#include "mesh_contact.h"

size_t ces_mesh_slots(const ces_Surface *surface, const ces_MeshBall *ball, double radius)
{
    const double around = radius + ball->margin + ces_norm(ball->path) + surface->travel;
    double center[3], path[3], lower[3], upper[3];
    if (!ces_surface_within(surface, ball->center, around)) {
        return 0;
    }
    ces_surface_to_mesh(surface, ball->center, ball->path, center, path);
    for (int k = 0; k < 3; k++) {
        lower[k] = center[k] - around;
        upper[k] = center[k] + around;
    }
    return ces_mesh_count(surface->mesh, lower, upper, CES_MESH_CONTACTS);
}

void ces_meet_mesh(const ces_Surface *surface, const ces_MeshBall *ball, size_t slots, ces_Candidate *candidates)
{
    const ces_Candidate first = candidates[0];
    ces_MeshContact contacts[CES_MESH_CONTACTS];
    ces_MeshPath path = {
        .radius = first.radius_a, .margin = ball->margin, .restitution = ball->restitution, .touched = ball->touched};
    ces_surface_to_mesh(surface, ball->center, ball->path, path.center, path.path);
    const size_t count = ces_mesh_contacts(surface->mesh, &path, contacts);
    for (size_t k = 0; k < slots; k++) {
        ces_Candidate *candidate = &candidates[k];
        *candidate = first;
        if (k >= count) {
            candidate->approach = (ces_Approach){.least_gap = HUGE_VAL};
            continue;
        }
        candidate->part_b = contacts[k].triangle;
        candidate->approach = contacts[k].approach;
        ces_surface_from_mesh(surface, contacts[k].approach.normal, candidate->approach.normal);
        ces_surface_from_mesh(surface, path.path, candidate->path);
        ces_copy(ball->center, candidate->point);
        ces_add_scaled(candidate->point, candidate->approach.fraction, ball->path);
        ces_add_scaled(candidate->point, -candidate->radius_a, candidate->approach.normal);
    }
}
