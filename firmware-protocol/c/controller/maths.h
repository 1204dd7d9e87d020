/** @file maths.h
 * @brief The controllers' mathematical functions, computed by the four basic operations: the same bits wherever a
 * double is a binary64, with or without a floating-point unit. */
#ifndef MATHS_H
#define MATHS_H

/** sin(2 pi x), within 4e-16, for |x| < 2^31. */
double sine_of_cycles(double x);

/** cos(2 pi x), within 4e-16, for |x| < 2^31. */
double cosine_of_cycles(double x);

/** The square root of a number that is not negative, within 2 units of the last place. */
double square_root(double x);

/** The least whole number that is not below x, for 0 <= x < 2^31. */
double round_up(double x);

#endif
