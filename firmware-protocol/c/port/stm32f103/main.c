/* The reference controller on an STM32F103: a stepped sine in open loop. */
#include "play.h"
#include "stepped_sine.h"

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
    static open_loop controller;
    open_loop_init(&controller, &spec);
    return play(open_loop_answer, &controller);
}
