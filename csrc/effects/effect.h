/*
 * effects/effect.h - what an effect is. One file per effect, one row each in table.c; the order of the table is the order
 * in which they act. An effect never loops over grains (but in prepare), never allocates, never sees OpenMP or another
 * effect.
 */
#ifndef CES_EFFECT_H
#define CES_EFFECT_H

#include "../cesim.h"
#include "../data/crowd.h"

/* What an effect needs sampled at a grain; nothing is sampled that no active effect asks for. */
enum {
    CES_NEEDS_FIELD = 1 << 0,        /* grain->field */
    CES_NEEDS_GROUND = 1 << 1,       /* grain->normal, grain->height */
    CES_NEEDS_GROUND_FIELD = 1 << 2, /* grain->ground_field; implies CES_NEEDS_GROUND */
    CES_NEEDS_GRADIENT = 1 << 3,     /* grain->square_gradient */
    CES_NEEDS_TOUCH = 1 << 4,        /* grain->touch, in force alone */
};

/* Surfaces touched (with a positive impulse) in the last step, by role. */
enum { CES_TOUCHED_GROUND = 1 << CES_GROUND, CES_TOUCHED_BRUSH = 1 << CES_BRUSH };

/* One grain at one instant, as an effect sees it. */
typedef struct ces_Grain {
    double position[3];          /* m */
    double velocity[3];          /* m/s */
    double relative_velocity[3]; /* m/s, through the air */
    double angular_velocity[3];  /* rad/s */
    const double *orientation;   /* unit quaternion (w, x, y, z), body to world */
    uint64_t id;                 /* of the grain, for what is random */
    double radius;               /* m, of the sphere of equal volume */
    double mass;                 /* kg */
    double charge;               /* C */
    const ces_MaterialDef *material;
    const ces_ShapeDef *shape;
    unsigned touched;          /* CES_TOUCHED_* */
    double field[3];           /* V/m, at the centre */
    double square_gradient[3]; /* V2/m3, of the field's square at the centre */
    double touch[3];  /* sum of the unit vectors to what pressed it in the last step, collisions apart; one a contact */
    double normal[3]; /* outward from the grounded drum's axis */
    double height;    /* m, of the centre over the drum's surface, at least the radius */
    double lift;      /* m, the same without that least */
    double ground_field; /* V/m, the field on the drum's surface below the grain, along normal */
} ces_Grain;

/* What brings charge to a grain during a step, and what takes it away: both are followed at once, exactly. */
typedef struct ces_ChargeFlow {
    double saturation; /* C, that ions bring it to; 0: no ions */
    double ion_time;   /* s, in which they bring a grain without charge half way; 0: at once */
    double rest;       /* C, that conduction to the drum brings it to ... */
    double decay_time; /* s, ... in this time; 0: at once; infinite: it does not conduct */
} ces_ChargeFlow;

typedef struct ces_EffectParameter {
    const char *name, *unit;
    double preset, least, most; /* preset NAN: decided from the scene by start() */
    const char *doc;
} ces_EffectParameter;

/* The scene in the numbers that say how large an effect is; the extremes over what is fed and set. */
typedef struct ces_EffectScale {
    double gravity;         /* m/s2 */
    double voltage;         /* V */
    double field;           /* V/m, the largest on the drum */
    double speed;           /* m/s, at the end of the flight: that of the drum and of the fall */
    double surface_speed;   /* m/s, of the drum */
    double rolling_speed;   /* m/s, of a sphere's surface about its centre when it leaves the drum rolling */
    double sphericity;      /* the least of all shapes */
    double square_gradient; /* V2/m3, of the field's square, the largest on the drum */
    double residence;       /* s, of a grain on the drum; 0: not known */
    double coverage;        /* of the stream as fed, as fast as the drum: cross-sections of its grains over its area */
    bool has_drum, has_brush, has_corona;
    ces_MaterialDef material; /* one material ... */
    double radius;            /* m, ... and its smallest grain (size is asked for each material, the largest counts) */
} ces_EffectScale;

typedef struct ces_Effect {
    const char *name, *doc, *source;
    unsigned needs;
    ces_EffectParameter parameters[CES_MAX_EFFECT_PARAMETERS]; /* ends with name == NULL */
    const char *table;        /* what its table holds, a row of three; NULL: it takes none */
    const char *size_formula; /* as text, for the explanation */
    /* Dimensionless size, a ratio to the weight, of the effect for one material of a scene; 0 when it cannot act.
     * parameters: as in ces_EffectDef. */
    double (*size)(const ces_EffectScale *scale, const double *parameters);

    size_t state_size; /* the scene makes room for the table behind it */
    ces_Status (*start)(const ces_SceneDef *def, const double *parameters, void *state, ces_Error *error);
    /* The hooks it has, NULL elsewhere. */
    void (*flow)(const void *state, const ces_Grain *grain, ces_ChargeFlow *flow); /* sets what it knows of */
    double (*charge)(const void *state, const ces_Grain *grain, double step);  /* the grain's charge after step, C */
    void (*force)(const void *state, const ces_Grain *grain, double force[3]); /* adds to force, N */
    /* Rate of a force -m rate v, v the velocity through the air, 1/s; that of several effects is added. */
    double (*damping)(const void *state, const ces_Grain *grain);
    void (*air)(const void *state, const ces_Grain *grain, double air[3]); /* adds to the velocity of the air, m/s */
    /* Once a step, for forces between grains: adds to force (count, 3), N, that all grains have. It alone loops over grains,
     * by ces_parallel_for, with pools (CES_CROWD_POOLS) of its own; bits must not depend on threads. error: of an
     * approximation, 0 where there is none. False: out of memory. */
    bool (*prepare)(const void *state, const ces_Crowd *crowd, ces_Pool *pools, double *force, ces_CrowdError *error);
} ces_Effect;

extern const ces_Effect ces_gravity, ces_drag, ces_electric_force, ces_sphere_plane, ces_image_force,
    ces_corona_charging, ces_contact_charging, ces_charge_decay, ces_brush_discharge, ces_shape_drag, ces_wind,
    ces_magnus, ces_dielectrophoresis, ces_adhesion, ces_pair_coulomb;

size_t ces_effect_count(void);
const ces_Effect *ces_effect_at(size_t index);
const ces_Effect *ces_effect_find(const char *name); /* NULL: no such row */

/* What a definition says of an effect; NULL: nothing. */
const ces_EffectDef *ces_effect_def(const ces_SceneDef *def, const char *name);

/* CES_INPUT where a parameter is outside its range, or the scene lacks the drum or the field that the effect needs.
 * Called before start(), which checks only what one parameter alone does not show. */
ces_Status ces_effect_check(const ces_Effect *effect, const ces_SceneDef *def, const double *parameters,
                            ces_Error *error);

#endif
