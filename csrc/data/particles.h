/*
 * data/particles.h - the grains, as columns. A grain has a row (now) and an id (for ever); rows stay in the order of ids.
 */
#ifndef CES_PARTICLES_H
#define CES_PARTICLES_H

#include "../base/memory.h"

typedef struct ces_Particles {
    ces_Buffer *columns[CES_COLUMN_COUNT];
    size_t count, capacity; /* rows */
    int64_t next_id;

    /* The columns once more, by type, renewed whenever a buffer is. */
    int64_t *id;              /* (count) */
    double *position;         /* m, (count, 3) */
    double *velocity;         /* m/s, (count, 3) */
    double *angular_velocity; /* rad/s, (count, 3) */
    double *orientation;      /* (count, 4) */
    double *charge;           /* C, (count) */
    double *mass;             /* kg, (count) */
    double *diameter;         /* m, (count) */
    int32_t *material;        /* (count) */
    int32_t *shape;           /* (count) */
    double *birth;            /* s, (count) */
    int32_t *collisions;      /* (count) */
    int32_t *surface;         /* (count) */
    int32_t *touched;         /* (count) */
    double *conducted;        /* C, (count), or NULL */
    bool mixed;               /* some material is a mixture: set before the first reserve */
} ces_Particles;

/* What a grain is born with. */
typedef struct ces_Newborn {
    double position[3], velocity[3], angular_velocity[3], orientation[4];
    double charge, mass, diameter, birth;
    int32_t material, shape;
} ces_Newborn;

size_t ces_column_size(ces_ColumnName name); /* bytes a row */

/* A column that nothing in the scene calls for is absent: its buffer is NULL. */
bool ces_particles_have(const ces_Particles *particles, ces_ColumnName name);

/* Makes room for capacity rows. False when out of memory: nothing changed. */
bool ces_particles_reserve(ces_Particles *particles, size_t capacity);
/* Writes a row at or beyond count, without counting it yet: the caller reserved it, and counts it when its step succeeds. */
void ces_particles_write(ces_Particles *particles, size_t row, int64_t id, const ces_Newborn *newborn);
/* Removes the rows for which gone is not 0, keeping the order of the others. */
void ces_particles_remove(ces_Particles *particles, const uint8_t *gone);
void ces_particles_free(ces_Particles *particles);

#endif
