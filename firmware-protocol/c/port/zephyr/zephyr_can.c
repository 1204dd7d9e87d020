#include "zephyr_can.h"

#include <errno.h>
#include <string.h>
#include <zephyr/drivers/can.h>
#include <zephyr/kernel.h>
#include <zephyr/sys/atomic.h>

#include "port.h"

CAN_MSGQ_DEFINE(received_frames, CONFIG_RESONARM_RECEIVED_FRAMES);
/* Given while no frame waits in a mailbox: one at a time, so that frames keep their order. */
static K_SEM_DEFINE(can_accept, 1, 1);

static const struct device *device;
static atomic_t is_bus_off;
static atomic_t is_stopped;

static void state_changed(const struct device *controller, enum can_state state, struct can_bus_err_cnt errors,
                          void *data)
{
    ARG_UNUSED(controller);
    ARG_UNUSED(errors);
    ARG_UNUSED(data);
    atomic_set(&is_bus_off, state == CAN_STATE_BUS_OFF ? 1 : 0);
}

static void sent(const struct device *controller, int error, void *data)
{
    ARG_UNUSED(controller);
    ARG_UNUSED(error);
    ARG_UNUSED(data);
    k_sem_give(&can_accept);
}

int zephyr_can_open(const struct device *controller)
{
    const struct can_filter standard = {.id = 0, .mask = 0, .flags = 0};
    const struct can_filter extended = {.id = 0, .mask = 0, .flags = CAN_FILTER_IDE};
    if (!device_is_ready(controller)) {
        return -ENODEV;
    }
    device = controller;
    can_set_state_change_callback(controller, state_changed, NULL);
    int result = can_add_rx_filter_msgq(controller, &received_frames, &standard);
    if (result >= 0) {
        result = can_add_rx_filter_msgq(controller, &received_frames, &extended);
    }
#ifndef RESONARM_CLASSIC_ONLY
    if (result >= 0) {
        result = can_set_mode(controller, CAN_MODE_FD);
    }
#endif
    return result < 0 ? result : can_start(controller);
}

void zephyr_can_stop(void)
{
    atomic_set(&is_stopped, 1);
}

uint64_t port_now_ns(void)
{
    return k_ticks_to_ns_floor64((uint64_t)k_uptime_ticks());
}

port_result port_receive(resonarm_frame *frame)
{
    struct can_frame received;
    if (k_msgq_get(&received_frames, &received, K_NO_WAIT) != 0) {
        return atomic_get(&is_bus_off) != 0 ? PORT_BUS_OFF : PORT_EMPTY;
    }
    const uint8_t length = can_dlc_to_bytes(received.dlc);
    *frame = (resonarm_frame){
        .id = received.id,
        .id_format = (received.flags & CAN_FRAME_IDE) != 0 ? RESONARM_ID_EXTENDED : RESONARM_ID_STANDARD,
        .format = (received.flags & CAN_FRAME_FDF) != 0 ? RESONARM_FRAME_FD : RESONARM_FRAME_CLASSIC,
        .length = length,
    };
    if ((received.flags & CAN_FRAME_RTR) != 0) {
        frame->format = RESONARM_FRAME_REMOTE;
    }
    memcpy(frame->data, received.data, MIN(length, MIN(sizeof frame->data, sizeof received.data)));
    return PORT_DONE;
}

port_result port_send(const resonarm_frame *frame)
{
    if (atomic_get(&is_bus_off) != 0) {
        return PORT_BUS_OFF;
    }
    if (k_sem_take(&can_accept, K_NO_WAIT) != 0) {
        return PORT_EMPTY;
    }
    struct can_frame message = {.id = frame->id, .dlc = can_bytes_to_dlc(frame->length)};
    message.flags = (frame->id_format == RESONARM_ID_EXTENDED ? CAN_FRAME_IDE : 0) |
                    (frame->format == RESONARM_FRAME_FD ? CAN_FRAME_FDF | CAN_FRAME_BRS : 0);
    memcpy(message.data, frame->data, MIN(frame->length, sizeof message.data));
    const int error = can_send(device, &message, K_NO_WAIT, sent, NULL);
    if (error == 0) {
        return PORT_DONE;
    }
    k_sem_give(&can_accept);
    switch (error) {
    case -EAGAIN:
    case -EBUSY:
        return PORT_EMPTY;
    case -ENETUNREACH: /* Bus off. */
        return PORT_BUS_OFF;
    default:
        return PORT_FAILED;
    }
}

void port_wait(uint64_t until_ns)
{
    struct k_poll_event events[] = {
        K_POLL_EVENT_INITIALIZER(K_POLL_TYPE_MSGQ_DATA_AVAILABLE, K_POLL_MODE_NOTIFY_ONLY, &received_frames),
    };
    const uint64_t now_ns = port_now_ns();
    const k_timeout_t left = until_ns > now_ns ? K_NSEC(until_ns - now_ns) : K_NO_WAIT;
    (void)k_poll(events, ARRAY_SIZE(events), left);
}

bool port_is_stopped(void)
{
    return atomic_get(&is_stopped) != 0;
}
