#include "snapshot_lists.h"

#include <string.h>

#include "../base/vec3.h"

/* ---- contacts ------------------------------------------------------------------------------------------------------- */

size_t ces_contact_count(const ces_Scene *scene)
{
    return scene->contacts.count;
}

void ces_save_contact_ints(const ces_Scene *scene, void *data)
{
    int64_t *out = data;
    for (size_t k = 0; k < scene->contacts.count; k++) {
        const ces_Contact *contact = &scene->contacts.list[k];
        const int64_t row[CES_CONTACT_INTS] = {contact->id_a,    contact->id_b,   contact->impact,
                                               contact->lasting, contact->part_a, contact->part_b};
        memcpy(&out[CES_CONTACT_INTS * k], row, sizeof row);
    }
}

void ces_load_contact_ints(ces_Scene *scene, const void *data, size_t count)
{
    const int64_t *in = data;
    scene->contacts.count = count;
    for (size_t k = 0; k < count; k++) {
        const int64_t *row = &in[CES_CONTACT_INTS * k];
        scene->contacts.list[k] = (ces_Contact){.id_a = row[0],
                                                .id_b = row[1],
                                                .impact = row[2] != 0,
                                                .lasting = row[3] != 0,
                                                .part_a = (uint32_t)row[4],
                                                .part_b = (uint32_t)row[5]};
    }
}

void ces_save_contact_doubles(const ces_Scene *scene, void *data)
{
    double *out = data;
    for (size_t k = 0; k < scene->contacts.count; k++, out += CES_CONTACT_DOUBLES) {
        const ces_Contact *contact = &scene->contacts.list[k];
        ces_copy(contact->normal, &out[0]);
        ces_copy(contact->point, &out[3]);
        ces_copy(contact->impulse, &out[6]);
        ces_copy(contact->roll_impulse, &out[9]);
        out[12] = contact->gap;
        out[13] = contact->spin_impulse;
    }
}

void ces_load_contact_doubles(ces_Scene *scene, const void *data, size_t count)
{
    const double *in = data;
    for (size_t k = 0; k < count; k++, in += CES_CONTACT_DOUBLES) {
        ces_Contact *contact = &scene->contacts.list[k];
        ces_copy(&in[0], contact->normal);
        ces_copy(&in[3], contact->point);
        ces_copy(&in[6], contact->impulse);
        ces_copy(&in[9], contact->roll_impulse);
        contact->gap = in[12];
        contact->spin_impulse = in[13];
    }
}

/* ---- landings -------------------------------------------------------------------------------------------------------- */

void ces_save_landing_ints(const ces_Scene *scene, void *data)
{
    int64_t *out = data;
    const ces_Landing *landing = scene->landing_pool.data;
    for (size_t k = 0; k < scene->landing_count; k++, landing++) {
        const int64_t row[CES_LANDING_INTS] = {landing->id, landing->material, landing->surface, landing->collisions,
                                               landing->lost};
        memcpy(&out[CES_LANDING_INTS * k], row, sizeof row);
    }
}

void ces_load_landing_ints(ces_Scene *scene, const void *data, size_t count)
{
    const int64_t *in = data;
    ces_Landing *landing = scene->landing_pool.data;
    scene->landing_count = count;
    for (size_t k = 0; k < count; k++, landing++, in += CES_LANDING_INTS) {
        landing->id = in[0];
        landing->material = (int32_t)in[1];
        landing->surface = (int32_t)in[2];
        landing->collisions = (int32_t)in[3];
        landing->lost = (int32_t)in[4];
    }
}

void ces_save_landing_doubles(const ces_Scene *scene, void *data)
{
    double *out = data;
    const ces_Landing *landing = scene->landing_pool.data;
    for (size_t k = 0; k < scene->landing_count; k++, landing++, out += CES_LANDING_DOUBLES) {
        ces_copy(landing->position, &out[0]);
        ces_copy(landing->velocity, &out[3]);
        const double rest[] = {landing->time, landing->birth, landing->charge, landing->mass, landing->diameter};
        memcpy(&out[6], rest, sizeof rest);
    }
}

void ces_load_landing_doubles(ces_Scene *scene, const void *data, size_t count)
{
    const double *in = data;
    ces_Landing *landing = scene->landing_pool.data;
    for (size_t k = 0; k < count; k++, landing++, in += CES_LANDING_DOUBLES) {
        ces_copy(&in[0], landing->position);
        ces_copy(&in[3], landing->velocity);
        landing->time = in[6];
        landing->birth = in[7];
        landing->charge = in[8];
        landing->mass = in[9];
        landing->diameter = in[10];
    }
}

/* ---- parts and joints: their number is the definition's, so a list of another length is refused -------------------------- */

size_t ces_part_count(const ces_Scene *scene)
{
    return scene->mechanism.part_count;
}

void ces_save_parts(const ces_Scene *scene, void *data)
{
    memcpy(data, scene->mechanism.now, scene->mechanism.part_count * sizeof(ces_Motion));
}

void ces_load_parts(ces_Scene *scene, const void *data, size_t count)
{
    memcpy(scene->mechanism.now, data, count * sizeof(ces_Motion));
}

size_t ces_joint_count(const ces_Scene *scene)
{
    return scene->mechanism.joint_count;
}

void ces_save_joints(const ces_Scene *scene, void *data)
{
    memcpy(data, scene->mechanism.states, scene->mechanism.joint_count * sizeof(ces_JointState));
}

void ces_load_joints(ces_Scene *scene, const void *data, size_t count)
{
    memcpy(scene->mechanism.states, data, count * sizeof(ces_JointState));
}
