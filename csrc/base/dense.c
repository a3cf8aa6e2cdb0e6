#include "dense.h"

#include <math.h>

static void swap_rows(double *a, size_t count, double *b, size_t one, size_t other)
{
    for (size_t k = 0; k < count; k++) {
        const double held = a[one * count + k];
        a[one * count + k] = a[other * count + k];
        a[other * count + k] = held;
    }
    const double held = b[one];
    b[one] = b[other];
    b[other] = held;
}

void ces_dense_solve(double *a, size_t count, double *b)
{
    for (size_t column = 0; column < count; column++) {
        size_t best = column;
        for (size_t row = column + 1; row < count; row++) {
            if (fabs(a[row * count + column]) > fabs(a[best * count + column])) {
                best = row;
            }
        }
        if (best != column) {
            swap_rows(a, count, b, best, column);
        }
        const double *pivot = a + column * count;
        if (pivot[column] == 0.0) {
            continue;
        }
        for (size_t row = column + 1; row < count; row++) {
            double *line = a + row * count;
            if (line[column] == 0.0) {
                continue;
            }
            const double factor = line[column] / pivot[column];
            for (size_t k = column; k < count; k++) {
                line[k] -= factor * pivot[k];
            }
            b[row] -= factor * b[column];
        }
    }
    for (size_t row = count; row-- > 0;) {
        const double *line = a + row * count;
        double sum = b[row];
        for (size_t k = row + 1; k < count; k++) {
            sum -= line[k] * b[k];
        }
        b[row] = line[row] != 0.0 ? sum / line[row] : 0.0;
    }
}
