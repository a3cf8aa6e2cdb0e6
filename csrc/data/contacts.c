#include "contacts.h"

#include <string.h>

#define SAME_WAY 0.866 /* cosine of 30 degrees */

bool ces_contacts_reserve(ces_Contacts *contacts, size_t count)
{
    const bool enough =
        ces_pool_grow(&contacts->pool, count, sizeof(ces_Contact), contacts->count * sizeof(ces_Contact));
    contacts->list = contacts->pool.data;
    return enough;
}

void ces_contacts_free(ces_Contacts *contacts)
{
    ces_pool_free(&contacts->pool);
    *contacts = (ces_Contacts){0};
}

/* Surfaces, whose ids count down from -1, in the order of their indices. */
static int64_t place_of(int64_t id_b)
{
    return id_b < 0 ? -1 - id_b : id_b;
}

static bool precedes(const ces_Contact *one, const ces_Contact *other)
{
    if (one->id_a != other->id_a) {
        return one->id_a < other->id_a;
    }
    if (one->id_b != other->id_b) {
        return place_of(one->id_b) < place_of(other->id_b);
    }
    return one->part_a != other->part_a ? one->part_a < other->part_a : one->part_b < other->part_b;
}

static bool same_partners(const ces_Contact *one, const ces_Contact *other)
{
    return one->id_a == other->id_a && one->id_b == other->id_b && one->part_a == other->part_a;
}

/* A grain that rolls on a mesh goes from triangle to triangle: the contact goes on where one of the surface's contacts
 * pushed in nearly the same direction. old is where the contact would stand among the old ones. */
static const ces_Contact *find_forerunner(const ces_Contact *contact, const ces_Contact *first, const ces_Contact *old,
                                          const ces_Contact *old_end)
{
    const ces_Contact *best = NULL;
    double closest = SAME_WAY;
    while (old > first && same_partners(old - 1, contact)) {
        old--;
    }
    for (; old < old_end && same_partners(old, contact); old++) {
        const double cosine = contact->normal[0] * old->normal[0] + contact->normal[1] * old->normal[1] +
                              contact->normal[2] * old->normal[2];
        if (cosine > closest) {
            closest = cosine;
            best = old;
        }
    }
    return best;
}

/* Both lists are in the order of ids and parts, so one walk finds all that persist. */
static void inherit_part(ces_Contact *contact, const ces_Contact *end, const ces_Contact *first,
                         const ces_Contact *old_end)
{
    const ces_Contact *old = first;
    for (; contact < end; contact++) {
        while (old < old_end && precedes(old, contact)) {
            old++;
        }
        const ces_Contact *same = old < old_end && !precedes(contact, old) ? old : NULL;
        if (same == NULL && contact->id_b < 0) {
            same = find_forerunner(contact, first, old, old_end);
        }
        if (same != NULL) {
            contact->lasting = ces_contact_push(same) > 0.0;
        }
        /* The blow of a collision does not last into the next step. */
        if (same != NULL && !same->impact && !contact->impact) {
            memcpy(contact->impulse, same->impulse, sizeof contact->impulse);
            memcpy(contact->roll_impulse, same->roll_impulse, sizeof contact->roll_impulse);
            contact->spin_impulse = same->spin_impulse;
        }
    }
}

void ces_contacts_inherit(ces_Contacts *contacts, const ces_Contacts *before)
{
    if (contacts->count == 0 || before->count == 0) {
        return;
    }
    inherit_part(contacts->list, contacts->list + contacts->pair_count, before->list,
                 before->list + before->pair_count);
    inherit_part(contacts->list + contacts->pair_count, contacts->list + contacts->count,
                 before->list + before->pair_count, before->list + before->count);
}
