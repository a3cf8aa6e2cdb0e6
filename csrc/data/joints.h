/*
 * data/joints.h - the dynamic parts of a machine and the joints that hold them: what a definition gives, checked, and the rows
 * of each joint. A row is a velocity of a against b in m/s: an angle is taken times a length of the part.
 */
#ifndef CES_JOINTS_H
#define CES_JOINTS_H

#include "../cesim.h"

#define CES_NO_PART UINT32_MAX

enum {
    CES_JOINT_ROWS = 6,   /* of a joint without its motor, at most */
    CES_JOINT_WIDTH = 12, /* numbers of a row: velocity and angular velocity of a, then of b */
};

/* Where a body is and how it moves. */
typedef struct ces_Motion {
    double position[3], orientation[4]; /* m */
    double velocity[3], spin[3];        /* m/s, rad/s, world */
} ces_Motion;

/* What a joint remembers from step to step. */
typedef struct ces_JointState {
    double travel, speed;       /* rad, rad/s; or m, m/s */
    double effort, work;        /* of the motor in the step: N m s or N s, J */
    double impulse, energy;     /* the same so far */
    double force[3], moment[3]; /* N s, N m s: impulses of the step on a, about the anchor */
    double motor, lower, upper; /* N s: impulses of the rows that may give way */
    double at_limit;            /* 1: the motor gave all that it may */
} ces_JointState;

typedef struct ces_Joint {
    ces_JointDef def;                /* its law is a copy */
    double anchor_a[3], anchor_b[3]; /* m, in the frames of the parts */
    double axis_a[3], axes_b[3][3];  /* axis in the frame of a; axis and two directions across it in the frame of b */
    double relative[4];              /* orientation of a in the frame of b at time 0 */
    double length;                   /* m, by which angles are multiplied */
    uint32_t rows;                   /* without the motor */
    bool free_motor,
        weak_motor; /* a motor without a limit is one row more of the joint; one with a limit may give way */
} ces_Joint;

/* A pair of bodies that a joint holds; the ground's motion is ces_ground. */
extern const ces_Motion ces_ground;

ces_Status ces_part_check(const ces_PartDef *def, ces_Error *error);
/* law: where the copy of its law is kept. */
ces_Status ces_joint_create(const ces_JointDef *def, const ces_PartDef *parts, size_t part_count, double *law,
                            ces_Joint *joint, ces_Error *error);

/* By how much the joint is apart, m (rows), and the rows (rows, CES_JOINT_WIDTH); either may be NULL. */
void ces_joint_rows(const ces_Joint *joint, const ces_Motion *a, const ces_Motion *b, double *apart, double *rows);
/* The row of its free motion, in m/s also where it turns, and the travel as seen, an angle in (-pi, pi]; travel may be NULL. */
void ces_joint_drive(const ces_Joint *joint, const ces_Motion *a, const ces_Motion *b, double *row, double *travel);
/* The travel that is seen, as the one of all that differ by whole turns that is nearest to expected. */
double ces_joint_unwind(const ces_Joint *joint, double seen, double expected);
/* From the free motion's unit to the row's: length for an angle, 1 for a distance. */
double ces_joint_scale(const ces_Joint *joint);
/* Where the anchor of a is, m, world. */
void ces_joint_anchor(const ces_Joint *joint, const ces_Motion *a, double anchor[3]);

/* Speed of the motor's law at a time, and its integral from one time to another. */
double ces_law_at(const ces_Joint *joint, double time);
double ces_law_between(const ces_Joint *joint, double from, double to);

#endif
