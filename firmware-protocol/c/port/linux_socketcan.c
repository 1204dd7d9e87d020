#define _GNU_SOURCE

#include "linux_socketcan.h"

#include <errno.h>
#include <fcntl.h>
#include <linux/can.h>
#include <linux/can/error.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include "port.h"

#define SECOND_NS UINT64_C(1000000000)

static int can_socket = -1;
static volatile sig_atomic_t is_stopped;

static void stop(int number)
{
    (void)number;
    is_stopped = 1;
}

static int set_up(int descriptor, unsigned interface)
{
    /* CAN FD frames are sent and received, too; those of the other profile are rejected and counted. Bus off is an
     * error frame. */
    const int on = 1;
    const can_err_mask_t errors = CAN_ERR_BUSOFF;
    struct sockaddr_can address;
    memset(&address, 0, sizeof address);
    address.can_family = AF_CAN;
    address.can_ifindex = (int)interface;
    if (setsockopt(descriptor, SOL_CAN_RAW, CAN_RAW_FD_FRAMES, &on, sizeof on) != 0 ||
        setsockopt(descriptor, SOL_CAN_RAW, CAN_RAW_ERR_FILTER, &errors, sizeof errors) != 0 ||
        fcntl(descriptor, F_SETFL, O_NONBLOCK) != 0) {
        return errno;
    }
    return bind(descriptor, (const struct sockaddr *)&address, sizeof address) == 0 ? 0 : errno;
}

int linux_socketcan_open(const char *interface)
{
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_handler = stop;
    const unsigned number = if_nametoindex(interface);
    if (number == 0 || sigaction(SIGINT, &action, NULL) != 0 || sigaction(SIGTERM, &action, NULL) != 0) {
        return errno;
    }
    can_socket = socket(PF_CAN, SOCK_RAW, CAN_RAW);
    return can_socket < 0 ? errno : set_up(can_socket, number);
}

uint64_t port_now_ns(void)
{
    struct timespec now;
    (void)clock_gettime(CLOCK_MONOTONIC, &now);
    return (uint64_t)now.tv_sec * SECOND_NS + (uint64_t)now.tv_nsec;
}

/* The result for an error of the socket. */
static port_result result_of(int error)
{
    switch (error) {
    case EAGAIN:
    case ENOBUFS:
    case EINTR:
        return PORT_EMPTY;
    case ENETDOWN:
        return PORT_BUS_OFF;
    default:
        return PORT_FAILED;
    }
}

port_result port_receive(resonarm_frame *frame)
{
    struct canfd_frame received;
    const ssize_t bytes = read(can_socket, &received, sizeof received);
    if (bytes < 0) {
        return result_of(errno);
    }
    if (bytes != CAN_MTU && bytes != CANFD_MTU) {
        return PORT_FAILED;
    }
    if ((received.can_id & CAN_ERR_FLAG) != 0) {
        return PORT_BUS_OFF;
    }
    const bool is_extended = (received.can_id & CAN_EFF_FLAG) != 0;
    *frame = (resonarm_frame){
        .id = received.can_id & (is_extended ? CAN_EFF_MASK : CAN_SFF_MASK),
        .id_format = is_extended ? RESONARM_ID_EXTENDED : RESONARM_ID_STANDARD,
        .format = bytes == CANFD_MTU ? RESONARM_FRAME_FD : RESONARM_FRAME_CLASSIC,
        .length = received.len,
    };
    if ((received.can_id & CAN_RTR_FLAG) != 0) {
        frame->format = RESONARM_FRAME_REMOTE;
    }
    memcpy(frame->data, received.data, received.len <= RESONARM_FRAME_BYTES ? received.len : RESONARM_FRAME_BYTES);
    return PORT_DONE;
}

port_result port_send(const resonarm_frame *frame)
{
    /* The members of a classical frame have the same offsets in a CAN FD frame, which is longer. */
    const size_t bytes = frame->format == RESONARM_FRAME_FD ? CANFD_MTU : CAN_MTU;
    struct canfd_frame sent;
    memset(&sent, 0, sizeof sent);
    sent.can_id = frame->id;
    sent.len = frame->length;
    sent.flags = frame->format == RESONARM_FRAME_FD ? CANFD_BRS : 0;
    memcpy(sent.data, frame->data, frame->length);
    return write(can_socket, &sent, bytes) == (ssize_t)bytes ? PORT_DONE : result_of(errno);
}

void port_wait(uint64_t until_ns)
{
    const uint64_t now_ns = port_now_ns();
    const uint64_t left_ns = until_ns > now_ns ? until_ns - now_ns : 0;
    struct pollfd descriptor = {.fd = can_socket, .events = POLLIN};
    const struct timespec left = {(time_t)(left_ns / SECOND_NS), (long)(left_ns % SECOND_NS)};
    (void)ppoll(&descriptor, 1, &left, NULL);
}

bool port_is_stopped(void)
{
    return is_stopped != 0;
}
