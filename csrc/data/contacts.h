/*
 * data/contacts.h - the contacts of a step, one record each, grain-grain first, then grain-surface, each part in the order
 * of (a, b, part_a, part_b). The order is canonical: it does not depend on threads, nor on how the contacts were found.
 */
#ifndef CES_CONTACTS_H
#define CES_CONTACTS_H

#include "../base/memory.h"
#include "joints.h"

typedef struct ces_Contact {
    int64_t id_a, id_b;      /* of the grains; id_b = -1 - surface */
    uint32_t a, b;           /* rows; b = index of the surface */
    uint32_t carrier;        /* the dynamic part that the surface b belongs to and that yields; CES_NO_PART: none */
    uint32_t part_a, part_b; /* the sphere of a cluster, the feature of a convex body or a mesh; else 0 */
    double arm_a[3];         /* m, from the centre of a to the point */
    double arm_b[3];         /* m, from the centre of b, when b is a grain or a dynamic part */
    double normal[3];        /* from b to a, where the free paths meet or come closest */
    double point[3];         /* m, where they touch or would */
    double gap;              /* m, at the start of the step */
    double fraction;         /* of the step, at which the free paths meet or come closest */
    double bias;             /* m/s: the contact demands u_N + bias >= 0 */
    double friction;         /* coefficient */
    double rolling;          /* coefficient: moment <= rolling * rolling radius * normal impulse */
    double spinning;         /* the same about the normal */
    double rolling_radius;   /* m */
    double ratio_a, ratio_b; /* rolling radius over the grain's radius */
    double surface[3];       /* m/s, velocity of b's matter at the contact, when b is a surface */
    double surface_roll[3];  /* m/s, rolling velocity of b, when b is a surface */
    double surface_spin;     /* m/s, the same about the normal */
    double impulse[3];       /* N s, on a */
    double roll_impulse[3];  /* N s: the moment's impulse on a is rolling radius * (normal x this) */
    double spin_impulse;     /* N s: about the normal, the moment's impulse is rolling radius * this */
    bool impact;             /* a collision inside the step, not a lasting touch */
    bool lasting;            /* it pushed in the step before, too */
} ces_Contact;

typedef struct ces_Contacts {
    ces_Pool pool;
    ces_Contact *list;        /* (count) */
    size_t count, pair_count; /* the first pair_count are grain-grain */
} ces_Contacts;

bool ces_contacts_reserve(ces_Contacts *contacts, size_t count);
void ces_contacts_free(ces_Contacts *contacts);

/* Normal impulse, N s. */
static inline double ces_contact_push(const ces_Contact *contact)
{
    return contact->normal[0] * contact->impulse[0] + contact->normal[1] * contact->impulse[1] +
           contact->normal[2] * contact->impulse[2];
}

/* Carries the impulses of the step before to the same contacts of this one. */
void ces_contacts_inherit(ces_Contacts *contacts, const ces_Contacts *before);

#endif
