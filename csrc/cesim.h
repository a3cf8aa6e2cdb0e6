/*
 * cesim.h - the public C interface of the engine, and the only header its users read.
 *
 * Ownership: whoever calls ces_scene_create calls ces_scene_destroy; every array handed in is copied, every pointer
 * handed out belongs to the scene and is good until the next call that changes the scene (ces_Buffer excepted: retain it).
 *
 * Units are SI, numbers are double; the unit stands in the comment of each field, the shape in that of each array.
 * Frame: x towards the electrode, y up, z along the drum axis; the drum turns so that its top moves to +x.
 */
#ifndef CESIM_H
#define CESIM_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#define CES_NAME_LENGTH 48
#define CES_ERROR_LENGTH 512

/* ---- status ---------------------------------------------------------------------------------------------------- */

typedef enum ces_Status {
    CES_OK = 0,
    CES_INPUT,    /* a definition or an argument is outside what it may be */
    CES_MEMORY,   /* the machine is out of memory; nothing was changed */
    CES_DIVERGED, /* a number stopped being finite; the state is the one before the step */
    CES_FEED,     /* the feed does not fit through its outlet; the state is the one before the step */
} ces_Status;

typedef struct ces_Error {
    ces_Status status;
    char text[CES_ERROR_LENGTH]; /* what, value, unit, legal range */
} ces_Error;

/* ---- definitions: plain structs, copied at creation ---------------------------------------------------------------- */

typedef enum ces_MaterialKind {
    CES_CONDUCTOR, /* takes its charge from the drum at once */
    CES_INSULATOR, /* neither gives nor takes charge there */
    CES_MIDDLING,  /* between: its charge relaxes in decay_time */
} ces_MaterialKind;

/* A material; or a mixture of a conducting share with a rest, which the other fields describe. */
typedef struct ces_MaterialDef {
    ces_MaterialKind kind;
    double density;         /* kg/m3, of the whole */
    double permittivity;    /* relative; insulators and middlings */
    double decay_time;      /* s, of a charge on the grounded drum; middlings */
    double conducting;      /* middlings: share of a conductor's polarisation near the drum that they have */
    double conductor_share; /* 0: no mixture */
} ces_MaterialDef;

typedef enum ces_ShapeKind {
    CES_SPHERE,
    CES_CLUSTER, /* rigid, made of spheres that may overlap */
    CES_CONVEX,  /* the hull of its vertices */
} ces_ShapeKind;

/*
 * A phase of a composite: its conducting spheres together, or the others. A body of its own that is held to the grain, in the
 * grain's frame and units: what charges it and what pulls it acts on it alone, at its centre of mass.
 */
typedef struct ces_PhaseDef {
    double volume;         /* share of the grain's; 0: it has no such phase */
    double mass;           /* share of the grain's */
    double center[3];      /* over d */
    double orientation[4]; /* unit quaternion (w, x, y, z), principal frame of the phase to the grain's */
    double sphericity;     /* the rest as of a shape, of the sphere of the phase's volume */
    double contact_charge[3], contact_force[3], semi_axes[3], depolarization[3];
} ces_PhaseDef;

enum { CES_PHASES = 2 }; /* that which conducts, and the rest */

/* The shape of a grain in units of its diameter d, that of the sphere of equal volume: so a grain weighs density pi/6 d^3
 * whatever its shape. In the principal frame, the centre of mass at the origin. */
