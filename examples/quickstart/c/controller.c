/* A controller in C: a sine of force at the tip for some seconds, in answer to the plant's samples.
 *
 *     make -C c && c/controller vcan0
 *
 * `answer` is what to change. The node of the library arms the plant, keeps the deadlines and disarms; loop.c passes it
 * frames and the time by the five functions of port.h, here those of linux_socketcan.c, on your hardware yours. */
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "linux_socketcan.h"
#include "loop.h"

#define RATE_HZ 1000
#define FREQUENCY_HZ 14.0
#define AMPLITUDE_N 20.0
#define RAMP_S 0.5
#define LENGTH_S 3.0
#define PATIENCE_NS UINT64_C(30000000000)
#define TAU 6.283185307179586

/* The force to hold until the next sample; the largest acceleration at the tip is the context. */
static resonarm_answer answer(void *context, const resonarm_sample *sample)
{
    double *largest_m_s2 = context;
    *largest_m_s2 = fmax(*largest_m_s2, fabs(sample->c.acceleration_x_m_s2));
    const double t_s = (double)sample->sample / RATE_HZ;
    if (t_s >= LENGTH_S) {
        return (resonarm_answer){.action = RESONARM_FINISH};
    }
    /* It grows at the beginning and falls at the end, so that nothing jumps. */
    const double ramp = fmin(fmin(t_s, LENGTH_S - t_s), RAMP_S) / RAMP_S;
    const double force_n = AMPLITUDE_N * ramp * sin(TAU * FREQUENCY_HZ * t_s);
    return (resonarm_answer){.action = RESONARM_HOLD_FORCE, .force_x_n = force_n};
}

int main(int count, char **arguments)
{
    static resonarm_exciter exciter;
    static double largest_m_s2;
    const char *interface = count > 1 ? arguments[1] : "vcan0";
    const int error = linux_socketcan_open(interface);
    if (error != 0) {
        fprintf(stderr, "%s: %s\n", interface, strerror(error));
        return 3;
    }
    const resonarm_exciter_config config = {
        .network = resonarm_own_network(),
        .rate_hz = RATE_HZ,
        .timing = resonarm_lockstep(),
        .answer = answer,
        .context = &largest_m_s2,
        .capabilities = {.samples_per_frame = 1, .force_limit_n = AMPLITUDE_N},
    };
    resonarm_exciter_init(&exciter, &config);
    const loop_end end = loop_run(&exciter, PATIENCE_NS);
    if (end != LOOP_ENDED || resonarm_exciter_report(&exciter).outcome != RESONARM_FINISHED) {
        fprintf(stderr, end == LOOP_NO_PLANT ? "no plant was armed in time\n" : "the run did not finish\n");
        return 1;
    }
    printf("the tip's largest acceleration along x: %.3f m/s²\n", largest_m_s2);
    return 0;
}
