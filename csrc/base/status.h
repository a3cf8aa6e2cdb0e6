/* base/status.h - filling a ces_Error. */
#ifndef CES_STATUS_H
#define CES_STATUS_H

#include "../cesim.h"

#if defined(__GNUC__)
#define CES_PRINTF __attribute__((format(printf, 3, 4)))
#else
#define CES_PRINTF
#endif

/* Writes the text (error may be NULL) and returns status, so that a check is one line. */
ces_Status ces_fail(ces_Error *error, ces_Status status, const char *format, ...) CES_PRINTF;

/* CES_INPUT unless least <= value <= most and value is finite. */
ces_Status ces_check_range(ces_Error *error, const char *what, double value, double least, double most,
                           const char *unit);

#endif
