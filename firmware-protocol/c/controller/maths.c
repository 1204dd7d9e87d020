#include "maths.h"

#include <stdint.h>

#define TAU 6.283185307179586

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
 * sin(2 pi (x + shift/4)): x = whole + quarters/4 + rest with |rest| <= 1/8, each step exact, and the sine of a
 * quarter is one of four series.
 */
static double shifted_sine(double x, int shift)
{
    const double part = x - (double)(int32_t)x;
    const int quarters = (int)(4.0 * part + (part < 0.0 ? -0.5 : 0.5));
    const double angle = TAU * (part - quarters * 0.25);
    switch ((quarters + shift + 4) % 4) {
    case 0:
        return sine_series(angle);
    case 1:
        return cosine_series(angle);
    case 2:
        return -sine_series(angle);
    default:
        return -cosine_series(angle);
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
