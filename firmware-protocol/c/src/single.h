/** @file single.h
 * @brief Physical values as IEEE 754 singles, little-endian (section 3). */
#ifndef RESONARM_SINGLE_H
#define RESONARM_SINGLE_H

#include <stdbool.h>
#include <stdint.h>

/** The largest single. */
#define SINGLE_MAX 0x1.fffffep127
/** Bytes in one. */
#define SINGLE_BYTES 4

/** Whether a value has a single. */
typedef enum { SINGLE_IN_RANGE, SINGLE_BEYOND, SINGLE_NOT_FINITE } single_range;

/** Writes the single nearest to a value, ties to even; for a value beyond the range the nearer end. */
single_range resonarm_put_single(uint8_t *at, double value);

/** Reads a single; false if it is not a finite number. */
bool resonarm_get_single(const uint8_t *at, double *value);

#endif
