/* An exciter on Zephyr: for two seconds the force at the tip answers the force in the impedance head.
 *
 *     west build -b native_sim firmware-protocol/c/zephyr/samples/exciter -- \
 *         -DZEPHYR_EXTRA_MODULES=$PWD/firmware-protocol/c
 *     build/zephyr/zephyr.exe
 *
 * against `resonarm run --bus vcan0 --mode lockstep --stop-on-disarm`. */
#include <zephyr/device.h>
#include <zephyr/kernel.h>

#include "loop.h"
#include "zephyr_can.h"

#define RATE_HZ 1000
#define LENGTH_S 2
#define GAIN 0.1
#define FORCE_LIMIT_N 100.0f
#define PATIENCE_NS UINT64_C(10000000000)

static resonarm_answer answer(void *context, const resonarm_sample *sample)
{
    ARG_UNUSED(context);
    if (sample->sample >= RATE_HZ * LENGTH_S) {
        return (resonarm_answer){.action = RESONARM_FINISH};
    }
    return (resonarm_answer){.action = RESONARM_HOLD_FORCE, .force_x_n = -GAIN * sample->head.force_x_n};
}

int main(void)
{
    static resonarm_exciter exciter;
    const int error = zephyr_can_open(DEVICE_DT_GET(DT_CHOSEN(zephyr_canbus)));
    if (error != 0) {
        printk("no CAN controller: error %d\n", -error);
        return error;
    }
    const resonarm_exciter_config config = {
        .network = resonarm_own_network(),
        .rate_hz = RATE_HZ,
        .timing = resonarm_lockstep(),
        .answer = answer,
        .capabilities = {.samples_per_frame = 1, .force_limit_n = FORCE_LIMIT_N},
    };
    resonarm_exciter_init(&exciter, &config);
    const loop_end end = loop_run(&exciter, PATIENCE_NS);
    const resonarm_report report = resonarm_exciter_report(&exciter);
    printk("%s: %u samples\n", end == LOOP_ENDED && report.outcome == RESONARM_FINISHED ? "finished" : "not finished",
           (unsigned)report.samples_answered);
    return 0;
}
