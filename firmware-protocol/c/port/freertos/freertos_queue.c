#include "freertos_queue.h"

#include "queue.h"
#include "task.h"

#define SECOND_NS UINT64_C(1000000000)

static QueueHandle_t received_frames;
static freertos_send send_frame;
static volatile BaseType_t is_bus_off;
static volatile BaseType_t is_stopped;

BaseType_t freertos_queue_open(UBaseType_t frames, freertos_send send)
{
    send_frame = send;
    received_frames = xQueueCreate(frames, sizeof(resonarm_frame));
    return received_frames != NULL ? pdTRUE : pdFALSE;
}

BaseType_t freertos_queue_put_from_isr(const resonarm_frame *frame, BaseType_t *woken)
{
    return xQueueSendFromISR(received_frames, frame, woken);
}

BaseType_t freertos_queue_put(const resonarm_frame *frame)
{
    return xQueueSend(received_frames, frame, 0);
}

void freertos_queue_set_bus_off(BaseType_t is_off)
{
    is_bus_off = is_off;
}

void freertos_queue_stop(void)
{
    is_stopped = pdTRUE;
}

/* Ticks since the start, also after the counter of ticks has passed its end: the loop reads it more often than that. */
static uint64_t ticks(void)
{
    static uint64_t count;
    static TickType_t last;
    const TickType_t now = xTaskGetTickCount();
    count += (TickType_t)(now - last);
    last = now;
    return count;
}

uint64_t port_now_ns(void)
{
    return ticks() * SECOND_NS / configTICK_RATE_HZ;
}

port_result port_receive(resonarm_frame *frame)
{
    if (xQueueReceive(received_frames, frame, 0) == pdTRUE) {
        return PORT_DONE;
    }
    return is_bus_off != pdFALSE ? PORT_BUS_OFF : PORT_EMPTY;
}

port_result port_send(const resonarm_frame *frame)
{
    return is_bus_off != pdFALSE ? PORT_BUS_OFF : send_frame(frame);
}

/* For at least a tick, so that tasks of lower priority run. */
void port_wait(uint64_t until_ns)
{
    resonarm_frame first;
    const uint64_t now_ns = port_now_ns();
    const uint64_t left_ns = until_ns > now_ns ? until_ns - now_ns : 0;
    const uint64_t left = left_ns * configTICK_RATE_HZ / SECOND_NS + 1;
    (void)xQueuePeek(received_frames, &first, left < portMAX_DELAY ? (TickType_t)left : portMAX_DELAY - 1);
}

bool port_is_stopped(void)
{
    return is_stopped != pdFALSE;
}
