/* Compares the controllers' mathematics with the compiler's library: maths; prints the largest errors. */
#include <float.h>
#include <math.h>
#include <stdio.h>

#include "../controller/maths.c"

int main(void)
{
    const double two_pi = 6.283185307179586;
    double sine = 0.0, cosine = 0.0, root = 0.0;
    for (int i = -400000; i <= 400000; i++) {
        const double cycles = i * 1.2345e-5;
        const double angle = two_pi * (cycles - trunc(cycles));
        sine = fmax(sine, (double)fabsl(sine_of_cycles(cycles) - sinl(angle)));
        cosine = fmax(cosine, (double)fabsl(cosine_of_cycles(cycles) - cosl(angle)));
        const double square = ldexp(1.0 + (i + 400000) * 3e-6, i / 4000);
        root = fmax(root, fabs(square_root(square) / sqrt(square) - 1.0));
    }
    /* At its zeros the sine is the rounding error of the angle; a single resolves 6e-8 of it. */
    const double zero = fmax(fabs(sine_of_cycles(0.5) / sin(0.5 * two_pi) - 1.0),
                             fabs(cosine_of_cycles(0.25) / cos(0.25 * two_pi) - 1.0));
    const double big = sine_of_cycles(1e6 + 0.125) - sine_of_cycles(0.125);
    const int is_whole = round_up(2.0) <= 2.0 && round_up(2.0000001) >= 3.0 && round_up(0.0) <= 0.0;
    printf("sine %.3g cosine %.3g zero %.3g root %.3g\n", sine, cosine, zero, root);
    const int is_near = sine < 4e-16 && cosine < 4e-16 && zero < 1e-9 && root < 2 * DBL_EPSILON && fabs(big) < 1e-16;
    const int has_root_of_zero = square_root(0.0) < 1e-100;
    return is_near && is_whole && has_root_of_zero ? 0 : 1;
}
