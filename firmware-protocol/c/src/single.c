#include "single.h"

#ifndef RESONARM_CLASSIC_ONLY

/* From here on a value rounds beyond the largest single: half a unit of its last place above it. */
#define FIRST_BEYOND 0x1.ffffffp127
#define EXPONENT UINT32_C(0x7F800000)

typedef char float_is_binary32[sizeof(float) == SINGLE_BYTES ? 1 : -1];

typedef union {
    float value;
    uint32_t bits;
} single;

single_range resonarm_put_single(uint8_t *at, double value)
{
    single nearest;
    single_range range = SINGLE_IN_RANGE;
    const double difference = value - value;
    if (!(difference >= 0.0)) {
        return SINGLE_NOT_FINITE;
    }
    if (value >= FIRST_BEYOND || value <= -FIRST_BEYOND) {
        range = SINGLE_BEYOND;
    }
    if (value > SINGLE_MAX) {
        nearest.value = (float)SINGLE_MAX;
    } else if (value < -SINGLE_MAX) {
        nearest.value = (float)-SINGLE_MAX;
    } else {
        nearest.value = (float)value;
    }
    for (int i = 0; i < SINGLE_BYTES; i++) {
        at[i] = (uint8_t)(nearest.bits >> (8 * i));
    }
    return range;
}

bool resonarm_get_single(const uint8_t *at, double *value)
{
    single read = {.bits = 0};
    for (int i = 0; i < SINGLE_BYTES; i++) {
        read.bits |= (uint32_t)at[i] << (8 * i);
    }
    if ((read.bits & EXPONENT) == EXPONENT) {
        return false;
    }
    *value = (double)read.value;
    return true;
}

#endif
