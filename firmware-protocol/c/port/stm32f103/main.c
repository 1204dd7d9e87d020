/* The reference controller on an STM32F103: a stepped sine in open loop, in lockstep with a plant of 1000 Hz. */
#include "loop.h"
#include "stepped_sine.h"

#define PATIENCE_NS UINT64_C(3600000000000)

static const stepped_sine_spec spec = {
    .rate_hz = 1000.0,
    .frequencies_hz = {19.7, 26.0},
    .points = 2,
    .amplitude_n = 150.0,
    .limit_n = 655.34,
    .ramp_s = 0.2,
    .dwell_s = 0.4,
};

int main(void)
{
    static resonarm_exciter exciter;
    static open_loop controller;
    const resonarm_exciter_config config = {
        .network = resonarm_own_network(),
        .rate_hz = 1000,
        .timing = resonarm_lockstep(),
        .answer = open_loop_answer,
        .context = &controller,
    };
    open_loop_init(&controller, &spec);
    resonarm_exciter_init(&exciter, &config);
    return loop_run(&exciter, PATIENCE_NS) == LOOP_ENDED ? 0 : 1;
}