typedef struct ces_ShapeDef {
    char name[CES_NAME_LENGTH];
    ces_ShapeKind kind;
    double moments[3]; /* principal moments of inertia over mass d^2 */
    double sphericity; /* surface of the sphere of equal volume over its own; a sphere has 1 */
    /* Of a conductor, or of an insulator in an ion flow, with the principal axis (k) along the drum's normal: */
    double contact_charge[3]; /* on the drum, over 4 pi eps0 r^2 E; a sphere has pi^2/6 */
    double contact_force[3];  /* on it there, over Q E; a sphere has 0.832 */
    double semi_axes[3];      /* over d, of the ellipsoid that stands for it; a sphere has 1/2 */
    double depolarization[3]; /* of that: the field inside is E/(1 + (eps_r - 1) N); a sphere has 1/3 */
    const double *spheres;    /* (sphere_count, 4): centre and radius over d; clusters only */
    size_t sphere_count;
    const double *vertices; /* (vertex_count, 3): over d; convex bodies only */
    size_t vertex_count;
    /* A composite is a cluster of several materials; NULL: all is of the grain's own material. */
    const uint32_t *sphere_materials; /* (sphere_count) indices: what a sphere touches others with */
    ces_PhaseDef phases[CES_PHASES];
    int32_t material; /* index: the one whose density is the composite's, and which all its grains have */
} ces_ShapeDef;

typedef enum ces_SurfaceShape {
    CES_PLANE,    /* half space below its local xz plane: the normal is local +y */
    CES_BOX,      /* solid, centred; size = full edge lengths, a zero thickness is legal */
    CES_CYLINDER, /* solid with flat caps, centred, axis = local z; size = (radius, radius, length) */
    CES_MESH,     /* thin sheet of triangles, both sides count; it need not be closed */
} ces_SurfaceShape;

/* What a surface does electrically to a grain that touches it. */
typedef enum ces_SurfaceRole { CES_INERT, CES_GROUND, CES_BRUSH } ces_SurfaceRole;
enum {
    CES_PHASE_BITS = 3, /* bits of the roles in the column "touched" */
    CES_RODE = 1 << 30, /* another one there: a surface pressed the grain in the last two steps, no collision */
};

typedef struct ces_SurfaceDef {
    char name[CES_NAME_LENGTH];
    ces_SurfaceShape shape;
    ces_SurfaceRole role;
    double position[3];         /* m, centre (plane: a point of it) */
    double orientation[4];      /* unit quaternion (w, x, y, z), local to world */
    double size[3];             /* m */
    double angular_speed;       /* rad/s about local z: a cylinder's surface moves in itself, a mesh turns; others: 0 */
    double belt_velocity[3];    /* m/s, world: the surface moves, the shape stays */
    double vibration[3];        /* m, amplitude of the shape's own motion, world: position + vibration sin(2 pi f t) */
    double vibration_frequency; /* Hz */
    const double *vertices;     /* m (vertex_count, 3), local; meshes only */
    size_t vertex_count;
    const uint32_t *triangles; /* (triangle_count, 3) indices of vertices; meshes only */
    size_t triangle_count;
    int32_t part; /* index of the dynamic part that carries it, -1: none; then its own motion above must be nothing */
} ces_SurfaceDef;

/* A part of the machine that moves by forces. Its frame is the principal one, the centre of mass at its origin. */
typedef struct ces_PartDef {
    char name[CES_NAME_LENGTH];
    double mass;                /* kg */
    double inertia[3];          /* kg m2, principal moments */
    double position[3];         /* m, of the centre of mass at time 0 */
    double orientation[4];      /* unit quaternion (w, x, y, z), part to world, at time 0 */
    double velocity[3];         /* m/s, at time 0 */
    double angular_velocity[3]; /* rad/s, world, at time 0 */
} ces_PartDef;

typedef enum ces_JointKind {
    CES_REVOLUTE,  /* a turns about the axis */
    CES_PRISMATIC, /* a slides along the axis */
    CES_FIXED,
    CES_SPHERICAL, /* a turns about the anchor */
} ces_JointKind;

/* A joint holds part a to part b; what it leaves free may have a motor and stops. Its motion is that of a against b. */
typedef struct ces_JointDef {
    char name[CES_NAME_LENGTH];
    ces_JointKind kind;
    int32_t part_a, part_b;          /* indices, -1: the ground */
    double anchor_a[3], anchor_b[3]; /* m, world at time 0: the points of a and of b that the joint brings together */
    double axis[3];                  /* world at time 0, of any length; revolute and prismatic joints */
    const double *law; /* (law_count, 2) the motor's speed: s, rad/s or m/s; linear between, constant beyond */
    size_t law_count;  /* 0: no motor */
    double limit;      /* N m or N, of the motor, infinite: none */
    double least_travel, most_travel; /* rad or m, of the stops; infinite: none */
} ces_JointDef;

