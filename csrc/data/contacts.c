#include "contacts.h"

#include <string.h>

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

/* Both lists are in the order of ids and parts, so one walk finds all that persist. */
static void inherit_part(ces_Contact *contact, const ces_Contact *end, const ces_Contact *old,
                         const ces_Contact *old_end)
{
    for (; contact < end; contact++) {
        while (old < old_end && precedes(old, contact)) {
            old++;
        }
        const bool same = old < old_end && !precedes(contact, old);
        if (same) {
            contact->lasting = ces_contact_push(old) > 0.0;
        }
        /* The blow of a collision does not last into the next step. */
        if (same && !old->impact && !contact->impact) {
            memcpy(contact->impulse, old->impulse, sizeof contact->impulse);
            memcpy(contact->roll_impulse, old->roll_impulse, sizeof contact->roll_impulse);
            contact->spin_impulse = old->spin_impulse;
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
