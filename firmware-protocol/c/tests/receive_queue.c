/*
 * The receive queue between an interrupt and a loop. The interrupt is a signal, which stops the loop at any
 * instruction, or another thread, for the sanitiser of threads.
 *
 *   receive_queue signal|thread FRAMES
 *
 * It exits with 1 and the reason if a frame arrives corrupted, twice or out of order, or if one is neither taken nor
 * counted as dropped.
 */
#define _POSIX_C_SOURCE 200809L

#include <inttypes.h>
#include <pthread.h>
#include <sched.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/time.h>

#include "resonarm_receive_queue.h"

#define PLACES 8u
/* Frames per signal: more than the queue holds. */
#define FRAMES_AT_ONCE 11u

static resonarm_receive_queue queue;
static resonarm_frame memory[PLACES];
static uint32_t frames;
/* The writer's count. */
static uint32_t put;

/* The n-th frame: every byte of it follows from n. */
static resonarm_frame frame_of(uint32_t n)
{
    resonarm_frame frame = {.id = n, .length = RESONARM_FRAME_BYTES};
    for (uint32_t i = 0; i < RESONARM_FRAME_BYTES; i++) {
        frame.data[i] = (uint8_t)(n * 31u + i);
    }
    return frame;
}

static bool put_next(void)
{
    const resonarm_frame frame = frame_of(put);
    put++;
    return resonarm_receive_queue_put(&queue, &frame);
}

static void on_signal(int number)
{
    (void)number;
    for (uint32_t n = 0; n < FRAMES_AT_ONCE && put < frames; n++) {
        (void)put_next();
    }
}

static void *write_all(void *context)
{
    (void)context;
    while (put < frames) {
        if (!put_next()) {
            sched_yield();
        }
    }
    return NULL;
}

static void begin_signals(void)
{
    struct sigaction action;
    const struct itimerval often = {{0, 50}, {0, 50}};
    memset(&action, 0, sizeof action);
    action.sa_handler = on_signal;
    if (sigaction(SIGALRM, &action, NULL) != 0 || setitimer(ITIMER_REAL, &often, NULL) != 0) {
        perror("a signal");
        exit(1);
    }
}

int main(int count, char **words)
{
    pthread_t writer;
    resonarm_frame frame;
    uint32_t taken = 0;
    int64_t last = -1;
    if (count != 3) {
        return 2;
    }
    const bool is_signal = strcmp(words[1], "signal") == 0;
    frames = (uint32_t)strtoul(words[2], NULL, 10);
    resonarm_receive_queue_init(&queue, memory, PLACES);
    if (is_signal) {
        begin_signals();
    } else if (pthread_create(&writer, NULL, write_all, NULL) != 0) {
        return 1;
    }
    while (taken + resonarm_receive_queue_dropped(&queue) < frames) {
        if (!resonarm_receive_queue_take(&queue, &frame)) {
            continue;
        }
        const resonarm_frame expected = frame_of(frame.id);
        if ((int64_t)frame.id <= last || memcmp(frame.data, expected.data, sizeof frame.data) != 0) {
            printf("frame %" PRIu32 " after %" PRId64 "\n", frame.id, last);
            return 1;
        }
        last = frame.id;
        taken++;
    }
    if (!is_signal && pthread_join(writer, NULL) != 0) {
        return 1;
    }
    const bool is_empty = !resonarm_receive_queue_take(&queue, &frame);
    printf("%" PRIu32 " taken, %" PRIu32 " dropped\n", taken, resonarm_receive_queue_dropped(&queue));
    return taken > 0 && is_empty && taken + resonarm_receive_queue_dropped(&queue) == frames ? 0 : 1;
}
