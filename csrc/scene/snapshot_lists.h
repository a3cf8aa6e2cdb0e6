/* scene/snapshot_lists.h - the lists of a snapshot: contacts, landings, parts and joints, as rows of numbers. */
#ifndef CES_SNAPSHOT_LISTS_H
#define CES_SNAPSHOT_LISTS_H

#include "scene.h"

enum {
    CES_CONTACT_INTS = 6,
    CES_CONTACT_DOUBLES = 14,
    CES_LANDING_INTS = 5,
    CES_LANDING_DOUBLES = 11,
    CES_PART_DOUBLES = sizeof(ces_Motion) / sizeof(double),
    CES_JOINT_DOUBLES = sizeof(ces_JointState) / sizeof(double),
};

size_t ces_contact_count(const ces_Scene *scene);
void ces_save_contact_ints(const ces_Scene *scene, void *data);
void ces_load_contact_ints(ces_Scene *scene, const void *data, size_t count);
void ces_save_contact_doubles(const ces_Scene *scene, void *data);
void ces_load_contact_doubles(ces_Scene *scene, const void *data, size_t count);
void ces_save_landing_ints(const ces_Scene *scene, void *data);
void ces_load_landing_ints(ces_Scene *scene, const void *data, size_t count);
void ces_save_landing_doubles(const ces_Scene *scene, void *data);
void ces_load_landing_doubles(ces_Scene *scene, const void *data, size_t count);
size_t ces_part_count(const ces_Scene *scene);
void ces_save_parts(const ces_Scene *scene, void *data);
void ces_load_parts(ces_Scene *scene, const void *data, size_t count);
size_t ces_joint_count(const ces_Scene *scene);
void ces_save_joints(const ces_Scene *scene, void *data);
void ces_load_joints(ces_Scene *scene, const void *data, size_t count);

#endif
