/*
 * contact/rigid.h - the cone problems of islands of rigid bodies of any shape, as the solvers of cone_solver.h see them.
 *
 * The state is the velocities of the bodies: an impulse pushes two of them, a slip is read off two of them, and the matrix
 * N = D^T M^-1 D is never formed. Islands of spheres alone have a faster form, problem.h.
 *
 * Dynamic parts of the machine are bodies behind the grains. A push on one moves all parts of its assembly, as their joints let
 * them (assembly.h); their rows that may give way stand behind the contacts of the island.
 */
#ifndef CES_RIGID_H
#define CES_RIGID_H

#include "../data/shapes.h"
#include "cone_solver.h"
#include "problem.h"

#define CES_NO_BODY UINT32_MAX

typedef struct ces_RigidBody {
    double v[3], w[3]; /* m/s, rad/s: as the impulses pushed so far leave them */
    double free_v[3], free_w[3];
    double inverse_mass;       /* 1/kg */
    double inverse_inertia[9]; /* 1/(kg m2), world */
} ces_RigidBody;

/* One contact, or one drive: then only that and its one row count. The rows of a contact are the normal, two tangents, and where it has moments the spin about and the two rolls across them. */
typedef struct ces_RigidRow {
    uint32_t a, b; /* bodies; b = CES_NO_BODY for a surface */
    uint32_t contact;
    ces_Drive *drive;          /* NULL: a contact */
    double frame[3][3];        /* N, T1, T2 */
    double arm_a[3], arm_b[3]; /* m */
    double offset[6];          /* m/s, what u has besides the bodies' motion: bias, surface */
    double radius;             /* m, of rolling: a moment over it is an impulse */
    uint32_t rows;             /* 3 or 6 */
} ces_RigidRow;

/* Where an island's part of the lists begins. */
typedef struct ces_RigidIsland {
    uint32_t first_block, block_count, first_row, row_count;
    size_t first_diagonal, first_scratch;
} ces_RigidIsland;

typedef struct ces_RigidInput {
    const ces_Contacts *contacts;
    const ces_Islands *islands;
    const ces_Particles *particles;
    const ces_Shape *shapes;
    ces_Mechanism *mechanism;    /* ready for the step: ces_mechanism_prepare */
    size_t rows;                 /* grains */
    const double *free_velocity; /* m/s, (rows, 3) */
    const double *free_spin;     /* rad/s, (rows, 3); NULL: the grains' own */
    bool rotation;
    const ces_ConeSolver *solver; /* says how much scratch it needs */
    ces_ContactLaw law;
    double tolerance; /* m/s */
    uint32_t max_iterations;
} ces_RigidInput;

typedef struct ces_Rigid {
    ces_RigidInput input;
    ces_RigidBody *bodies; /* (rows, then parts), those with contacts in such islands are filled */
    ces_RigidRow *list;    /* (block_count) */
    ces_ConeBlock *blocks; /* (block_count), rows counted from the island's first */
    double *diagonal;      /* the square of its rows a block */
    double *impulse;       /* one a row */
    double *least, *most;  /* the same, read for drives only */
    double *scratch;
    ces_RigidIsland *islands; /* one an island; block_count 0 for those of problem.h */
    size_t block_count, row_count, diagonal_count, scratch_count;
    ces_Pool body_pool, list_pool, block_pool, diagonal_pool, impulse_pool, scratch_pool, island_pool, bound_pool;
} ces_Rigid;

/* States the problems of the islands that are not packed. False: out of memory. */
bool ces_rigid_build(ces_Rigid *rigid, const ces_RigidInput *input);
/* Solves one of them; changes only its own bodies and rows. */
ces_ConeReport ces_rigid_solve(ces_Rigid *rigid, size_t island);
/* The convex objective of a solved island, J. */
double ces_rigid_objective(ces_Rigid *rigid, size_t island);
/* Impulses to the contacts and drives, velocities to the grains of the step. */
void ces_rigid_finish(const ces_Rigid *rigid, ces_Contacts *contacts, ces_Body *bodies);
void ces_rigid_free(ces_Rigid *rigid);

#endif
