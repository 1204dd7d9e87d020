#include "resonarm.h"

#define SECOND_NS UINT64_C(1000000000)

uint64_t resonarm_sample_period_ns(uint16_t rate_hz)
{
    return SECOND_NS / (rate_hz == 0 ? 1u : rate_hz);
}

uint16_t resonarm_sample_window(uint16_t rate_hz)
{
    const uint64_t samples = rate_hz * RESONARM_HEARTBEAT_TIMEOUT_NS / SECOND_NS;
    return samples > RESONARM_SAMPLE_WINDOW_MIN ? (uint16_t)samples : (uint16_t)RESONARM_SAMPLE_WINDOW_MIN;
}
