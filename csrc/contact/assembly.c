#include "assembly.h"

#include <math.h>
#include <string.h>

#include "../base/vec3.h"
#include "../data/shapes.h"
#include "mechanism.h"

/* A row whose pivot, of 1 at first, falls below this depends on the others. */
#define RANK 1e-11

static double dot(const double *a, const double *b, uint32_t width)
{
    double sum = 0.0;
    for (uint32_t k = 0; k < width; k++) {
        sum += a[k] * b[k];
    }
    return sum;
}

void ces_assembly_spread(const ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Joint *joint,
                         const double row[CES_JOINT_WIDTH], double *wide)
{
    memset(wide, 0, ces_assembly_width(assembly) * sizeof *wide);
    const int32_t ends[2] = {joint->def.part_a, joint->def.part_b};
    for (int end = 0; end < 2; end++) {
        if (ends[end] >= 0) {
            memcpy(&wide[6 * mechanism->slot[ends[end]]], &row[6 * end], 6 * sizeof *wide);
        }
    }
}

void ces_assembly_free_response(const ces_Mechanism *mechanism, const ces_Assembly *assembly, const double *push,
                                double *twist)
{
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        const double *in = &push[6 * slot], *inertia = &assembly->inverse_inertia[9 * slot];
        double *out = &twist[6 * slot];
        for (int k = 0; k < 3; k++) {
            out[k] = in[k] / mechanism->parts[assembly->parts[slot]].mass;
            out[3 + k] = ces_dot(&inertia[3 * k], &in[3]);
        }
    }
}

/* Cholesky with pivots, of the matrix whose rows and columns are scaled to a diagonal of 1. */
uint32_t ces_assembly_factorise(ces_Assembly *assembly, uint32_t rows)
{
    const uint32_t width = ces_assembly_width(assembly), stride = assembly->rows;
    double *l = assembly->factor, *left = assembly->work; /* left: what is left of each diagonal */
    for (uint32_t r = 0; r < rows; r++) {
        assembly->scale[r] = 1.0 / sqrt(dot(&assembly->jacobian[r * width], &assembly->response[r * width], width));
        assembly->order[r] = r;
        left[r] = 1.0;
    }
    assembly->rank = 0;
    for (uint32_t step = 0; step < rows; step++) {
        uint32_t best = step;
        for (uint32_t r = step + 1; r < rows; r++) {
            best = left[assembly->order[r]] > left[assembly->order[best]] ? r : best;
        }
        const uint32_t row = assembly->order[best];
        if (!(left[row] > RANK)) {
            break;
        }
        assembly->order[best] = assembly->order[step];
        assembly->order[step] = row;
        const double pivot = sqrt(left[row]);
        l[row * stride + step] = pivot;
        for (uint32_t r = step + 1; r < rows; r++) {
            const uint32_t other = assembly->order[r];
            double sum = assembly->scale[row] * assembly->scale[other] *
                         dot(&assembly->jacobian[other * width], &assembly->response[row * width], width);
            sum -= dot(&l[other * stride], &l[row * stride], step);
            l[other * stride + step] = sum / pivot;
            left[other] -= l[other * stride + step] * l[other * stride + step];
        }
        assembly->rank++;
    }
    return assembly->rank;
}

void ces_assembly_linearise(const ces_Mechanism *mechanism, ces_Assembly *assembly, const ces_Motion *motions)
{
    const uint32_t width = ces_assembly_width(assembly);
    uint32_t row = 0;
    for (uint32_t slot = 0; slot < assembly->part_count; slot++) {
        const uint32_t part = assembly->parts[slot];
        ces_inverse_tensor(mechanism->parts[part].inertia, motions[part].orientation,
                           &assembly->inverse_inertia[9 * slot]);
    }
    for (int motors = 0; motors < 2; motors++) {
        for (uint32_t k = 0; k < assembly->joint_count; k++) {
            const ces_Joint *joint = &mechanism->joints[assembly->joints[k]];
            const ces_Motion *a = ces_motion_of(motions, joint->def.part_a),
                             *b = ces_motion_of(motions, joint->def.part_b);
            double rows[CES_JOINT_ROWS * CES_JOINT_WIDTH];
            uint32_t count = joint->rows;
            if (motors) {
                count = joint->free_motor ? 1 : 0;
                ces_joint_drive(joint, a, b, rows, NULL);
            } else {
                ces_joint_rows(joint, a, b, NULL, rows);
            }
            for (uint32_t r = 0; r < count; r++, row++) {
                double *wide = &assembly->jacobian[row * width];
                ces_assembly_spread(mechanism, assembly, joint, &rows[r * CES_JOINT_WIDTH], wide);
                ces_assembly_free_response(mechanism, assembly, wide, &assembly->response[row * width]);
            }
        }
    }
    ces_assembly_factorise(assembly, assembly->rows);
    assembly->ready = false;
}

