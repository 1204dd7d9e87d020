/** @file random.h
 * @brief Random words for the programs that test random frames. */
#ifndef RANDOM_H
#define RANDOM_H

#include <stdint.h>

/** Not 0. */
static uint64_t random_state;

/** xorshift64* (S. Vigna, "An Experimental Exploration of Marsaglia's xorshift Generators, Scrambled",
 * ACM Trans. Math. Softw. 42, 30 (2016)). */
static uint32_t random_word(void)
{
    random_state ^= random_state >> 12;
    random_state ^= random_state << 25;
    random_state ^= random_state >> 27;
    return (uint32_t)((random_state * UINT64_C(2685821657736338717)) >> 32);
}

#endif
