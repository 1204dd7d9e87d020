/*
 * The exciter's node on standard input and output, one command per line, for a test in virtual time.
 *
 *   init real-time|lockstep RATE FINISH GIVE_UP BEYOND [SAMPLES LIMIT]
 *                                                        a node of resonarm_config.h's network that answers sample n
 *                                                        with n mod 1000 counts of force along x and ends, gives up,
 *                                                        or asks too much at these samples; its capabilities are so
 *                                                        many samples in a frame, 2, and a force, N, by default that
 *                                                        of the wire
 *   start NOW | deadline NOW | bus-lost NOW | stop NOW | leave NOW | rearm NOW
 *   frame NOW c|f ID LEN DATA                            a data frame comes in, classical or CAN FD
 *   jam | flow                                           from now on the bus takes no frame, or all
 *
 * Every answer: the frames sent since, ID#DATA or ID##1DATA each, then "| next NS |" and the node's report, in the
 * order of the members of resonarm_report.
 */
#include <float.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "resonarm_exciter.h"

typedef struct {
    uint64_t finish;
    uint64_t give_up;
    uint64_t beyond;
} plan;

static resonarm_exciter exciter;
static plan the_plan;
static bool is_jammed;

static resonarm_answer answer(void *context, const resonarm_sample *sample)
{
    const plan *what = context;
    resonarm_answer given = {.action = RESONARM_HOLD_FORCE};
    if (sample->sample >= what->finish) {
        given.action = RESONARM_FINISH;
    } else if (sample->sample >= what->give_up) {
        given.action = RESONARM_GIVE_UP;
    } else if (sample->sample >= what->beyond) {
        given.force_x_n = 1e39;
    } else {
        given.force_x_n = (double)(sample->sample % 1000) * 0.02;
    }
    return given;
}

static uint64_t next_number(int base)
{
    const char *word = strtok(NULL, " ");
    return word == NULL ? 0 : strtoull(word, NULL, base);
}

static void init(void)
{
    const char *mode = strtok(NULL, " ");
    const uint16_t rate_hz = (uint16_t)next_number(10);
    resonarm_exciter_config config = {
        .network = resonarm_own_network(), .rate_hz = rate_hz, .answer = answer, .context = &the_plan};
    the_plan.finish = next_number(10);
    the_plan.give_up = next_number(10);
    the_plan.beyond = next_number(10);
    const char *samples = strtok(NULL, " ");
    config.capabilities = (resonarm_capabilities){.samples_per_frame = 2, .force_limit_n = FLT_MAX};
    if (samples != NULL) {
        config.capabilities.samples_per_frame = (uint8_t)strtoul(samples, NULL, 10);
        config.capabilities.force_limit_n = (double)next_number(10);
    }
    is_jammed = false;
    config.timing = mode != NULL && mode[0] == 'l' ? resonarm_lockstep() : resonarm_real_time(rate_hz);
    resonarm_exciter_init(&exciter, &config);
}

static resonarm_frame next_frame(void)
{
    const char *format = strtok(NULL, " ");
    resonarm_frame frame = {.id = (uint32_t)next_number(16), .length = (uint8_t)next_number(10)};
    const char *data = strtok(NULL, " ");
    frame.format = format != NULL && format[0] == 'f' ? RESONARM_FRAME_FD : RESONARM_FRAME_CLASSIC;
    for (size_t i = 0; data != NULL && i < RESONARM_FRAME_BYTES && 2 * i + 1 < strlen(data); i++) {
        const char digits[3] = {data[2 * i], data[2 * i + 1], 0};
        frame.data[i] = (uint8_t)strtoul(digits, NULL, 16);
    }
    return frame;
}

static void say(void)
{
    resonarm_frame frame;
    while (!is_jammed && resonarm_exciter_next_frame(&exciter, &frame)) {
        printf("%03" PRIX32 "%s", frame.id, frame.format == RESONARM_FRAME_FD ? "##1" : "#");
        for (size_t i = 0; i < frame.length; i++) {
            printf("%02X", frame.data[i]);
        }
        printf(" ");
        resonarm_exciter_frame_sent(&exciter);
    }
    const resonarm_report report = resonarm_exciter_report(&exciter);
    printf("| next %" PRIu64 " | %d %d", resonarm_exciter_next_deadline_ns(&exciter), (int)report.state,
           (int)report.outcome);
    if (report.outcome == RESONARM_FAULTED) {
        const resonarm_emergency *fault = &report.fault;
        printf(" %d %d %u %u", (int)report.fault_node, (int)fault->code, fault->detail, fault->sample);
    }
    printf(" %d %" PRIu64 " %" PRIu64 " %" PRIu32, report.has_heard_plant, report.samples_answered,
           report.missed_samples, report.stale_samples);
    printf(" %" PRIu64 " %" PRIu32 " %" PRIu32 " %" PRIu32 " %d", report.slipped_periods, report.refused_frames,
           report.other_sender_frames, report.unsent_frames, resonarm_exciter_is_quiet(&exciter));
    printf(" %d %u\n", (int)report.plant_fault.code, report.plant_fault.detail);
}

static void execute(const char *command)
{
    if (strcmp(command, "init") == 0) {
        init();
        return;
    }
    const uint64_t now_ns = next_number(10);
    if (strcmp(command, "start") == 0) {
        resonarm_exciter_start(&exciter, now_ns);
    } else if (strcmp(command, "deadline") == 0) {
        resonarm_exciter_handle_deadline(&exciter, now_ns);
    } else if (strcmp(command, "frame") == 0) {
        const resonarm_frame frame = next_frame();
        resonarm_exciter_handle_frame(&exciter, now_ns, &frame);
    } else if (strcmp(command, "bus-lost") == 0) {
        resonarm_exciter_bus_lost(&exciter, now_ns);
    } else if (strcmp(command, "stop") == 0) {
        resonarm_exciter_stop(&exciter, now_ns);
    } else if (strcmp(command, "leave") == 0) {
        resonarm_exciter_leave(&exciter, now_ns);
    } else if (strcmp(command, "rearm") == 0) {
        (void)resonarm_exciter_rearm(&exciter, now_ns);
    } else {
        is_jammed = strcmp(command, "jam") == 0;
    }
}

int main(void)
{
    char line[512];
    while (fgets(line, sizeof line, stdin) != NULL) {
        line[strcspn(line, "\n")] = 0;
        const char *command = strtok(line, " ");
        if (command != NULL) {
            execute(command);
            say();
            fflush(stdout);
        }
    }
    return 0;
}
