#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "linux_socketcan.h"
#include "loop.h"
#include "options.h"

/* Exit statuses; the usage names them. */
enum {
    STATUS_FINISHED = 0,
    STATUS_USAGE = 2,
    STATUS_NO_BUS_OR_PLANT = 3,
    STATUS_PLANT_FAULT = 4,
    STATUS_OWN_FAULT = 5,
    STATUS_GAVE_UP = 6,
    STATUS_STOPPED = 7,
    STATUS_PLANT_LEFT = 8
};

static const char *const reasons[] = {
    "", "the head was clipped", "the command would be above its limit", "the force does not settle",
    "the head reads no force",
};

static void say_points(const held *controller)
{
    for (size_t i = 0; i < controller->reached; i++) {
        const held_point *point = &controller->points[i];
        printf("point frequency_hz=%.17g command_n=%.17g force_n=%.17g tries=%d first=%" PRIu64 " end=%" PRIu64 "\n",
               point->frequency_hz, point->command_n, point->force_n, point->tries, point->first_sample,
               point->end_sample);
    }
}

static int status_of(const resonarm_report *report, held_reason reason)
{
    const resonarm_emergency *fault = &report->fault;
    switch (report->outcome) {
    case RESONARM_FINISHED:
        printf("finished\n");
        return STATUS_FINISHED;
    case RESONARM_GAVE_UP:
        printf("gave up: %s\n", reasons[reason]);
        return STATUS_GAVE_UP;
    case RESONARM_STOPPED:
        printf("stopped\n");
        return STATUS_STOPPED;
    case RESONARM_PLANT_LEFT:
        printf("the plant left\n");
        return STATUS_PLANT_LEFT;
    case RESONARM_FAULTED:
    case RESONARM_NOT_ENDED:
        break;
    }
    const bool is_own = report->fault_node == RESONARM_EXCITER;
    printf("fault of the %s, code %d, detail %u, at sample %u\n", is_own ? "controller" : "plant", (int)fault->code,
           fault->detail, fault->sample);
    return is_own ? STATUS_OWN_FAULT : STATUS_PLANT_FAULT;
}

int main(int count, char **arguments)
{
    static resonarm_exciter exciter;
    static open_loop played;
    static held controller;
    options read;
    const char *wrong = options_read(&read, count, arguments);
    if (wrong != NULL) {
        fprintf(stderr, "controller: %s\n%s", wrong, options_usage);
        return STATUS_USAGE;
    }
    const int error = linux_socketcan_open(read.interface);
    if (error != 0) {
        fprintf(stderr, "controller: %s: %s\n", read.interface, strerror(error));
        return STATUS_NO_BUS_OR_PLANT;
    }
    open_loop_init(&played, &read.spec);
    held_init(&controller, &read.spec);
    const resonarm_exciter_config config = {
        .network = read.network,
        .rate_hz = (uint16_t)read.spec.rate_hz,
        .timing = read.timing,
        .answer = read.is_open_loop ? open_loop_answer : held_answer,
        .context = read.is_open_loop ? (void *)&played : (void *)&controller,
        .capabilities = {.samples_per_frame = 1, .force_limit_n = read.spec.limit_n},
    };
    resonarm_exciter_init(&exciter, &config);
    const loop_end end = loop_run(&exciter, (uint64_t)(read.patience_s * 1e9));
    const resonarm_report report = resonarm_exciter_report(&exciter);
    if (end != LOOP_ENDED) {
        fprintf(stderr, "controller: %s\n", end == LOOP_NO_PLANT ? "no plant was armed in time" : "the bus has failed");
        return STATUS_NO_BUS_OR_PLANT;
    }
    if (!read.is_open_loop) {
        say_points(&controller);
    }
    printf("samples=%" PRIu64 " missed=%" PRIu64 " slipped=%" PRIu64 " refused=%" PRIu32 "\n", report.samples_answered,
           report.missed_samples, report.slipped_periods, report.refused_frames);
    return status_of(&report, controller.reason);
}
