#include "sequence.h"

resonarm_sequence_ resonarm_sequence_new(uint16_t rate_hz)
{
    return (resonarm_sequence_){.window = resonarm_sample_window(rate_hz)};
}

sequence_place resonarm_sequence_judge(resonarm_sequence_ *sequence, uint16_t index, uint16_t *ahead)
{
    const uint16_t step = (uint16_t)(index - sequence->last);
    const uint16_t back = (uint16_t)(sequence->last - index);
    *ahead = 0;
    if (!sequence->started) {
        sequence->started = true;
        sequence->last = index;
        return SEQUENCE_FIRST;
    }
    if (step >= 1 && step <= sequence->window) {
        sequence->last = index;
        *ahead = step;
        return SEQUENCE_AHEAD;
    }
    if (back > sequence->window) {
        return SEQUENCE_BROKEN;
    }
    sequence->stale++;
    return sequence->stale < RESONARM_STALE_SAMPLES_LIMIT ? SEQUENCE_STALE : SEQUENCE_BROKEN;
}