typedef struct ces_FieldDef {
    char kind[CES_NAME_LENGTH]; /* a row of the field table; "" for none */
    double drum_radius;         /* m; a grid may be without a drum: 0 */
    double electrode_radius;    /* m, two_cylinders */
    double distance;            /* m, between the axes, two_cylinders */
    double angle;               /* rad, of the electrode that sends the ions above the horizontal */
    double voltage;             /* V, of that electrode; the drum is at 0 */
    double drum_center[2];      /* m, x and y of the drum's axis */
    double origin[3];           /* m, of the grid's first node */
    double spacing[3];          /* m, of its nodes */
    uint32_t counts[3];         /* nodes along x, y, z; one along z: the same at every z */
    const double *values;       /* V (counts), z fastest */
    /* conductors: what makes up their potential, csrc/field/conductors.c */
    const double *circles, *poles; /* (circle_count, 4) x, y, radius m, voltage V; (pole_count, 3) x, y m, strength V */
    const double *series, *terms;  /* (series_count, 5) x, y, radius m, terms, 1 where growing; (term_count, 2) V */
    size_t circle_count, pole_count, series_count, term_count;
    double constant; /* V */
    double box[4];   /* m, x and y of the lower and of the upper corner; 0: none */
} ces_FieldDef;

#define CES_MAX_EFFECT_PARAMETERS 8

typedef struct ces_EffectDef {
    char name[CES_NAME_LENGTH];                   /* a row of the effect table */
    double parameters[CES_MAX_EFFECT_PARAMETERS]; /* in the order of the row */
    const double *table;                          /* (table_count, 3), as the row says; for rows that take one */
    size_t table_count;
} ces_EffectDef;

#define CES_MAX_DISTRIBUTION_PARAMETERS 4

typedef struct ces_FamilyDef {
    uint32_t material, shape;                           /* indices */
    double mass_fraction;                               /* of the feed, all families sum to 1 */
    char distribution[CES_NAME_LENGTH];                 /* of the diameter by number, a row of the distribution table */
    double parameters[CES_MAX_DISTRIBUTION_PARAMETERS]; /* in the order of the row, m where it is a length */
    double least, most;  /* m, the distribution is truncated to [least, most]; most = 0: not at all */
    const double *table; /* (table_count, 2): diameter in m, cumulative number fraction; "table" only */
    size_t table_count;
    char charge[CES_NAME_LENGTH]; /* law of the charges it is fed with: constant, uniform, normal, table; "": none */
    double charge_parameters[CES_MAX_DISTRIBUTION_PARAMETERS]; /* C/kg, or C/m2 of the sphere of equal volume */
    bool charge_per_surface;
    const double *charge_table; /* (charge_table_count, 2): charge, cumulative number fraction; "table" only */
    size_t charge_table_count;
} ces_FamilyDef;

typedef enum ces_RateKind { CES_RATE_MASS, CES_RATE_COUNT } ces_RateKind;

typedef struct ces_FeedDef {
    ces_RateKind rate_kind;
    double rate;        /* kg/s or 1/s; 0: no feed */
    double start, stop; /* s, feeding time; stop may be infinite */
    double center[3];   /* m, centre of the outlet, a rectangle */
    double edge_u[3];   /* m, one full edge of the outlet */
    double edge_v[3];   /* m, the other */
    double velocity[3]; /* m/s, of a grain at the outlet */
    const ces_FamilyDef *families;
    size_t family_count;
} ces_FeedDef;

typedef enum ces_ContactLaw { CES_COULOMB, CES_CCP } ces_ContactLaw;

