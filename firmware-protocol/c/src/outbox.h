/** @file outbox.h
 * @brief What a node has yet to send (section 8, "Bus lost"): emergencies, heartbeats, requests and hellos in their
 * order, then the latest command. */
#ifndef RESONARM_OUTBOX_H
#define RESONARM_OUTBOX_H

#include "resonarm_exciter.h"

/** Queues a message that can be sent. A command takes the place of one that still waits. */
void outbox_push(resonarm_outbox_ *outbox, const resonarm_message *message);

/** The message to send next; NULL if none waits. */
const resonarm_message *outbox_front(const resonarm_outbox_ *outbox);

/** Takes out the message to send next. */
void outbox_pop(resonarm_outbox_ *outbox);

/** Takes back the command that still waits. */
void outbox_clear_command(resonarm_outbox_ *outbox);

/** Messages that wait. */
uint32_t outbox_waiting(const resonarm_outbox_ *outbox);

#endif