void ces_assembly_solve(const ces_Assembly *assembly, const double *b, double *x)
{
    const uint32_t stride = assembly->rows, rank = assembly->rank;
    const double *l = assembly->factor;
    double *y = assembly->work;
    for (uint32_t k = 0; k < rank; k++) {
        const uint32_t row = assembly->order[k];
        y[k] = (assembly->scale[row] * b[row] - dot(&l[row * stride], y, k)) / l[row * stride + k];
    }
    for (uint32_t k = rank; k-- > 0;) {
        double sum = y[k];
        for (uint32_t j = k + 1; j < rank; j++) {
            sum -= l[assembly->order[j] * stride + k] * y[j];
        }
        y[k] = sum / l[assembly->order[k] * stride + k];
    }
    memset(x, 0, stride * sizeof *x);
    for (uint32_t k = 0; k < rank; k++) {
        x[assembly->order[k]] = assembly->scale[assembly->order[k]] * y[k];
    }
}

void ces_assembly_slip(const ces_Assembly *assembly, const double *twist, double *u)
{
    const uint32_t width = ces_assembly_width(assembly);
    for (uint32_t r = 0; r < assembly->rows; r++) {
        u[r] = dot(&assembly->jacobian[r * width], twist, width);
    }
}

void ces_assembly_push(const ces_Assembly *assembly, const double *impulse, double *twist)
{
    const uint32_t width = ces_assembly_width(assembly);
    for (uint32_t r = 0; r < assembly->rows; r++) {
        for (uint32_t k = 0; k < width; k++) {
            twist[k] += impulse[r] * assembly->response[r * width + k];
        }
    }
}

/* Twice: the second time takes what rounding has left. */
void ces_assembly_constrain(const ces_Assembly *assembly, double *twist, double *impulse)
{
    memset(impulse, 0, assembly->rows * sizeof *impulse);
    for (int round = 0; round < 2 && assembly->rows > 0; round++) {
        ces_assembly_slip(assembly, twist, assembly->more);
        ces_assembly_solve(assembly, assembly->more, assembly->more);
        for (uint32_t r = 0; r < assembly->rows; r++) {
            assembly->more[r] = -assembly->more[r];
            impulse[r] += assembly->more[r];
        }
        ces_assembly_push(assembly, assembly->more, twist);
    }
}

double ces_assembly_apart(const ces_Mechanism *mechanism, const ces_Assembly *assembly, const ces_Motion *motions,
                          double *apart, uint32_t *worst_joint)
{
    double worst = 0.0;
    uint32_t row = 0;
    for (uint32_t k = 0; k < assembly->joint_count; k++) {
        const ces_Joint *joint = &mechanism->joints[assembly->joints[k]];
        ces_joint_rows(joint, ces_motion_of(motions, joint->def.part_a), ces_motion_of(motions, joint->def.part_b),
                       &apart[row], NULL);
        for (uint32_t r = 0; r < joint->rows; r++, row++) {
            if (!(fabs(apart[row]) <= worst)) {
                worst = fabs(apart[row]);
                *worst_joint = assembly->joints[k];
            }
        }
    }
    return worst;
}

void ces_assembly_fill_mobility(const ces_Mechanism *mechanism, ces_Assembly *assembly)
{
    const uint32_t width = ces_assembly_width(assembly);
    for (uint32_t column = 0; column < width; column++) {
        double *answer = &assembly->mobility[column * width]; /* symmetric: a column is a row */
        memset(assembly->push, 0, width * sizeof *assembly->push);
        assembly->push[column] = 1.0;
        ces_assembly_free_response(mechanism, assembly, assembly->push, answer);
        ces_assembly_constrain(assembly, answer, assembly->impulse);
    }
    for (uint32_t row = 0; row < width; row++) {
        for (uint32_t column = 0; column < row; column++) {
            assembly->mobility[row * width + column] = assembly->mobility[column * width + row];
        }
    }
    assembly->ready = true;
}
