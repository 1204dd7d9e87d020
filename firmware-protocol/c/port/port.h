/** @file port.h
 * @brief The five functions that a machine must provide for the controller. */
#ifndef PORT_H
#define PORT_H

#include "resonarm.h"

/** The result for a frame. */
typedef enum {
    PORT_DONE,    /**< A frame was received, or accepted for sending. */
    PORT_EMPTY,   /**< No frame was received, or the transmit queue is full. */
    PORT_BUS_OFF, /**< The CAN controller is off the bus. */
    PORT_FAILED   /**< It has failed for good. */
} port_result;

/** A monotonic clock, ns. */
uint64_t port_now_ns(void);
/** Takes the next received frame, without waiting. */
port_result port_receive(resonarm_frame *frame);
/** Sends a frame, without waiting; frames keep their order. */
port_result port_send(const resonarm_frame *frame);
/** Waits until a frame is received or the clock reaches this time; it may return earlier. */
void port_wait(uint64_t until_ns);
/** Whether the controller was asked to end. */
bool port_is_stopped(void);

#endif
