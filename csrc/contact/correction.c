#include "correction.h"

#include "../base/vec3.h"

enum { SWEEPS = 10 };
#define SLOP 1e-6 /* of a radius: the overlap that is left alone */

/* Both parts give the overlap they found, as a share of the radius. */
static double separate_pair(const ces_Contact *contact, ces_Particles *particles)
{
    double *xa = &particles->position[3 * (size_t)contact->a], *xb = &particles->position[3 * (size_t)contact->b];
    const double ra = 0.5 * particles->diameter[contact->a], rb = 0.5 * particles->diameter[contact->b];
    double offset[3];
    ces_subtract(xa, xb, offset);
    const double distance = ces_norm(offset);
    const double overlap = ra + rb - distance;
    const double share = overlap / ces_min(ra, rb);
    if (share <= SLOP) {
        return share;
    }
    const double ma = particles->mass[contact->a], mb = particles->mass[contact->b];
    double normal[3];
    ces_copy(contact->normal, normal); /* coincident centres keep the normal they were found with */
    if (distance > 0.0) {
        for (int k = 0; k < 3; k++) {
            normal[k] = offset[k] / distance;
        }
    }
    ces_add_scaled(xa, overlap * mb / (ma + mb), normal);
    ces_add_scaled(xb, -overlap * ma / (ma + mb), normal);
    return share;
}

static double separate_surface(const ces_Contact *contact, const ces_Surface *surface, ces_Particles *particles)
{
    double *x = &particles->position[3 * (size_t)contact->a];
    const double radius = 0.5 * particles->diameter[contact->a];
    double normal[3];
    const double overlap = radius - ces_surface_distance(surface, x, normal);
    const double share = overlap / radius;
    if (share > SLOP) {
        ces_add_scaled(x, overlap, normal);
    }
    return share;
}

void ces_correct_island(const ces_Island *island, const ces_Islands *islands, const ces_Contacts *contacts,
                        const ces_Surface *surfaces, ces_Particles *particles)
{
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double worst = 0.0;
        for (uint32_t k = island->pair_first; k < island->pair_last; k++) {
            worst = ces_max(worst, separate_pair(&contacts->list[islands->pair_order[k]], particles));
        }
        /* From the last to the first: where surfaces disagree the machine's first one, the drum, has the last word. */
        for (uint32_t k = island->surface_last; k-- > island->surface_first;) {
            const ces_Contact *contact = &contacts->list[islands->surface_order[k]];
            worst = ces_max(worst, separate_surface(contact, &surfaces[contact->b], particles));
        }
        if (worst <= SLOP) {
            return;
        }
    }
}