typedef struct ces_SceneDef {
    double step;         /* s */
    double gravity[3];   /* m/s2, scale for tolerances; the force itself is an effect */
    double drum_axis[2]; /* m, x and y of the grounded drum's axis */
    double drum_radius;  /* m, 0: no drum to measure heights from */
    ces_ContactLaw contact_law;
    char solver[CES_NAME_LENGTH]; /* a row of the solver table */
    double tolerance;             /* m/s, residual at which a contact problem counts as solved; 0: from physics */
    double reference_speed;       /* m/s, the fastest prescribed surface; enters the default tolerance */
    uint32_t max_iterations;      /* sweeps a step; ten times as many over an island of at most 64 contacts */
    bool grain_contact;           /* false: grains do not see each other */
    bool rotation;                /* false: grains keep their orientation, they slide as blocks */
    bool gyroscopic;              /* false: the angular velocity of a free grain is kept, not its angular momentum */
    int threads;
    uint64_t seed;
    double (*clock)(void);     /* s, for the time per stage; NULL: not timed (the engine reads no clock of its own) */
    double landing_height;     /* m, y of the landing plane; -infinity: none */
    double lower[3], upper[3]; /* m, a grain outside is lost, and counted */

    const ces_MaterialDef *materials;
    size_t material_count;
    const ces_ShapeDef *shapes; /* the first is a sphere; none: spheres only */
    size_t shape_count;
    const ces_SurfaceDef *surfaces;
    size_t surface_count;
    const ces_PartDef *parts;
    size_t part_count;
    const ces_JointDef *joints;
    size_t joint_count;
    /* pair coefficients: grain-grain (material_count, material_count), grain-surface (surface_count, material_count) */
    const double *grain_friction, *grain_restitution, *grain_rolling, *grain_spinning;
    const double *surface_friction, *surface_restitution, *surface_rolling, *surface_spinning;
    ces_FieldDef field;
    const ces_EffectDef *effects; /* the ones that are on */
    size_t effect_count;
    ces_FeedDef feed;
} ces_SceneDef;

ces_SceneDef ces_default_scene_def(void);

/* ---- what a scene tells ---------------------------------------------------------------------------------------------- */

typedef enum ces_ColumnName {
    CES_ID,               /* int64  (count)    for ever, never reused; rows are in the order of ids */
    CES_POSITION,         /* double (count, 3) m */
    CES_VELOCITY,         /* double (count, 3) m/s */
    CES_ANGULAR_VELOCITY, /* double (count, 3) rad/s */
    CES_ORIENTATION,      /* double (count, 4) unit quaternion (w, x, y, z) */
    CES_CHARGE,           /* double (count)    C */
    CES_MASS,             /* double (count)    kg */
    CES_DIAMETER,         /* double (count)    m, of the sphere of equal volume */
    CES_MATERIAL,         /* int32  (count)    index */
    CES_SHAPE,            /* int32  (count)    index */
    CES_BIRTH,            /* double (count)    s */
    CES_COLLISIONS,       /* int32  (count)    number of contacts that began */
    CES_SURFACE,          /* int32  (count)    surface touched last, -1: none */
    CES_TOUCHED,          /* int32  (count)    bits 1 << ces_SurfaceRole of the surfaces pressed in the last step; of a
                           * composite also those of its phases, each CES_PHASE_BITS further up; CES_RODE */
    CES_CONDUCTED,        /* double (count)    C, the part of charge on what conducts; absent without mixtures and
                           * composites */
    CES_COLUMN_COUNT
} ces_ColumnName;

typedef enum ces_ColumnType { CES_DOUBLE, CES_INT32, CES_INT64 } ces_ColumnType;

typedef struct ces_ColumnInfo {
    const char *name, *unit, *doc;
    ces_ColumnType type;
    uint32_t width; /* numbers a row */
    bool writable;  /* by the user, between steps */
} ces_ColumnInfo;

/* Memory that outlives its owner while somebody holds it: an array view may be stale, it never dangles. */
typedef struct ces_Buffer ces_Buffer;
void *ces_buffer_data(const ces_Buffer *buffer);
void ces_buffer_retain(ces_Buffer *buffer);
void ces_buffer_release(ces_Buffer *buffer);

