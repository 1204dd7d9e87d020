/** @file axes.h
 * @brief The common coding of messages with two physical values. */
#ifndef RESONARM_AXES_H
#define RESONARM_AXES_H

#include "resonarm.h"

/** Flag bits of a sensor message, in the high nibble of byte 1: which axis is saturated. */
#define FLAG_X_SATURATED 0x10u
#define FLAG_Y_SATURATED 0x20u

/** How the two values of a message are coded. */
typedef struct {
    const char *signals[2];
    int counts_per_unit;
} axes_coding;

/** Two values, whether each is saturated, and the sample's index. */
typedef struct {
    double values[2];
    bool saturated[2];
    uint16_t sample;
} axes;

/** The coding of a kind with two physical values; NULL for any other. */
const axes_coding *resonarm_axes_coding_of(resonarm_kind kind);

/** Whether the kind is a sensor message: saturated values are clipped and flagged. */
bool resonarm_axes_are_measured(resonarm_kind kind);

/** The values of a message with two. */
axes resonarm_axes_of(const resonarm_message *message);

/** The message of this kind with these values. */
resonarm_message resonarm_axes_message(resonarm_kind kind, const axes *values);

#endif
