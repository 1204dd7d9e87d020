#include "scaling.h"

#include <stdbool.h>

/* Only binary64 rounds the factor 0.02 or 0.05 and its product with a count as the specification says. */
typedef char double_is_binary64[sizeof(double) == 8 ? 1 : -1];

/* Whether x - x is a number: neither infinity nor "not a number" gives 0. */
static bool is_finite(double x)
{
    const double difference = x - x;
    return difference >= 0.0 && difference <= 0.0;
}

/* The nearest integer, ties to even, for |x| < 2^31: truncation is exact, and so is the remainder. */
static int32_t nearest(double x)
{
    const int32_t whole = (int32_t)x;
    const double rest = x - (double)whole;
    const bool is_odd = whole % 2 != 0;
    if (rest > 0.5 || (rest >= 0.5 && is_odd)) {
        return whole + 1;
    }
    if (rest < -0.5 || (rest <= -0.5 && is_odd)) {
        return whole - 1;
    }
    return whole;
}

count_range resonarm_count_of(double value, int counts_per_unit, int16_t *count)
{
    *count = 0;
    if (!is_finite(value)) {
        return COUNT_NOT_FINITE;
    }
    const double scaled = value * counts_per_unit;
    if (scaled >= RESONARM_COUNT_MAX + 0.5) {
        *count = RESONARM_COUNT_MAX;
        return COUNT_BEYOND;
    }
    if (scaled <= -RESONARM_COUNT_MAX - 0.5) {
        *count = -RESONARM_COUNT_MAX;
        return COUNT_BEYOND;
    }
    *count = (int16_t)nearest(scaled);
    return COUNT_IN_RANGE;
}

double resonarm_value_of(int16_t count, int counts_per_unit)
{
    return (double)count / counts_per_unit;
}