typedef struct ces_Landing {
    int64_t id;
    double time;        /* s */
    double birth;       /* s */
    double position[3]; /* m */
    double velocity[3]; /* m/s */
    double charge;      /* C */
    double mass;        /* kg */
    double diameter;    /* m */
    int32_t material;
    int32_t surface; /* touched last, -1: none */
    int32_t collisions;
    int32_t lost; /* 0: landed on the plane; 1: left the bounds */
} ces_Landing;

typedef struct ces_ContactInfo {
    int64_t a;      /* id of the first grain */
    int64_t b;      /* id of the second grain, or -1 - index of a surface */
    int32_t part_a; /* which sphere of a cluster, which feature of a convex body; 0 for a sphere */
    int32_t part_b;
    double point[3];   /* m */
    double normal[3];  /* from b to a */
    double gap;        /* m */
    double impulse[3]; /* N s, on a */
} ces_ContactInfo;

typedef struct ces_PartInfo {
    double position[3];    /* m */
    double orientation[4]; /* unit quaternion (w, x, y, z) */
    double velocity[3];    /* m/s */
    double angular_velocity[3];
} ces_PartInfo;

/* A joint at the end of the last step; the forces are means over it. */
typedef struct ces_JointInfo {
    double travel;    /* rad or m, since time 0 */
    double speed;     /* rad/s or m/s */
    double effort;    /* N m or N, of the motor on a along the axis */
    double power;     /* W, what the motor gives */
    double energy;    /* J, what it has given so far */
    double impulse;   /* N m s or N s, its effort summed over the time so far */
    double force[3];  /* N, of the joint on a at the anchor, motor and stops included */
    double moment[3]; /* N m, about the anchor */
    int32_t at_limit; /* the motor gives all that it may */
    int32_t at_stop;  /* -1: pushed by the lower stop, 1: by the upper one */
} ces_JointInfo;

enum { CES_STAGE_COUNT = 7 }; /* feed, charge, force, detect, solve, move, collect */

enum { CES_SOLVER_COUNT = 8 }; /* the closed form of a lone contact, then the rows of the solver table */

/* What a solver did, summed over steps. */
typedef struct ces_SolverUse {
    uint64_t islands, contacts, iterations, unconverged; /* unconverged: islands */
    double residual;                                     /* m/s, worst */
    double
        seconds; /* of work, over all threads; not measured for the closed form, which takes less than a look at the clock */
} ces_SolverUse;

typedef struct ces_Health {
    uint64_t steps, contact_rows, active_contacts, iterations, visits, islands,
        unconverged;                         /* summed over steps; visits: of a contact by a sweep; the last: steps */
    uint64_t last_contacts, last_iterations; /* of the last step */
    double last_residual, residual;          /* m/s, last step and worst so far */
    double last_penetration, penetration;    /* m, last step and worst so far */
    double penetration_ratio;                /* worst so far, of a radius */
    double kinetic_energy;                   /* J, now, of grains and dynamic parts */
    uint64_t redundant_rows;                 /* of joints: what other rows hold already */
    double joint_drift;                      /* m, worst so far: by how far a joint was apart at the end of a step */
    double pair_force, pair_defect; /* N2, sums of squares over a sample: forces between grains, and their error */
    double turn;                    /* rad, worst so far: of a grain that is no sphere in a step */
    uint64_t limited_charges;       /* that reached what air can hold: fed with more, or by ions */
    ces_SolverUse solvers[CES_SOLVER_COUNT]; /* by ces_solver_name */
} ces_Health;

/* Masses are summed as integers, so that fed = landed + resident + lost holds exactly; closed says that it did. */
typedef struct ces_Balance {
    uint64_t fed_count, landed_count, resident_count, lost_count;
    double fed_mass, landed_mass, resident_mass, lost_mass; /* kg */
    bool closed;
} ces_Balance;

/* ---- verbs ------------------------------------------------------------------------------------------------------------- */

