/** @file sequence.h
 * @brief The order of sample indices (section 8, "Index of a sample"). */
#ifndef RESONARM_SEQUENCE_H
#define RESONARM_SEQUENCE_H

#include "resonarm_exciter.h"

/** The place of a sample's index. */
typedef enum {
    SEQUENCE_FIRST, /**< The first since arming. */
    SEQUENCE_AHEAD, /**< A new one. */
    SEQUENCE_STALE, /**< Repeated or older: ignored. */
    SEQUENCE_BROKEN /**< Outside the window, or the tenth stale one. */
} sequence_place;

/** A sequence that begins with any index. */
resonarm_sequence_ resonarm_sequence_new(uint16_t rate_hz);

/** Judges an index; a new one becomes the last one, and `ahead` is its distance from the one before. */
sequence_place resonarm_sequence_judge(resonarm_sequence_ *sequence, uint16_t index, uint16_t *ahead);

#endif
