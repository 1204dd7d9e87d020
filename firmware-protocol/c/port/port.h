/** @file port.h
 * @brief What a machine has to give the controller: five functions. */
#ifndef PORT_H
#define PORT_H

#include "resonarm.h"

/** What became of a frame. */
typedef enum {
    PORT_DONE,    /**< A frame was received, or taken to be sent. */
    PORT_EMPTY,   /**< None has come, or the transmit queue is full. */
    PORT_BUS_OFF, /**< The CAN controller is off the bus. */
    PORT_FAILED   /**< It will never be again. */
} port_result;

/** A clock that only goes forward, ns. */
uint64_t port_now_ns(void);
/** Takes the next frame that has come, without waiting. */
port_result port_receive(resonarm_frame *frame);
/** Hands over a frame to be sent, without waiting; frames go in this order. */
port_result port_send(const resonarm_frame *frame);
/** Waits until a frame has come or the clock has this time, or less. */
void port_wait(uint64_t until_ns);
/** Whether the controller was told to end. */
bool port_is_stopped(void);

#endif