typedef struct ces_Scene ces_Scene;

ces_Status ces_scene_create(const ces_SceneDef *def, ces_Scene **scene, ces_Error *error);
void ces_scene_destroy(ces_Scene *scene);

/* What grains are added with, by arrays of their number. */
typedef struct ces_GrainsDef {
    const double *position;         /* m (count, 3) */
    const double *velocity;         /* m/s (count, 3) */
    const double *angular_velocity; /* rad/s (count, 3) */
    const double *orientation;      /* unit quaternions (count, 4); NULL: not turned */
    const int32_t *material;        /* index (count) */
    const int32_t *shape;           /* index (count); NULL: spheres */
    const double *diameter;         /* m (count) */
    const double *charge;           /* C (count) */
} ces_GrainsDef;

/* Adds count grains; their ids come in ids (count). All or nothing. */
ces_Status ces_scene_add(ces_Scene *scene, size_t count, const ces_GrainsDef *grains, int64_t *ids, ces_Error *error);
ces_Status ces_scene_step(ces_Scene *scene, ces_Error *error);

/* How a solver would do on the contact problem of the next step. */
typedef struct ces_Trial {
    uint64_t contacts, iterations; /* iterations: of the island that takes most */
    double residual;               /* m/s, worst of all islands */
    double objective;              /* J, of the convex problem */
    double seconds;                /* in the solver */
    bool converged;
} ces_Trial;

/* Makes the contact problem of the next step and solves it, without stepping: nothing that lasts is changed. cold: from no
 * impulses instead of those of the step before. */
ces_Status ces_scene_try_solver(ces_Scene *scene, const char *solver, uint32_t max_iterations, double tolerance,
                                bool cold, ces_Trial *trial, ces_Error *error);

size_t ces_scene_count(const ces_Scene *scene);
double ces_scene_time(const ces_Scene *scene);
uint64_t ces_scene_step_index(const ces_Scene *scene);
double ces_scene_step_size(const ces_Scene *scene);
double ces_scene_tolerance(const ces_Scene *scene); /* m/s, at which a contact problem counts as solved */
int ces_scene_threads(const ces_Scene *scene);
ces_Buffer *ces_scene_column(const ces_Scene *scene, ces_ColumnName name);
const ces_ColumnInfo *ces_column_info(ces_ColumnName name);
size_t ces_scene_landing_count(const ces_Scene *scene);
const ces_Landing *ces_scene_landings(const ces_Scene *scene);
size_t ces_scene_contact_count(const ces_Scene *scene);
void ces_scene_contacts(const ces_Scene *scene, ces_ContactInfo *contacts);
size_t ces_scene_part_count(const ces_Scene *scene);
void ces_scene_parts(const ces_Scene *scene, ces_PartInfo *parts);
size_t ces_scene_joint_count(const ces_Scene *scene);
void ces_scene_joints(const ces_Scene *scene, ces_JointInfo *joints);
ces_Health ces_scene_health(const ces_Scene *scene);
ces_Balance ces_scene_balance(const ces_Scene *scene);
const char *ces_solver_name(int solver);
const char *ces_stage_name(int stage);
double ces_scene_stage_seconds(const ces_Scene *scene, int stage); /* s, so far */
uint64_t ces_scene_state_hash(ces_Scene *scene);

/* A snapshot is a list of named blocks of memory, in an order that depends on the scene alone. */
typedef struct ces_Block {
    const char *name;
    ces_ColumnType type;
    uint32_t width;
    size_t count;
    const void *data; /* (count, width) */
} ces_Block;

size_t ces_scene_block_count(const ces_Scene *scene);
ces_Status ces_scene_block(ces_Scene *scene, size_t index, ces_Block *block, ces_Error *error);
/* Gives the scene the state of a snapshot; all or nothing. blocks (block_count) in the order of ces_scene_block. */
ces_Status ces_scene_restore(ces_Scene *scene, const ces_Block *blocks, size_t count, ces_Error *error);

#endif
