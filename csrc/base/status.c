#include "status.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>

ces_Status ces_fail(ces_Error *error, ces_Status status, const char *format, ...)
{
    if (error == NULL) {
        return status;
    }
    error->status = status;
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(error->text, sizeof error->text, format, arguments);
    va_end(arguments);
    return status;
}

ces_Status ces_check_range(ces_Error *error, const char *what, double value, double least, double most,
                           const char *unit)
{
    if (isfinite(value) && value >= least && value <= most) {
        return CES_OK;
    }
    return ces_fail(error, CES_INPUT, "%s is %g %s, outside [%g, %g] %s", what, value, unit, least, most, unit);
}
