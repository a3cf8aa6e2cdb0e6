/* scene/scene.h - what a scene is made of; seen by csrc/scene only. */
#ifndef CES_SCENE_H
#define CES_SCENE_H

#include "../contact/detect.h"
#include "../contact/rigid.h"
#include "../contact/solver_pgs.h"
#include "../contact/turns.h"
#include "../effects/effect.h"
#include "../field/field.h"
#include "feeder.h"

enum { CES_MAX_HOOKS = 32 };
#define CES_FARTHEST 1e6 /* m, from the origin: beyond it a double no longer resolves a grain's contacts */

enum { CES_CLOSED_FORM = 0 }; /* in ces_Health.solvers */

/* What became of an island. */
typedef struct ces_IslandReport {
    uint32_t iterations;
    int solver;      /* as in ces_Health.solvers */
    double residual; /* m/s */
    double seconds;
    bool converged;
} ces_IslandReport;

/* An active effect with its state. */
typedef struct ces_Hook {
    const ces_Effect *effect;
    void *state;
} ces_Hook;

/* What effects between grains have, where there are any. */
typedef struct ces_CrowdWork {
    ces_Pool position, force;                       /* m, N (rows, 3) */
    ces_Pool pools[CES_MAX_HOOKS][CES_CROWD_POOLS]; /* of each effect */
    ces_CrowdError error;                           /* of this step */
    const double *given; /* N, of row at given[stride * row]: nothing, where there are none */
    size_t stride;
} ces_CrowdWork;

/* The effects that a scene calls for, by what they do. What is off is not here: no flag, no branch, no cost. */
typedef struct ces_Hooks {
    ces_Hook flow[CES_MAX_HOOKS], charge[CES_MAX_HOOKS], force[CES_MAX_HOOKS], damping[CES_MAX_HOOKS],
        air[CES_MAX_HOOKS], prepare[CES_MAX_HOOKS];
    size_t flow_count, charge_count, force_count, damping_count, air_count, prepare_count;
    bool charges; /* some effect changes charges */
    unsigned charge_needs, force_needs, air_needs;
} ces_Hooks;

__extension__ typedef __int128 ces_Int128;

/* Masses as integers, in units of 2^-100 kg: their sums do not depend on the order, and the balance closes exactly. */
typedef struct ces_Ledger {
    uint64_t fed_count, landed_count, lost_count;
    ces_Int128 fed, landed, lost;
} ces_Ledger;

struct ces_Scene {
    ces_SceneDef def;
    ces_MaterialDef *materials;
    ces_MaterialDef *faces; /* (2 material_count) what a mixture is averaged over: its conducting share, its rest */
    bool mixed;             /* some material is a mixture, or some shape a composite: there are two charges */
    ces_Shapes shapes;
    double *coefficients; /* the pair tables, one after the other */
    ces_PairTable table;
    ces_Surface *surfaces;
    ces_Mechanism mechanism;
    const ces_FieldRow *field;
    void *field_state;
    void *effect_states[CES_MAX_HOOKS];
    ces_Hooks hooks;
    const ces_ConeSolver *solver;
    bool packs;             /* islands of spheres go to the kernel for them: it is what the solver asked for would do */
    bool rolling, spinning; /* some pair has such friction */
    double most_restitution; /* of all pairs */
    double tolerance;
    ces_Feeder *feeder;

    uint64_t step_index;
    ces_Particles particles;
    ces_Contacts contacts, next_contacts; /* of the last step, and of the one being made */
    ces_Pool landing_pool;
    size_t landing_count;
    ces_Ledger ledger;
    ces_Health health;
    double stage_seconds[CES_STAGE_COUNT];

    /* Scratch of a step. */
    size_t rows;             /* grains of this step: those present and the newborn */
    const ces_Birth *births; /* (born) */
    size_t born;
    ces_Pool limited;                     /* uint32_t, a block of rows: charges that reached what air can hold */
    ces_Pool free_orientation, free_spin; /* where there are grains that are no spheres */
    ces_Pool moment;                      /* (rows, 3) N m about the centre, where there are composites */
    ces_Pool touch;                       /* (rows, 3) as in ces_Grain, where some effect asks for it */
    ces_Pool moved_in;                    /* uint32_t, rows: of the correction */
    ces_Pool displacement, free_velocity, charge, start_position, start_velocity, gone, reports;
    ces_CrowdWork crowd;
    ces_Detector detector;
    ces_Islands islands;
    ces_Problem problem;
    ces_Rigid rigid;

    ces_Pool snapshot; /* small blocks that are assembled on demand */
};

double ces_scene_time_at(const ces_Scene *scene, uint64_t step_index); /* s: a product, not a sum that drifts */
ces_Int128 ces_mass_units(double mass);
double ces_mass_from_units(ces_Int128 units);

/* The stages of a step, in their files. */
ces_Status ces_stage_feed(ces_Scene *scene, ces_Error *error);
ces_Status ces_stage_charge(ces_Scene *scene, ces_Error *error);
ces_Status ces_stage_force(ces_Scene *scene, ces_Error *error);
ces_Status ces_stage_detect(ces_Scene *scene, ces_Error *error);
ces_Status ces_stage_solve(ces_Scene *scene, ces_Error *error);
ces_Status ces_stage_move(ces_Scene *scene, ces_Error *error);
ces_Status ces_stage_collect(ces_Scene *scene, ces_Error *error);

/* Surfaces at a time, s. to: of parts, where those of the machine go; at the end of the step, where they are. */
void ces_place_surfaces(ces_Scene *scene, double time, const ces_Motion *to);

/* A sphere looks the same however it turns. */
static inline bool ces_is_sphere(const ces_Scene *scene, uint32_t row)
{
    return scene->shapes.only_spheres || scene->shapes.list[scene->particles.shape[row]].def.kind == CES_SPHERE;
}

/* Where stage "force" asks for the force on a grain, m. */
void ces_middle_of_path(const ces_Scene *scene, size_t row, double position[3]);
double ces_charge_of(const ces_Scene *scene, size_t row); /* C, after the stage "charge" */
/* What the effects between grains give, in scene->crowd. */
ces_Status ces_crowd_prepare(ces_Scene *scene, ces_Error *error);

ces_RigidInput ces_rigid_input(ces_Scene *scene); /* for the contacts being made */
int ces_solver_index(const char *name);           /* in ces_Health.solvers */
void ces_count_limited_charges(ces_Scene *scene); /* of the step that takes effect: nothing is cut off in silence */
/* The health of a step that has been made. */
void ces_note_health(ces_Scene *scene);

#endif
