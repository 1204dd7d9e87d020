/** @file held_spec.h
 * @brief The stepped sine of main_held.c. */
#ifndef HELD_SPEC_H
#define HELD_SPEC_H

#include "stepped_sine.h"

static const stepped_sine_spec held_spec = {
    .rate_hz = 1000.0,
    .frequencies_hz = {45.0},
    .points = 1,
    .amplitude_n = 20.0,
    .limit_n = 100.0,
    .ramp_s = 0.05,
    .settle_s = 0.1,
};

#endif
