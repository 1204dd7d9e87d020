/** @file outbox.h
 * @brief The messages that a node has yet to send (section 8, "Bus lost"): emergencies, heartbeats, requests, hellos
 * and capabilities in their order, then the latest command. */
#ifndef RESONARM_OUTBOX_H
#define RESONARM_OUTBOX_H

#include "resonarm_exciter.h"

/** Queues a message. A command replaces one that still waits. */
void resonarm_outbox_push(resonarm_outbox_ *outbox, const resonarm_waiting_ *message);

/** The message to send next; NULL if none waits. */
const resonarm_waiting_ *resonarm_outbox_front(const resonarm_outbox_ *outbox);

/** Removes the message to send next. */
void resonarm_outbox_pop(resonarm_outbox_ *outbox);

/** Drops the waiting command. */
void resonarm_outbox_clear_command(resonarm_outbox_ *outbox);

/** The number of waiting messages. */
uint32_t resonarm_outbox_waiting(const resonarm_outbox_ *outbox);

#endif
