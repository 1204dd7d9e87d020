#include "listening.h"

uint64_t resonarm_saturating_sum(uint64_t a, uint64_t b)
{
    return a > UINT64_MAX - b ? UINT64_MAX : a + b;
}

uint64_t resonarm_earlier(uint64_t a, uint64_t b)
{
    return a < b ? a : b;
}

void resonarm_listening_look(resonarm_listening_ *listening, uint64_t now_ns)
{
    if (now_ns > listening->looked_at_ns) {
        const uint64_t counts_ns = resonarm_earlier(now_ns - listening->looked_at_ns, listening->look_period_ns);
        listening->listened_ns = resonarm_saturating_sum(listening->listened_ns, counts_ns);
        listening->looked_at_ns = now_ns;
    }
}

static uint64_t left_ns(const resonarm_listening_ *listening, uint64_t since_ns, uint64_t timeout_ns)
{
    const uint64_t end_ns = resonarm_saturating_sum(since_ns, timeout_ns);
    return end_ns > listening->listened_ns ? end_ns - listening->listened_ns : 0;
}

bool resonarm_listening_has_passed(const resonarm_listening_ *listening, uint64_t since_ns, uint64_t timeout_ns)
{
    return left_ns(listening, since_ns, timeout_ns) == 0;
}

uint64_t resonarm_listening_next_look_ns(const resonarm_listening_ *listening, uint64_t since_ns, uint64_t timeout_ns)
{
    const uint64_t left = resonarm_earlier(left_ns(listening, since_ns, timeout_ns), listening->look_period_ns);
    return resonarm_saturating_sum(listening->looked_at_ns, left);
}
