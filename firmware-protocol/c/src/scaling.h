/** @file scaling.h
 * @brief Physical values as signed 16-bit counts (section 3). */
#ifndef RESONARM_SCALING_H
#define RESONARM_SCALING_H

#include <stdint.h>

#include "resonarm_config.h"

/** The count for "not available". */
#define COUNT_NOT_AVAILABLE (-32768)

/** Whether a value has a count. */
typedef enum { COUNT_IN_RANGE, COUNT_BEYOND, COUNT_NOT_FINITE } count_range;

/** The count nearest to a value, ties to even; for a value beyond the range the nearer end. */
count_range resonarm_count_of(double value, int counts_per_unit, int16_t *count);

/** The value of a count. */
double resonarm_value_of(int16_t count, int counts_per_unit);

#endif
