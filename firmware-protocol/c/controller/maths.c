#include "maths.h"

#include <stdint.h>

#define TAU 6.283185307179586
#define HALF_PI_HIGH 1.57079632673412561417
#define HALF_PI_LOW 6.07710050650619224932e-11

/* Taylor series for |x| <= pi/4, where the first term left out, x^17/17! or x^18/18!, is below 5e-17. */
static double sine_series(double x)
{
    const double y = x * x;
    double sum = 1.0;
    for (int n = 14; n >= 2; n -= 2) {
        sum = 1.0 - sum * y / (n * (n + 1));
    }
    return x * sum;
}

static double cosine_series(double x)
{
    const double y = x * x;
    double sum = 1.0;
    for (int n = 15; n >= 1; n -= 2) {
        sum = 1.0 - sum * y / (n * (n + 1));
    }
    return sum;
}

/*
 * sin(a + shift pi/2), where a is 2 pi x, less whole cycles, rounded to a double. Its rounding error is all
 * that remains at a zero, and a single resolves it. So the commands equal those of a library's sin(2 pi x) in both
 * profiles.
 *
 * a = quarters pi/2 + rest with |rest| <= pi/4. In pi/2 = HIGH + LOW, HIGH has 33 bits, so that the first
 * subtraction is exact (W. J. Cody and W. Waite 1980, Software Manual for the Elementary Functions), and the sine of a
 * quarter is one of four series.
 */
static double shifted_sine(double x, int shift)
{
    const double angle = TAU * (x - (double)(int32_t)x);
    const int quarters = (int)(angle / (0.25 * TAU) + (angle < 0.0 ? -0.5 : 0.5));
    const double rest = (angle - quarters * HALF_PI_HIGH) - quarters * HALF_PI_LOW;
    switch ((quarters + shift + 4) % 4) {
    case 0:
        return sine_series(rest);
    case 1:
        return cosine_series(rest);
    case 2:
        return -sine_series(rest);
    default:
        return -cosine_series(rest);
    }
}

double sine_of_cycles(double x)
{
    return shifted_sine(x, 0);
}

double cosine_of_cycles(double x)
{
    return shifted_sine(x, 1);
}

/* Newton's iteration from above: the steps fall until the last digits. */
double square_root(double x)
{
    double root = x > 1.0 ? x : 1.0;
    double next = 0.5 * (root + x / root);
    while (next < root) {
        root = next;
        next = 0.5 * (root + x / root);
    }
    return root;
}

double round_up(double x)
{
    const double whole = (double)(int32_t)x;
    return whole < x ? whole + 1.0 : whole;
}
