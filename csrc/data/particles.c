#include "particles.h"

#include <string.h>

static const ces_ColumnInfo column_info[CES_COLUMN_COUNT] = {
    [CES_ID] = {"id", "", "identity, for ever, never reused", CES_INT64, 1, false},
    [CES_POSITION] = {"position", "m", "centre", CES_DOUBLE, 3, true},
    [CES_VELOCITY] = {"velocity", "m/s", "of the centre", CES_DOUBLE, 3, true},
    [CES_ANGULAR_VELOCITY] = {"angular_velocity", "rad/s", "in the world frame", CES_DOUBLE, 3, true},
    [CES_ORIENTATION] = {"orientation", "", "unit quaternion (w, x, y, z), body to world", CES_DOUBLE, 4, true},
    [CES_CHARGE] = {"charge", "C", "electric charge", CES_DOUBLE, 1, true},
    [CES_MASS] = {"mass", "kg", "mass", CES_DOUBLE, 1, false},
    [CES_DIAMETER] = {"diameter", "m", "of the sphere of equal volume", CES_DOUBLE, 1, false},
    [CES_MATERIAL] = {"material", "", "index into the scene's materials", CES_INT32, 1, false},
    [CES_SHAPE] = {"shape", "", "index into the scene's shapes", CES_INT32, 1, false},
    [CES_BIRTH] = {"birth", "s", "time at which it was fed or added", CES_DOUBLE, 1, false},
    [CES_COLLISIONS] = {"collisions", "", "number of contacts that began", CES_INT32, 1, false},
    [CES_SURFACE] = {"surface", "", "index of the surface touched last, -1: none", CES_INT32, 1, false},
    [CES_TOUCHED] =
        {"touched", "",
         "roles of the surfaces pressed in the last step, bits; of a composite also of its phases; bit 30: it rode on one",
         CES_INT32, 1, false},
    [CES_CONDUCTED] = {"conducted", "C", "charge on what conducts of a mixture or a composite", CES_DOUBLE, 1, true},
};

const ces_ColumnInfo *ces_column_info(ces_ColumnName name)
{
    return &column_info[name];
}

size_t ces_column_size(ces_ColumnName name)
{
    const ces_ColumnInfo *info = &column_info[name];
    return info->width * (info->type == CES_INT32 ? sizeof(int32_t) : sizeof(double));
}

bool ces_particles_have(const ces_Particles *particles, ces_ColumnName name)
{
    return name != CES_CONDUCTED || particles->mixed;
}

static void renew_pointers(ces_Particles *particles)
{
    void *data[CES_COLUMN_COUNT];
    for (int name = 0; name < CES_COLUMN_COUNT; name++) {
        data[name] =
            ces_particles_have(particles, (ces_ColumnName)name) ? ces_buffer_data(particles->columns[name]) : NULL;
    }
    particles->id = data[CES_ID];
    particles->position = data[CES_POSITION];
    particles->velocity = data[CES_VELOCITY];
    particles->angular_velocity = data[CES_ANGULAR_VELOCITY];
    particles->orientation = data[CES_ORIENTATION];
    particles->charge = data[CES_CHARGE];
    particles->mass = data[CES_MASS];
    particles->diameter = data[CES_DIAMETER];
    particles->material = data[CES_MATERIAL];
    particles->shape = data[CES_SHAPE];
    particles->birth = data[CES_BIRTH];
    particles->collisions = data[CES_COLLISIONS];
    particles->surface = data[CES_SURFACE];
    particles->touched = data[CES_TOUCHED];
    particles->conducted = data[CES_CONDUCTED];
}

bool ces_particles_reserve(ces_Particles *particles, size_t capacity)
{
    if (capacity <= particles->capacity && particles->columns[0] != NULL) {
        return true;
    }
    const size_t grown = capacity + capacity / 2 + 64;
    ces_Buffer *fresh[CES_COLUMN_COUNT] = {NULL};
    bool have_all = true;
    for (int name = 0; name < CES_COLUMN_COUNT && have_all; name++) {
        if (!ces_particles_have(particles, (ces_ColumnName)name)) {
            continue;
        }
        fresh[name] = ces_buffer_create(grown, ces_column_size((ces_ColumnName)name));
        have_all = fresh[name] != NULL;
    }
    for (int name = 0; name < CES_COLUMN_COUNT; name++) {
        if (!have_all) {
            ces_buffer_release(fresh[name]);
            continue;
        }
        if (particles->count > 0 && fresh[name] != NULL) {
            const void *old = ces_buffer_data(particles->columns[name]);
            memcpy(ces_buffer_data(fresh[name]), old, particles->count * ces_column_size((ces_ColumnName)name));
        }
        ces_buffer_release(particles->columns[name]);
        particles->columns[name] = fresh[name];
    }
    if (have_all) {
        particles->capacity = grown;
        renew_pointers(particles);
    }
    return have_all;
}

void ces_particles_write(ces_Particles *particles, size_t row, int64_t id, const ces_Newborn *newborn)
{
    particles->id[row] = id;
    for (size_t k = 0; k < 3; k++) {
        particles->position[3 * row + k] = newborn->position[k];
        particles->velocity[3 * row + k] = newborn->velocity[k];
        particles->angular_velocity[3 * row + k] = newborn->angular_velocity[k];
    }
    memcpy(&particles->orientation[4 * row], newborn->orientation, sizeof newborn->orientation);
    particles->charge[row] = newborn->charge;
    particles->mass[row] = newborn->mass;
    particles->diameter[row] = newborn->diameter;
    particles->material[row] = newborn->material;
    particles->shape[row] = newborn->shape;
    particles->birth[row] = newborn->birth;
    particles->collisions[row] = 0;
    particles->surface[row] = -1;
    particles->touched[row] = 0;
    if (particles->conducted != NULL) {
        particles->conducted[row] = 0.0;
    }
}

void ces_particles_remove(ces_Particles *particles, const uint8_t *gone)
{
    size_t first = 0;
    while (first < particles->count && gone[first] == 0) {
        first++;
    }
    size_t kept = first;
    for (int name = 0; name < CES_COLUMN_COUNT; name++) {
        if (!ces_particles_have(particles, (ces_ColumnName)name)) {
            continue;
        }
        const size_t size = ces_column_size((ces_ColumnName)name);
        char *data = ces_buffer_data(particles->columns[name]);
        kept = first;
        for (size_t row = first; row < particles->count; row++) {
            if (gone[row] == 0) {
                memcpy(data + kept * size, data + row * size, size);
                kept++;
            }
        }
    }
    particles->count = kept;
}

void ces_particles_free(ces_Particles *particles)
{
    for (int name = 0; name < CES_COLUMN_COUNT; name++) {
        ces_buffer_release(particles->columns[name]);
    }
    *particles = (ces_Particles){0};
}
