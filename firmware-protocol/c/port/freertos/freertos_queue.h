/** @file freertos_queue.h
 * @brief The port to FreeRTOS: a queue that the interrupt of the CAN controller fills, and the tick as the clock. */
#ifndef FREERTOS_QUEUE_H
#define FREERTOS_QUEUE_H

#include "FreeRTOS.h"

#include "port.h"

/** Sends a frame by the CAN controller, without waiting; frames must keep their order. */
typedef port_result (*freertos_send)(const resonarm_frame *frame);

/** Makes the queue of received frames; `pdFALSE` if there is no memory for it. */
BaseType_t freertos_queue_open(UBaseType_t frames, freertos_send send);
/** From the interrupt of the CAN controller: puts a received frame into the queue; `pdFALSE` if that is full. `woken`
 * becomes `pdTRUE` if the loop's task should run now, as for xQueueSendFromISR(). */
BaseType_t freertos_queue_put_from_isr(const resonarm_frame *frame, BaseType_t *woken);
/** The same from a task. */
BaseType_t freertos_queue_put(const resonarm_frame *frame);
/** From an interrupt or a task: whether the CAN controller is off the bus. */
void freertos_queue_set_bus_off(BaseType_t is_off);
/** Lets loop_run() leave the bus and return. */
void freertos_queue_stop(void);

#endif
