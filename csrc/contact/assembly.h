/*
 * contact/assembly.h - the rows of joints, eliminated. An assembly is the dynamic parts that joints hang together. What its joints
 * demand without a bound is a linear system of few rows, solved exactly once a step; the contact problem then sees bodies
 * that already move as their joints let them: mobility A = M^-1 - M^-1 J' (J M^-1 J')^+ J M^-1. So neither the mass of a drum
 * nor a chain of joints is left to an iteration. Rows that may give way, a motor with a limit and stops, are blocks of
 * the contact problem (contact/rigid.h).
 */
#ifndef CES_ASSEMBLY_H
#define CES_ASSEMBLY_H

#include "../data/joints.h"

typedef struct ces_Mechanism ces_Mechanism;

typedef struct ces_Assembly {
    uint32_t *parts, *joints; /* indices, rising */
    uint32_t part_count, joint_count;
    uint32_t first_drive, drive_count;
    uint32_t joint_rows, rows; /* the latter with those of motors without a limit, which come last */
    uint32_t rank;             /* of all rows where they were last linearised */
    double size;               /* m, of its parts and arms */
    bool yields;               /* its joints leave it some freedom */
    bool ready;                /* the mobility is that of this step */
    bool by_turns;             /* it is solved by turns with the grains: turns.h */

    /* At the poses of the last linearisation; width = 6 part_count, velocity and angular velocity part by part. */
    double *inverse_inertia;     /* (part_count, 9) 1/(kg m2) */
    double *jacobian, *response; /* (rows, width): J, and J M^-1 */
    double *factor, *scale;      /* of J M^-1 J' with rows scaled to 1: (rows, rows), (rows) */
    uint32_t *order;             /* rows in the order of their pivots; those beyond rank depend on the others */
    double *mobility;            /* (width, width) */
    double *apart, *impulse, *more, *work; /* (rows) */
    double *twist, *push;                  /* (width) m/s and rad/s; N s and N m s */
} ces_Assembly;

static inline uint32_t ces_assembly_width(const ces_Assembly *assembly)
{
    return 6 * assembly->part_count;
}

/* Writes the rows at these poses (of all parts of the mechanism), and factorises. */
void ces_assembly_linearise(const ces_Mechanism *mechanism, ces_Assembly *assembly, const ces_Motion *motions);
/* Rank of the first rows alone; what was factorised before is lost. */
uint32_t ces_assembly_factorise(ces_Assembly *assembly, uint32_t rows);
/* x = (J M^-1 J')^+ b; may be the same array. */
void ces_assembly_solve(const ces_Assembly *assembly, const double *b, double *x);
/* u = J twist. */
void ces_assembly_slip(const ces_Assembly *assembly, const double *twist, double *u);
/* twist += M^-1 J' impulse. */
void ces_assembly_push(const ces_Assembly *assembly, const double *impulse, double *twist);
/* M^-1 push, without the joints. */
void ces_assembly_free_response(const ces_Mechanism *mechanism, const ces_Assembly *assembly, const double *push,
                                double *twist);
/* Takes from a twist what the joints do not let pass; the impulses that do it in impulse (rows). */
void ces_assembly_constrain(const ces_Assembly *assembly, double *twist, double *impulse);
/* By how much each row of the joints is apart, m; gives the worst and its joint. */
double ces_assembly_apart(const ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Motion *motions,
                          double *apart, uint32_t *worst_joint);
void ces_assembly_fill_mobility(const ces_Mechanism *mechanism, ces_Assembly *assembly);
/* A row of a joint, spread over the width of its assembly. */
void ces_assembly_spread(const ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Joint *joint,
                         const double row[CES_JOINT_WIDTH], double *wide);

#endif
