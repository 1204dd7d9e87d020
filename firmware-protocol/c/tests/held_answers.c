/*
 * The held controller of port/stm32f103/main_held.c on this machine: the force along x in the impedance head on
 * standard input, one line per sample from the first on; prints the answers, "hold FORCE_X_N", "finish" or "give up",
 * and at the end the results, "point COMMAND_N FORCE_N TRIES FIRST END".
 */
#include <inttypes.h>
#include <stdio.h>

#include "../controller/held.c"
#include "../controller/maths.c"
#include "../port/stm32f103/held_spec.h"

int main(void)
{
    held controller;
    resonarm_sample sample = {0};
    held_init(&controller, &held_spec);
    while (scanf("%lf", &sample.head.force_x_n) == 1) {
        const resonarm_answer answer = held_answer(&controller, &sample);
        if (answer.action == RESONARM_HOLD_FORCE) {
            printf("hold %.17g\n", answer.force_x_n);
        } else {
            printf("%s\n", answer.action == RESONARM_FINISH ? "finish" : "give up");
        }
        sample.sample++;
    }
    for (size_t i = 0; i < controller.reached; i++) {
        const held_point *point = &controller.points[i];
        printf("point %.17g %.17g %d %" PRIu64 " %" PRIu64 "\n", point->command_n, point->force_n, point->tries,
               point->first_sample, point->end_sample);
    }
    return 0;
}
