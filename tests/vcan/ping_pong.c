/* The frames of a sample and their answer between two processes on raw CAN sockets, and nothing else: what a closed
 * loop costs beneath plant and controller.
 *
 *     ping_pong pong INTERFACE                    answers each third frame, until it is ended
 *     ping_pong ping INTERFACE ROUNDS PERIOD_NS   plays ROUNDS rounds, one at once after the other if the period is 0
 *
 * ping prints `seconds p50 p99 max`: how long all rounds took, and the round trip, µs, from the clock before the
 * sending to the kernel's time stamp of the answer. It exits with 1, and says why, if anything fails or no answer comes
 * within 5 s. */
#define _GNU_SOURCE
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <time.h>
#include <unistd.h>

enum { COMMAND = 0x201, FIRST = 0x203, LAST = 0x205 };

static void need(int holds, const char *what)
{
    if (!holds) {
        fprintf(stderr, "ping_pong: %s: %s\n", what, strerror(errno));
        exit(1);
    }
}

static int open_can(const char *interface, canid_t id, canid_t mask)
{
    struct sockaddr_can address = {.can_family = AF_CAN, .can_ifindex = (int)if_nametoindex(interface)};
    struct can_filter filter = {.can_id = id, .can_mask = mask};
    struct timeval patience = {.tv_sec = 5};
    int stamps = 1, can = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    need(can >= 0, "socket");
    need(setsockopt(can, SOL_CAN_RAW, CAN_RAW_FILTER, &filter, sizeof filter) == 0, "filter");
    need(setsockopt(can, SOL_SOCKET, SO_TIMESTAMPNS, &stamps, sizeof stamps) == 0, "time stamps");
    if (id == COMMAND)
        need(setsockopt(can, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience) == 0, "patience");
    need(bind(can, (struct sockaddr *)&address, sizeof address) == 0, interface);
    return can;
}

static double seconds(struct timespec t)
{
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static double now_s(clockid_t clock)
{
    struct timespec t;
    clock_gettime(clock, &t);
    return seconds(t);
}

static void send_frame(int can, canid_t id)
{
    struct can_frame frame = {.can_id = id, .len = 8};
    need(write(can, &frame, sizeof frame) == sizeof frame, "write");
}

/* The identifier of the next frame, and when the kernel had it. */
static canid_t receive_frame(int can, struct timespec *stamp)
{
    struct can_frame frame;
    char control[128];
    struct iovec data = {.iov_base = &frame, .iov_len = sizeof frame};
    struct msghdr message = {
        .msg_iov = &data, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
    need(recvmsg(can, &message, 0) == sizeof frame, "no answer");
    struct cmsghdr *header = CMSG_FIRSTHDR(&message);
    need(header != NULL && header->cmsg_type == SCM_TIMESTAMPNS, "no time stamp");
    memcpy(stamp, CMSG_DATA(header), sizeof *stamp);
    return frame.can_id;
}

static void pong(const char *interface)
{
    struct timespec stamp;
    int can = open_can(interface, 0x200, CAN_SFF_MASK & ~7u);
    puts("ready");
    fflush(stdout);
    for (;;)
        if (receive_frame(can, &stamp) == LAST)
            send_frame(can, COMMAND);
}

static int ascending(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void ping(const char *interface, long rounds, long period_ns)
{
    int can = open_can(interface, COMMAND, CAN_SFF_MASK);
    double *trips_us = malloc((size_t)rounds * sizeof *trips_us);
    need(rounds > 0 && trips_us != NULL, "rounds");
    struct timespec due, sent, stamp;
    clock_gettime(CLOCK_MONOTONIC, &due);
    double begin_s = now_s(CLOCK_MONOTONIC);
    for (long k = 0; k < rounds; k++) {
        if (period_ns > 0) {
            due.tv_nsec += period_ns;
            due.tv_sec += due.tv_nsec / 1000000000;
            due.tv_nsec %= 1000000000;
            while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &due, NULL) == EINTR)
                ;
        }
        clock_gettime(CLOCK_REALTIME, &sent);
        for (canid_t id = FIRST; id <= LAST; id++)
            send_frame(can, id);
        receive_frame(can, &stamp);
        trips_us[k] = 1e6 * (double)(stamp.tv_sec - sent.tv_sec) + 1e-3 * (double)(stamp.tv_nsec - sent.tv_nsec);
    }
    double took_s = now_s(CLOCK_MONOTONIC) - begin_s;
    qsort(trips_us, (size_t)rounds, sizeof *trips_us, ascending);
    printf("%.6f %.1f %.1f %.1f\n", took_s, trips_us[rounds / 2], trips_us[rounds * 99 / 100], trips_us[rounds - 1]);
}

int main(int count, char **words)
{
    if (count == 3 && strcmp(words[1], "pong") == 0)
        pong(words[2]);
    else if (count == 5 && strcmp(words[1], "ping") == 0)
        ping(words[2], atol(words[3]), atol(words[4]));
    else
        need(0, "pong INTERFACE, or ping INTERFACE ROUNDS PERIOD_NS");
    return 0;
}
